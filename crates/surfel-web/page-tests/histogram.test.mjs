// The range of a column in a filter.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { filterName, rangeIn, withRange } from '../page/histogram.js';

test('ranges are added to a filter, changed and removed', () => {
  let filter = withRange('', 'z', [3, null]);
  assert.equal(filter, 'z >= 3');
  filter = withRange(filter, 'intensity', [10, 500.5]);
  assert.equal(filter, 'z >= 3 && intensity >= 10 && intensity <= 500.5');
  assert.deepEqual(rangeIn(filter, 'intensity'), [10, 500.5]);
  filter = withRange(filter, 'z', [-1e-7, 4]);
  assert.deepEqual([rangeIn(filter, 'z'), rangeIn(filter, 'intensity')], [[-1e-7, 4], [10, 500.5]]);
  filter = withRange(withRange(filter, 'z', [null, null]), 'intensity', [null, null]);
  assert.equal(filter, '');
});

test('what the user has typed keeps its meaning', () => {
  for (const [typed, expected] of [
    ['class == 2', 'class == 2 && z >= 3'],
    ['class == 2 || class == 6', '(class == 2 || class == 6) && z >= 3'],
    ['class == 2 || z <= 5', '(class == 2 || z <= 5) && z >= 3'],
    ['(class == 2 || class == 6) && z <= 5', '(class == 2 || class == 6) && z >= 3'],
    ['(a == 1) || (b == 2)', '((a == 1) || (b == 2)) && z >= 3'],
    ['z[1:2]', 'z[1:2] && z >= 3'],
  ]) {
    const filter = withRange(typed, 'z', [3, null]);
    assert.equal(filter, expected);
    assert.deepEqual(rangeIn(filter, 'z'), [3, null]);
  }
  assert.deepEqual(rangeIn('class == 2 || z <= 5', 'z'), [null, null]);
  assert.equal(withRange('class == 2 || class == 6', 'z', [null, null]), 'class == 2 || class == 6');
});

test('names of columns are written as filters have them', () => {
  assert.equal(filterName('Return Number'), 'Return_Number');
});
