// Paths of the camera: keys at times, as an animation of a scene file has them, and the cameras between them.

import { add, scale } from './vector.js';

const PROJECTIONS = ['view_angle', 'orthographic'];
const VECTORS = ['position', 'focal_point', 'view_up'];
/** Seconds between the last key and a new one, and least seconds between two keys. */
const NEW_KEY_SECS = 3;
const MIN_SECS = 0.1;

/** The keys of a path, each `{ time, camera }`. */
export function keysOf(path) {
  const properties = [...VECTORS, ...PROJECTIONS].filter((key) => path?.[key]);
  return (path?.times ?? []).map((time, i) => ({ time, camera: Object.fromEntries(properties.map((key) => [key, path[key][i]])) }));
}

/** The patch of a scene that gives it a path with these keys; without keys it has none. */
export function pathPatch(keys, interpolation) {
  if (!keys.length) return { camera_path: null };
  const sorted = [...keys].sort((a, b) => a.time - b.time);
  const listOf = (key) => (sorted.every(({ camera }) => camera[key] !== undefined) ? sorted.map(({ camera }) => camera[key]) : null);
  const lists = [...VECTORS, ...PROJECTIONS].map((key) => [key, listOf(key)]);
  return { camera_path: { times: sorted.map(({ time }) => time), interpolation, ...Object.fromEntries(lists) } };
}

/** The keys with another one behind the last. */
export function withNewKey(keys, camera) {
  const last = keys.at(-1);
  return [...keys, { time: last ? last.time + NEW_KEY_SECS : 0, camera }];
}

/** The keys with another time of one of them, near which no other may be. */
export function withTime(keys, i, seconds) {
  const others = keys.filter((_, other) => other !== i);
  let time = Math.max(0, seconds);
  while (others.some((other) => Math.abs(other.time - time) < MIN_SECS - 1e-9)) time += MIN_SECS;
  return [...others, { ...keys[i], time: Number(time.toFixed(3)) }].sort((a, b) => a.time - b.time);
}

/** Whether a camera can be a key beside others: all of a path have one projection. */
export function fitsPath(keys, camera) {
  const projection = (one) => PROJECTIONS.find((key) => one[key] !== undefined);
  return Boolean(projection(camera)) && keys.every((key) => projection(key.camera) === projection(camera));
}

/** The camera at a time, as the movie has it: between keys as `interpolation` says, before and behind them as the next; none without a key. */
export function cameraAt(keys, interpolation, time) {
  const next = keys.findIndex((key) => time < key.time);
  if (next <= 0) return (next === 0 ? keys[0] : keys.at(-1))?.camera;
  const properties = Object.keys(keys[0].camera);
  return Object.fromEntries(properties.map((key) => [key, valueAt(keys, key, next, interpolation, time)]));
}

function valueAt(keys, property, next, interpolation, time) {
  const value = (i) => keys[i].camera[property];
  const [from, to] = [keys[next - 1].time, keys[next].time];
  const weight = (time - from) / (to - from);
  if (interpolation === 'step') return value(next - 1);
  if (interpolation !== 'cubic') {
    const eased = interpolation === 'ease' ? weight * weight * (3 - 2 * weight) : weight;
    return sum([value(next - 1), 1 - eased], [value(next), eased]);
  }
  // Tangents after Catmull and Rom (1974): the mean velocity from the key before to the key after.
  const tangent = (i) => {
    const [before, after] = [Math.max(0, i - 1), Math.min(keys.length - 1, i + 1)];
    const seconds = keys[after].time - keys[before].time;
    return sum([value(after), 1 / seconds], [value(before), -1 / seconds]);
  };
  const [t, t2, t3] = [weight, weight ** 2, weight ** 3];
  const seconds = to - from;
  return sum(
    [value(next - 1), 2 * t3 - 3 * t2 + 1], [tangent(next - 1), seconds * (t3 - 2 * t2 + t)],
    [value(next), 3 * t2 - 2 * t3], [tangent(next), seconds * (t3 - t2)]);
}

/** The sum of numbers or vectors with their weights. */
function sum(...terms) {
  const weighted = terms.map(([value, weight]) => (Array.isArray(value) ? scale(value, weight) : value * weight));
  return weighted.reduce((a, b) => (Array.isArray(a) ? add(a, b) : a + b));
}
