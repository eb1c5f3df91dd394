// A viewer on a connection whose other end is the test.

import { Viewer } from '../page/viewer.js';

/** A WebSocket that records what the page sends. */
class FakeSocket {
  static OPEN = 1;
  readyState = FakeSocket.OPEN;
  sent = [];

  constructor() {
    FakeSocket.newest = this;
  }

  send(text) {
    this.sent.push(JSON.parse(text));
  }

  close() {
    this.readyState = 3;
  }
}

/** Timers that run when the test advances the time, and a clock that tests can set. */
class FakeTimers {
  now_ms = 0;
  /** Difference between the clock that the page reads and the time of the timers. */
  clock_offset_ms = 0;
  #timers = new Map();
  #lastId = 0;

  set(run, wait_ms, interval_ms = Infinity) {
    this.#timers.set(++this.#lastId, { run, at: this.now_ms + wait_ms, interval_ms });
    return this.#lastId;
  }

  clear(id) {
    this.#timers.delete(id);
  }

  advance(duration_ms) {
    const end = this.now_ms + duration_ms;
    for (;;) {
      const [[id, timer] = []] = [...this.#timers].sort(([, a], [, b]) => a.at - b.at);
      if (!timer || end < timer.at) break;
      this.now_ms = Math.max(this.now_ms, timer.at);
      timer.at = this.now_ms + timer.interval_ms;
      if (timer.at === Infinity) this.clear(id);
      timer.run();
    }
    this.now_ms = Math.max(this.now_ms, end);
  }

  /** Lets time pass in which no timer runs; those that are due run at once, an interval once, as after the sleep of a machine. */
  sleep(duration_ms) {
    this.now_ms += duration_ms;
    this.advance(0);
  }
}

export const CAMERA = { position: [0, -5, 3], focal_point: [0, 0, 0], view_up: [0, 0, 1], view_angle: 35 };
export const SCENE = { color: 'rgb', camera: CAMERA };
const INFO = { name: 'town', up: [0, 0, 1], stations: [], bounds: { min: [0, 0, 0], max: [1, 1, 1] }, limits: { max_message_bytes: 1e6 } };

/** A viewer that was opened with the settings of a link, and the server's end of its connection. */
export function connectedViewer(linkPatch = {}) {
  const frames = [];
  const timers = new FakeTimers();
  const page = new EventTarget();
  Object.defineProperty(globalThis, 'performance', { value: { now: () => timers.now_ms + timers.clock_offset_ms }, configurable: true });
  Object.assign(globalThis, {
    location: { protocol: 'http:', host: 'host' },
    WebSocket: FakeSocket,
    requestAnimationFrame: (run) => frames.push(run),
    cancelAnimationFrame() {},
    setTimeout: (run, wait_ms) => timers.set(run, wait_ms),
    clearTimeout: (id) => timers.clear(id),
    setInterval: (run, wait_ms) => timers.set(run, wait_ms, wait_ms),
    window: page,
    document: page,
  });
  const viewer = new Viewer(linkPatch);
  viewer.connect();
  const server = {
    /** The messages of a type that the page has sent on its newest connection. */
    sent: (type) => FakeSocket.newest.sent.filter((message) => message.type === type),
    send: (message) => FakeSocket.newest.onmessage({ data: JSON.stringify(message) }),
    /** Opens a connection, and answers it. */
    welcome(info = {}, scene = SCENE) {
      FakeSocket.newest.onopen();
      server.send({ type: 'welcome', scene, info: { ...INFO, ...info } });
      server.send({ type: 'scene', number: 1, seq: 0, scene, camera: scene.camera, legend: null });
    },
    /** Ends the connection; the page opens another one. */
    close() {
      FakeSocket.newest.close();
      FakeSocket.newest.onclose();
      timers.advance(5000);
    },
  };
  const wait = (duration_ms) => timers.advance(duration_ms);
  let now = 0;
  /** Lets the page send what waits for the next animation frame, which is this much later. */
  const nextFrame = (interval_ms = 1000 / 60) => {
    now += interval_ms;
    for (const run of frames.splice(0)) run(now);
  };
  server.welcome();
  nextFrame();
  return { viewer, server, nextFrame, page, wait, timers };
}
