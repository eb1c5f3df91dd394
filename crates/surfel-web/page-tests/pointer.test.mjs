// Pointers on the picture: pinches, and drags of handles.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setUpPointer } from '../page/pointer.js';
import { signal } from '../page/signal.js';
import { fakeDocument } from './fake-dom.mjs';

/** A viewport, with functions for its pointers, and a list of what happens. */
function picture({ grabs }) {
  const viewport = fakeDocument().createElement('main');
  const calls = [];
  const navigation = {
    isActive: false, stop() {},
    orbit() { this.isActive = true; calls.push('orbit'); },
    pan() { this.isActive = true; calls.push('pan'); },
    zoom() { this.isActive = true; },
    endInteraction() { this.isActive = false; calls.push('end of navigation'); },
  };
  const handle = { move: () => calls.push('move of handle'), end: () => calls.push('end of handle') };
  const actions = { leave() {}, hover() {}, grab: () => (grabs ? handle : null), click: () => calls.push('click') };
  const viewer = { camera: {}, size: { width: 400, height: 200 }, viewReplaced: signal() };
  setUpPointer(viewport, viewer, navigation, actions);
  const send = (type) => (pointerId, clientX) =>
    viewport.emit(type, { pointerId, clientX, clientY: 9, button: 0, target: viewport });
  const [down, move, up] = ['pointerdown', 'pointermove', 'pointerup'].map(send);
  return { calls, navigation, viewer, down, move, up };
}

test('a second finger does not pinch while a handle is dragged', () => {
  const { calls, navigation, down, move, up } = picture({ grabs: true });
  down(1, 10);
  move(1, 20);
  down(2, 90);
  move(2, 100);
  up(2, 100);
  up(1, 20);
  assert.deepEqual(calls, ['move of handle', 'end of handle']);
  assert.ok(!navigation.isActive);
});

test('navigation under way ends with the drag of a handle', () => {
  const { calls, navigation, down, up } = picture({ grabs: true });
  down(1, 10);
  navigation.isActive = true;
  up(1, 10);
  assert.deepEqual(calls, ['end of handle', 'end of navigation']);
});

test('two fingers pinch the picture', () => {
  const { calls, down, move, up } = picture({ grabs: false });
  down(1, 10);
  down(2, 90);
  move(2, 100);
  up(2, 100);
  up(1, 10);
  assert.deepEqual(calls, ['pan', 'end of navigation']);
});

test('a drag has no effect any more once the view is replaced, as by undo, and the next one has', () => {
  for (const grabs of [true, false]) {
    const { calls, navigation, viewer, down, move, up } = picture({ grabs });
    const [moved, ended] = grabs ? ['move of handle', 'end of handle'] : ['orbit', 'end of navigation'];
    down(1, 10);
    move(1, 20);
    viewer.viewReplaced();
    // The navigation ends by the same signal. Other data have no camera at first.
    navigation.isActive = false;
    viewer.camera = null;
    move(1, 30);
    down(2, 90);
    move(2, 100);
    up(2, 100);
    up(1, 30);
    assert.deepEqual(calls, [moved], `${grabs}`);
    viewer.camera = {};
    down(1, 10);
    move(1, 20);
    up(1, 20);
    assert.deepEqual(calls, [moved, moved, ended]);
  }
});

test('a press on a view that is replaced before the release is no click', () => {
  const { calls, viewer, down, up } = picture({ grabs: false });
  down(1, 10);
  viewer.viewReplaced();
  up(1, 10);
  assert.deepEqual(calls, []);
});
