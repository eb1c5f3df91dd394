// Connections: reconnecting, several pages at once, and access control.

import assert from 'node:assert/strict';
import { after, test } from 'node:test';
import { decodeHash, encodeHash } from '../page/link.js';
import {
  blankPage, closePage, drag, finishedPixels, openPage, pixels, pixelAt, PLAIN_HOST, QUICK, serve, settled, show, state,
} from './harness.mjs';

const open = [];
after(() => Promise.all(open.map((page) => page.context().close())));

/** The token in the link that a server has printed. */
const tokenOf = (server) => new URL(server.link).searchParams.get('token');

async function openTracked(link) {
  const page = await openPage(link);
  open.push(page);
  return page;
}

test('a page reconnects and keeps its view', async () => {
  const server = await serve(['town.ply'], ...QUICK);
  const page = await openTracked(server.link);
  await show(page, { color: 'elevation', range: [147, 152], sun: { azimuth: 100 } });
  await drag(page, await pixelAt(page, 0.5, 0.5), await pixelAt(page, 0.6, 0.5));
  const [screen, camera] = [await finishedPixels(page), await state(page, 'camera')];
  await server.stop();
  await page.locator('#banner', { hasText: 'no connection' }).waitFor();
  await page.locator('#toolbar [data-tool=pick]').click();
  const { x, y } = await pixelAt(page, 0.5, 0.6);
  await page.mouse.click(x, y);
  await page.locator('.toast', { hasText: 'there is no connection' }).waitFor();
  await page.locator('#toolbar [data-tool=pick]').click();
  // Changes made while there is no connection are kept, and so are those before.
  await page.locator('#viewport').focus();
  await page.keyboard.press('5');
  const rotated = await state(page, 'camera');
  assert.notDeepEqual(rotated, camera);
  await serve(['town.ply'], '--port', server.port, ...QUICK);
  await page.locator('#banner').waitFor({ state: 'hidden' });
  assert.notEqual(await finishedPixels(page), screen, 'the change made meanwhile is shown');
  await page.keyboard.press('o');
  await settled(page);
  const { color, range, sun } = await state(page, 'scene');
  assert.deepEqual([color, range, sun.azimuth], ['elevation', [147, 152], 100]);
  const found = await state(page, 'camera');
  assert.deepEqual(found.view_up.map((value) => Math.round(value * 1e6) / 1e6), rotated.view_up.map((value) => Math.round(value * 1e6) / 1e6));
  await page.keyboard.press('p');
  await show(page, {});
  assert.notEqual(await finishedPixels(page), screen);
});

test('a link of a megabyte, a broken one and one that is nested too deep open the initial view, with the reason', async () => {
  const server = await serve(['town.ply'], ...QUICK);
  for (const [hash, reason] of [
    [encodeHash({ caption: 'x'.repeat(750_000) }), /too long/], [encodeHash({ color: 'elevation' }).slice(0, -3), /broken or incomplete/],
    [`#view=${btoa(`${'{"a":'.repeat(150)}1${'}'.repeat(150)}`)}`, /broken or incomplete/],
  ]) {
    const page = await blankPage();
    open.push(page);
    await page.goto(server.link + hash);
    await page.locator('.toast', { hasText: reason }).waitFor();
    await settled(page);
    assert.equal((await state(page, 'scene')).caption, undefined);
    await show(page, {});
    await page.evaluate((to) => { location.hash = to; }, encodeHash({ caption: 'y'.repeat(300_000) }));
    await page.locator('.toast', { hasText: 'These settings are too long' }).waitFor();
    await settled(page);
    assert.ok(await page.locator('#banner').isHidden());
  }
});

test('a page without changes shows the same picture after reconnecting', async () => {
  const server = await serve(['town.ply'], ...QUICK);
  const page = await openTracked(server.link);
  await show(page, { color: 'class', surface: 'sphere' });
  await drag(page, await pixelAt(page, 0.5, 0.5), await pixelAt(page, 0.7, 0.4));
  const screen = await finishedPixels(page);
  const { shownAt } = await state(page, 'lastFrame');
  await server.stop();
  await page.locator('#banner', { hasText: 'no connection' }).waitFor();
  await serve(['town.ply'], '--port', server.port, ...QUICK);
  await page.waitForFunction((before) => {
    const { lastFrame, connected } = window.surfel.state;
    return connected && lastFrame?.finished && before < lastFrame.shownAt;
  }, shownAt);
  assert.equal(await pixels(page), screen);
});

test('a server that is started again with other data shows their initial view', async () => {
  const server = await serve(['moving.toml'], ...QUICK);
  const page = await openTracked(server.link);
  await drag(page, await pixelAt(page, 0.5, 0.5), await pixelAt(page, 0.6, 0.5));
  await page.locator('[data-action="play"]').click();
  await page.waitForFunction(() => 0.1 < window.surfel.state.scene.time);
  await server.stop();
  await page.locator('#banner', { hasText: 'no connection' }).waitFor();
  await serve(['town.ply'], '--port', server.port, ...QUICK);
  await page.waitForFunction(() => window.surfel.state.connected && window.surfel.state.lastFrame?.finished);
  const fresh = await openTracked(server.link);
  assert.deepEqual(await state(page, 'camera'), await state(fresh, 'camera'));
  assert.deepEqual(await state(page, 'scene'), await state(fresh, 'scene'));
  assert.equal(await pixels(page), await pixels(fresh));
});

test('two pages have views of their own, and one survives the other', async () => {
  const server = await serve(['town.ply'], ...QUICK);
  const [one, other] = [await openTracked(server.link), await openTracked(server.link)];
  const screen = await finishedPixels(one);
  await other.keyboard.press('5');
  await show(other, { color: 'class' });
  assert.notEqual(await finishedPixels(other), screen);
  assert.equal(await finishedPixels(one), screen);
  const { clients } = await (await fetch(new URL('/stats', server.link))).json();
  assert.equal(clients, 2);
  await closePage(other);
  await drag(one, await pixelAt(one, 0.5, 0.5), await pixelAt(one, 0.6, 0.5));
  assert.notEqual(await finishedPixels(one), screen);
  await closePage(one);
});

test('beyond loopback a token is required', async () => {
  const server = await serve(['town.ply'], '--host', '0.0.0.0', ...QUICK);
  const token = tokenOf(server);
  assert.match(token, /^[0-9a-f]{32}$/);
  const address = `http://127.0.0.1:${server.port}/`;
  const wrong = ['?token=', `?token=${token.replace(/^./, (digit) => (digit === '0' ? '1' : '0'))}`];
  for (const query of wrong) assert.equal((await fetch(address + query)).status, 401);
  for (const query of ['', ...wrong]) {
    for (const path of ['render', 'scene', 'stats']) assert.equal((await fetch(address + path + query)).status, 401, path);
  }
  const page = await blankPage();
  await page.goto(address);
  await page.locator('#banner', { hasText: 'no connection to the server (token: missing or wrong' }).waitFor();
  assert.equal(await state(page, 'lastFrame'), null);
  await page.context().close();
  const render = () => fetch(`${address}render?resolution=20x10&token=${token}`);
  let picture = await render();
  // The files may still be loading.
  while (picture.status === 503) picture = await render();
  assert.equal(picture.headers.get('content-type'), 'image/png');
});

test('the token moves from the address into a cookie, and the view stays', async () => {
  const server = await serve(['town.ply'], '--host', '0.0.0.0', ...QUICK);
  for (const host of ['127.0.0.1', PLAIN_HOST]) {
    const address = `http://${host}:${server.port}/`;
    const hash = encodeHash({ color: 'class' });
    const page = await openPage(`${address}?token=${tokenOf(server)}${hash}`);
    // The page completes the view in its address.
    assert.equal(page.url().replace(/#.*/, ''), address);
    assert.equal(decodeHash(new URL(page.url()).hash).patch.color, 'class');
    assert.equal((await state(page, 'scene')).color, 'class');
    assert.equal(await page.evaluate(() => document.cookie), '');
    await page.locator('[data-action="export"]').click();
    await page.locator('[data-format="link"]').click();
    const link = new URL(await page.locator('#export-text').inputValue());
    assert.deepEqual([link.origin + link.pathname, link.search], [address, '']);
    await page.reload();
    await settled(page);
    await closePage(page);
  }
});

test('an image of a foreign page renders nothing', async () => {
  const server = await serve(['town.ply'], ...QUICK);
  const foreign = await blankPage();
  const address = `http://127.0.0.1:${server.port}/`;
  const outcomes = await foreign.evaluate((paths) => Promise.all(paths.map((path) => new Promise((resolve) => {
    const image = new Image();
    image.onload = () => resolve('loaded');
    image.onerror = () => resolve('failed');
    image.src = path;
  }))), [`${address}render?resolution=20x10`, `${address}render?color=none`]);
  assert.deepEqual(outcomes, ['failed', 'failed']);
  assert.equal((await (await fetch(`${address}stats`)).json()).pictures, 0);
  await foreign.context().close();
});

test('pages of other origins are denied', async () => {
  const server = await serve(['town.ply'], ...QUICK);
  const foreign = await blankPage();
  await foreign.goto('about:blank');
  const isDenied = await foreign.evaluate((address) => new Promise((resolve) => {
    const socket = new WebSocket(address);
    socket.onopen = () => resolve(false);
    socket.onerror = () => resolve(true);
  }), `ws://127.0.0.1:${server.port}/ws`);
  assert.ok(isDenied);
  await foreign.context().close();
});
