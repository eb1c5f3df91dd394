// Requests for volumes: one at a time, and again after changes.

import assert from 'node:assert/strict';
import { mock, test } from 'node:test';
import { signal } from '../page/signal.js';
import { setUpVolumes } from '../page/volume.js';

const REST_MS = 600;
const settle = () => new Promise((resolve) => setImmediate(resolve));

/** A viewer and figures, with the requests that wait for an answer. */
function setUp(...names) {
  const waiting = [];
  const viewer = {
    isConnected: true, lastFrame: {}, info: { up: [0, 0, 1] }, frameShown: signal(), sceneChanged: signal(),
    request: () => new Promise((resolve, reject) => waiting.push({ resolve, reject })),
  };
  const tool = {
    figures: names.map((name) => ({ kind: 'volume', name })),
    figuresShown: signal(),
    complete(figure, completed) {
      tool.figures = tool.figures.map((other) => (other === figure ? completed : other));
      tool.figuresShown();
    },
  };
  setUpVolumes(viewer, tool);
  const answer = async (volume) => {
    waiting.shift().resolve({ volume });
    await settle();
  };
  return { viewer, tool, waiting, answer, volumes: () => tool.figures.map(({ volume }) => volume) };
}

test('volumes are requested one at a time', async () => {
  const { tool, waiting, answer, volumes } = setUp('a', 'b', 'c', 'd', 'e');
  tool.figuresShown();
  for (const volume of [1, 2, 3, 4, 5]) {
    assert.equal(waiting.length, 1);
    await answer(volume);
  }
  assert.equal(waiting.length, 0);
  assert.deepEqual(volumes(), [1, 2, 3, 4, 5]);
});

test('answers about an earlier scene are dropped and requested again, errors too', async () => {
  const { viewer, tool, waiting, answer, volumes } = setUp('a');
  mock.timers.enable({ apis: ['setTimeout'] });
  tool.figuresShown();
  viewer.sceneChanged();
  await answer(1);
  assert.deepEqual([volumes(), waiting.length], [[undefined], 1]);
  viewer.sceneChanged();
  waiting.shift().reject(new Error('no points'));
  await settle();
  assert.equal(waiting.length, 1);
  await answer(3);
  assert.deepEqual(volumes(), [3]);
  mock.timers.reset();
});

test('a volume that arrived before the new scene is replaced', async () => {
  const { viewer, tool, waiting, answer, volumes } = setUp('a');
  mock.timers.enable({ apis: ['setTimeout'] });
  tool.figuresShown();
  await answer(1);
  viewer.sceneChanged();
  mock.timers.tick(REST_MS);
  await answer(2);
  viewer.sceneChanged();
  mock.timers.tick(REST_MS);
  await answer(3);
  assert.deepEqual([volumes(), waiting.length], [[3], 0]);
  mock.timers.reset();
});

test('volumes follow a scene that arrives while they are computed', async () => {
  const { viewer, tool, waiting, answer, volumes } = setUp('a');
  mock.timers.enable({ apis: ['setTimeout'] });
  tool.figuresShown();
  await answer(1);
  viewer.sceneChanged();
  mock.timers.tick(REST_MS);
  assert.equal(waiting.length, 1);
  viewer.sceneChanged();
  await answer(2);
  assert.deepEqual(volumes(), [undefined]);
  await answer(3);
  assert.deepEqual(volumes(), [3]);
  mock.timers.tick(REST_MS);
  assert.deepEqual([volumes(), waiting.length], [[3], 0]);
  mock.timers.reset();
});
