// Measurements of the viewer in Chromium, which print their figures: a drag, and pages beside a long render.
//
// They are quick, and of a small cloud, unless CLOUD names a file and SECONDS the duration of a drag.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { encodeHash } from '../page/link.js';
import { blankPage, closePage, openPage, pixelAt, QUICK, serve, settled, state, TIMEOUT_MS } from './harness.mjs';

const { CLOUD, SECONDS = '1' } = process.env;
const SCENE = CLOUD ? [CLOUD, '--surface', 'splat'] : ['town.ply', ...QUICK];
/** Windows whose pictures have 1128x872 and 1288x772 pixels. */
const WINDOWS = [{ width: 1440, height: 900 }, { width: 1600, height: 800 }];
const RENDER = CLOUD ? 'resolution=4000x4000&spp=512' : 'resolution=1000x1000&spp=512';

/** The value below which this fraction of the numbers lies. */
function quantile(numbers, fraction) {
  const sorted = [...numbers].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(fraction * sorted.length))];
}

/** Records the pictures shown from now on in `window.shown`, with the time since the oldest input that each obeys first. */
const recordInputs = (page) => page.evaluate(() => {
  window.shown = [];
  const inputs = new Map();
  // Runs after the frame's message was sent, which has all inputs since the one before.
  window.addEventListener('pointermove', ({ timeStamp }) => requestAnimationFrame(() => {
    const { lastSeq } = window.surfel.state;
    if (!inputs.has(lastSeq)) inputs.set(lastSeq, timeStamp);
  }));
  const watch = new MutationObserver(() => {
    const { seq, shownAt, width, height } = window.surfel.state.lastFrame;
    window.shown.push({ width, height, latency_ms: shownAt - inputs.get(seq) });
    for (const known of [...inputs.keys()]) if (known <= seq) inputs.delete(known);
  });
  watch.observe(document.getElementById('numbers'), { childList: true });
});

/** Number of pictures that obey inputs since the drag began. */
const countAnswers = (page) => page.evaluate(() => window.shown.filter((one) => Number.isFinite(one.latency_ms)).length);

/**
 * Drags in circles for `secs`, and until two pictures have obeyed it; returns the pictures shown meanwhile, and the time
 * from release to the finished picture.
 */
async function dragInCircles(page, secs) {
  const start = await pixelAt(page, 0.5, 0.5);
  await page.mouse.move(start.x, start.y);
  await page.mouse.down();
  await recordInputs(page);
  const begin = performance.now();
  const isLonger = async (ms) => ms < 1000 * secs || (ms < TIMEOUT_MS && (await countAnswers(page)) < 2);
  for (let ms = 0; await isLonger(ms); ms = performance.now() - begin) {
    const angle = ms / 500;
    await page.mouse.move(start.x + 120 * Math.sin(angle), start.y + 40 * (1 - Math.cos(angle)));
  }
  const shown = await page.evaluate(() => window.shown);
  const elapsed_secs = (performance.now() - begin) / 1000;
  await page.mouse.up();
  const released = performance.now();
  await settled(page);
  return { shown, elapsed_secs, finished_secs: (performance.now() - released) / 1000 };
}

for (const viewport of WINDOWS) {
  test(`drag in a window of ${viewport.width}x${viewport.height}`, async () => {
    const server = await serve(SCENE);
    const page = await openPage(server.link, { viewport });
    const { shown, elapsed_secs, finished_secs } = await dragInCircles(page, Number(SECONDS));
    const latencies = shown.map(({ latency_ms }) => latency_ms).filter(Number.isFinite);
    const messages = await state(page, 'latencies_ms');
    const size = await state(page, 'size');
    const widths = shown.map(({ width }) => width);
    assert.ok(1 < shown.length && 0 < latencies.length);
    assert.ok(latencies.every((latency) => 0 < latency));
    console.log(`picture ${size.width}x${size.height}, drafts ${quantile(widths, 0.05)} to ${quantile(widths, 0.95)} wide
pictures a second: ${(shown.length / elapsed_secs).toFixed(1)}
from input to picture: median ${quantile(latencies, 0.5).toFixed(0)} ms, 95 % within ${quantile(latencies, 0.95).toFixed(0)} ms
from message to picture: median ${quantile(messages, 0.5).toFixed(0)} ms, 95 % within ${quantile(messages, 0.95).toFixed(0)} ms
from release to the finished picture: ${finished_secs.toFixed(1)} s`);
    await closePage(page);
    await server.stop();
  });
}

/** Waits for a picture that obeys the last message; returns the time since `start` in seconds. */
async function secsToPicture(page, start) {
  await page.waitForFunction(() => {
    const { connected, synced, lastFrame, lastSeq } = window.surfel?.state ?? {};
    return connected && synced && lastFrame?.seq === lastSeq;
  });
  return (performance.now() - start) / 1000;
}

const CHANGES = { 'sun azimuth': { sun: { azimuth: 100 } }, colour: { color: 'elevation' }, normals: { normals_k: 20 } };

test('a second page and changes of settings while a large picture is rendered', async () => {
  const server = await serve(SCENE);
  const first = await openPage(server.link);
  const abort = new AbortController();
  const render = fetch(new URL(`/render?${RENDER}`, server.link), { signal: abort.signal }).then(() => 'done', () => 'aborted');
  const page = await blankPage();
  const start = performance.now();
  await page.goto(server.link);
  console.log(`first picture of a second page: ${(await secsToPicture(page, start)).toFixed(2)} s`);
  await settled(page);
  for (const [name, patch] of Object.entries(CHANGES)) {
    const changed = performance.now();
    await page.evaluate((hash) => new Promise((resolve) => {
      window.addEventListener('hashchange', () => setTimeout(resolve), { once: true });
      location.hash = hash;
    }), encodeHash(patch));
    console.log(`change of ${name}: ${(await secsToPicture(page, changed)).toFixed(2)} s`);
    await settled(page);
  }
  abort.abort();
  assert.equal(await render, 'aborted');
  await settled(first);
  await closePage(page);
  await closePage(first);
  await server.stop();
});
