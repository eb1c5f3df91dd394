// Results of measurements: lengths, heights, angles, circles and areas of points in the world.

import { pathLength } from './figures.js';
import { levelLength } from './profile.js';
import { volumeResults } from './volume-results.js';
import { add, addScaled, cross, distance, dot, length, scale, subtract } from './vector.js';

const horizontalPart = (offset, up) => addScaled(offset, up, -dot(offset, up));

/** Straight, horizontal and vertical distance of two points; vertical is positive if `b` is above `a`. */
export function distances(a, b, up) {
  const offset = subtract(b, a);
  return { straight: length(offset), horizontal: length(horizontalPart(offset, up)), vertical: dot(offset, up) };
}

/** Area of a polygon in space, by Newell's normal; exact for flat polygons. */
export function area(points) {
  return length(newell(points));
}

/** Area of a polygon's projection onto level ground. */
export function levelArea(points, up) {
  return Math.abs(dot(newell(points), up));
}

/** Length of a polygon's outline, from the last point back to the first. */
export function perimeter(points) {
  return points.reduce((sum, point, i) => sum + distance(point, points[(i + 1) % points.length]), 0);
}

/** Angle at `b` between the directions to `a` and `c`, in degrees. */
export function angleDegrees([a, b, c]) {
  const [toA, toC] = [subtract(a, b), subtract(c, b)];
  return (Math.atan2(length(cross(toA, toC)), dot(toA, toC)) * 180) / Math.PI;
}

/** The circle through three points: `{ center, radius, axes }` with two unit vectors in its plane; null for points on a line. */
export function circleThrough([a, b, c]) {
  const [toB, toC] = [subtract(b, a), subtract(c, a)];
  const normal = cross(toB, toC);
  const [lengthB, lengthC, lengthNormal] = [toB, toC, normal].map(length);
  if (!(1e-9 * lengthB * lengthC < lengthNormal)) return null;
  const toCenter = scale(
    add(scale(cross(normal, toB), lengthC ** 2), scale(cross(toC, normal), lengthB ** 2)), 0.5 / lengthNormal ** 2);
  const first = scale(toB, 1 / lengthB);
  return { center: add(a, toCenter), radius: length(toCenter), axes: [first, scale(cross(normal, first), 1 / lengthNormal)] };
}

/** Mean of a polygon's corners, for a label. */
export function middle(points) {
  const first = points[0];
  const sum = points.reduce((total, point) => add(total, subtract(point, first)), [0, 0, 0]);
  return addScaled(first, sum, 1 / points.length);
}

/** The point above or below `a` at the height of `b`. */
export function corner(a, b, up) {
  return addScaled(a, up, dot(subtract(b, a), up));
}

/** Newell's normal, whose length is the area; computed relative to the first point, so that large coordinates keep their precision. */
function newell(points) {
  const offsets = points.map((point) => subtract(point, points[0]));
  const sum = offsets.reduce(
    (total, offset, i) => add(total, cross(offset, offsets[(i + 1) % offsets.length])), [0, 0, 0]);
  return scale(sum, 0.5);
}

/**
 * The results of a measurement as rows of name, value and dimension: 0 for angles, 1 for lengths, 2 for areas,
 * 3 for volumes, `percent` for fractions.
 */
export function resultsOf(figure, up) {
  const { kind, points } = figure;
  if (kind === 'annotation') return [];
  if (kind === 'volume') return volumeResults(figure);
  if (kind === 'area') {
    return [
      { name: 'Area', value: area(points), dimension: 2 },
      { name: 'Level area', value: levelArea(points, up), dimension: 2 },
      { name: 'Perimeter', value: perimeter(points), dimension: 1 },
    ];
  }
  if (kind === 'angle') return [{ name: 'Angle', value: angleDegrees(points), dimension: 0 }];
  if (kind === 'profile') return [{ name: 'Level length', value: levelLength(points, up), dimension: 1 }];
  if (kind === 'polyline') return [{ name: 'Length', value: pathLength(points), dimension: 1 }];
  if (kind === 'circle') {
    const radius = circleThrough(points)?.radius ?? Infinity;
    return [
      { name: 'Diameter', value: 2 * radius, dimension: 1 },
      { name: 'Radius', value: radius, dimension: 1 },
    ];
  }
  const found = distances(points[0], points[1], up);
  if (kind === 'height') return [{ name: 'Height', value: Math.abs(found.vertical), dimension: 1 }];
  return [
    { name: 'Distance', value: found.straight, dimension: 1 },
    { name: 'Horizontal', value: found.horizontal, dimension: 1 },
    { name: 'Vertical', value: found.vertical, dimension: 1 },
  ];
}
