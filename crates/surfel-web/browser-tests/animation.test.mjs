// Animated scenes: scrubbing, playing, looping, and the camera that an animation moves.

import assert from 'node:assert/strict';
import { after, before, beforeEach, test } from 'node:test';
import { closePage, drag, finishedPixels, openPage, pixelAt, QUICK, reopen, serve, settled, state, unfoldPanel } from './harness.mjs';

const DURATION_SECS = 2;
let page;
let first;
before(async () => {
  page = await openPage((await serve(['moving.toml'], ...QUICK)).link);
  first = await finishedPixels(page);
});
beforeEach(async () => {
  await reopen(page);
});
after(() => closePage(page));

const time = async () => (await state(page, 'scene')).time;
const scrub = (fraction, target = page) => target.locator('[data-key="time"]').fill(String(1000 * fraction));
const waitForTime = (time_secs) => page.waitForFunction((min) => min <= window.surfel.state.scene.time, time_secs);

/** Waits for this many animation frames of the page. */
const waitForFrames = (count) => page.evaluate((n) => new Promise((resolve) => {
  const step = () => (0 < n-- ? requestAnimationFrame(step) : resolve());
  step();
}), count);

test('the time slider shows the scene at its time', async () => {
  assert.equal((await state(page, 'info')).duration_secs, DURATION_SECS);
  await scrub(0.5);
  assert.notEqual(await finishedPixels(page), first);
  assert.equal(await time(), DURATION_SECS / 2);
  assert.equal(await page.locator('[data-output="time"]').textContent(), '1.00 s');
  await scrub(0);
  assert.equal(await finishedPixels(page), first);
});

test('the animation plays and pauses', async () => {
  const button = page.locator('[data-action="play"]');
  const { frame } = await state(page, 'lastFrame');
  await button.click();
  await waitForTime(0.3);
  await page.waitForFunction((before) => before + 2 < window.surfel.state.lastFrame.frame, frame);
  await button.click();
  assert.notEqual(await finishedPixels(page), first);
  const stopped = await time();
  await waitForFrames(10);
  assert.equal(await time(), stopped);
});

test('the animation loops, or stops at its end', async () => {
  await scrub(0.9);
  await page.locator('[data-action="play"]').click();
  await page.waitForFunction(() => window.surfel.state.scene.time < 1.5);
  await page.locator('[data-key="animation.loop"]').setChecked(false);
  await waitForTime(DURATION_SECS);
  await settled(page);
  assert.equal(await time(), DURATION_SECS);
  assert.equal(await page.locator('[data-action="play"]').textContent(), 'Play');
});

test('the animation moves the camera until the user does, and again on request', async () => {
  const orbiting = await openPage((await serve(['orbit.toml'], ...QUICK)).link);
  await unfoldPanel(orbiting);
  const follow = orbiting.locator('[data-key="camera.lock"]');
  const viewAt = async (fraction) => {
    await scrub(fraction, orbiting);
    return { pixels: await finishedPixels(orbiting), ...(await state(orbiting, 'camera')) };
  };
  const [start, quarter] = [await viewAt(0), await viewAt(0.25)];
  assert.notEqual(quarter.pixels, start.pixels);
  const horizontalOffset = (camera) => camera.position.map((x, i) => x - camera.focal_point[i]).slice(0, 2);
  const [[x, y], [rotatedX, rotatedY]] = [horizontalOffset(start), horizontalOffset(quarter)];
  assert.ok(Math.hypot(rotatedX + y, rotatedY - x) < 1e-6 * Math.hypot(x, y), 'a quarter of a turn');
  assert.ok(await follow.isChecked());

  await drag(orbiting, await pixelAt(orbiting, 0.3, 0.5), await pixelAt(orbiting, 0.5, 0.5));
  await settled(orbiting);
  const { position } = await state(orbiting, 'camera');
  assert.notDeepEqual(position, quarter.position);
  assert.ok(!(await follow.isChecked()));
  assert.deepEqual((await viewAt(0.5)).position, position);

  await follow.setChecked(true);
  await orbiting.waitForFunction(() => !window.surfel.state.camera.lock);
  assert.deepEqual(await viewAt(0.25), quarter);
  await closePage(orbiting);
});
