// Draws figures over the picture: their lines, and labels with their names and results.

import { svg } from './dom.js';
import { measured, rounded, withUnit } from './format.js';
import { Labels } from './labels.js';
import { circleThrough, corner, middle, resultsOf } from './measure.js';
import { borders } from './profile.js';
import { addScaled, mix } from './vector.js';

const POWERS = { 1: '', 2: '²', 3: '³' };
/** Kinds whose only result needs no name. */
const KINDS_OF_ONE_RESULT = ['height', 'angle', 'polyline'];
/** Results of a volume in its label; all would hide much of the picture. */
const N_VOLUME_RESULTS = 3;
/** Number of lines that a circle is drawn with. */
const N_CIRCLE_LINES = 64;
const DOT_RADIUS = 4;

/** The text of a result in the unit of the file. */
export function textOfResult({ value, dimension }, unit) {
  if (dimension === 0) return `${rounded(value, 4)}°`;
  if (dimension === 'percent') return `${rounded(value, 3)} %`;
  if (value === Infinity) return 'straight line';
  return withUnit(measured(value), unit ? `${unit}${POWERS[dimension]}` : unit);
}

/** Paints the finished figures of a tool and the unfinished one. */
export function figurePainter(viewer, tool) {
  /** The lines of the labels of figures that were drawn before. */
  const known = new WeakMap();
  const linesOf = (figure) => {
    if (!known.has(figure)) known.set(figure, labelLines(figure, viewer.info));
    return known.get(figure);
  };
  return (view) => {
    const labels = new Labels(view);
    const drawing = new Drawing(view);
    for (const figure of tool.figures) {
      if (figure.kind === 'annotation' && view.isHidden(figure.points)) continue;
      labels.add(labelPoint(figure, viewer.info.up), linesOf(figure), figure.points);
      drawLines(drawing, figure, viewer.info.up);
      drawing.addDots(figure.points);
    }
    const { points, pointer } = tool;
    drawing.addPath(points, 'measure');
    drawing.addDots(points);
    const from = pointer && points.length ? view.toPixel(points.at(-1)) : null;
    if (from) drawing.addSegment(from, pointer, 'measure-rubber-band');
    return [...drawing.elements, ...labels.elements];
  };
}

/** The lines, areas and dots of many figures, with one element for all of a class: thousands of elements would stop the page. */
class Drawing {
  #areas = [];
  /** The data of the paths by their classes, in the order in which they are drawn. */
  #data = new Map(['measure-leg', 'measure', 'measure-rubber-band', 'measure-dot'].map((name) => [name, []]));

  constructor(view) {
    this.view = view;
  }

  get elements() {
    const paths = [...this.#data].filter(([, data]) => data.length).map(([name, data]) => svg('path', { class: name, d: data.join('') }));
    return [...this.#areas, ...paths];
  }

  addArea(points) {
    this.#areas.push(...this.view.polygon(points, 'measure-area'));
  }

  addLine(a, b, className) {
    for (const [from, to] of this.view.segments(a, b)) this.addSegment(from, to, className);
  }

  addPath(points, className, isClosed = false) {
    points.slice(1).forEach((point, i) => this.addLine(points[i], point, className));
    if (isClosed) this.addLine(points.at(-1), points[0], className);
  }

  addSegment(from, to, className) {
    const { width, height } = this.view.size;
    const isOutside = (a, b, end) => (a < 0 && b < 0) || (end < a && end < b);
    if (isOutside(from.x, to.x, width) || isOutside(from.y, to.y, height)) return;
    this.#data.get(className).push(`M${short(from.x)} ${short(from.y)}L${short(to.x)} ${short(to.y)}`);
  }

  addDots(points) {
    for (const point of points) {
      const pixel = this.view.toPixel(point);
      const arc = (sign) => `a${DOT_RADIUS} ${DOT_RADIUS} 0 1 0 ${sign * 2 * DOT_RADIUS} 0`;
      if (pixel) this.#data.get('measure-dot').push(`M${short(pixel.x - DOT_RADIUS)} ${short(pixel.y)}${arc(1)}${arc(-1)}`);
    }
  }
}

/** A pixel with two decimals. */
const short = (value) => Math.round(100 * value) / 100;

function drawLines(drawing, { kind, points, width }, up) {
  if (kind === 'annotation') return;
  if (kind === 'area' || kind === 'volume') {
    drawing.addArea(points);
    drawing.addPath(points, 'measure', true);
    return;
  }
  if (kind === 'polyline' || kind === 'angle' || kind === 'profile') {
    drawing.addPath(points, 'measure');
    if (kind === 'profile') for (const [from, to] of borders(points, width, up)) drawing.addLine(from, to, 'measure-leg');
    return;
  }
  if (kind === 'circle') {
    const circle = circleThrough(points);
    drawing.addPath(circle ? outlineOf(circle) : points, 'measure', circle !== null);
    return;
  }
  const [a, b] = points;
  const elbow = corner(a, b, up);
  drawing.addLine(a, elbow, kind === 'height' ? 'measure' : 'measure-leg');
  drawing.addLine(elbow, b, 'measure-leg');
  if (kind === 'distance') drawing.addLine(a, b, 'measure');
}

/** The point above which the label of a figure stands. */
function labelPoint({ kind, points }, up) {
  if (kind === 'area' || kind === 'volume') return middle(points);
  if (kind === 'angle') return points[1];
  if (kind === 'polyline') return points.at(-1);
  if (kind === 'circle') return circleThrough(points)?.center ?? points[1];
  if (kind === 'distance') return mix(points[0], points[1], 0.5);
  if (kind === 'height') return mix(points[0], corner(points[0], points[1], up), 0.5);
  return points[0];
}

/** The name of a figure and its results, for its label. */
function labelLines(figure, { up, unit }) {
  const { kind, name } = figure;
  if (kind === 'profile') return [name];
  const results = resultsOf(figure, up).slice(0, kind === 'volume' ? N_VOLUME_RESULTS : Infinity);
  const text = (result) => textOfResult(result, unit);
  return [name, ...results.map((result) => (KINDS_OF_ONE_RESULT.includes(kind) ? text(result) : `${result.name} ${text(result)}`))];
}

/** Points of a circle at equal distances. */
function outlineOf({ center, radius, axes: [first, second] }) {
  return Array.from({ length: N_CIRCLE_LINES }, (_, i) => {
    const angle = (2 * Math.PI * i) / N_CIRCLE_LINES;
    return addScaled(addScaled(center, first, radius * Math.cos(angle)), second, radius * Math.sin(angle));
  });
}
