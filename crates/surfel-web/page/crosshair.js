// The crosshair, with which points are picked by the keyboard while a tool is active.

import { svg } from './dom.js';

/** Length of a step as a fraction of the picture's height, and that of a fine one. */
const STEP = 0.025;
const FINE_STEP = 0.0025;
const ARM = 14;

export class Crosshair {
  /** Position as fractions of the picture's width and height; null while it is hidden. */
  #at = null;
  #lastPicked = null;

  constructor(viewer, overlay) {
    this.viewer = viewer;
    this.overlay = overlay;
    overlay.add(({ size }) => this.#paint(size));
    viewer.toolChanged.listen(() => this.hide());
  }

  /** The pixel of the picture under it; null while it is hidden. */
  get pixel() {
    const { width, height } = this.viewer.size;
    return this.#at && { x: this.#at.x * width, y: this.#at.y * height };
  }

  /** Whether it has moved, or appeared, since a point was picked. */
  get isMoved() {
    return this.#at !== null && this.#at !== this.#lastPicked;
  }

  /** Shows it where it was, or in the middle. */
  show() {
    this.#at ??= { x: 0.5, y: 0.5 };
    this.overlay.redraw();
  }

  hide() {
    [this.#at, this.#lastPicked] = [null, null];
    this.overlay.redraw();
  }

  /** Moves it by steps to the right and down. */
  move([dx, dy], isFine) {
    this.show();
    const { width, height } = this.viewer.size;
    const step = isFine ? FINE_STEP : STEP;
    const within = (value) => Math.min(0.999, Math.max(0.001, value));
    this.#at = { x: within(this.#at.x + (dx * step * height) / width), y: within(this.#at.y + dy * step) };
  }

  /** Records that the point under it was picked. */
  markPicked() {
    this.#lastPicked = this.#at;
  }

  #paint({ width, height }) {
    if (!this.#at) return [];
    const [x, y] = [this.#at.x * width, this.#at.y * height];
    const shape = `M${x - ARM} ${y}h${ARM - 3}m6 0h${ARM - 3}M${x} ${y - ARM}v${ARM - 3}m0 6v${ARM - 3}`;
    return ['crosshair-halo', 'crosshair'].map((name) => svg('path', { class: name, d: shape }));
  }
}
