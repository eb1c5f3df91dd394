// The viewer's messages to the server, and what it makes of the answers.

import assert from 'node:assert/strict';
import { test } from 'node:test';
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
