// Measuring tools: the user clicks on points, the overlay draws the figure, a card lists the results.

import { copyButton } from './copy.js';
import { download, element, iconButton } from './dom.js';
import { exact, measured, rounded, stemOf, withUnit } from './format.js';
import { KINDS, circleThrough, corner, middle, pathLength, resultsOf } from './measure.js';
import { borders } from './profile.js';
import { signal } from './signal.js';
import { addScaled, mix } from './vector.js';
import { volumeControls } from './volume.js';

export const MEASURE_TOOLS = Object.keys(KINDS);
const POWERS = { 1: '', 2: '²', 3: '³' };
/** Kinds whose only result needs no name. */
const KINDS_OF_ONE_RESULT = ['height', 'angle', 'polyline'];
/** Width of the strip of a new profile as a fraction of its length. */
const PROFILE_WIDTH = 0.01;
/** Number of lines that a circle is drawn with. */
const N_CIRCLE_LINES = 64;
const DOT_RADIUS = 4;

export class MeasureTool {
  changed = signal();
  /** Emits when the list of figures is shown again. */
  figuresShown = signal();
  /** Emits the figure of a profile whose chart is to be shown. */
  profileOpened = signal();
  /** Finished figures, each `{ kind, name, points }`, and the `width` of a profile. */
  #finished = [];
  /** The elements with the results of each finished figure. */
  #values = [];
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
    if (this.#points.length === KINDS[this.viewer.tool].fixed) this.finish();
    this.overlay.redraw();
  }

  /** Finishes the figure if it has enough points. */
  finish() {
    const kind = this.viewer.tool;
    if (!KINDS[kind] || this.#points.length < KINDS[kind].least) return;
    const figure = { kind, name: this.#newName(kind), points: this.#points };
    if (kind === 'profile') figure.width = PROFILE_WIDTH * pathLength(figure.points);
    if (kind === 'volume') figure.base = 'lowest';
    this.cancel();
    this.#change([...this.#finished, figure]);
    if (kind === 'profile') this.profileOpened(figure);
  }

  /** A name with a number above those of all figures. */
  #newName(kind) {
    const numbers = this.#finished.map(({ name }) => Number(name.split(' ').at(-1)) || 0);
    return `${kind} ${Math.max(0, ...numbers) + 1}`;
  }

  replace(figure, changed) {
    this.#change(this.#finished.map((other) => (other === figure ? changed : other)));
  }

  /** Puts results that the server has found into a figure, which is no change by the user, who may be typing in its fields. */
  complete(figure, completed) {
    const i = this.#finished.indexOf(figure);
    if (i < 0) return;
    this.#finished = this.#finished.with(i, completed);
    this.#values[i].replaceChildren(...this.#rows(completed));
    this.overlay.redraw();
    this.figuresShown();
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
    if (dimension === 0) return `${rounded(value, 4)}°`;
    if (dimension === 'percent') return `${rounded(value, 3)} %`;
    if (value === Infinity) return 'straight line';
    const { unit } = this.viewer.info;
    return withUnit(measured(value), unit ? `${unit}${POWERS[dimension]}` : unit);
  }

  #list() {
    this.card.hidden = this.#finished.length === 0;
    const all = () => this.#finished.map((figure) => this.#textOf(figure)).join('\n');
    const clear = () => this.#change([]);
    this.#values = this.#finished.map((figure) => element('dl', { class: 'values' }, ...this.#rows(figure)));
    this.card.replaceChildren(
      element('header', {}, element('h2', {}, 'Measurements'), copyButton('Copy all', all),
        iconButton('export', 'Download as GeoJSON', () => this.#download()),
        iconButton('close', 'Delete all', clear)),
      ...this.#finished.map((figure, i) => this.#item(figure, () => this.#finished[i], this.#values[i])));
    this.overlay.redraw();
    this.figuresShown();
  }

  async #download() {
    const { geoJson } = await import('./geojson.js');
    const { info } = this.viewer;
    const content = geoJson(this.#finished, info);
    download(new Blob([JSON.stringify(content, null, 1)], { type: 'application/geo+json' }), `${stemOf(info.name)}-measurements.geojson`);
  }

  #rows(figure) {
    return this.#results(figure).flatMap((result) =>
      [element('dt', {}, result.name), element('dd', {}, element('span', {}, this.#text(result)))]);
  }

  /** The part of the card for a figure; `current()` is the figure with the results so far, which `values` shows. */
  #item({ kind, name }, current, values) {
    const remove = () => this.#change(this.#finished.filter((other) => other !== current()));
    return element('section', { class: 'measurement' },
      element('header', {}, element('h3', {}, name),
        kind === 'profile' ? iconButton('profile', `Show ${name}`, () => this.profileOpened(current())) : null,
        copyButton(`Copy ${name}`, () => this.#textOf(current())),
        iconButton('delete', `Delete ${name}`, remove)),
      kind === 'volume' ? volumeControls(current, (changed) => this.replace(current(), changed)) : null,
      values);
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
    // All results of a volume would hide much of the picture.
    const shown = kind === 'volume' ? this.#results(figure).slice(0, 3) : this.#results(figure);
    const lines = shown.map((result) =>
      (KINDS_OF_ONE_RESULT.includes(kind) ? this.#text(result) : `${result.name} ${this.#text(result)}`));
    if (kind === 'area' || kind === 'volume') {
      return [...view.polygon(points, 'measure-area'), ...view.path(points, 'measure', true), ...dots(view, points),
        ...(lines.length ? view.label(middle(points), lines, points) : [])];
    }
    if (kind === 'profile') {
      const strip = borders(points, figure.width, up).flatMap(([from, to]) => view.line(from, to, 'measure-leg'));
      return [...strip, ...view.path(points, 'measure', false), ...dots(view, points), ...view.label(points[0], [figure.name], points)];
    }
    if (kind === 'polyline' || kind === 'angle') {
      const at = kind === 'angle' ? points[1] : points.at(-1);
      return [...view.path(points, 'measure', false), ...dots(view, points), ...view.label(at, lines, points)];
    }
    if (kind === 'circle') {
      const circle = circleThrough(points);
      return [...view.path(circle ? outlineOf(circle) : points, 'measure', circle !== null), ...dots(view, points),
        ...view.label(circle?.center ?? points[1], lines, points)];
    }
    const [a, b] = points;
    const elbow = corner(a, b, up);
    const legs = [...view.line(a, elbow, kind === 'height' ? 'measure' : 'measure-leg'), ...view.line(elbow, b, 'measure-leg')];
    const straight = kind === 'distance' ? view.line(a, b, 'measure') : [];
    const at = kind === 'height' ? mix(a, elbow, 0.5) : mix(a, b, 0.5);
    return [...legs, ...straight, ...dots(view, points), ...view.label(at, lines, points)];
  }
}

/** Points of a circle at equal distances. */
function outlineOf({ center, radius, axes: [first, second] }) {
  return Array.from({ length: N_CIRCLE_LINES }, (_, i) => {
    const angle = (2 * Math.PI * i) / N_CIRCLE_LINES;
    return addScaled(addScaled(center, first, radius * Math.cos(angle)), second, radius * Math.sin(angle));
  });
}

const dots = (view, points) => points.flatMap((point) => view.dot(point, DOT_RADIUS, 'measure-dot'));
