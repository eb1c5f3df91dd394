// The range of a column in a filter.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { filterName, histogramChart, rangeIn, rangeOf, withRange } from '../page/histogram.js';
import { histogramRows } from '../page/histogram-choice.js';
import { signal } from '../page/signal.js';
import { fakeDocument } from './fake-dom.mjs';

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

test('a handle at its end sets no limit, whatever its digits and steps', () => {
  const [low, high] = [12.345678912345, 987.654321987654];
  const step = (high - low) / 200.001;
  assert.deepEqual(rangeOf([low, high], { low, high }, step), [null, null]);
  assert.deepEqual(rangeOf([low, low + 200 * step], { low, high }, step), [null, null]);
  assert.ok(!rangeOf([low + step, low + 199 * step], { low, high }, step).includes(null));
  assert.deepEqual(rangeOf([high, low], { low, high }, step), [null, null]);
});

test('a step is a limit for whole numbers, of ten digits too', () => {
  assert.deepEqual(rangeOf([2, 5], { low: 1, high: 6 }, 1), [2, 5]);
  const [low, high] = [1234567891, 1234567899];
  assert.deepEqual(rangeOf([low, high], { low, high }, 1), [null, null]);
});

test('a handle that is dragged stays while settings arrive, and loses its place to an undo', () => {
  const document = fakeDocument();
  const changes = [];
  const viewer = { scene: {}, sceneChanged: signal(), viewReplaced: signal(), changeSettings: (patch) => changes.push(patch) };
  const show = (scene) => {
    viewer.scene = scene;
    viewer.sceneChanged();
  };
  const place = document.createElement('div');
  histogramChart(viewer, place)('z', { low: 0, high: 100, width: 10, counts: Array(10).fill(3) });
  const [low] = place.all('input');
  const dragTo = (value) => {
    low.value = value;
    low.emit('input');
  };
  dragTo(30);
  show({ filter: 'z >= 10', color: 'rgb' });
  assert.equal(low.value, 30);
  low.emit('change');
  assert.deepEqual(changes, [{ filter: 'z >= 30' }]);
  show({ filter: 'z >= 30' });
  const timers = [];
  globalThis.setTimeout = (run) => timers.push(run);
  dragTo(40);
  dragTo(30);
  low.emit('pointerup');
  for (const run of timers) run();
  show({ filter: 'z >= 50' });
  assert.equal(low.value, 50);
  dragTo(60);
  viewer.viewReplaced();
  show({});
  assert.equal(low.value, 0);
});

test('a new connection keeps the chosen column if the data has it', () => {
  fakeDocument();
  const requested = [];
  const request = ({ column }) => {
    requested.push(column);
    return new Promise(() => {});
  };
  const viewer = { info: { columns: ['x', 'z'] }, infoChanged: signal(), sceneChanged: signal(), request };
  const [choice] = histogramRows(viewer)[0].all('select');
  viewer.infoChanged();
  assert.equal(choice.value, '');
  choice.value = 'z';
  viewer.infoChanged();
  assert.equal(choice.value, 'z');
  viewer.info = { columns: ['x'] };
  viewer.infoChanged();
  assert.equal(choice.value, '');
  assert.deepEqual(requested, ['z']);
});
