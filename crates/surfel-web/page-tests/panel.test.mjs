// Rows of the panel: a field takes over the scene's value once the user has left it.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { pictureControls, pointControls } from '../page/controls.js';
import { mergePatch } from '../page/merge-patch.js';
import { Panel } from '../page/panel.js';
import { signal } from '../page/signal.js';
import { fakeDocument } from './fake-dom.mjs';

/** The row of a control, its inputs, and the changes that it makes. */
function rowOf(control, scene, info) {
  const document = fakeDocument();
  const changes = [];
  const viewer = {
    scene, info, initialScene: scene, sceneChanged: signal(), cameraChanged: signal(), rejected: signal(), viewReplaced: signal(),
    changeSettings: (patch, isMoving) => {
      changes.push({ patch, isMoving });
      viewer.show(patch);
    },
    show: (patch) => {
      viewer.scene = mergePatch(viewer.scene, patch);
      viewer.sceneChanged();
    },
  };
  const [row] = new Panel(viewer).addRows([control]);
  const field = row.children[1];
  const leave = (to = null) => {
    document.activeElement = to;
    field.emit('focusout', { relatedTarget: to });
  };
  return { document, viewer, changes, field, inputs: row.all('input'), leave };
}

const FILTER = { kind: 'text', key: 'filter', label: 'Filter', read: (scene) => scene.filter ?? '' };
const SPP = { kind: 'slider', key: 'spp', label: 'Samples', range: [0, 100], step: 1 };
const RANGE = { kind: 'numbers', key: 'range', label: 'Range', names: ['low', 'high'] };

test('a text that is typed back to what it was does not stay', () => {
  const { viewer, inputs: [input], leave } = rowOf(FILTER, { filter: 'a' });
  input.emit('input');
  viewer.show({ filter: 'b' });
  assert.equal(input.value, 'a');
  input.emit('blur');
  leave();
  assert.equal(input.value, 'b');
});

test('a number that was not changed shows the new value once it is left', () => {
  const { document, viewer, inputs: [, number], leave } = rowOf(SPP, { spp: 4 });
  document.activeElement = number;
  viewer.show({ spp: 9 });
  assert.equal(number.value, 4);
  leave();
  assert.equal(number.value, 9);
});

test('numbers that are being entered stay until all of them are left', () => {
  const { document, inputs: [low, high], leave } = rowOf(RANGE, {});
  document.activeElement = low;
  low.value = 5;
  leave(high);
  assert.equal(low.value, 5);
  leave();
  assert.equal(low.value, '');
});

test('a drag without an end is ended when the field is left', () => {
  const { viewer, changes, inputs: [range], leave } = rowOf(SPP, { spp: 4 });
  range.value = 500;
  range.emit('input');
  leave();
  const [dragged, ended] = changes;
  assert.deepEqual([dragged.isMoving, ended.isMoving, changes.length], [true, false, 2]);
  assert.deepEqual(ended.patch, { spp: 50 });
  viewer.show({ spp: 10 });
  assert.equal(range.value, 100);
});

test('a drag that becomes a scroll ends, and one that ends by itself is reported once', () => {
  for (const [event, ...following] of [['pointercancel'], ['pointerup', 'change']]) {
    const { changes, field, inputs: [range] } = rowOf(SPP, { spp: 4 });
    const timers = [];
    globalThis.setTimeout = (run) => timers.push(run);
    range.value = 500;
    range.emit('input');
    field.emit(event);
    for (const type of following) range.emit(type);
    for (const run of timers) run();
    assert.deepEqual(changes.map(({ isMoving }) => isMoving), [true, false], event);
  }
});

test('a drag keeps its value while other settings arrive, and loses it to an undo', () => {
  const { viewer, changes, field, inputs: [range] } = rowOf(SPP, { spp: 4 });
  const timers = [];
  globalThis.setTimeout = (run) => timers.push(run);
  range.value = 500;
  range.emit('input');
  viewer.show({ spp: 20, color: 'rgb' });
  assert.equal(range.value, 500);
  viewer.viewReplaced();
  viewer.show({ spp: 10 });
  assert.equal(range.value, 100);
  // A browser reports no change after a value that was set by the page.
  field.emit('pointerup');
  for (const run of timers) run();
  assert.equal(changes.length, 1);
});

test('a typed number is sent as it is, as the server says what it takes', () => {
  const { changes, inputs: [, number] } = rowOf(pictureControls.find(({ key }) => key === 'spp'), { spp: 4 });
  number.valueAsNumber = 5000;
  number.emit('change');
  assert.deepEqual(changes.at(-1).patch, { spp: 5000 });
});

test('classes of noise read as hidden, and the usual classes are no choice', () => {
  const info = { classes: [2, 6, 7].map((one) => ({ class: one, is_hidden: one === 7 })) };
  const { read, write } = pointControls.find(({ key }) => key === 'class');
  assert.deepEqual(read({}, { info }), [2, 6]);
  assert.deepEqual(read({ noise_points: 'keep' }, { info }), [2, 6, 7]);
  assert.deepEqual(read({ class: [7] }, { info }), [7]);
  for (const [classes, expected] of [[[2, 6], null], [[2], [2]], [[2, 7], [2, 7]], [[2, 6, 7], [2, 6, 7]]]) {
    assert.deepEqual(write(classes, {}, { info }), { class: expected });
  }
  assert.deepEqual(write([2, 6, 7], { noise_points: 'keep' }, { info }), { class: null });
});
