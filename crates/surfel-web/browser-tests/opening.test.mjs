// The picture: it comes, moves with the hand, and is finished when all is still.

import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import {
  blankPage, closePage, colorCount, drag, finishedPixels, openPage, pixels, placeAt, QUICK, serve, settled, state, watchPictures,
} from './harness.mjs';

const PNG = 2;
let server;
let page;
before(async () => {
  server = await serve(['town.ply'], ...QUICK);
  page = await openPage(server.link);
});
after(() => closePage(page));

test('a first picture comes, and is not blank', async () => {
  const fresh = await blankPage();
  await fresh.goto(server.link);
  await fresh.waitForFunction(() => window.surfel?.state.lastFrame);
  assert.ok(await colorCount(fresh) > 100);
  assert.equal(await fresh.title(), 'town.ply – surfel');
  await closePage(fresh);
});

test('a still picture ends lossless, in the size of the screen', async () => {
  const { kind, finished, width, height, samples, of_samples } = await state(page, 'lastFrame');
  assert.deepEqual({ kind, finished, samples }, { kind: PNG, finished: true, samples: of_samples });
  const stage = await page.locator('#stage').boundingBox();
  assert.deepEqual({ width, height }, { width: stage.width, height: stage.height });
  assert.equal(await page.locator('#work-text').textContent(), 'finished');
});

test('pictures come while the hand is still moving', async () => {
  const [first, begin] = [await finishedPixels(page), await state(page, 'lastFrame')];
  const place = await placeAt(page, 0.5, 0.5);
  await watchPictures(page);
  await page.mouse.move(place.x, place.y);
  await page.mouse.down();
  await page.mouse.move(place.x + 60, place.y + 10, { steps: 4 });
  await page.waitForFunction((input) => input < window.surfel.state.lastFrame.input, begin.input);
  assert.notEqual(await pixels(page), first);
  const pictures = await page.evaluate(() => window.pictures);
  assert.equal(pictures.find(({ input }) => begin.input < input).finished, false);
  await page.mouse.up();
  await settled(page);
  assert.ok((await state(page, 'latencies_ms')).length > 0);
});

test('the same view is the same picture', async () => {
  const [camera, first] = [await state(page, 'camera'), await finishedPixels(page)];
  const [from, to] = [await placeAt(page, 0.5, 0.5), await placeAt(page, 0.6, 0.55)];
  await drag(page, from, to);
  assert.notEqual(await finishedPixels(page), first);
  await drag(page, to, from);
  const back = await state(page, 'camera');
  const distance = Math.hypot(...camera.position.map((value, i) => value - back.position[i]));
  assert.ok(distance < 1e-6, `${distance}`);
});

test('another size of the window is another size of the picture', async () => {
  const [first, before] = [await finishedPixels(page), await state(page, 'size')];
  await page.setViewportSize({ width: 700, height: 400 });
  await page.waitForFunction((height) => window.surfel.state.size.height < height, before.height);
  assert.notEqual(await finishedPixels(page), first);
});
