// What measurements say: lengths, heights and areas of points in the world.

import { add, addScaled, cross, distance, dot, length, scale, subtract } from './vector.js';

const withoutHeight = (offset, up) => addScaled(offset, up, -dot(offset, up));

/** Straight, horizontal and vertical distance of two points; vertical is positive upward from `a` to `b`. */
export function distances(a, b, up) {
  const offset = subtract(b, a);
  return { straight: length(offset), horizontal: length(withoutHeight(offset, up)), vertical: dot(offset, up) };
}

/** Area of a polygon in space, by Newell's normal: exact where it is flat. */
export function area(points) {
  return length(newell(points));
}

/** Area of its shadow on level ground. */
export function levelArea(points, up) {
  return Math.abs(dot(newell(points), up));
}

/** Length of its rim, from the last point back to the first. */
export function perimeter(points) {
  return points.reduce((sum, point, i) => sum + distance(point, points[(i + 1) % points.length]), 0);
}

/** Middle of its corners, where a label may stand. */
export function middle(points) {
  const first = points[0];
  const sum = points.reduce((total, point) => add(total, subtract(point, first)), [0, 0, 0]);
  return addScaled(first, sum, 1 / points.length);
}

/** Right angle of a height: over (or under) `a`, as high as `b`. */
export function corner(a, b, up) {
  return addScaled(a, up, dot(subtract(b, a), up));
}

/** Normal whose length is the area, relative to the first point so that large coordinates lose nothing. */
function newell(points) {
  const offsets = points.map((point) => subtract(point, points[0]));
  const sum = offsets.reduce(
    (total, offset, i) => add(total, cross(offset, offsets[(i + 1) % offsets.length])), [0, 0, 0]);
  return scale(sum, 0.5);
}

/** A finished measurement as rows of name and number. */
export function resultsOf({ kind, points }, up) {
  if (kind === 'area') {
    return [
      { name: 'Area', value: area(points) },
      { name: 'Level area', value: levelArea(points, up) },
      { name: 'Perimeter', value: perimeter(points) },
    ];
  }
  const found = distances(points[0], points[1], up);
  if (kind === 'height') return [{ name: 'Height', value: Math.abs(found.vertical) }];
  return [
    { name: 'Distance', value: found.straight },
    { name: 'Horizontal', value: found.horizontal },
    { name: 'Vertical', value: found.vertical },
  ];
}
