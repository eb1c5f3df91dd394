// Measuring tools: the user clicks on points, the overlay draws the figure, a card lists the results.

import { copyButton } from './copy.js';
import { element, iconButton } from './dom.js';
import { exact, rounded, withUnit } from './format.js';
import { corner, middle, resultsOf } from './measure.js';
import { signal } from './signal.js';
import { mix } from './vector.js';

export const MEASURE_TOOLS = ['distance', 'height', 'area'];
const DOT_RADIUS = 4;

export class MeasureTool {
  changed = signal();
  /** Finished figures, each `{ kind, name, points }`. */
  #finished = [];
  /** The points of the unfinished figure. */
  #points = [];
  #hover = null;

  constructor(viewer, overlay) {
    this.viewer = viewer;
    this.overlay = overlay;
    this.card = document.getElementById('measure-card');
    overlay.add((view) => this.#paint(view));
    viewer.toolChanged.listen(() => this.cancel());
  }

  get figures() {
    return this.#finished;
  }

  set figures(figures) {
    this.#finished = figures;
    this.#list();
  }

  get isActive() {
    return 0 < this.#points.length;
  }

  add(point) {
    this.#points.push(point);
    if (this.viewer.tool !== 'area' && this.#points.length === 2) this.finish();
    this.overlay.redraw();
  }

  /** Finishes the figure if it has enough points. */
  finish() {
    const kind = this.viewer.tool;
    if (this.#points.length < (kind === 'area' ? 3 : 2)) return;
    const figure = { kind, name: this.#newName(kind), points: this.#points };
    this.cancel();
    this.#change([...this.#finished, figure]);
  }

  /** A name with a number above those of all figures. */
  #newName(kind) {
    const numbers = this.#finished.map(({ name }) => Number(name.split(' ').at(-1)) || 0);
    return `${kind} ${Math.max(0, ...numbers) + 1}`;
  }

  #change(figures) {
    this.figures = figures;
    this.changed();
  }

  cancel() {
    this.#points = [];
    this.#hover = null;
    this.overlay.redraw();
  }

  /** Draws a line from the last point to the pointer, which is at these CSS pixels. */
  hover(pixel) {
    if (!this.isActive) return;
    this.#hover = pixel;
    this.overlay.redraw();
  }

  #results(figure) {
    return resultsOf(figure, this.viewer.info.up);
  }

  /** The text of a length or area in the unit of the file. */
  #text({ value, dimension }) {
    const { unit } = this.viewer.info;
    return withUnit(rounded(value, 6), unit && dimension === 2 ? `${unit}²` : unit);
  }

  #list() {
    this.card.hidden = this.#finished.length === 0;
    const all = () => this.#finished.map((figure) => this.#textOf(figure)).join('\n');
    const clear = () => this.#change([]);
    this.card.replaceChildren(
      element('header', {}, element('h2', {}, 'Measurements'), copyButton('Copy all', all),
        iconButton('close', 'Delete all', clear)),
      ...this.#finished.map((figure) => this.#item(figure)));
    this.overlay.redraw();
  }

  #item(figure) {
    const remove = () => this.#change(this.#finished.filter((other) => other !== figure));
    const rows = this.#results(figure).flatMap((result) =>
      [element('dt', {}, result.name), element('dd', {}, element('span', {}, this.#text(result)))]);
    return element('section', { class: 'measurement' },
      element('header', {}, element('h3', {}, figure.name),
        copyButton(`Copy ${figure.name}`, () => this.#textOf(figure)),
        iconButton('delete', `Delete ${figure.name}`, remove)),
      element('dl', { class: 'values' }, ...rows));
  }

  /** The text for the clipboard: full precision, separated by tabs. */
  #textOf(figure) {
    const results = this.#results(figure).map(({ name, value }) => `${name}\t${exact(value)}`);
    const points = figure.points.map((point, i) => `point ${i + 1}\t${point.join('\t')}`);
    return [figure.name, ...results, ...points].join('\n');
  }

  #paint(view) {
    const figures = this.#finished.flatMap((figure) => this.#paintFigure(view, figure));
    if (!this.isActive) return figures;
    return [...figures, ...view.path(this.#points, 'measure', false), ...this.#rubberBand(view), ...dots(view, this.#points)];
  }

  #rubberBand(view) {
    const from = view.toPixel(this.#points.at(-1));
    if (!from || !this.#hover) return [];
    return [view.rubberBand(from, this.#hover)];
  }

  #paintFigure(view, figure) {
    const { up } = this.viewer.info;
    const { kind, points } = figure;
    const lines = this.#results(figure).map((result) =>
      (kind === 'height' ? this.#text(result) : `${result.name} ${this.#text(result)}`));
    if (kind === 'area') {
      return [...view.polygon(points, 'measure-area'), ...view.path(points, 'measure', true), ...dots(view, points),
        ...view.label(middle(points), lines)];
    }
    const [a, b] = points;
    const elbow = corner(a, b, up);
    const legs = [...view.line(a, elbow, kind === 'height' ? 'measure' : 'measure-leg'), ...view.line(elbow, b, 'measure-leg')];
    const straight = kind === 'distance' ? view.line(a, b, 'measure') : [];
    const at = kind === 'height' ? mix(a, elbow, 0.5) : mix(a, b, 0.5);
    return [...legs, ...straight, ...dots(view, points), ...view.label(at, lines)];
  }
}

const dots = (view, points) => points.flatMap((point) => view.dot(point, DOT_RADIUS, 'measure-dot'));
