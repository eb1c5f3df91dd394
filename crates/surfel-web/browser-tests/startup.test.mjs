// Startup: the first picture arrives, follows the mouse, and is finished when the view is at rest.

import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import {
  blankPage, closePage, colorCount, drag, finishedPixels, openPage, pixels, pixelAt, QUICK, serve, settled, show, state, recordPictures,
} from './harness.mjs';

const PNG = 2;
let server;
let page;
before(async () => {
  server = await serve(['town.ply'], ...QUICK);
  page = await openPage(server.link);
});
after(() => closePage(page));

test('a first picture arrives and is not blank', async () => {
  const fresh = await blankPage();
  await fresh.goto(server.link);
  await fresh.waitForFunction(() => window.surfel?.state.lastFrame);
  assert.ok(await colorCount(fresh) > 100);
  assert.equal(await fresh.title(), 'town.ply – surfel');
  await closePage(fresh);
});

test('the page loads with few requests to its server alone, and keeps to its content security policy', async () => {
  const fresh = await blankPage();
  const requests = [];
  fresh.on('request', (request) => requests.push(request.url()));
  fresh.on('websocket', (socket) => requests.push(socket.url()));
  await fresh.goto(server.link);
  await settled(fresh);
  assert.ok(requests.length <= 10, `${requests}`);
  assert.deepEqual(new Set(requests.map((address) => new URL(address).host)), new Set([new URL(server.link).host]));
  // Violations of the policy are errors on the console.
  assert.deepEqual(fresh.faults, []);
  const violated = await fresh.evaluate(() => new Promise((resolve) => {
    document.addEventListener('securitypolicyviolation', ({ effectiveDirective }) => resolve(effectiveDirective), { once: true });
    const script = document.createElement('script');
    script.textContent = 'window.isInjected = true';
    document.body.append(script);
  }));
  assert.equal(violated, 'script-src-elem');
  assert.equal(await fresh.evaluate(() => window.isInjected), undefined);
  await fresh.context().close();
});

test('the finished picture is lossless and has the size of the screen', async () => {
  const { kind, finished, width, height, samples, of_samples } = await state(page, 'lastFrame');
  assert.deepEqual({ kind, finished, samples }, { kind: PNG, finished: true, samples: of_samples });
  const viewport = await page.locator('#viewport').boundingBox();
  assert.deepEqual({ width, height }, { width: viewport.width, height: viewport.height });
  assert.equal(await page.locator('#work-text').textContent(), 'finished');
});

test('pictures arrive while the mouse is dragged', async () => {
  const [first, start] = [await finishedPixels(page), await state(page, 'lastFrame')];
  const pixel = await pixelAt(page, 0.5, 0.5);
  await recordPictures(page);
  await page.mouse.move(pixel.x, pixel.y);
  await page.mouse.down();
  await page.mouse.move(pixel.x + 60, pixel.y + 10, { steps: 4 });
  await page.waitForFunction((seq) => seq < window.surfel.state.lastFrame.seq, start.seq);
  assert.notEqual(await pixels(page), first);
  const pictures = await page.evaluate(() => window.pictures);
  assert.equal(pictures.find(({ seq }) => start.seq < seq).finished, false);
  await page.mouse.up();
  await settled(page);
  assert.ok((await state(page, 'latencies_ms')).length > 0);
});

test('a drag back returns to the same view', async () => {
  const [camera, first] = [await state(page, 'camera'), await finishedPixels(page)];
  const [from, to] = [await pixelAt(page, 0.5, 0.5), await pixelAt(page, 0.6, 0.55)];
  await drag(page, from, to);
  assert.notEqual(await finishedPixels(page), first);
  await drag(page, to, from);
  const back = await state(page, 'camera');
  const distance = Math.hypot(...camera.position.map((value, i) => value - back.position[i]));
  assert.ok(distance < 1e-6, `${distance}`);
});

test('the same view is the same picture', async () => {
  const before = page.url();
  await drag(page, await pixelAt(page, 0.5, 0.5), await pixelAt(page, 0.55, 0.52));
  await page.waitForFunction((old) => location.href !== old, before);
  const open = async (address) => {
    await page.goto('about:blank');
    await page.goto(address);
    return { picture: await finishedPixels(page), camera: await state(page, 'camera') };
  };
  // The address has fewer digits than the camera that was dragged, so the first picture comes from it, too.
  const address = page.url();
  const seen = await open(address);
  await drag(page, await pixelAt(page, 0.5, 0.5), await pixelAt(page, 0.4, 0.55));
  assert.notEqual(await finishedPixels(page), seen.picture);
  assert.deepEqual(await open(address), seen);
});

test('the picture has the size of a resized window', async () => {
  const [first, before] = [await finishedPixels(page), await state(page, 'size')];
  await page.setViewportSize({ width: 700, height: 400 });
  await page.waitForFunction((height) => window.surfel.state.size.height < height, before.height);
  assert.notEqual(await finishedPixels(page), first);
});

test('a picture at rest goes on to more samples if nobody chose their number', async () => {
  const resting = await serve(['town.ply'], '--light-samples', '1', '--exposure', '0');
  const other = await openPage(resting.link, { viewport: { width: 500, height: 300 } });
  await other.locator('#numbers', { hasText: ' 64 samples' }).waitFor();
  const best = await pixels(other);
  assert.equal((await state(other, 'lastFrame')).finished, true);
  await show(other, { spp: 64, light_samples: 16 });
  assert.equal((await state(other, 'lastFrame')).samples, 64);
  assert.equal(await pixels(other), best);
  await closePage(other);
});
