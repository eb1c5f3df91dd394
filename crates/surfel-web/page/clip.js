// Clip box and clip plane: their words in scene files, and where their handles are and go.

import { add, addScaled, cross, distance, dot, mix, normalize, perpendicular, scale, subtract } from './vector.js';

/** Six numbers of `([x0,x1],[y0,y1],[z0,z1])` as a box, or null. */
export function parseBox(text) {
  const numbers = (text ?? '').match(/-?[\d.]+(?:e[+-]?\d+)?/gi)?.map(Number) ?? [];
  if (numbers.length !== 6) return null;
  const [x0, x1, y0, y1, z0, z1] = numbers;
  return { min: [x0, y0, z0], max: [x1, y1, z1] };
}

export function formatBox({ min, max }) {
  return `(${[0, 1, 2].map((axis) => `[${tidy(min[axis])},${tidy(max[axis])}]`).join(',')})`;
}

/** A box that holds all of `bounds`, though they are rounded, and again when they are written. */
export function boxAround({ min, max }) {
  const room = (value) => 1e-6 * distance(min, max) + 1e-11 * Math.abs(value);
  return { min: min.map((value) => value - room(value)), max: max.map((value) => value + room(value)) };
}

/** The six faces of a box: middle, the axis it moves along, and which end it is. */
export function facesOf({ min, max }) {
  const center = mix(min, max, 0.5);
  return [0, 1, 2].flatMap((axis) => ['min', 'max'].map((end) => {
    const middle = [...center];
    middle[axis] = (end === 'min' ? min : max)[axis];
    const direction = [0, 0, 0];
    direction[axis] = end === 'min' ? -1 : 1;
    return { axis, end, middle, direction };
  }));
}

/** The box with one face at another place, not past the face across. */
export function withFace(box, { axis, end }, value) {
  const moved = { min: [...box.min], max: [...box.max] };
  const limit = end === 'min' ? Math.min : Math.max;
  moved[end][axis] = limit(value, (end === 'min' ? box.max : box.min)[axis]);
  return moved;
}

/** How far along a line (from `point`, along the unit `direction`) it comes nearest to a ray. */
export function nearestAlong(point, direction, ray) {
  const offset = subtract(point, ray.origin);
  const along = dot(direction, ray.direction);
  const sine = 1 - along * along;
  // Seen from the end of the line, no place on it is nearer than another.
  if (sine < 1e-6) return 0;
  return (along * dot(offset, ray.direction) - dot(offset, direction)) / sine;
}

/** A scene file's `[x, y, z, nx, ny, nz]` as point and unit normal, or null. */
export function parsePlane(numbers) {
  if (!numbers) return null;
  return { point: numbers.slice(0, 3), normal: normalize(numbers.slice(3)) ?? [0, 0, 1] };
}

export function formatPlane({ point, normal }) {
  return [...point, ...normal].map(tidy);
}

/** The plane through another place along its normal; `position` is the distance from the middle of `bounds`. */
export function planeAt(plane, bounds, position) {
  return { ...plane, point: addScaled(mix(bounds.min, bounds.max, 0.5), plane.normal, position) };
}

export function positionOf({ point, normal }, bounds) {
  return dot(subtract(point, mix(bounds.min, bounds.max, 0.5)), normal);
}

/** How far from the middle of `bounds` a plane with this normal still cuts it. */
export function reachOf(normal, { min, max }) {
  return [0, 1, 2].reduce((sum, axis) => sum + Math.abs(normal[axis]) * (max[axis] - min[axis]), 0) / 2;
}

/** The polygon in which a plane cuts a box, its corners in order; empty where it does not. */
export function planeOutline({ point, normal }, { min, max }) {
  const corner = (i) => [0, 1, 2].map((axis) => ((i >> axis) & 1 ? max : min)[axis]);
  const height = (place) => dot(subtract(place, point), normal);
  const cuts = [];
  for (let i = 0; i < 8; i++) {
    for (const bit of [1, 2, 4].filter((one) => (i & one) === 0)) {
      const [a, b] = [corner(i), corner(i | bit)];
      const [low, high] = [height(a), height(b)];
      if (low < 0 !== high < 0) cuts.push(mix(a, b, low / (low - high)));
    }
  }
  const middle = scale(cuts.reduce(add, [0, 0, 0]), 1 / Math.max(1, cuts.length));
  const across = perpendicular(normal);
  const along = cross(normal, across);
  const angle = (place) => {
    const offset = subtract(place, middle);
    return Math.atan2(dot(offset, along), dot(offset, across));
  };
  return cuts.sort((a, b) => angle(a) - angle(b));
}

/** Length for arrows and handles in a world of this size. */
export const sizeOf = ({ min, max }) => distance(min, max);

const tidy = (value) => Number(value.toPrecision(12));
