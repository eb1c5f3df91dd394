// Asking and measuring: what the page tells of a place is what the file says.

import assert from 'node:assert/strict';
import { after, before, beforeEach, test } from 'node:test';
import { project } from '../page/camera.js';
import { RESOLUTION } from './data.mjs';
import { closePage, copyBy, data, openPage, placeAt, QUICK, serve, settled, show, state } from './harness.mjs';

const AXES = ['x', 'y', 'z'];
let page;
before(async () => {
  const server = await serve(['town.ply', 'house.obj'], ...QUICK);
  page = await openPage(server.link, { viewport: { width: 1300, height: 640 } });
});
beforeEach(async () => {
  await page.goto(page.url().replace(/#.*/, ''));
  await page.reload();
  await settled(page);
});
after(() => closePage(page));

/** The card's rows after Alt + click. */
async function ask(place, of = page) {
  const card = of.locator('#pick-card');
  await card.evaluate((element) => element.replaceChildren());
  await of.keyboard.down('Alt');
  await of.mouse.click(place.x, place.y);
  await of.keyboard.up('Alt');
  await card.locator('dl').waitFor();
  return card.evaluate((element) => Object.fromEntries(
    [...element.querySelectorAll('dt')].map((name) => [name.textContent, name.nextSibling.querySelector('span').textContent])));
}

const positionOf = (row) => AXES.map((name) => Number(row[name]));

/** The card tells a point of the file, near the place that was clicked at. */
async function isOfTheFile(row, place, reach = 30) {
  const point = data.points[Number(row.index)];
  for (const axis of AXES) assert.ok(Math.abs(Number(row[axis]) - point[axis]) < RESOLUTION / 10, `${axis}: ${row[axis]} ${point[axis]}`);
  for (const name of ['red', 'green', 'blue', 'intensity', 'classification', 'gps_time']) assert.equal(Number(row[name]), point[name], name);
  assert.equal(row.class, { 2: 'ground', 6: 'building' }[point.classification]);
  const found = project(await state(page, 'camera'), await state(page, 'size'), positionOf(row));
  const stage = await page.locator('#stage').boundingBox();
  const off = Math.hypot(found.x - (place.x - stage.x), found.y - (place.y - stage.y));
  assert.ok(off < reach, `${off} pixels off`);
}

const PLACES = [[0.45, 0.6], [0.6, 0.75], [0.9, 0.7], [0.47, 0.13], [0.9, 0.4]];

test('a point is told as the file has it', async () => {
  for (const shares of PLACES) {
    const place = await placeAt(page, ...shares);
    await isOfTheFile(await ask(place), place);
  }
});

test('a point that moves is told where it is at the time', async () => {
  const rising = await openPage((await serve(['rising.toml'], ...QUICK)).link);
  await show(rising, { time: 1 });
  const row = await ask(await placeAt(rising, 0.5, 0.25), rising);
  assert.ok(Math.abs(Number(row.z) - data.points[Number(row.index)].z - 10) < RESOLUTION, row.z);
  await closePage(rising);
});

const VIEWS = {
  'other radii': { radius_scale: 0.8, surface: 'disc' },
  'half of the points': { select: 'random:10000' },
  'a clip box': { clip_box: '([562316,562340],[4183187,4183215],[140,160])' },
};

for (const [name, patch] of Object.entries(VIEWS)) {
  test(`a point is the same through ${name}`, async () => {
    await show(page, patch);
    const place = await placeAt(page, 0.45, 0.6);
    await isOfTheFile(await ask(place), place, 40);
  });
}

test('a point is the same on an orthographic map', async () => {
  await page.locator('#stage').focus();
  for (const key of ['5', 'o', 'f']) await page.keyboard.press(key);
  await settled(page);
  const place = await placeAt(page, 0.45, 0.4);
  await isOfTheFile(await ask(place), place);
});

test('a triangle is told by the mesh', async () => {
  const camera = await state(page, 'camera');
  const roof = project(camera, await state(page, 'size'), [562339.125, 4183196.5, 153]);
  const stage = await page.locator('#stage').boundingBox();
  const row = await ask({ x: stage.x + roof.x, y: stage.y + roof.y });
  assert.match(await page.locator('#pick-card h2').textContent(), /Triangle/);
  assert.equal(row.object, 'house');
  assert.ok(Math.abs(Number(row.z) - 153) < RESOLUTION && Number(row.index) < 2, JSON.stringify(row));
  assert.equal(row.normal.replaceAll('-0.0000', '0.0000'), '0.0000, 0.0000, 1.0000');
});

test('where nothing is, the page says so', async () => {
  await page.locator('[data-tool="pick"]').click();
  const corner = await placeAt(page, 0.98, 0.03);
  await page.mouse.click(corner.x, corner.y);
  await page.locator('.toast', { hasText: 'Nothing is there.' }).waitFor();
  assert.ok(await page.locator('#pick-card').isHidden());
});

test('values are copied', async () => {
  const row = await ask(await placeAt(page, 0.6, 0.75));
  await copyBy(page.locator('[aria-label="Copy x"]'));
  assert.equal(await page.evaluate(() => navigator.clipboard.readText()), row.x);
  await copyBy(page.locator('#pick-card [aria-label="Copy all"]'));
  const lines = (await page.evaluate(() => navigator.clipboard.readText())).split('\n').map((line) => line.split('\t'));
  assert.deepEqual(Object.fromEntries(lines), row);
});

/** Points of the file under these places. */
async function pointsAt(places) {
  const points = [];
  for (const place of places) points.push(data.points[Number((await ask(place)).index)]);
  await page.keyboard.press('Escape');
  return points;
}

/** Numbers of the measurement that was made last, with all their digits, from the clipboard. */
async function measured(name) {
  await copyBy(page.locator(`[aria-label="Copy ${name}"]`));
  const lines = (await page.evaluate(() => navigator.clipboard.readText())).split('\n').map((line) => line.split('\t'));
  return Object.fromEntries(lines.slice(1).map(([of, ...numbers]) => [of, numbers.length === 1 ? Number(numbers[0]) : numbers.map(Number)]));
}

/** Clicks on places that are too far from each other for a double click. */
async function measure(tool, places) {
  await page.locator(`[data-tool="${tool}"]`).click();
  for (const place of places) await page.mouse.click(place.x, place.y);
}

const isClose = (found, expected) => assert.ok(Math.abs(found - expected) < RESOLUTION, `${found} ${expected}`);

test('distance and height are those of the points in the file', async () => {
  const places = [await placeAt(page, 0.6, 0.75), await placeAt(page, 0.9, 0.4)];
  const [a, b] = await pointsAt(places);
  await measure('distance', places);
  const found = await measured('distance 1');
  isClose(found.Distance, Math.hypot(b.x - a.x, b.y - a.y, b.z - a.z));
  isClose(found.Horizontal, Math.hypot(b.x - a.x, b.y - a.y));
  isClose(found.Vertical, b.z - a.z);
  await measure('height', places);
  isClose((await measured('height 2')).Height, Math.abs(b.z - a.z));
  await page.locator('[aria-label="Delete distance 1"]').click();
  assert.equal(await page.locator('.measurement').count(), 1);
});

test('points are measured in the order of the clicks, however long the answers take', async () => {
  const places = [await placeAt(page, 0.6, 0.75), await placeAt(page, 0.9, 0.4)];
  const [a, b] = await pointsAt(places);
  await page.evaluate(() => { window.heard.delays_ms = [500, 0]; });
  await measure('distance', places);
  isClose((await measured('distance 1')).Vertical, b.z - a.z);
});

test('an area is that of its corners', async () => {
  const places = [await placeAt(page, 0.6, 0.75), await placeAt(page, 0.9, 0.7), await placeAt(page, 0.9, 0.45)];
  const corners = await pointsAt(places);
  await measure('area', places);
  await page.keyboard.press('Enter');
  const found = await measured('area 1');
  const shoelace = corners.reduce((sum, { x, y }, i) => {
    const next = corners[(i + 1) % 3];
    return sum + (x - corners[0].x) * (next.y - corners[0].y) - (next.x - corners[0].x) * (y - corners[0].y);
  }, 0);
  assert.ok(Math.abs(found['Level area'] - Math.abs(shoelace) / 2) < 0.01, `${found['Level area']}`);
  assert.ok(found['Level area'] <= found.Area + 1e-9);
});

test('Escape gives up what is half measured, then the tool', async () => {
  const place = await placeAt(page, 0.6, 0.6);
  await measure('distance', [place]);
  await page.locator('.measure-dot').first().waitFor();
  await page.keyboard.press('Escape');
  await page.locator('.measure-dot').first().waitFor({ state: 'detached' });
  assert.equal(await state(page, 'tool'), 'distance');
  await page.keyboard.press('Escape');
  assert.equal(await state(page, 'tool'), 'look');
});
