// The coordinates of the point under the mouse, in the status line.

import { coordinate, exact, withUnit } from './format.js';

/** Pause before a request, in which the mouse may move on. */
const MIN_PAUSE_MS = 80;
/** The pause is at least this many times the duration of the last answer, so that slow ones take little of the server. */
const PAUSE_PER_ANSWER = 2;
/** A machine that slept counts its sleep as part of an answer. */
const MAX_PAUSE_MS = 2000;

/** The coordinates of a picked point, with the decimals of its file. */
export function coordinatesText(point, unit) {
  const texts = point.position.map((value, i) =>
    (point.kind === 'point' ? coordinate(value, point.decimals?.[i]) : exact(value)));
  return withUnit(texts.join('  '), unit);
}

/** Shows the coordinates while the mouse rests or moves without a button, with one request at a time. */
export class CursorCoordinates {
  /** The pixel of the picture under the mouse; null while it is elsewhere, or has a button pressed. */
  #pixel = null;
  #timer = 0;
  #isWaiting = false;
  #pause_ms = MIN_PAUSE_MS;

  constructor(viewer) {
    this.viewer = viewer;
    this.text = document.getElementById('cursor');
    viewer.frameShown.listen(() => { if (viewer.lastFrame.finished) this.#schedule(); });
    viewer.cameraChanged.listen(() => { if (viewer.isMoving) this.#clear(); });
    viewer.connectionChanged.listen(() => this.#clear());
  }

  /** Takes the pixel under the mouse, or null. */
  moveTo(pixel) {
    this.#pixel = pixel;
    if (pixel) this.#schedule();
    else this.#clear();
  }

  #clear() {
    clearTimeout(this.#timer);
    this.#timer = 0;
    this.text.textContent = '';
  }

  #schedule() {
    if (!this.#pixel || this.#timer || this.#isWaiting) return;
    this.#timer = setTimeout(() => this.#request(), this.#pause_ms);
  }

  async #request() {
    this.#timer = 0;
    const { viewer } = this;
    const pixel = this.#pixel;
    if (viewer.isMoving || !viewer.isConnected) return;
    const start = performance.now();
    this.#isWaiting = true;
    const point = await viewer.pick(pixel).catch(() => null);
    this.#isWaiting = false;
    this.#pause_ms = Math.min(MAX_PAUSE_MS, Math.max(MIN_PAUSE_MS, PAUSE_PER_ANSWER * (performance.now() - start)));
    if (this.#pixel && !viewer.isMoving) this.text.textContent = point ? coordinatesText(point, viewer.info.unit) : '';
    if (this.#pixel !== pixel) this.#schedule();
  }
}
