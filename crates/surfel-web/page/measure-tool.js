// Measuring tools: the figures that the user makes by clicks on points.

import { KINDS, pathLength } from './figures.js';
import { signal } from './signal.js';

export const MEASURE_TOOLS = Object.keys(KINDS);
/** Width of the strip of a new profile as a fraction of its length. */
const PROFILE_WIDTH = 0.01;

export class MeasureTool {
  /** Emits when the user has changed a figure or their number. */
  changed = signal();
  /** Emits when the list of figures is shown again. */
  figuresShown = signal();
  /** Emits the figure of a profile whose chart is to be shown. */
  profileOpened = signal();
  /** Pixel of the pointer while a figure is unfinished; null if it is elsewhere. */
  pointer = null;
  /** The annotation that was made last, until its text can be typed. */
  newAnnotation = null;
  /** Number of figures that were given up, for those who wait for a point of one. */
  nCancelled = 0;
  /** Finished figures, each `{ kind, name, points }`, and the `width` of a profile. */
  #finished = [];
  /** The points of the unfinished figure. */
  #points = [];

  /** `show(i)` loads what draws and lists figures with the first of them, and lists all again, or the results of figure `i`. */
  constructor(viewer, overlay, show) {
    this.viewer = viewer;
    this.overlay = overlay;
    this.show = show;
    viewer.toolChanged.listen(() => this.cancel());
  }

  get figures() {
    return this.#finished;
  }

  set figures(figures) {
    const isNeeded = 0 < figures.length + this.#finished.length;
    this.#finished = figures;
    if (isNeeded) this.show();
  }

  get isActive() {
    return 0 < this.#points.length;
  }

  /** The points of the unfinished figure. */
  get points() {
    return this.#points;
  }

  add(point) {
    this.#points.push(point);
    if (this.#points.length === KINDS[this.viewer.tool].fixed) this.finish();
    else if (this.#points.length === 1) this.show();
    this.overlay.redraw();
  }

  /** Finishes the figure if it has enough points. */
  finish() {
    const kind = this.viewer.tool;
    if (!KINDS[kind] || this.#points.length < KINDS[kind].least) return;
    const figure = { kind, name: this.#newName(kind), points: this.#points };
    if (kind === 'profile') figure.width = PROFILE_WIDTH * pathLength(figure.points);
    if (kind === 'volume') figure.base = 'lowest';
    if (kind === 'annotation') this.newAnnotation = figure;
    this.#clear();
    this.change([...this.#finished, figure]);
    if (kind === 'profile') this.profileOpened(figure);
  }

  /** A name with a number above those of all figures. */
  #newName(kind) {
    const numbers = this.#finished.map((other) => Number(other.name.split(`${other.kind} `)[1]) || 0);
    return `${kind} ${Math.max(0, ...numbers) + 1}`;
  }

  replace(figure, changed) {
    this.change(this.#finished.map((other) => (other === figure ? changed : other)));
  }

  /** Puts results that the server has found into a figure, which is no change by the user, who may be typing in its fields. */
  complete(figure, completed) {
    const i = this.#finished.indexOf(figure);
    if (i < 0) return;
    this.#finished = this.#finished.with(i, completed);
    this.show(i);
  }

  change(figures) {
    this.figures = figures;
    this.changed();
  }

  cancel() {
    this.nCancelled += 1;
    this.#clear();
  }

  #clear() {
    this.#points = [];
    this.pointer = null;
    this.overlay.redraw();
  }

  /** Draws a line from the last point to the pointer, which is at these CSS pixels. */
  hover(pixel) {
    if (!this.isActive) return;
    this.pointer = pixel;
    this.overlay.redraw();
  }
}
