// The viewer's messages to the server, and what it makes of the answers.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { Navigation } from '../page/navigation.js';
import { CAMERA, SCENE, connectedViewer } from './fake-server.mjs';

const sceneFile = { name: 'a.toml', size: 2, text: async () => 'x' };
const camera = (x) => ({ ...CAMERA, position: [x, 0, 0] });

test('a scene file is a change by the user, and brings its camera after any other answer', async () => {
  const { viewer, server, nextFrame } = connectedViewer();
  let nChanges = 0;
  viewer.changeSettings({ color: 'class' });
  viewer.changedByUser.listen(() => { nChanges += 1; });
  viewer.setCamera(camera(1), false);
  await viewer.loadScene(sceneFile);
  // What was changed before the file is sent before it.
  const [{ id }] = server.sent('loadScene');
  const [set, moved, load] = [...server.sent('set'), ...server.sent('camera'), ...server.sent('loadScene')];
  assert.deepEqual([set.seq, moved.seq, load.id], [1, 2, id]);
  nextFrame();
  assert.equal(server.sent('camera').length, 1);
  nChanges = 0;
  assert.ok(!viewer.isSynced);
  server.send({ type: 'scene', number: 2, seq: 1, scene: { ...SCENE, color: 'class' }, camera: CAMERA, legend: null });
  server.send({ type: 'error', text: 'not of this file' });
  assert.equal(nChanges, 0);
  const loaded = { ...SCENE, color: 'normal' };
  server.send({ type: 'scene', number: 3, seq: 2, id, scene: loaded, camera: camera(9), legend: null });
  assert.equal(nChanges, 1);
  assert.deepEqual([viewer.scene.color, viewer.camera.position], ['normal', [9, 0, 0]]);
});

test('a camera that the user sets after a scene file stays', async () => {
  const { viewer, server, nextFrame } = connectedViewer();
  await viewer.loadScene(sceneFile);
  viewer.setCamera(camera(4), false);
  nextFrame();
  const [{ id }] = server.sent('loadScene');
  server.send({ type: 'scene', number: 2, seq: 0, id, scene: SCENE, camera: camera(9), legend: null });
  assert.deepEqual(viewer.camera.position, [4, 0, 0]);
});

test('what is exported has all changes made before', async () => {
  const { viewer, server, nextFrame } = connectedViewer();
  viewer.changeSettings({ color: 'class' });
  viewer.setCamera(camera(4), false);
  const answer = viewer.request({ type: 'export', width: 3, height: 2 });
  const abort = new AbortController();
  const cancelled = viewer.request({ type: 'save', width: 3, height: 2 }, { abort: abort.signal });
  viewer.request({ type: 'pick', x: 1, y: 1 });
  assert.equal(server.sent('pick').length, 1);
  nextFrame();
  assert.deepEqual([server.sent('set').length, server.sent('camera').length, server.sent('export').length], [1, 1, 0]);
  abort.abort();
  await assert.rejects(cancelled, /cancelled/);
  server.send({ type: 'scene', number: 2, seq: 1, scene: { ...SCENE, color: 'class' }, camera: CAMERA, legend: null });
  const [{ id }] = server.sent('export');
  server.send({ type: 'export', id, command: 'surfel' });
  assert.equal((await answer).command, 'surfel');
  assert.equal(server.sent('save').length, 0);
});

test('what plays ends before the view is asked for', () => {
  const { viewer, server, nextFrame } = connectedViewer();
  let isPlaying = true;
  viewer.viewRequested.listen(() => { isPlaying = false; });
  viewer.request({ type: 'pick', x: 1, y: 1 });
  assert.ok(isPlaying);
  viewer.changeSettings({ time: 1 }, true);
  viewer.request({ type: 'save', width: 3, height: 2 });
  assert.ok(!isPlaying);
  nextFrame();
  server.send({ type: 'scene', number: 2, seq: 1, scene: { ...SCENE, time: 1 }, camera: CAMERA, legend: null });
  assert.equal(server.sent('save').length, 1);
});

test('a rejected change delays an export no longer, and a lost connection ends it', async () => {
  const { viewer, server, nextFrame } = connectedViewer();
  viewer.changeSettings({ color: 'class' });
  const lost = viewer.request({ type: 'export', width: 3, height: 2 });
  viewer.request({ type: 'points', format: 'laz' }).catch(() => {});
  nextFrame();
  server.send({ type: 'error', seq: 1, text: 'there are no classes' });
  assert.equal(server.sent('export').length, 1);
  server.close();
  await assert.rejects(lost, /lost/);
  server.welcome();
  assert.deepEqual([server.sent('export').length, server.sent('points').length], [0, 0]);
});

test('a pick tells no surface from no answer', async () => {
  const { viewer, server } = connectedViewer();
  const [sky, refused] = [viewer.pick({ x: 1, y: 1 }), viewer.pick({ x: 2, y: 2 })];
  const [first, second] = server.sent('pick');
  server.send({ type: 'error', id: second.id, text: 'too many questions' });
  server.send({ type: 'pick', id: first.id, point: null });
  assert.equal(await sky, null);
  await assert.rejects(refused, /too many questions/);
});

test('a fast screen does not send more than the server takes', () => {
  const { viewer, server, nextFrame } = connectedViewer();
  for (let i = 0; i < 240; i++) {
    viewer.setCamera(camera(i), true);
    viewer.changeSettings({ time: i }, true);
    nextFrame(1000 / 240);
  }
  nextFrame();
  const n = server.sent('camera').length;
  assert.ok(100 < n && n <= 126, `${n} messages in a second`);
  assert.deepEqual(server.sent('camera').at(-1).camera.position, [239, 0, 0]);
});

test('a server with other data gets none of the old view, and its camera is shown', () => {
  const { viewer, server, nextFrame } = connectedViewer();
  let nReplaced = 0;
  viewer.viewReplaced.listen(() => { nReplaced += 1; });
  assert.equal(server.sent('hello')[0].name, undefined);
  viewer.setCamera(camera(1), true);
  nextFrame();
  viewer.changeSettings({ color: 'class' });
  server.close();
  viewer.setCamera(camera(2), true);
  const scene = { color: 'elevation', camera: camera(7) };
  server.welcome({ name: 'valley' }, scene);
  const [hello] = server.sent('hello');
  assert.deepEqual([hello.name, hello.scene.color], ['town', 'class']);
  assert.equal(nReplaced, 1);
  assert.deepEqual([viewer.scene.color, viewer.camera.position], ['elevation', [7, 0, 0]]);
  nextFrame();
  assert.deepEqual([server.sent('camera').length, server.sent('set').length], [0, 0]);
  // Another answer of the server moves the camera.
  server.send({ type: 'scene', number: 2, seq: 0, scene, camera: camera(8), legend: null });
  assert.deepEqual(viewer.camera.position, [8, 0, 0]);
});

test('a server with the same data gets the view, and changes made without a connection', () => {
  const { viewer, server, nextFrame } = connectedViewer();
  viewer.changeSettings({ color: 'class' });
  nextFrame();
  server.close();
  viewer.setCamera(camera(2), false);
  server.welcome({}, { ...SCENE, color: 'class' });
  nextFrame();
  assert.equal(server.sent('hello')[0].scene.color, 'class');
  assert.deepEqual(server.sent('camera')[0].camera.position, [2, 0, 0]);
  assert.deepEqual(viewer.camera.position, [2, 0, 0]);
});

test('a connection that brings nothing is given up, and the view is kept', () => {
  const { viewer, server, nextFrame, page, wait } = connectedViewer();
  const losses = [];
  viewer.connectionChanged.listen(({ isConnected }) => losses.push(isConnected));
  for (let i = 0; i < 10; i++) {
    wait(10_000);
    server.send({ type: 'pong' });
  }
  assert.deepEqual([losses, server.sent('ping').length], [[], 10]);
  viewer.changeSettings({ color: 'class' });
  nextFrame();
  page.dispatchEvent(new Event('online'));
  wait(19_000);
  assert.deepEqual(losses, []);
  wait(3_000);
  assert.deepEqual(losses, [false]);
  server.welcome();
  assert.deepEqual([losses, server.sent('hello')[0].scene.color], [[false, true], 'class']);
});

test('a saved picture may take long to arrive', () => {
  const { viewer, server, wait } = connectedViewer();
  let isLost = false;
  viewer.connectionChanged.listen(() => { isLost = true; });
  viewer.request({ type: 'save', width: 9, height: 9 }).catch(() => {});
  wait(100_000);
  assert.ok(!isLost);
  const [{ id }] = server.sent('save');
  server.send({ type: 'error', id, text: 'too large' });
  wait(35_000);
  assert.ok(isLost);
});

test('a connection that is never opened is given up', () => {
  const { viewer, server, wait } = connectedViewer();
  let nAttempts = 0;
  viewer.connectionChanged.listen(() => { nAttempts += 1; });
  server.close();
  wait(50_000);
  assert.equal(nAttempts, 3);
});

test('settings that are too long for the server are left out, and the connection lasts', () => {
  const long = 'x'.repeat(300_000);
  const opened = connectedViewer({ caption: long });
  assert.deepEqual(opened.server.sent('hello')[0].scene, {});
  assert.equal(opened.viewer.scene.caption, undefined);
  const { viewer, server, nextFrame } = connectedViewer({ caption: 'short' });
  const rejections = [];
  viewer.rejected.listen(({ text }) => rejections.push(text));
  assert.equal(server.sent('hello')[0].scene.caption, 'short');
  viewer.changeSettings({ caption: long.repeat(4) });
  nextFrame();
  assert.deepEqual([server.sent('set').length, viewer.scene.caption, rejections.length], [0, undefined, 1]);
  viewer.request({ type: 'export', width: 3, height: 2 });
  assert.equal(server.sent('export').length, 1);
});

test('settings and cameras that arrive in the middle of a drag leave it as it is', () => {
  const { viewer, server, nextFrame } = connectedViewer();
  const answer = (number, seq, scene = {}) =>
    server.send({ type: 'scene', number, seq, scene: { ...SCENE, ...scene }, camera: camera(9), legend: null });
  viewer.setCamera(camera(1), true);
  viewer.changeSettings({ sun: { azimuth: 10 } }, true);
  // Before they are sent, while they are on their way, and once they have taken effect.
  answer(2, 0, { color: 'class' });
  assert.deepEqual([viewer.camera.position, viewer.scene.sun, viewer.scene.color], [[1, 0, 0], { azimuth: 10 }, 'class']);
  nextFrame();
  answer(3, 0, { color: 'normal' });
  assert.deepEqual([viewer.camera.position, viewer.scene.sun, viewer.scene.color], [[1, 0, 0], { azimuth: 10 }, 'normal']);
  answer(4, 2, { sun: { azimuth: 10, elevation: 5 } });
  assert.deepEqual([viewer.camera.position, viewer.scene.sun], [[1, 0, 0], { azimuth: 10, elevation: 5 }]);
  viewer.changeSettings({ sun: { azimuth: 20 } }, true);
  viewer.setCamera(camera(2), false);
  answer(5, 2, { sun: { azimuth: 10, elevation: 5 } });
  nextFrame();
  answer(6, 3, { sun: { azimuth: 20, elevation: 5 } });
  assert.deepEqual([viewer.camera.position, viewer.scene.sun], [[2, 0, 0], { azimuth: 20, elevation: 5 }]);
  assert.deepEqual(server.sent('camera').map(({ moving, camera: { position } }) => [moving, position[0]]), [[true, 1], [false, 2]]);
});

test('an undo in the middle of a drag shows the earlier view, at rest', () => {
  const { viewer, server, nextFrame } = connectedViewer();
  const navigation = new Navigation(viewer);
  navigation.orbit(30, 0);
  viewer.changeSettings({ sun: { azimuth: 10 } }, true);
  nextFrame();
  assert.ok(viewer.isMoving && navigation.isActive);
  viewer.showLink({});
  nextFrame();
  const [last] = server.sent('camera').slice(-1);
  assert.deepEqual([viewer.camera, viewer.isMoving, navigation.isActive], [CAMERA, false, false]);
  assert.deepEqual([last.camera, last.moving], [CAMERA, false]);
  assert.deepEqual(server.sent('set').at(-1).scene, { sun: null });
});

test('a connection that is lost in the middle of a drag ends at rest', () => {
  const { viewer, server, nextFrame } = connectedViewer();
  viewer.setCamera(camera(1), true);
  nextFrame();
  server.close();
  viewer.setCamera(camera(2), true);
  nextFrame();
  server.welcome();
  assert.deepEqual([viewer.camera.position, viewer.isMoving], [[2, 0, 0], true]);
  viewer.setCamera(camera(3), false);
  nextFrame();
  assert.deepEqual(server.sent('camera').map(({ moving, camera: { position } }) => [moving, position[0]]), [[false, 3]]);
});

const HOUR_MS = 3_600_000;

test('changes are sent and timed on a clock that jumps', () => {
  for (const jump_ms of [-HOUR_MS, 5 * HOUR_MS]) {
    const { viewer, server, nextFrame, wait, timers } = connectedViewer();
    let isLost = false;
    viewer.connectionChanged.listen(() => { isLost = true; });
    viewer.setCamera(camera(1), true);
    nextFrame();
    timers.clock_offset_ms += jump_ms;
    viewer.setCamera(camera(2), false);
    nextFrame(jump_ms);
    assert.equal(server.sent('camera').at(-1).camera.position[0], 2);
    viewer.acknowledge({ frame: 1, seq: 1, scene: 1, finished: false });
    viewer.acknowledge({ frame: 2, seq: 2, scene: 1, finished: true });
    assert.ok(viewer.latencies_ms.every((latency) => 0 <= latency), `${viewer.latencies_ms}`);
    // The connection is asked as before, and answers.
    for (let i = 0; i < 3; i++) {
      wait(10_000);
      server.send({ type: 'pong' });
    }
    assert.deepEqual([isLost, server.sent('ping').length, viewer.isSynced], [false, 3, true]);
  }
});

test('a machine that slept reads the answers that wait before it gives a connection up', () => {
  const { viewer, server, wait, timers } = connectedViewer();
  const losses = [];
  viewer.connectionChanged.listen(({ isConnected }) => losses.push(isConnected));
  wait(10_000);
  assert.equal(server.sent('ping').length, 1);
  timers.sleep(8 * HOUR_MS);
  server.send({ type: 'pong' });
  assert.deepEqual(losses, []);
  wait(15_000);
  server.send({ type: 'pong' });
  assert.deepEqual(losses, []);
  // A connection that ended meanwhile is given up as soon as after any other silence.
  wait(10_000);
  timers.sleep(8 * HOUR_MS);
  wait(19_000);
  assert.deepEqual(losses, []);
  wait(1_000);
  assert.deepEqual(losses, [false]);
  wait(1_000);
  server.welcome();
  assert.deepEqual(losses, [false, true]);
});

test('a machine that sleeps while it connects tries again', () => {
  const { viewer, server, wait, timers } = connectedViewer();
  let nAttempts = 0;
  viewer.connectionChanged.listen(({ isConnected }) => { nAttempts += isConnected ? 0 : 1; });
  server.close();
  timers.sleep(8 * HOUR_MS);
  wait(21_000);
  assert.equal(nAttempts, 2);
  server.welcome();
  assert.ok(viewer.isConnected);
});
