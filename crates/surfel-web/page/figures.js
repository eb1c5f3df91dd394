// Figures of points in the world that are measured, and annotations: their kinds, and which are valid.

import { distance } from './vector.js';

/** Kinds of figures: the least number of their points, and their number if it is fixed. */
export const KINDS = {
  distance: { least: 2, fixed: 2 },
  height: { least: 2, fixed: 2 },
  angle: { least: 3, fixed: 3 },
  circle: { least: 3, fixed: 3 },
  polyline: { least: 2 },
  area: { least: 3 },
  profile: { least: 2 },
  volume: { least: 3 },
  annotation: { least: 1, fixed: 1 },
};
/** Maximum number of characters of a name, which is the text of an annotation. */
export const MAX_NAME_LENGTH = 100;

/** Whether a value from a link is a measurement: `{ kind, name, points }`, and the `width` of a profile or the base of a volume. */
export function isMeasurement(value) {
  const isPoint = (point) => Array.isArray(point) && point.length === 3 && point.every(Number.isFinite);
  if (!Object.hasOwn(KINDS, value?.kind) || typeof value.name !== 'string' || MAX_NAME_LENGTH < value.name.length) return false;
  const { least, fixed = Infinity } = KINDS[value.kind];
  const n = Array.isArray(value.points) ? value.points.length : 0;
  const hasWidth = value.kind !== 'profile' || (Number.isFinite(value.width) && 0 < value.width);
  const hasBase = value.kind !== 'volume' || isVolume(value);
  return least <= n && n <= fixed && value.points.every(isPoint) && hasWidth && hasBase;
}

/** Whether the base and cell size of a volume from a link are valid. */
function isVolume({ base, cell_size }) {
  const isBase = base === 'lowest' || base === 'mean' || Number.isFinite(base);
  return isBase && (cell_size === undefined || (Number.isFinite(cell_size) && 0 < cell_size));
}

/** Length of the lines between consecutive points. */
export function pathLength(points) {
  return points.slice(1).reduce((sum, point, i) => sum + distance(points[i], point), 0);
}
