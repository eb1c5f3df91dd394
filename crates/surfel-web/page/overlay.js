// The overlay over the picture: lines and handles in the world, projected with the camera of the picture.

import { depthOf, project } from './camera.js';
import { svg } from './dom.js';
import { mix } from './vector.js';

/** Depth at which lines are clipped in front of the camera, as a fraction of the line's own depth. */
const NEAR_FRACTION = 1e-3;
/** Number of segments of a line in a panorama, where straight lines are curved. */
const N_CURVE_SEGMENTS = 32;
/** Time between two questions about hidden points. */
const QUESTION_PAUSE_MS = 150;
/** Maximum number of points of a question. */
const MAX_POINTS = 2000;

export class Overlay {
  #painters = [];
  #isScheduled = false;
  /** Keys of the points that surfaces hide, of which the server was asked last. */
  #hidden = new Set();
  #isAsking = false;
  #askedFor = '';

  constructor(root, viewer) {
    this.root = root;
    this.viewer = viewer;
    viewer.frameShown.listen(() => this.redraw());
    viewer.sceneChanged.listen(() => this.redraw());
    viewer.toolChanged.listen(() => this.redraw());
    new ResizeObserver(() => this.redraw()).observe(root);
  }

  /** Adds a painter: `paint(view)` returns SVG elements, created with the functions of the view. */
  add(paint) {
    this.#painters.push(paint);
  }

  redraw() {
    if (this.#isScheduled) return;
    this.#isScheduled = true;
    requestAnimationFrame(() => {
      this.#isScheduled = false;
      const camera = this.viewer.shownCamera;
      if (!camera) return;
      const anchors = new Map();
      /** Whether surfaces hide all of these points, as far as the server has said. */
      const isHidden = (points) => {
        for (const point of points) anchors.set(`${point}`, point);
        return points.every((point) => this.#hidden.has(`${point}`));
      };
      const view = viewOf(camera, { width: this.root.clientWidth, height: this.root.clientHeight }, isHidden);
      this.root.replaceChildren(...this.#painters.flatMap((paint) => paint(view)));
      this.#askForHidden([...anchors.values()]);
    });
  }

  /** Asks the server which of the points of labels are hidden, one question at a time, and draws again if that changes. */
  async #askForHidden(anchors) {
    const points = anchors.slice(0, MAX_POINTS);
    const { lastFrame } = this.viewer;
    if (this.#isAsking || points.length === 0 || this.#askedFor === keyOf(points, lastFrame)) return;
    this.#isAsking = true;
    this.#askedFor = keyOf(points, lastFrame);
    try {
      const { visible } = await this.viewer.request({ type: 'visible', points });
      const hidden = new Set(points.filter((_, i) => !visible[i]).map(String));
      const isSame = hidden.size === this.#hidden.size && [...hidden].every((key) => this.#hidden.has(key));
      this.#hidden = hidden;
      if (!isSame) this.redraw();
    } catch {
      // All labels are shown until there is an answer.
    }
    await new Promise((resolve) => { setTimeout(resolve, QUESTION_PAUSE_MS); });
    this.#isAsking = false;
    // Asks again if points or picture have changed meanwhile.
    this.redraw();
  }
}

/** Changes with the labels' points and with the picture. */
const keyOf = (points, frame) => `${frame?.frame} ${points.join(' ')}`;

/** The functions that painters draw with. Points are in the world, their positions on the overlay in CSS pixels. */
function viewOf(camera, size, isHidden) {
  const toPixel = (point) => project(camera, size, point);

  const straight = (a, b) => {
    const [depthA, depthB] = [depthOf(camera, a), depthOf(camera, b)];
    const near = NEAR_FRACTION * Math.max(depthA, depthB);
    if (!(0 < near)) return [];
    const cut = () => mix(a, b, (near - depthA) / (depthB - depthA));
    const [from, to] = [toPixel(depthA < near ? cut() : a), toPixel(depthB < near ? cut() : b)];
    return from && to ? [[from, to]] : [];
  };

  /** A line in a panorama; parts that cross from one side of the picture to the other are left out. */
  const curved = (a, b) => {
    const pixels = Array.from({ length: N_CURVE_SEGMENTS + 1 }, (_, i) => toPixel(mix(a, b, i / N_CURVE_SEGMENTS)));
    const isVisible = ([from, to]) => from && to && Math.abs(from.x - to.x) < size.width / 2;
    return pixels.slice(1).map((to, i) => [pixels[i], to]).filter(isVisible);
  };

  /** A line between two points as pairs of pixels. */
  const segments = camera.panorama ? curved : straight;

  const line = (a, b, className) => segments(a, b).map(([from, to]) =>
    svg('line', { class: className, x1: from.x, y1: from.y, x2: to.x, y2: to.y }));

  const path = (points, className, isClosed) => points.flatMap((point, i) => {
    const next = points[i + 1] ?? (isClosed ? points[0] : null);
    return next ? line(point, next, className) : [];
  });

  /** A filled polygon; none if part of it is behind the camera, or in a panorama. */
  const polygon = (points, className) => {
    const pixels = points.map(toPixel);
    if (camera.panorama || pixels.length < 3 || pixels.some((one) => one === null)) return [];
    return [svg('polygon', { class: className, points: pixels.map(({ x, y }) => `${x},${y}`).join(' ') })];
  };

  const dot = (point, radius, className, attributes = {}) => {
    const pixel = toPixel(point);
    return pixel ? [svg('circle', { class: className, cx: pixel.x, cy: pixel.y, r: radius, ...attributes })] : [];
  };

  return { camera, size, toPixel, segments, line, path, polygon, dot, isHidden };
}

/** Paints a cross at the pivot while the user moves the camera. */
export function pivotPainter(navigation) {
  return ({ camera, toPixel }) => {
    const hasPivot = navigation.isActive && !camera.panorama && !navigation.station;
    const at = hasPivot ? toPixel(camera.focal_point) : null;
    if (!at) return [];
    const shape = `M${at.x - 9} ${at.y}h6m6 0h6M${at.x} ${at.y - 9}v6m0 6v6`;
    return [svg('path', { class: 'pivot-halo', d: shape }), svg('path', { class: 'pivot', d: shape })];
  };
}
