// Measurements: lengths, heights and areas of points in the world.

import { add, addScaled, cross, distance, dot, length, scale, subtract } from './vector.js';

/** Kinds of measurements with their least number of points. */
const LEAST_POINTS = { distance: 2, height: 2, area: 3 };
const MAX_NAME_LENGTH = 100;

/** Whether a value from a link is a measurement: `{ kind, name, points }`. */
export function isMeasurement(value) {
  const isPoint = (point) => Array.isArray(point) && point.length === 3 && point.every(Number.isFinite);
  return Object.hasOwn(LEAST_POINTS, value?.kind) && typeof value.name === 'string' && value.name.length <= MAX_NAME_LENGTH
    && Array.isArray(value.points) && LEAST_POINTS[value.kind] <= value.points.length && value.points.every(isPoint);
}

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

/** The results of a measurement as rows of name, value and dimension: 1 for lengths, 2 for areas. */
export function resultsOf({ kind, points }, up) {
  if (kind === 'area') {
    return [
      { name: 'Area', value: area(points), dimension: 2 },
      { name: 'Level area', value: levelArea(points, up), dimension: 2 },
      { name: 'Perimeter', value: perimeter(points), dimension: 1 },
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
