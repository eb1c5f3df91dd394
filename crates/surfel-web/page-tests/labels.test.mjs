// Labels of figures: where they stand, and which are left out.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Labels } from '../page/labels.js';
import { fakeDocument } from './fake-dom.mjs';

const size = { width: 800, height: 600 };
const view = { size, toPixel: ([x, y, depth]) => (0 < depth ? { x, y } : null), isHidden: () => false };

/** The frames and lines of labels at these points. */
function placed(points, changes = {}) {
  fakeDocument();
  const labels = new Labels({ ...view, ...changes });
  points.forEach((point, i) => labels.add(point, [`distance ${i}`, '1.5 m'], [point]));
  const frames = labels.elements.filter(({ tag }) => tag === 'g').map(({ children: [{ x, y, width, height }] }) => ({ x, y, width, height }));
  return { frames, leaders: labels.elements.filter(({ tag }) => tag === 'line') };
}

const areApart = (a, b) => a.x + a.width <= b.x || b.x + b.width <= a.x || a.y + a.height <= b.y || b.y + b.height <= a.y;

test('labels stand above each other, and those that moved have a line to their point', () => {
  const { frames, leaders } = placed([[400, 500, 1], [410, 505, 1], [420, 495, 1], [700, 500, 1]]);
  assert.equal(frames.length, 4);
  frames.forEach((frame, i) => frames.slice(i + 1).forEach((other) => assert.ok(areApart(frame, other))));
  assert.deepEqual(leaders.map(({ x1, y1 }) => [x1, y1]), [[410, 505], [420, 495]]);
});

test('labels stay between the sides of the picture', () => {
  const { frames: [left, right] } = placed([[3, 300, 1], [799, 500, 1]]);
  assert.deepEqual([left.x, right.x + right.width], [0, size.width]);
  const { frames: [long] } = placed([[5, 300, 1]], { size: { ...size, width: 40 } });
  assert.equal(long.x, 0);
});

test('labels outside of the picture, hidden ones and those without room are left out', () => {
  assert.equal(placed([[-1, 300, 1], [801, 300, 1], [400, 601, 1], [400, 300, -1]]).frames.length, 0);
  assert.equal(placed([[400, 300, 1]], { isHidden: () => true }).frames.length, 0);
  const { frames } = placed(Array(1000).fill([400, 300, 1]));
  assert.ok(3 < frames.length && frames.length < 12, `${frames.length}`);
  assert.ok(frames.every(({ y }) => 0 <= y));
});
