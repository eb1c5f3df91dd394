// Movements to the cameras of scene files, which may leave keys open.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { completed } from '../page/camera.js';
import { Navigation } from '../page/navigation.js';
import { signal } from '../page/signal.js';

const current = { position: [1, 2, 3], focal_point: [0, 0, 0], view_up: [0, 0, 1], view_angle: 35 };
const { view_angle, ...place } = current;

/** The cameras that a viewer at `current` is given for a movement without animation. */
function movedTo(camera) {
  globalThis.matchMedia = () => ({ matches: true });
  const given = { set: [], found: [] };
  const [setCamera, findCamera] = [(set) => given.set.push(set), (keys) => given.found.push(keys)];
  const viewer = { camera: current, viewReplaced: signal(), setCamera, findCamera };
  new Navigation(viewer).transitionTo(camera);
  return given;
}

test('a camera keeps the up and the projection that the other leaves open', () => {
  const there = { position: [0, 90, 2], focal_point: [0, 0, 2] };
  assert.deepEqual(completed(there, current), { ...current, ...there });
  assert.deepEqual(completed({ ...there, orthographic: 8 }, current), { ...place, ...there, orthographic: 8 });
  assert.deepEqual(completed(current, { ...place, orthographic: 8 }), current);
});

test('the camera moves to a place, and the server finds one that is not given', () => {
  const there = { position: [0, 90, 2], focal_point: [0, 0, 2] };
  assert.deepEqual(movedTo(there), { set: [{ ...current, ...there }], found: [] });
  for (const open of [{}, { position: [0, 90, 2] }, { azimuth_angle: 30 }, { ...there, orthographic: true }]) {
    assert.deepEqual(movedTo(open).found, [open]);
  }
});
