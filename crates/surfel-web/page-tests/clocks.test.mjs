// Clocks that jump, as those of machines that sleep: what is animated goes on and ends, and nothing waits for hours.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { animationRows } from '../page/animation.js';
import { CursorCoordinates } from '../page/cursor-coordinates.js';
import { setUpKeyboard } from '../page/keyboard.js';
import { mergePatch } from '../page/merge-patch.js';
import { Navigation } from '../page/navigation.js';
import { signal } from '../page/signal.js';
import { distance } from '../page/vector.js';
import { fakeDocument, settled } from './fake-dom.mjs';

const HOUR_MS = 3_600_000;
const FRAME_MS = 1000 / 60;
const JUMPS_MS = [-5 * HOUR_MS, 5 * HOUR_MS];
const START = { position: [0, -10, 0], focal_point: [0, 0, 0], view_up: [0, 0, 1], view_angle: 35 };
const THERE = { ...START, position: [0, -10, 10] };

/** A document, a viewer of an animated scene, and a clock whose animation frames and timers run when the test says so. */
function set() {
  fakeDocument();
  let now = 1000;
  let frames = [];
  const timers = [];
  Object.defineProperty(globalThis, 'performance', { value: { now: () => now }, configurable: true });
  Object.assign(globalThis, {
    requestAnimationFrame: (run) => frames.push(run),
    cancelAnimationFrame() { frames = []; },
    matchMedia: () => ({ matches: false }),
    setTimeout: (run, wait_ms) => timers.push({ run, wait_ms }),
    clearTimeout() {},
  });
  document.querySelector = () => null;
  const emitted = ['infoChanged', 'sceneChanged', 'cameraChanged', 'connectionChanged', 'frameShown', 'viewReplaced', 'viewRequested'];
  const viewer = {
    ...Object.fromEntries(emitted.map((name) => [name, signal()])),
    camera: START, scene: {}, size: { width: 400, height: 300 }, isMoving: false, isConnected: true,
    info: { up: [0, 0, 1], stations: [], duration_secs: 2, bounds: { min: [-5, -5, -5], max: [5, 5, 5] } },
    setCamera: (camera, isMoving) => Object.assign(viewer, { camera, isMoving }),
    changeSettings: (patch, isMoving) => Object.assign(viewer, { scene: mergePatch(viewer.scene, patch), isMoving }),
  };
  const jump = (duration_ms) => { now += duration_ms; };
  const nextFrame = (n = 1) => {
    for (let i = 0; i < n; i++) {
      jump(FRAME_MS);
      for (const run of frames.splice(0)) run(now);
    }
  };
  return { viewer, jump, nextFrame, timers, isAnimated: () => 0 < frames.length };
}

test('a transition stays on its way and ends at rest', () => {
  for (const jump_ms of JUMPS_MS) {
    const { viewer, jump, nextFrame, isAnimated } = set();
    new Navigation(viewer).transitionTo(THERE);
    nextFrame(3);
    jump(jump_ms);
    for (let i = 0; i < 40; i++) {
      nextFrame();
      const { position } = viewer.camera;
      assert.ok(distance(position, START.position) + distance(position, THERE.position) < 15, `${position}`);
    }
    assert.deepEqual([viewer.camera, viewer.isMoving, isAnimated()], [THERE, false, false]);
  }
});

test('a path is followed to its end, and no view is out of it', () => {
  for (const jump_ms of JUMPS_MS) {
    const { viewer, jump, nextFrame, isAnimated } = set();
    const times = [];
    new Navigation(viewer).follow(() => THERE, 2, (time) => times.push(time));
    nextFrame(3);
    jump(jump_ms);
    nextFrame(130);
    assert.ok(times.every((time, i) => 0 <= time && time <= 2 && (i === 0 || times[i - 1] <= time)), `${times}`);
    assert.deepEqual([times.at(-1), viewer.isMoving, isAnimated()], [2, false, false]);
  }
});

test('the turntable goes on, at its distance', () => {
  for (const jump_ms of JUMPS_MS) {
    const { viewer, jump, nextFrame } = set();
    new Navigation(viewer).startTurntable(12);
    nextFrame(3);
    jump(jump_ms);
    nextFrame();
    const after = viewer.camera.position;
    nextFrame();
    assert.notDeepEqual(viewer.camera.position, after);
    assert.ok(Math.abs(distance(viewer.camera.position, [0, 0, 0]) - 10) < 1e-6);
  }
});

test('an animation stays within its duration, and goes on or ends', () => {
  for (const jump_ms of JUMPS_MS) {
    for (const loops of [true, false]) {
      const { viewer, jump, nextFrame, isAnimated } = set();
      const rows = animationRows(viewer, () => ({}));
      const [[play], [loop]] = [rows[0].all('button'), rows[1].all('input')];
      loop.checked = loops;
      play.emit('click');
      nextFrame(3);
      jump(jump_ms);
      for (let i = 0; i < 130; i++) {
        nextFrame();
        assert.ok(0 <= viewer.scene.time && viewer.scene.time <= 2, `${viewer.scene.time}`);
      }
      assert.equal(isAnimated(), loops);
      if (!loops) assert.deepEqual([viewer.scene.time, viewer.isMoving], [2, false]);
    }
  }
});

test('flying takes no leap, waits for a camera, and ends at rest', () => {
  for (const jump_ms of JUMPS_MS) {
    const { viewer, jump, nextFrame, timers } = set();
    setUpKeyboard(viewer, new Navigation(viewer), {}, {});
    const target = { matches: () => false, closest: () => null };
    const distanceFlown = () => distance(viewer.camera.position, START.position);
    globalThis.window.emit('keydown', { key: 'w', target });
    nextFrame(3);
    const before = distanceFlown();
    assert.ok(0 < before);
    jump(jump_ms);
    nextFrame();
    assert.ok(distanceFlown() < 2, `${distanceFlown()}`);
    viewer.camera = null;
    nextFrame(3);
    viewer.camera = START;
    nextFrame(3);
    assert.ok(0 < distanceFlown() && viewer.isMoving);
    globalThis.window.emit('keyup', { key: 'w', target });
    nextFrame(2);
    timers.at(-1).run();
    assert.equal(viewer.isMoving, false);
  }
});

test('coordinates under the mouse are shown soon after a sleep', async () => {
  const { viewer, jump, timers } = set();
  viewer.pick = async () => {
    jump(8 * HOUR_MS);
    return { kind: 'point', position: [1, 2, 3] };
  };
  const coordinates = new CursorCoordinates(viewer);
  for (let i = 0; i < 3; i++) {
    coordinates.moveTo({ x: i, y: 0 });
    const { run, wait_ms } = timers.pop();
    assert.ok(wait_ms <= 2000, `${wait_ms}`);
    run();
    await settled();
  }
});
