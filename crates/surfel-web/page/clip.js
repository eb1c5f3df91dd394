// Clip box and clip plane: their text in scene files, and the geometry of their handles.

import { add, addScaled, cross, distance, dot, mix, normalize, perpendicular, scale, subtract } from './vector.js';

/** The box in a text such as `([x0,x1],[y0,y1],[z0,z1])`; null unless there are six numbers. */
export function parseBox(text) {
  const numbers = (text ?? '').match(/-?[\d.]+(?:e[+-]?\d+)?/gi)?.map(Number) ?? [];
  if (numbers.length !== 6) return null;
  const [x0, x1, y0, y1, z0, z1] = numbers;
  return { min: [x0, y0, z0], max: [x1, y1, z1] };
}

export function formatBox({ min, max }) {
  return `(${[0, 1, 2].map((axis) => `[${rounded(min[axis])},${rounded(max[axis])}]`).join(',')})`;
}

/** A box that contains all of `bounds`, with a margin for their rounding here and in the text. */
export function boxAround({ min, max }) {
  const margin = (value) => 1e-6 * distance(min, max) + 1e-11 * Math.abs(value);
  return { min: min.map((value) => value - margin(value)), max: max.map((value) => value + margin(value)) };
}

/** The six faces of a box: middle, axis, end of the axis, and outward direction. */
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

/** The box with one face moved to `value` on its axis, at most to the opposite face. */
export function withFace(box, { axis, end }, value) {
  const moved = { min: [...box.min], max: [...box.max] };
  const limit = end === 'min' ? Math.min : Math.max;
  moved[end][axis] = limit(value, (end === 'min' ? box.max : box.min)[axis]);
  return moved;
}

/** The parameter of the point on a line (`point` plus a multiple of the unit `direction`) that is nearest to a ray. */
export function nearestAlong(point, direction, ray) {
  const offset = subtract(point, ray.origin);
  const along = dot(direction, ray.direction);
  const sine = 1 - along * along;
  // The ray is parallel to the line: all points are equally near.
  if (sine < 1e-6) return 0;
  return (along * dot(offset, ray.direction) - dot(offset, direction)) / sine;
}

/** The plane of a scene file's `[x, y, z, nx, ny, nz]`, with a unit normal; null without one. */
export function parsePlane(numbers) {
  if (!numbers) return null;
  return { point: numbers.slice(0, 3), normal: normalize(numbers.slice(3)) ?? [0, 0, 1] };
}

export function formatPlane({ point, normal }) {
  return [...point, ...normal].map(rounded);
}

/** The plane moved along its normal; `position` is the signed distance from the centre of `bounds`. */
export function planeAt(plane, bounds, position) {
  return { ...plane, point: addScaled(mix(bounds.min, bounds.max, 0.5), plane.normal, position) };
}

export function positionOf({ point, normal }, bounds) {
  return dot(subtract(point, mix(bounds.min, bounds.max, 0.5)), normal);
}

/** The distance from the centre of `bounds` up to which a plane with this normal cuts them. */
export function maxPosition(normal, { min, max }) {
  return [0, 1, 2].reduce((sum, axis) => sum + Math.abs(normal[axis]) * (max[axis] - min[axis]), 0) / 2;
}

/** The polygon in which a plane cuts a box, with its corners in order; empty if it does not. */
export function planeOutline({ point, normal }, { min, max }) {
  const corner = (i) => [0, 1, 2].map((axis) => ((i >> axis) & 1 ? max : min)[axis]);
  const signedDistance = (corner) => dot(subtract(corner, point), normal);
  const cuts = [];
  for (let i = 0; i < 8; i++) {
    for (const bit of [1, 2, 4].filter((one) => (i & one) === 0)) {
      const [a, b] = [corner(i), corner(i | bit)];
      const [low, high] = [signedDistance(a), signedDistance(b)];
      if (low < 0 !== high < 0) cuts.push(mix(a, b, low / (low - high)));
    }
  }
  const middle = scale(cuts.reduce(add, [0, 0, 0]), 1 / Math.max(1, cuts.length));
  const u = perpendicular(normal);
  const v = cross(normal, u);
  const angle = (cut) => {
    const offset = subtract(cut, middle);
    return Math.atan2(dot(offset, v), dot(offset, u));
  };
  return cuts.sort((a, b) => angle(a) - angle(b));
}

/** Length of the diagonal of `bounds`. */
export const sizeOf = ({ min, max }) => distance(min, max);

const rounded = (value) => Number(value.toPrecision(12));
