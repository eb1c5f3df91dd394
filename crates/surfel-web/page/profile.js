// Height profiles: their strip in the world, and their chart.

import { ticks } from './format.js';
import { addScaled, cross, dot, length, normalize, subtract } from './vector.js';

/** Pixels about the chart, for its labels. */
export const MARGIN = { left: 64, right: 14, top: 12, bottom: 28 };
/** Part of the chart's height that stays free above and below the points. */
const FREE_HEIGHT = 0.06;
const [TICK_DISTANCE_X, TICK_DISTANCE_Y] = [90, 24];

/** Length of a line over level ground. */
export function levelLength(points, up) {
  const last = segmentsOf(points, up).at(-1);
  return last ? last.distance + last.length : 0;
}

/** The two lines at the borders of the strip of this width, as pairs of points. */
export function borders(points, width, up) {
  const side = (sign) => segmentsOf(points, up).map(({ start, end, left }) =>
    [start, end].map((point) => addScaled(point, left, (sign * width) / 2)));
  return [...side(1), ...side(-1)];
}

function segmentsOf(points, up) {
  let distance = 0;
  return points.slice(1).flatMap((end, i) => {
    const offset = subtract(end, points[i]);
    const level = addScaled(offset, up, -dot(offset, up));
    if (length(level) === 0) return [];
    const along = normalize(level);
    const segment = { start: points[i], end, along, left: cross(up, along), length: length(level), distance };
    distance += segment.length;
    return [segment];
  });
}

/** The chart of a profile in a picture of this size: functions from lengths to pixels and back, ticks, and exaggeration. */
export function chartOf(profile, lineLength, { width, height }) {
  const [low, high] = profile.heights.reduce(([least, most], value) => [Math.min(least, value), Math.max(most, value)], [Infinity, -Infinity]);
  const range = Math.max(high - low, 1e-3 * lineLength) * (1 + 2 * FREE_HEIGHT) || 1;
  const lowest = (low + high - range) / 2;
  const [innerWidth, innerHeight] = [width - MARGIN.left - MARGIN.right, height - MARGIN.top - MARGIN.bottom];
  const [perLength, perHeight] = [innerWidth / lineLength, innerHeight / range];
  return {
    width,
    height,
    x: (distance) => MARGIN.left + perLength * distance,
    y: (value) => height - MARGIN.bottom - perHeight * (value - lowest),
    exaggeration: perHeight / perLength,
    xTicks: ticks(0, lineLength, innerWidth / TICK_DISTANCE_X),
    yTicks: ticks(lowest, lowest + range, innerHeight / TICK_DISTANCE_Y),
    /** Digits of a tick's label, so that neighbours differ. */
    digits: Math.max(5, Math.ceil(Math.log10(Math.max(Math.abs(low), Math.abs(high), 1e-9) / range)) + 4),
  };
}

/** Index of the point of a profile that is drawn next to a pixel, within this many pixels; -1 if there is none. */
export function nearestPoint({ distances, heights }, chart, pixel, maxDistance) {
  let [nearest, least] = [-1, maxDistance];
  distances.forEach((distance, i) => {
    const away = Math.hypot(chart.x(distance) - pixel.x, chart.y(heights[i]) - pixel.y);
    if (away < least) [nearest, least] = [i, away];
  });
  return nearest;
}
