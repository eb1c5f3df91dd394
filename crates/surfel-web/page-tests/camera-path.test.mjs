// Paths of the camera: keys, and the cameras between them.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { cameraAt, fitsPath, keysOf, pathPatch, withNewKey, withTime } from '../page/camera-path.js';

const camera = (x, view_angle = 40) => ({ position: [x, 0, 0], focal_point: [x, 10, 0], view_up: [0, 0, 1], view_angle });
const KEYS = [{ time: 0, camera: camera(0) }, { time: 1, camera: camera(2, 50) }, { time: 3, camera: camera(10, 30) }];

test('keys are written as an animation of a scene file, and read back', () => {
  const { camera_path: path } = pathPatch([KEYS[2], KEYS[0], KEYS[1]], 'cubic');
  assert.deepEqual(path.times, [0, 1, 3]);
  assert.deepEqual(path.view_angle, [40, 50, 30]);
  // A merge patch must take away the list of another projection.
  assert.equal(path.orthographic, null);
  assert.deepEqual(keysOf(path), KEYS);
  assert.deepEqual(pathPatch([], 'cubic'), { camera_path: null });
  assert.deepEqual(keysOf(undefined), []);
});

test('new keys come behind the last, and keys are moved to free times', () => {
  assert.deepEqual(withNewKey([], camera(1)).map(({ time }) => time), [0]);
  assert.deepEqual(withNewKey(KEYS, camera(1)).map(({ time }) => time), [0, 1, 3, 6]);
  assert.deepEqual(withTime(KEYS, 0, 2).map((key) => [key.time, key.camera.position[0]]), [[1, 2], [2, 0], [3, 10]]);
  assert.deepEqual(withTime(KEYS, 0, 1).map(({ time }) => time), [1, 1.1, 3]);
  assert.deepEqual(withTime(KEYS, 2, -5).map(({ time }) => time), [0, 0.1, 1]);
});

test('all keys have one projection', () => {
  const flat = { position: [0, 0, 9], focal_point: [0, 0, 0], view_up: [0, 1, 0], orthographic: 5 };
  assert.ok(fitsPath([], camera(1)) && fitsPath(KEYS, camera(1)) && fitsPath([{ time: 0, camera: flat }], flat));
  assert.ok(!fitsPath(KEYS, flat) && !fitsPath([], { panorama: true }));
});

test('cameras pass the keys, and lie between them as the interpolation says', () => {
  for (const kind of ['cubic', 'linear', 'ease', 'step']) {
    for (const { time, camera: key } of KEYS) assert.deepEqual(cameraAt(KEYS, kind, time), key, kind);
    assert.deepEqual(cameraAt(KEYS, kind, 99), KEYS[2].camera);
    assert.deepEqual(cameraAt(KEYS, kind, -1), KEYS[0].camera);
  }
  const at = (kind, time) => cameraAt(KEYS, kind, time);
  assert.deepEqual([at('linear', 0.25).position[0], at('linear', 0.25).view_angle], [0.5, 42.5]);
  assert.equal(at('ease', 0.25).position[0], 2 * 0.15625);
  assert.equal(at('step', 0.9).position[0], 0);
  // Velocities 2 and 10/3 at the ends of the first span.
  const [t, v0, v1] = [0.25, 2, 10 / 3];
  const expected = v0 * (t ** 3 - 2 * t ** 2 + t) + 2 * (3 * t ** 2 - 2 * t ** 3) + v1 * (t ** 3 - t ** 2);
  assert.ok(Math.abs(at('cubic', 0.25).position[0] - expected) < 1e-12);
});

test('a path of one key stands still', () => {
  assert.deepEqual(cameraAt([KEYS[1]], 'cubic', 0.5), KEYS[1].camera);
});

test('a path without keys has no camera', () => {
  assert.equal(cameraAt([], 'cubic', 1), undefined);
});
