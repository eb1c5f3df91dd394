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
}

export const CAMERA = { position: [0, -5, 3], focal_point: [0, 0, 0], view_up: [0, 0, 1], view_angle: 35 };
export const SCENE = { color: 'rgb', camera: CAMERA };
const INFO = { name: 'town', bounds: { min: [0, 0, 0], max: [1, 1, 1] }, limits: { max_message_bytes: 1e6 } };

/** A viewer, and the server's end of its connection. */
export function connectedViewer() {
  const frames = [];
  const timers = [];
  Object.assign(globalThis, {
    location: { protocol: 'http:', host: 'host' },
    WebSocket: FakeSocket,
    requestAnimationFrame: (run) => frames.push(run),
    setTimeout: (run) => timers.push(run),
  });
  const viewer = new Viewer({});
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
      FakeSocket.newest.readyState = 3;
      FakeSocket.newest.onclose();
      for (const run of timers.splice(0)) run();
    },
  };
  let now = 0;
  /** Lets the page send what waits for the next animation frame, which is this much later. */
  const nextFrame = (interval_ms = 1000 / 60) => {
    now += interval_ms;
    for (const run of frames.splice(0)) run(now);
  };
  server.welcome();
  nextFrame();
  return { viewer, server, nextFrame };
}
