// Measuring on the picture: points are clicked, figures drawn, results listed.

import { copyButton } from './copy.js';
import { element, iconButton } from './dom.js';
import { rounded } from './format.js';
import { corner, middle, resultsOf } from './measure.js';
import { mix } from './vector.js';

export const MEASURE_TOOLS = ['distance', 'height', 'area'];
const DOT_RADIUS = 4;
/** Figures are in the unit of the file. */
const text = (value) => rounded(value, 6);

export class MeasureTool {
  #finished = [];
  /** Of the figure that is being made. */
  #points = [];
  #hover = null;
  #lastNumber = 0;

  constructor(viewer, overlay) {
    this.viewer = viewer;
    this.overlay = overlay;
    this.place = document.getElementById('measure-card');
    overlay.add((view) => this.#paint(view));
    viewer.toolChanged.listen(() => this.cancel());
  }

  get isUnderway() {
    return 0 < this.#points.length;
  }

  add(point) {
    this.#points.push(point);
    if (this.viewer.tool !== 'area' && this.#points.length === 2) this.finish();
    this.overlay.redraw();
  }

  /** Closes an area, if it has three corners. */
  finish() {
    const kind = this.viewer.tool;
    if (this.#points.length < (kind === 'area' ? 3 : 2)) return;
    const name = `${kind} ${++this.#lastNumber}`;
    this.#finished.push({ kind, name, points: this.#points });
    this.cancel();
    this.#list();
  }

  cancel() {
    this.#points = [];
    this.#hover = null;
    this.overlay.redraw();
  }

  /** The pointer's place in CSS pixels, to which a line reaches from the last point. */
  hover(place) {
    if (!this.isUnderway) return;
    this.#hover = place;
    this.overlay.redraw();
  }

  #results(figure) {
    return resultsOf(figure, this.viewer.info.up);
  }

  #list() {
    this.place.hidden = this.#finished.length === 0;
    const all = () => this.#finished.map((figure) => this.#wordsOf(figure)).join('\n');
    const clear = () => {
      this.#finished = [];
      this.#list();
    };
    this.place.replaceChildren(
      element('header', {}, element('h2', {}, 'Measurements'), copyButton('Copy all', all),
        iconButton('close', 'Delete all', clear)),
      ...this.#finished.map((figure) => this.#listed(figure)));
    this.overlay.redraw();
  }

  #listed(figure) {
    const remove = () => {
      this.#finished = this.#finished.filter((other) => other !== figure);
      this.#list();
    };
    const rows = this.#results(figure).flatMap(({ name, value }) =>
      [element('dt', {}, name), element('dd', {}, element('span', {}, text(value)))]);
    return element('section', { class: 'measurement' },
      element('header', {}, element('h3', {}, figure.name),
        copyButton(`Copy ${figure.name}`, () => this.#wordsOf(figure)),
        iconButton('delete', `Delete ${figure.name}`, remove)),
      element('dl', { class: 'values' }, ...rows));
  }

  /** For the clipboard: full numbers, tabs between them. */
  #wordsOf(figure) {
    const results = this.#results(figure).map(({ name, value }) => `${name}\t${value}`);
    const points = figure.points.map((point, i) => `point ${i + 1}\t${point.join('\t')}`);
    return [figure.name, ...results, ...points].join('\n');
  }

  #paint(view) {
    const figures = this.#finished.flatMap((figure) => this.#paintFigure(view, figure));
    if (!this.isUnderway) return figures;
    return [...figures, ...view.path(this.#points, 'measure', false), ...this.#rubber(view), ...dots(view, this.#points)];
  }

  #rubber(view) {
    const from = view.place(this.#points.at(-1));
    if (!from || !this.#hover) return [];
    return [view.rubber(from, this.#hover)];
  }

  #paintFigure(view, figure) {
    const { up } = this.viewer.info;
    const { kind, points } = figure;
    const lines = this.#results(figure).map(({ name, value }) => (kind === 'height' ? text(value) : `${name} ${text(value)}`));
    if (kind === 'area') {
      return [...view.polygon(points, 'measure-area'), ...view.path(points, 'measure', true), ...dots(view, points),
        ...view.label(middle(points), lines)];
    }
    const [a, b] = points;
    const turn = corner(a, b, up);
    const legs = [...view.line(a, turn, kind === 'height' ? 'measure' : 'measure-leg'), ...view.line(turn, b, 'measure-leg')];
    const straight = kind === 'distance' ? view.line(a, b, 'measure') : [];
    const at = kind === 'height' ? mix(a, turn, 0.5) : mix(a, b, 0.5);
    return [...legs, ...straight, ...dots(view, points), ...view.label(at, lines)];
  }
}

const dots = (view, points) => points.flatMap((point) => view.dot(point, DOT_RADIUS, 'measure-dot'));
