// Clip boxes and planes: their text, handles and outlines.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import * as clip from '../page/clip.js';

const bounds = { min: [562316, 4183187, -2], max: [562363.25, 4183232, 8] };

test('boxes survive formatting and parsing', () => {
  const text = '([562316,562363.25],[4183187,4183232],[-2,8])';
  assert.equal(clip.formatBox(bounds), text);
  assert.deepEqual(clip.parseBox(text), bounds);
  assert.deepEqual(clip.parseBox('( [1e3, 2.5E3], [-1,-0.5], [0,1] )').min, [1000, -1, 0]);
  for (const invalid of [undefined, null, '', '([0,1],[0,1])']) assert.equal(clip.parseBox(invalid), null);
});

test('the initial box contains the bounds with a margin', () => {
  const inner = { min: [562316.0750007629, 4183187.450000763, -2], max: [562351.4230003357, 4183222.7989997864, 8] };
  const box = clip.parseBox(clip.formatBox(clip.boxAround(inner)));
  for (const axis of [0, 1, 2]) {
    const [low, high] = [inner.min[axis] - box.min[axis], box.max[axis] - inner.max[axis]];
    assert.ok(2e-5 < low && low < 2e-4 && 2e-5 < high && high < 2e-4, `${low} ${high}`);
  }
});

test('a face stops at the opposite face', () => {
  const face = clip.facesOf(bounds).find(({ axis, end }) => axis === 2 && end === 'max');
  assert.deepEqual(face.direction, [0, 0, 1]);
  assert.equal(clip.withFace(bounds, face, 3).max[2], 3);
  assert.equal(clip.withFace(bounds, face, -9).max[2], -2);
  assert.equal(bounds.max[2], 8);
});

test('a handle follows the ray', () => {
  const ray = { origin: [5, -10, 3], direction: [0, 1, 0] };
  assert.ok(Math.abs(clip.nearestAlong([1, 0, 0], [1, 0, 0], ray) - 4) < 1e-12);
  assert.equal(clip.nearestAlong([0, 0, 0], [0, 1, 0], ray), 0);
});

test('a plane keeps its position along its normal', () => {
  const plane = clip.planeAt({ normal: [0, 0, 1] }, bounds, 1.5);
  assert.equal(plane.point[2], 4.5);
  assert.ok(Math.abs(clip.positionOf(plane, bounds) - 1.5) < 1e-9);
  assert.equal(clip.maxPosition([0, 0, -1], bounds), 5);
  assert.deepEqual(clip.parsePlane(clip.formatPlane(plane)).normal, [0, 0, 1]);
  assert.equal(clip.parsePlane(undefined), null);
});

test('a plane cuts a box in a polygon of three to six corners', () => {
  const cube = { min: [0, 0, 0], max: [1, 1, 1] };
  const cut = (normal, point) => clip.planeOutline({ point, normal }, cube).length;
  const slanted = [1, 1, 1].map((value) => value / Math.sqrt(3));
  assert.equal(cut([0, 0, 1], [0, 0, 0.5]), 4);
  assert.equal(cut(slanted, [0.5, 0.5, 0.5]), 6);
  assert.equal(cut(slanted, [0.1, 0.1, 0.1]), 3);
  assert.equal(cut([0, 0, 1], [0, 0, 2]), 0);
});
