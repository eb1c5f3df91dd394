// Movements to the cameras of scene files, which may leave keys open.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { completed, focalDistance } from '../page/camera.js';
import { Navigation } from '../page/navigation.js';
import { signal } from '../page/signal.js';
import { distance } from '../page/vector.js';

const current = { position: [1, 2, 3], focal_point: [0, 0, 0], view_up: [0, 0, 1], view_angle: 35 };
const { view_angle, ...place } = current;

/** The cameras that a viewer at `current` is given for a movement without animation. */
function movedTo(camera) {
  globalThis.matchMedia = () => ({ matches: true });
  const given = { set: [], found: [] };
  const [setCamera, findCamera] = [(set) => given.set.push(set), (keys) => given.found.push(keys)];
  const viewer = { camera: current, viewReplaced: signal(), viewRequested: signal(), setCamera, findCamera };
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

test('flying ends at a nearest and a farthest place, and leads back', () => {
  const bounds = { min: [-3, -4, 0], max: [3, 4, 0] };
  const start = { position: [0, -10, 5], focal_point: [0, 0, 0], view_up: [0, 0, 1] };
  for (const projection of [{ view_angle: 35 }, { orthographic: 8 }]) {
    const viewer = {
      camera: { ...start, ...projection }, info: { bounds }, viewReplaced: signal(), viewRequested: signal(), setCamera(camera) { viewer.camera = camera; },
    };
    const navigation = new Navigation(viewer);
    const fly = (direction) => {
      for (let i = 0; i < 2000; i++) navigation.fly(direction, 0.1, 4);
      return viewer.camera;
    };
    for (const direction of [[0, 0, -1], [1, 0, 0], [0, 1, 0]]) {
      const { position, orthographic = 0 } = fly(direction);
      assert.ok(distance(position, [0, 0, 0]) <= 500 && orthographic <= 500, `${direction}: ${position} ${orthographic}`);
      const there = viewer.camera;
      navigation.fly(direction.map((value) => -value), 0.1, 4);
      assert.notDeepEqual(viewer.camera, there);
    }
    assert.ok(1e-4 <= (fly([0, 0, 1]).orthographic ?? focalDistance(viewer.camera)));
  }
});
