// The card of a height profile shows and exports no profile but its own.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { ProfileCard } from '../page/profile-card.js';
import { signal } from '../page/signal.js';
import { fakeDocument, settled } from './fake-dom.mjs';

const first = { kind: 'profile', name: 'profile 1', points: [[0, 0, 0], [10, 0, 0]], width: 1 };
const second = { ...first, name: 'profile 2', points: [[0, 5, 0], [20, 5, 0]] };
const profile = { distances: [1, 2], offsets: [0, 0], heights: [3, 4], positions: [[1, 0, 3], [2, 0, 4]], colors: [[1, 2, 3], [4, 5, 6]], n_found: 2 };

/** A card whose requests wait until `answers` are called. */
function openCard() {
  const document = fakeDocument();
  const answers = [];
  const request = () => new Promise((resolve) => { answers.push(() => resolve({ profile })); });
  const info = { up: [0, 0, 1], unit: 'm', name: 'a.laz' };
  const viewer = { info, isConnected: true, request, sceneChanged: signal() };
  const measureTool = { figures: [first, second], figuresShown: signal() };
  const card = new ProfileCard(viewer, { add() {}, redraw() {} }, measureTool);
  const buttons = () => document.getElementById('profile-card').all('button');
  const areEnabled = () => buttons().filter((button) => button.class === 'chip').map(({ disabled }) => !disabled);
  return { card, measureTool, answers, areEnabled };
}

test('another figure has no points and no files before its answer', async () => {
  const { card, answers, areEnabled } = openCard();
  card.open(first);
  assert.deepEqual(areEnabled(), [false, false]);
  answers[0]();
  await settled();
  assert.deepEqual(areEnabled(), [true, true]);
  assert.match(card.readout.textContent, /^2 points/);
  card.open(second);
  assert.deepEqual(areEnabled(), [false, false]);
  assert.deepEqual([card.readout.textContent, card.canvas.width], ['', 0]);
  card.canvas.emit('pointermove', { offsetX: 100, offsetY: 100 });
  answers[1]();
  await settled();
  assert.deepEqual(areEnabled(), [true, true]);
  assert.equal(card.canvas.width, 400);
});

test('a changed width waits for its own answer', async () => {
  const { card, measureTool, answers, areEnabled } = openCard();
  card.open(first);
  answers[0]();
  await settled();
  measureTool.figures = [{ ...first, width: 3 }];
  measureTool.figuresShown();
  assert.deepEqual(areEnabled(), [false, false]);
});

test('a width that is not positive is taken back with a reason', async () => {
  const { card, answers } = openCard();
  card.open(first);
  answers[0]();
  await settled();
  const [width] = card.card.all('input');
  [width.value, width.valueAsNumber] = ['-5', -5];
  width.emit('change');
  assert.equal(width.value, 1);
  assert.match(card.readout.textContent, /positive/);
});

test('a card that was closed is opened without the old chart', async () => {
  const { card, answers } = openCard();
  card.open(first);
  answers[0]();
  await settled();
  card.close();
  card.open(second);
  card.canvas.emit('pointermove', { offsetX: 100, offsetY: 100 });
  assert.equal(card.readout.textContent, '');
});
