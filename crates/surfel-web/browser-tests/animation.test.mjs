// Scenes that move: the clock is scrubbed, played and looped.

import assert from 'node:assert/strict';
import { after, before, beforeEach, test } from 'node:test';
import { closePage, drag, finishedPixels, openPage, placeAt, QUICK, serve, settled, state, unfoldPanel } from './harness.mjs';

const SECONDS = 2;
let page;
let first;
before(async () => {
  page = await openPage((await serve(['moving.toml'], ...QUICK)).link);
  first = await finishedPixels(page);
});
beforeEach(async () => {
  await page.reload();
  await settled(page);
});
after(() => closePage(page));

const time = async () => (await state(page, 'scene')).time;
const scrub = (share, of = page) => of.locator('[data-key="time"]').fill(String(1000 * share));
const reaches = (least) => page.waitForFunction((wanted) => wanted <= window.surfel.state.scene.time, least);

test('the clock is moved by hand, and back', async () => {
  assert.equal((await state(page, 'info')).duration_secs, SECONDS);
  await scrub(0.5);
  assert.notEqual(await finishedPixels(page), first);
  assert.equal(await time(), SECONDS / 2);
  assert.equal(await page.locator('[data-output="time"]').textContent(), '1.00 s');
  await scrub(0);
  assert.equal(await finishedPixels(page), first);
});

test('a movement is played and paused', async () => {
  const button = page.locator('[data-action="play"]');
  const { frame } = await state(page, 'lastFrame');
  await button.click();
  await reaches(0.3);
  await page.waitForFunction((before) => before + 2 < window.surfel.state.lastFrame.frame, frame);
  await button.click();
  assert.notEqual(await finishedPixels(page), first);
  const stopped = await time();
  await page.waitForTimeout(200);
  assert.equal(await time(), stopped);
});

test('it begins again, or ends, as it is told', async () => {
  await scrub(0.9);
  await page.locator('[data-action="play"]').click();
  await page.waitForFunction(() => window.surfel.state.scene.time < 1.5);
  await page.locator('[data-key="animation.loop"]').setChecked(false);
  await reaches(SECONDS);
  await settled(page);
  assert.equal(await time(), SECONDS);
  assert.equal(await page.locator('[data-action="play"]').textContent(), 'Play');
});

test('a camera that the scene moves is followed until it is moved by hand, and again', async () => {
  const led = await openPage((await serve(['orbit.toml'], ...QUICK)).link);
  await unfoldPanel(led);
  const lead = led.locator('[data-key="camera.still"]');
  const seen = async (share) => {
    await scrub(share, led);
    return { pixels: await finishedPixels(led), ...(await state(led, 'camera')) };
  };
  const [start, quarter] = [await seen(0), await seen(0.25)];
  assert.notEqual(quarter.pixels, start.pixels);
  const across = (camera) => camera.position.map((x, i) => x - camera.focal_point[i]).slice(0, 2);
  const [[x, y], [turnedX, turnedY]] = [across(start), across(quarter)];
  assert.ok(Math.hypot(turnedX + y, turnedY - x) < 1e-6 * Math.hypot(x, y), 'a quarter of a turn');
  assert.ok(await lead.isChecked());

  await drag(led, await placeAt(led, 0.3, 0.5), await placeAt(led, 0.5, 0.5));
  await settled(led);
  const { position } = await state(led, 'camera');
  assert.notDeepEqual(position, quarter.position);
  assert.ok(!(await lead.isChecked()));
  assert.deepEqual((await seen(0.5)).position, position);

  await lead.setChecked(true);
  await led.waitForFunction(() => !window.surfel.state.camera.still);
  assert.deepEqual(await seen(0.25), quarter);
  await closePage(led);
});
