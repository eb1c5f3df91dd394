// The WebSocket to the server: reconnects when it is lost, and decodes messages and pictures.

const MIN_RECONNECT_DELAY_MS = 500;
const MAX_RECONNECT_DELAY_MS = 5000;
/** Interval between two questions whether the server answers; browsers do not report connections that bring nothing. */
const PING_INTERVAL_MS = 10_000;
/** Duration without an answer after which a connection is given up. A large picture may arrive before the answer. */
const MAX_SILENCE_MS = 20_000;
/** Delay of a timer that means that the machine or the page slept: the answer may have arrived, and wait to be read. */
const MIN_SLEEP_MS = 5_000;
const HEADER_BYTES = 20;
/** Rectangle and length before each file of a picture. */
const PLACE_BYTES = 12;
const PICTURE_TYPES = { 1: 'image/jpeg', 2: 'image/png', 3: 'image/png' };

const SAVED_PICTURE = 3;

/** The header before the files in a binary message. */
export function readHeader(buffer) {
  const view = new DataView(buffer);
  const kind = view.getUint8(0);
  return {
    kind,
    finished: (view.getUint8(1) & 1) === 1,
    scene: view.getUint16(2, true),
    frame: view.getUint32(4, true),
    seq: view.getUint32(8, true),
    width: view.getUint16(12, true),
    height: view.getUint16(14, true),
    samples: view.getUint16(16, true),
    of_samples: view.getUint16(18, true),
    type: PICTURE_TYPES[kind],
  };
}

/** The files of a picture in the order in which they are drawn, each with its place in the picture. */
export function readFiles(buffer, type) {
  const view = new DataView(buffer);
  const files = [];
  for (let at = HEADER_BYTES; at < buffer.byteLength;) {
    const [x, y, width, height] = [0, 2, 4, 6].map((offset) => view.getUint16(at + offset, true));
    const length = view.getUint32(at + 8, true);
    files.push({ x, y, width, height, blob: new Blob([new Uint8Array(buffer, at + PLACE_BYTES, length)], { type }) });
    at += PLACE_BYTES + length;
  }
  return files;
}

/** Address of the server's socket for the page's own address. The browser sends the token as a cookie. */
export function socketAddress({ protocol, host }) {
  return `${protocol === 'https:' ? 'wss' : 'ws'}://${host}/ws`;
}

export class Connection {
  #socket = null;
  #reconnectDelay_ms = MIN_RECONNECT_DELAY_MS;
  /** Timer that gives the connection up; zero while no answer is awaited. */
  #silenceTimer = 0;

  /**
   * `on` has `opened()`, `message(object)`, `picture(header, files)`, `saved(id, blob)`, `lost(wait_ms)` and
   * `awaitsFile()`, which says whether a saved picture may be on its way: it arrives as one message.
   */
  constructor(address, on) {
    this.address = address;
    this.on = on;
  }

  /** Connects, and again whenever the connection is lost. */
  start() {
    this.#open();
    setInterval(() => this.#ping(), PING_INTERVAL_MS);
    // After a sleep, or in another network, the connection may be dead.
    window.addEventListener('online', () => this.#ping());
    document.addEventListener('visibilitychange', () => { if (!document.hidden) this.#ping(); });
  }

  #open() {
    const socket = new WebSocket(this.address);
    this.#awaitAnswer(socket);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.#endSilence();
      // Set here and not earlier: a message sent before this event would arrive before hello.
      this.#socket = socket;
      this.on.opened();
    };
    socket.onmessage = ({ data }) => {
      this.#endSilence();
      // The delay is reset by a message, not by opening: a server that closes each connection at once must not be
      // asked twice a second.
      this.#reconnectDelay_ms = MIN_RECONNECT_DELAY_MS;
      this.#receive(data);
    };
    socket.onclose = () => this.#reconnect();
  }

  /** Sends a message; returns whether the connection is open. */
  send(message) {
    const isOpen = this.#socket?.readyState === WebSocket.OPEN;
    if (isOpen) this.#socket.send(JSON.stringify(message));
    return isOpen;
  }

  #ping() {
    if (this.send({ type: 'ping' })) this.#awaitAnswer(this.#socket);
  }

  #awaitAnswer(socket) {
    if (this.#silenceTimer) return;
    const start = performance.now();
    this.#silenceTimer = setTimeout(() => {
      this.#silenceTimer = 0;
      if (this.on.awaitsFile()) return;
      if (MAX_SILENCE_MS + MIN_SLEEP_MS < performance.now() - start) {
        this.send({ type: 'ping' });
        this.#awaitAnswer(socket);
        return;
      }
      // A dead connection takes a minute to close.
      socket.onopen = socket.onmessage = socket.onclose = null;
      socket.close();
      this.#reconnect();
    }, MAX_SILENCE_MS);
  }

  #endSilence() {
    clearTimeout(this.#silenceTimer);
    this.#silenceTimer = 0;
  }

  #receive(data) {
    if (typeof data === 'string') {
      this.on.message(JSON.parse(data));
      return;
    }
    const header = readHeader(data);
    if (header.kind !== SAVED_PICTURE) this.on.picture(header, readFiles(data, header.type));
    else this.on.saved(header.frame, new Blob([new Uint8Array(data, HEADER_BYTES)], { type: header.type }));
  }

  #reconnect() {
    this.#endSilence();
    this.#socket = null;
    this.on.lost(this.#reconnectDelay_ms);
    setTimeout(() => this.#open(), this.#reconnectDelay_ms);
    this.#reconnectDelay_ms = Math.min(MAX_RECONNECT_DELAY_MS, 2 * this.#reconnectDelay_ms);
  }
}
