// The path of the camera: views at times, played, exported as a movie that the command line makes alike.

import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, beforeEach, test } from 'node:test';
import { closePage, data, openPage, QUICK, recorded, reopen, serve, settled, shell, state, unfoldPanel } from './harness.mjs';

let page;
before(async () => {
  page = await openPage((await serve(['town.ply', 'house.obj'], ...QUICK)).link, { viewport: { width: 900, height: 600 } });
});
beforeEach(async () => {
  await reopen(page);
  await unfoldPanel(page);
  await page.locator('[data-action="camera-path"]').click();
  await page.locator('#path-card').waitFor();
});
after(() => closePage(page));

const path = async () => (await state(page, 'scene')).camera_path;
const times = () => page.locator('[data-path-time]').evaluateAll((fields) => fields.map(({ value }) => Number(value)));

async function addViews(...sides) {
  for (const side of sides) {
    await page.locator(`[data-side="${side}"]`).click();
    await settled(page);
    await page.locator('[data-action="add-key"]').click();
    await settled(page);
  }
}

/** Sets size and rate of the movie. */
async function setMovie(values) {
  for (const [key, value] of Object.entries(values)) {
    const field = page.locator(`[data-movie="${key}"]`);
    if (key === 'format') await field.selectOption(value);
    else await field.fill(String(value));
  }
}

test('views are added, moved in time, replaced, deleted, and these changes undone', async () => {
  await addViews('front', 'right', 'top');
  assert.deepEqual(await times(), [0, 3, 6]);
  await page.locator('[data-path-time="2"]').fill('1.5');
  await page.locator('[data-path-time="2"]').press('Enter');
  await settled(page);
  assert.deepEqual((await path()).times, [0, 1.5, 3]);
  // What follows before this state is recorded would be undone with it.
  await recorded(page, ({ camera_path }) => camera_path?.times[1] === 1.5);
  const { position } = await path();
  await page.locator('[aria-label="Set view 1 to the current view"]').click();
  await settled(page);
  assert.deepEqual((await path()).position, [position[1], position[1], position[2]]);
  await page.locator('[aria-label="Delete view 2"]').click();
  await settled(page);
  assert.deepEqual(await times(), [0, 3]);
  await page.locator('[data-action="undo"]').click();
  await settled(page);
  assert.deepEqual(await times(), [0, 1.5, 3]);
  await page.locator('[aria-label="Go to view 3"]').click();
  await settled(page);
  assert.deepEqual((await state(page, 'camera')).position.map(Math.fround), position[2].map(Math.fround));
});

test('all views have one projection', async () => {
  await addViews('front');
  await page.locator('[data-action="projection"]').click();
  await settled(page);
  await page.locator('[data-action="add-key"]').click();
  await page.locator('.toast', { hasText: 'one projection' }).waitFor();
  assert.deepEqual(await times(), [0]);
});

test('the path is played, and stopped by hand', async () => {
  await addViews('front', 'right');
  await page.locator('[data-path-time="1"]').fill('4');
  await page.locator('[data-path-time="1"]').press('Enter');
  await settled(page);
  const { position } = await path();
  await page.evaluate(() => {
    window.cameras = [];
    const record = () => {
      window.cameras.push(window.surfel.state.camera.position);
      window.recording = requestAnimationFrame(record);
    };
    record();
  });
  await page.locator('[data-action="play-path"]').click();
  await page.locator('[data-action="play-path"]', { hasText: 'Stop' }).waitFor();
  await page.locator('[data-action="play-path"]', { hasText: 'Play' }).waitFor();
  await settled(page);
  const cameras = await page.evaluate(() => {
    cancelAnimationFrame(window.recording);
    return window.cameras;
  });
  assert.deepEqual(cameras.at(-1), position[1]);
  const distances = cameras.map((camera) => Math.hypot(...camera.map((value, axis) => value - position[1][axis])));
  const played = distances.slice(distances.lastIndexOf(Math.max(...distances)));
  assert.ok(played.some((distance) => 0 < distance && distance < played[0]), 'there are cameras between the views');
  assert.ok(played.every((distance, i) => i === 0 || distance <= played[i - 1]), 'the camera comes nearer');
  await page.locator('[data-path-time="1"]').fill('60');
  await page.locator('[data-path-time="1"]').press('Enter');
  await page.locator('[data-action="play-path"]').click();
  await page.locator('[data-action="play-path"]', { hasText: 'Stop' }).click();
  await page.locator('[data-action="play-path"]', { hasText: 'Play' }).waitFor();
  await settled(page);
});

test('the movie is that of the command line, byte for byte', async () => {
  await addViews('front', 'right', 'top');
  await setMovie({ format: 'png', width: 96, height: 64, fps: 2 });
  await page.locator('[data-action="movie"]').click();
  const link = page.locator('[data-action="download-movie"]');
  await link.waitFor();
  assert.match(await page.locator('.movie .note[role]').textContent(), /^12 frames/);
  const [movie] = await Promise.all([page.waitForEvent('download'), link.click()]);
  assert.equal(movie.suggestedFilename(), 'town-movie.png');
  const [file] = await Promise.all([page.waitForEvent('download'), page.locator('[data-action="movie-scene-file"]').click()]);
  writeFileSync(join(data.folder, 'movie.toml'), readFileSync(await file.path()));
  shell('surfel animate movie.toml -o movie.png --fps 2 -q');
  assert.deepEqual(readFileSync(await movie.path()), readFileSync(join(data.folder, 'movie.png')));
});

test('links and scene files carry the path, and pictures do not follow it', async () => {
  await addViews('front', 'right');
  await page.locator('[data-action="export"]').click();
  await page.waitForFunction(() => document.getElementById('export-text').value.startsWith('surfel'));
  await page.locator('[data-format="toml"]').click();
  const toml = await page.locator('#export-text').inputValue();
  assert.match(toml, /\[\[animation\]\]/);
  await page.locator('[data-format="link"]').click();
  const link = await page.locator('#export-text').inputValue();
  await page.locator('#export-close').click();
  const camera = await state(page, 'camera');
  const saved = await path();
  const other = await openPage(link);
  assert.deepEqual((await state(other, 'scene')).camera_path.times, saved.times);
  assert.deepEqual((await state(other, 'camera')).position.map(Math.fround), camera.position.map(Math.fround));
  await closePage(other);
  await reopen(page);
  await page.locator('#scene-file').setInputFiles({ name: 'path.toml', mimeType: 'text/plain', buffer: Buffer.from(toml) });
  await page.waitForFunction(() => window.surfel.state.scene.camera_path?.times.length === 2);
  await settled(page);
  assert.deepEqual((await state(page, 'camera')).position.map(Math.fround), camera.position.map(Math.fround));
});

test('a movie is cancelled, and wrong ones are refused', async () => {
  assert.ok(await page.locator('[data-action="movie"]').isDisabled());
  await addViews('front', 'right');
  await setMovie({ format: 'gif', width: 800, height: 600, fps: 25 });
  await page.locator('[data-action="movie"]').click();
  await page.locator('[data-action="cancel-movie"]').click();
  await page.locator('.movie .note', { hasText: 'Cancelled.' }).waitFor();
  await setMovie({ width: 800.5 });
  await page.locator('[data-action="movie"]').click();
  await page.locator('[data-movie="width"]:invalid:focus').waitFor();
  assert.ok(await page.locator('[data-action="cancel-movie"]').isHidden());
  await setMovie({ width: 32000, height: 32000 });
  await page.locator('[data-action="movie"]').click();
  await page.locator('.movie .note', { hasText: 'expected' }).waitFor();
});
