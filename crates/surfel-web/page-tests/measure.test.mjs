// Measurements of known shapes, at national-grid coordinates.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { area, corner, distances, levelArea, middle, perimeter, resultsOf } from '../page/measure.js';

const up = [0, 0, 1];
const [east, north] = [562337, 4183203];
const close = (a, b) => assert.ok(Math.abs(a - b) < 1e-6, `${a} is not ${b}`);

test('distances are straight, horizontal and vertical', () => {
  const found = distances([east, north, 10], [east + 3, north + 4, 10 - 12], up);
  close(found.straight, 13);
  close(found.horizontal, 5);
  close(found.vertical, -12);
});

test('the area of a roof and its level area', () => {
  const roof = [[east, north, 0], [east + 10, north, 0], [east + 10, north + 3, 4], [east, north + 3, 4]];
  close(area(roof), 50);
  close(levelArea(roof, up), 30);
  close(perimeter(roof), 30);
  close(area([...roof].reverse()), 50);
});

test('areas of concave polygons are exact', () => {
  const hook = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 2, 0], [1, 1, 0], [0, 1, 0]];
  close(area(hook), 3);
  close(levelArea(hook, [0, 1, 0]), 0);
});

test('labels are at the middle, the corner of a height above its first point', () => {
  assert.deepEqual(middle([[0, 0, 0], [2, 0, 0], [2, 2, 6], [0, 2, 6]]), [1, 1, 3]);
  assert.deepEqual(corner([1, 2, 3], [7, 8, 9], up), [1, 2, 9]);
});

test('results have names', () => {
  const height = resultsOf({ kind: 'height', points: [[0, 0, 5], [1, 1, 2]] }, up);
  assert.deepEqual(height, [{ name: 'Height', value: 3, dimension: 1 }]);
  const square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]];
  assert.deepEqual(resultsOf({ kind: 'area', points: square }, up).map(({ value }) => value), [1, 1, 4]);
});
