// The WebSocket to the server: opened again when it is lost, pictures told from messages.

const FIRST_WAIT_MS = 500;
const LONGEST_WAIT_MS = 5000;
const HEADER_BYTES = 20;
const PICTURE_TYPES = { 1: 'image/jpeg', 2: 'image/png', 3: 'image/png' };

export const SAVED_PICTURE = 3;

/** What stands before the file in a binary message. */
export function readHeader(buffer) {
  const view = new DataView(buffer);
  const kind = view.getUint8(0);
  return {
    kind,
    finished: (view.getUint8(1) & 1) === 1,
    scene: view.getUint16(2, true),
    frame: view.getUint32(4, true),
    input: view.getUint32(8, true),
    width: view.getUint16(12, true),
    height: view.getUint16(14, true),
    samples: view.getUint16(16, true),
    of_samples: view.getUint16(18, true),
    type: PICTURE_TYPES[kind],
  };
}

/** Address of the server's socket for the page's own address, token included. */
export function socketAddress(location) {
  const token = new URLSearchParams(location.search).get('token');
  const query = token ? `?token=${encodeURIComponent(token)}` : '';
  return `${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/ws${query}`;
}

export class Connection {
  #socket = null;
  #wait_ms = FIRST_WAIT_MS;

  /** `on` has `opened`, `message(object)`, `picture(header, blob)` and `lost(wait_ms)`. */
  constructor(address, on) {
    this.address = address;
    this.on = on;
  }

  open() {
    const socket = new WebSocket(this.address);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      // Not before: what is sent between opening and this event would come before the greeting.
      this.#socket = socket;
      this.on.opened();
    };
    socket.onmessage = ({ data }) => {
      // Only a server that speaks is there again; one that hangs up at once is waited for ever longer.
      this.#wait_ms = FIRST_WAIT_MS;
      this.#receive(data);
    };
    socket.onclose = () => this.#reopen();
  }

  /** Whether the message could be sent. */
  send(message) {
    const isOpen = this.#socket?.readyState === WebSocket.OPEN;
    if (isOpen) this.#socket.send(JSON.stringify(message));
    return isOpen;
  }

  #receive(data) {
    if (typeof data === 'string') {
      this.on.message(JSON.parse(data));
      return;
    }
    const header = readHeader(data);
    this.on.picture(header, new Blob([new Uint8Array(data, HEADER_BYTES)], { type: header.type }));
  }

  #reopen() {
    this.on.lost(this.#wait_ms);
    setTimeout(() => this.open(), this.#wait_ms);
    this.#wait_ms = Math.min(LONGEST_WAIT_MS, 2 * this.#wait_ms);
  }
}
