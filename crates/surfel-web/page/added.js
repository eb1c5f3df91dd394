// Files that were added to this page alone: what of them is a part of a state, a link, the list of objects.

import { cornersOf } from './camera.js';
import { distance, mix } from './vector.js';

/** How far away other things lie that the user is told of, in diagonals of all else. */
const MAX_SIZES = 20;

/** The patch of a link, which cannot carry added files and their settings. `added` has the files by their ids. */
export function withoutAdded({ added_files, ...patch }, added) {
  const names = (added_files ?? []).map((id) => added.get(id)?.name);
  return names.reduce((kept, name) => ({ ...kept, ...withoutSettings(kept, name) }), patch);
}

/** The lists of settings and materials without those of one object, where there are such lists. */
export function withoutSettings(scene, name) {
  const isOther = (text) => !text.startsWith(`${name}:`) && !text.startsWith(`${name}=`);
  const lists = ['object_settings', 'material'].filter((key) => Array.isArray(scene[key]));
  return Object.fromEntries(lists.map((key) => [key, scene[key].filter(isOther)]));
}

/** The box around several. */
export function boxAround(boxes) {
  const corners = boxes.flatMap(cornersOf);
  const ends = (end) => [0, 1, 2].map((axis) => end(...corners.map((corner) => corner[axis])));
  return { min: ends(Math.min), max: ends(Math.max) };
}

/** The distance between two boxes if they lie far from each other; zero if they do not. */
export function distanceBetween(bounds, others) {
  const [a, b] = [bounds, others].map(({ min, max }) => mix(min, max, 0.5));
  const size = Math.max(distance(bounds.min, bounds.max), distance(others.min, others.max));
  return MAX_SIZES * size < distance(a, b) ? distance(a, b) : 0;
}
