// The drawing over the picture: lines, labels and handles in the world, as the camera of the picture sees them.

import { depthOf, project } from './camera.js';
import { svg } from './dom.js';
import { mix } from './vector.js';

/** Share of a line's depth at which it is cut off before the camera. */
const NEAR = 1e-3;
/** Straight lines are bent in a panorama, which draws so many pieces of each. */
const BENT_PIECES = 32;
const LABEL_LINE = 16;
const LABEL_GAP = 10;

export class Overlay {
  #painters = [];
  #isDue = false;

  constructor(root, viewer) {
    this.root = root;
    this.viewer = viewer;
    viewer.frameShown.listen(() => this.redraw());
    viewer.sceneChanged.listen(() => this.redraw());
    viewer.toolChanged.listen(() => this.redraw());
    new ResizeObserver(() => this.redraw()).observe(root);
  }

  /** `paint(view)` returns elements, made with the functions of a view. */
  add(paint) {
    this.#painters.push(paint);
  }

  redraw() {
    if (this.#isDue) return;
    this.#isDue = true;
    requestAnimationFrame(() => {
      this.#isDue = false;
      const camera = this.viewer.shownCamera;
      if (!camera) return;
      const view = viewOf(camera, { width: this.root.clientWidth, height: this.root.clientHeight });
      this.root.replaceChildren(...this.#painters.flatMap((paint) => paint(view)));
    });
  }
}

/** What painters draw with; places are CSS pixels, points are in the world. */
function viewOf(camera, size) {
  const place = (point) => project(camera, size, point);

  const lineBetween = (from, to, className) => svg('line', { class: className, x1: from.x, y1: from.y, x2: to.x, y2: to.y });

  const straight = (a, b, className) => {
    const [depthA, depthB] = [depthOf(camera, a), depthOf(camera, b)];
    const near = NEAR * Math.max(depthA, depthB);
    if (!(0 < near)) return [];
    const cut = () => mix(a, b, (near - depthA) / (depthB - depthA));
    const [from, to] = [place(depthA < near ? cut() : a), place(depthB < near ? cut() : b)];
    return from && to ? [lineBetween(from, to, className)] : [];
  };

  /** What leaves a panorama at one side comes back at the other. */
  const bent = (a, b, className) => {
    const places = Array.from({ length: BENT_PIECES + 1 }, (_, i) => place(mix(a, b, i / BENT_PIECES)));
    const isSeen = ([from, to]) => from && to && Math.abs(from.x - to.x) < size.width / 2;
    const pieces = places.slice(1).map((to, i) => [places[i], to]).filter(isSeen);
    return pieces.map(([from, to]) => lineBetween(from, to, className));
  };

  const line = camera.panorama ? bent : straight;

  const path = (points, className, isClosed) => points.flatMap((point, i) => {
    const next = points[i + 1] ?? (isClosed ? points[0] : null);
    return next ? line(point, next, className) : [];
  });

  /** A filled polygon; left out where part of it is behind the camera, and where its sides are bent. */
  const polygon = (points, className) => {
    const places = points.map(place);
    if (camera.panorama || places.length < 3 || places.some((one) => one === null)) return [];
    return [svg('polygon', { class: className, points: places.map(({ x, y }) => `${x},${y}`).join(' ') })];
  };

  const dot = (point, radius, className, attributes = {}) => {
    const at = place(point);
    return at ? [svg('circle', { class: className, cx: at.x, cy: at.y, r: radius, ...attributes })] : [];
  };

  /** Lines of text over a point. */
  const label = (point, lines) => {
    const foot = place(point);
    if (!foot) return [];
    const width = 14 + 6.7 * Math.max(...lines.map((text) => text.length));
    const height = 8 + LABEL_LINE * lines.length;
    const at = { x: foot.x, y: foot.y - height / 2 - LABEL_GAP };
    const texts = lines.map((text, i) =>
      svg('text', { x: at.x, y: at.y - height / 2 + LABEL_LINE * (i + 1) }, text));
    const frame = svg('rect', { x: at.x - width / 2, y: at.y - height / 2, width, height, rx: 6 });
    return [svg('g', { class: 'label' }, frame, ...texts)];
  };

  const rubber = (from, to) => lineBetween(from, to, 'measure-rubber');

  return { camera, size, place, line, path, polygon, dot, label, rubber };
}

/** The cross at the pivot while the camera is moved by hand. */
export function pivotPainter(navigation) {
  return ({ camera, place }) => {
    const at = navigation.isActive && !camera.panorama ? place(camera.focal_point) : null;
    if (!at) return [];
    const shape = `M${at.x - 9} ${at.y}h6m6 0h6M${at.x} ${at.y - 9}v6m0 6v6`;
    return [svg('path', { class: 'pivot-halo', d: shape }), svg('path', { class: 'pivot', d: shape })];
  };
}
