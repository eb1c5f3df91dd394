// Picking and measuring: the page shows the attributes that are in the file.

import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, beforeEach, test } from 'node:test';
import { project } from '../page/camera.js';
import { pathLength } from '../page/figures.js';
import { decodeHash, encodeHash } from '../page/link.js';
import { angleDegrees, circleThrough } from '../page/measure.js';
import { RESOLUTION } from './data.mjs';
import { closePage, copyBy, data, openPage, pixelAt, QUICK, reopen, serve, settled, shell, show, state } from './harness.mjs';

const AXES = ['x', 'y', 'z'];
let page;
before(async () => {
  const server = await serve(['town.ply', 'house.obj'], ...QUICK);
  page = await openPage(server.link, { viewport: { width: 1300, height: 640 } });
});
beforeEach(async () => {
  await reopen(page);
});
after(() => closePage(page));

/** The card's rows after Alt + click. */
async function pick(pixel, target = page) {
  const card = target.locator('#pick-card');
  await card.evaluate((element) => element.replaceChildren());
  await target.keyboard.down('Alt');
  await target.mouse.click(pixel.x, pixel.y);
  await target.keyboard.up('Alt');
  await card.locator('dl').waitFor();
  return card.evaluate((element) => Object.fromEntries(
    [...element.querySelectorAll('dt')].map((name) => [name.textContent, name.nextSibling.querySelector('span').textContent])));
}

const positionOf = (row) => AXES.map((name) => Number(row[name]));

/** Asserts that the card shows a point of the file that is near the clicked pixel. */
async function assertIsInFile(row, pixel, maxDistance = 30) {
  const point = data.points[Number(row.index)];
  for (const axis of AXES) assert.equal(Number(row[axis]), point[axis], axis);
  for (const name of ['red', 'green', 'blue', 'intensity', 'classification', 'gps_time']) assert.equal(Number(row[name]), point[name], name);
  assert.equal(row.class, { 2: 'ground', 6: 'building' }[point.classification]);
  const found = project(await state(page, 'camera'), await state(page, 'size'), positionOf(row));
  const viewport = await page.locator('#viewport').boundingBox();
  const distance = Math.hypot(found.x - (pixel.x - viewport.x), found.y - (pixel.y - viewport.y));
  assert.ok(distance < maxDistance, `${distance} pixels away`);
}

const POSITIONS = [[0.45, 0.6], [0.6, 0.75], [0.9, 0.7], [0.47, 0.13], [0.9, 0.4]];

test('a picked point has the attributes in the file', async () => {
  for (const fractions of POSITIONS) {
    const pixel = await pixelAt(page, ...fractions);
    await assertIsInFile(await pick(pixel), pixel);
  }
});

test('the status line has the coordinates of the point under the mouse, but not during drags', async () => {
  const [pixel, other] = [await pixelAt(page, 0.6, 0.75), await pixelAt(page, 0.5, 0.8)];
  const [point] = await pointsAt([pixel]);
  const cursor = page.locator('#cursor');
  await page.mouse.move(other.x, other.y);
  await page.mouse.move(pixel.x, pixel.y);
  await page.waitForFunction((text) => document.getElementById('cursor').textContent === text, positionOf(point).join('  '));
  await page.mouse.down();
  await page.mouse.move(pixel.x + 60, pixel.y, { steps: 4 });
  assert.equal(await cursor.textContent(), '');
  const n_sent = await page.evaluate(() => window.picks.n_sent);
  await page.mouse.move(other.x, other.y, { steps: 4 });
  await page.waitForTimeout(300);
  assert.equal(await cursor.textContent(), '');
  assert.equal(await page.evaluate(() => window.picks.n_sent), n_sent);
  await page.mouse.up();
  await page.locator('#cursor:not(:empty)').waitFor();
  await page.locator('#panel-fold').hover();
  assert.equal(await cursor.textContent(), '');
});

test('an animated point has its position at the current time', async () => {
  const rising = await openPage((await serve(['rising.toml'], ...QUICK)).link);
  await show(rising, { time: 1 });
  const row = await pick(await pixelAt(rising, 0.5, 0.25), rising);
  assert.ok(Math.abs(Number(row.z) - data.points[Number(row.index)].z - 10) < RESOLUTION, row.z);
  await closePage(rising);
});

const VIEWS = {
  'other radii': { radius_scale: 0.8, surface: 'disc' },
  'half of the points': { subsample: 'random:10000' },
  'a clip box': { clip_box: '([562316,562340],[4183187,4183215],[140,160])' },
};

for (const [name, patch] of Object.entries(VIEWS)) {
  test(`a picked point is correct with ${name}`, async () => {
    await show(page, patch);
    const pixel = await pixelAt(page, 0.45, 0.6);
    await assertIsInFile(await pick(pixel), pixel, 40);
  });
}

test('a picked point is correct on an orthographic map', async () => {
  await page.locator('#viewport').focus();
  for (const key of ['5', 'o', 'f']) await page.keyboard.press(key);
  await settled(page);
  const pixel = await pixelAt(page, 0.45, 0.4);
  await assertIsInFile(await pick(pixel), pixel);
});

test('a picked triangle has the attributes of its mesh', async () => {
  const camera = await state(page, 'camera');
  const roof = project(camera, await state(page, 'size'), [562339.125, 4183196.5, 153]);
  const viewport = await page.locator('#viewport').boundingBox();
  const row = await pick({ x: viewport.x + roof.x, y: viewport.y + roof.y });
  assert.match(await page.locator('#pick-card h2').textContent(), /Triangle/);
  assert.equal(row.object, 'house');
  assert.ok(Math.abs(Number(row.z) - 153) < RESOLUTION && Number(row.index) < 2, JSON.stringify(row));
  assert.equal(row.normal.replaceAll('-0.0000', '0.0000'), '0.0000, 0.0000, 1.0000');
});

test('a pick without a point shows a toast', async () => {
  await page.locator('[data-tool="pick"]').click();
  const corner = await pixelAt(page, 0.98, 0.03);
  await page.mouse.click(corner.x, corner.y);
  await page.locator('.toast', { hasText: 'There is no point here.' }).waitFor();
  assert.ok(await page.locator('#pick-card').isHidden());
});

test('values can be copied', async () => {
  const row = await pick(await pixelAt(page, 0.6, 0.75));
  await copyBy(page.locator('[aria-label="Copy x"]'));
  assert.equal(await page.evaluate(() => navigator.clipboard.readText()), row.x);
  await copyBy(page.locator('#pick-card [aria-label="Copy all"]'));
  const lines = (await page.evaluate(() => navigator.clipboard.readText())).split('\n').map((line) => line.split('\t'));
  assert.deepEqual(Object.fromEntries(lines), row);
});

/** The points of the file behind these pixels. */
async function pointsAt(pixels) {
  const points = [];
  for (const pixel of pixels) points.push(data.points[Number((await pick(pixel)).index)]);
  await page.keyboard.press('Escape');
  return points;
}

/** The values of a measurement with full precision, from the clipboard. */
async function measuredValues(name) {
  await copyBy(page.locator(`[aria-label="Copy ${name}"]`));
  const lines = (await page.evaluate(() => navigator.clipboard.readText())).split('\n').map((line) => line.split('\t'));
  return Object.fromEntries(lines.slice(1).map(([label, ...numbers]) => [label, numbers.length === 1 ? Number(numbers[0]) : numbers.map(Number)]));
}

/** Measures with a tool; the pixels must be too far apart for a double click. */
async function measure(tool, pixels) {
  await page.locator(`[data-tool="${tool}"]`).click();
  for (const pixel of pixels) await page.mouse.click(pixel.x, pixel.y);
}

const isClose = (found, expected) => assert.ok(Math.abs(found - expected) < RESOLUTION, `${found} ${expected}`);

test('distance and height agree with the points of the file', async () => {
  const pixels = [await pixelAt(page, 0.6, 0.75), await pixelAt(page, 0.9, 0.4)];
  const [a, b] = await pointsAt(pixels);
  await measure('distance', pixels);
  const found = await measuredValues('distance 1');
  isClose(found.Distance, Math.hypot(b.x - a.x, b.y - a.y, b.z - a.z));
  isClose(found.Horizontal, Math.hypot(b.x - a.x, b.y - a.y));
  isClose(found.Vertical, b.z - a.z);
  await measure('height', pixels);
  isClose((await measuredValues('height 2')).Height, Math.abs(b.z - a.z));
  await page.locator('[aria-label="Delete distance 1"]').click();
  assert.equal(await page.locator('.measurement').count(), 1);
});

test('points are measured in the order of the clicks, even if answers arrive in another order', async () => {
  const pixels = [await pixelAt(page, 0.6, 0.75), await pixelAt(page, 0.9, 0.4)];
  const [a, b] = await pointsAt(pixels);
  await page.evaluate(() => { window.picks.delays_ms = [500, 0]; });
  await measure('distance', pixels);
  isClose((await measuredValues('distance 1')).Vertical, b.z - a.z);
});

test('an area agrees with its corners', async () => {
  const pixels = [await pixelAt(page, 0.6, 0.75), await pixelAt(page, 0.9, 0.7), await pixelAt(page, 0.9, 0.45)];
  const corners = await pointsAt(pixels);
  await measure('area', pixels);
  await page.keyboard.press('Enter');
  const found = await measuredValues('area 1');
  const shoelace = corners.reduce((sum, { x, y }, i) => {
    const next = corners[(i + 1) % 3];
    return sum + (x - corners[0].x) * (next.y - corners[0].y) - (next.x - corners[0].x) * (y - corners[0].y);
  }, 0);
  assert.ok(Math.abs(found['Level area'] - Math.abs(shoelace) / 2) < 0.01, `${found['Level area']}`);
  assert.ok(found['Level area'] <= found.Area + 1e-9);
});

test('angles, circles and polylines agree with their points', async () => {
  const pixels = [await pixelAt(page, 0.6, 0.75), await pixelAt(page, 0.9, 0.7), await pixelAt(page, 0.9, 0.45)];
  const corners = (await pointsAt(pixels)).map(positionOf);
  await measure('angle', pixels);
  isClose((await measuredValues('angle 1')).Angle, angleDegrees(corners));
  await measure('circle', pixels);
  isClose((await measuredValues('circle 2')).Radius, circleThrough(corners).radius);
  await measure('polyline', pixels);
  await page.keyboard.press('Enter');
  isClose((await measuredValues('polyline 3')).Length, pathLength(corners));
  const [file] = await Promise.all([page.waitForEvent('download'), page.locator('[aria-label="Download as GeoJSON"]').click()]);
  const { features } = JSON.parse(readFileSync(await file.path(), 'utf8'));
  assert.deepEqual(features.map(({ geometry }) => geometry.type), ['LineString', 'MultiPoint', 'LineString']);
  assert.deepEqual(features[2].geometry.coordinates, corners);
});

test('labels are hidden behind what hides their points', async () => {
  const pixels = [await pixelAt(page, 0.6, 0.75), await pixelAt(page, 0.9, 0.4)];
  const seen = (await pointsAt(pixels)).map(positionOf);
  const buried = seen.map(([x, y, z]) => [x, y, z - 1]);
  const figure = (name, points) => ({ kind: 'polyline', name, points });
  const shown = async (n, figures, patch = {}) => {
    await page.evaluate((hash) => { location.hash = hash; }, encodeHash(patch, figures));
    await page.waitForFunction((count) => document.querySelectorAll('#overlay .label').length === count, n);
    return Number(await page.locator('#overlay .label').first().locator('text').last().textContent());
  };
  const figures = [figure('polyline 1', seen), figure('polyline 2', [buried[0], buried[1], buried[0]])];
  isClose(await shown(1, figures), pathLength(seen));
  await shown(1, [figure('polyline 1', [seen[0], buried[1]])]);
  const { position, focal_point } = await state(page, 'camera');
  const camera = { position: [position[0], position[1], 2 * focal_point[2] - position[2]], focal_point, view_up: [0, 0, 1] };
  await shown(2, figures, { camera });
});

test('a text is pinned to a point, is hidden behind what hides it, and undone', async () => {
  const pixel = await pixelAt(page, 0.6, 0.75);
  // The last pick is elsewhere, as a second click at the same place is a double click.
  const [point] = (await pointsAt([pixel, await pixelAt(page, 0.9, 0.4)])).map(positionOf);
  await measure('annotation', [pixel]);
  const field = page.getByLabel('Text of the annotation');
  await page.waitForFunction(() => document.activeElement.ariaLabel === 'Text of the annotation');
  const recorded = (name) => page.waitForURL((url) => decodeHash(url.hash)?.measurements?.[0]?.name === name);
  await recorded('annotation 1');
  await page.keyboard.type('loose tiles');
  await page.keyboard.press('Enter');
  const label = page.locator('#overlay .label');
  await label.filter({ hasText: 'loose tiles' }).waitFor();
  assert.equal(await page.evaluate(() => document.activeElement.id), 'viewport');
  await recorded('loose tiles');
  const { measurements } = decodeHash(new URL(page.url()).hash);
  assert.deepEqual(measurements, [{ kind: 'annotation', name: 'loose tiles', points: [point] }]);
  const [file] = await Promise.all([page.waitForEvent('download'), page.locator('[aria-label="Download as GeoJSON"]').click()]);
  const { features: [feature] } = JSON.parse(readFileSync(await file.path(), 'utf8'));
  assert.deepEqual([feature.properties.name, feature.geometry], ['loose tiles', { type: 'Point', coordinates: point }]);
  await field.fill('');
  await field.press('Enter');
  assert.equal(await field.inputValue(), 'loose tiles');
  await page.keyboard.press('Control+z');
  await label.filter({ hasText: 'annotation 1' }).waitFor();
  const [x, y, z] = point;
  const buried = { kind: 'annotation', name: 'below', points: [[x, y, z - 1]] };
  await page.evaluate((hash) => { location.hash = hash; }, encodeHash({}, [buried]));
  await label.filter({ hasText: 'annotation 1' }).waitFor({ state: 'detached' });
  await page.locator('#overlay .measure-dot').waitFor({ state: 'detached' });
  assert.equal(await field.inputValue(), 'below');
});

test('scene files carry measurements: the viewer shows them again, and the command line renders them', async () => {
  const pixels = [await pixelAt(page, 0.6, 0.75), await pixelAt(page, 0.9, 0.4)];
  const corners = (await pointsAt(pixels)).map(positionOf);
  await measure('distance', pixels);
  await page.locator('.measurement').waitFor();
  await page.locator('[data-action="export"]').click();
  await page.waitForFunction(() => document.getElementById('export-text').value.startsWith('surfel'));
  const text = page.locator('#export-text');
  assert.ok(!(await text.inputValue()).includes('measurements'));
  const files = {};
  for (const format of ['toml', 'json']) {
    await page.locator(`[data-format="${format}"]`).click();
    files[format] = await text.inputValue();
  }
  await page.locator('#export-close').click();
  const figure = { kind: 'distance', name: 'distance 1', points: corners };
  assert.deepEqual(JSON.parse(files.json).measurements, [figure]);
  writeFileSync(join(data.folder, 'measured.toml'), files.toml);
  shell('surfel render measured.toml --resolution 64x48 --spp 1 -o measured.png');
  const other = await openPage((await serve(['measured.toml'], ...QUICK)).link);
  const name = other.locator('.measurement h3');
  await name.waitFor();
  assert.deepEqual(await name.allTextContents(), ['distance 1']);
  assert.equal(decodeHash(new URL(other.url()).hash)?.measurements ?? null, null);
  // A link tells that they were deleted.
  await other.locator('[aria-label="Delete distance 1"]').click();
  await other.waitForFunction(() => location.hash !== '');
  await other.reload();
  await settled(other);
  assert.equal(await name.count(), 0);
  await reopen(other);
  await name.waitFor();
  assert.equal(await name.count(), 1);
  await closePage(other);
  await reopen(page);
  await page.locator('#scene-file').setInputFiles({ name: 'measured.json', mimeType: 'text/plain', buffer: Buffer.from(files.json) });
  await page.locator('.measurement h3', { hasText: 'distance 1' }).waitFor();
  await page.waitForFunction(() => !document.querySelector('[data-action="undo"]').disabled);
  await page.locator('[data-action="undo"]').click();
  await page.locator('.measurement').waitFor({ state: 'detached' });
});

test('a volume over the roof agrees with its points, above each base', async () => {
  await page.locator('#viewport').focus();
  for (const key of ['5', 'f']) await page.keyboard.press(key);
  await settled(page);
  // Within the roof, which is level at 154.
  const [camera, size] = [await state(page, 'camera'), await state(page, 'size')];
  const viewport = await page.locator('#viewport').boundingBox();
  const pixels = [[9, 13], [13, 13], [13, 19], [9, 19]].map(([east, north]) => {
    const { x, y } = project(camera, size, [562316.125 + east, 4183187.5 + north, 154]);
    return { x: viewport.x + x, y: viewport.y + y };
  });
  const corners = await pointsAt(pixels);
  const [xs, ys] = ['x', 'y'].map((axis) => corners.map((corner) => corner[axis]));
  const area = Math.abs(xs.reduce((sum, x, i) => sum + x * ys[(i + 1) % 4] - ys[i] * xs[(i + 1) % 4], 0)) / 2;
  await measure('volume', pixels);
  await page.keyboard.press('Enter');
  const card = page.locator('#measure-card');
  await card.locator('dt', { hasText: 'Empty cells' }).waitFor();
  let found = await measuredValues('volume 1');
  isClose(found.Cut, 0);
  isClose(found['Base height'], 154);
  assert.ok(Math.abs(found['Level area'] - area) < 0.01 && found['Empty cells'] < 15, JSON.stringify(found));
  await card.locator('select').selectOption('height');
  await card.getByLabel('Height').fill('150');
  await card.getByLabel('Height').press('Enter');
  await card.getByLabel('Cell size').fill('0.5');
  await card.getByLabel('Cell size').press('Enter');
  await page.waitForFunction(() => /Cell size0\.5(?!\d)/.test(document.getElementById('measure-card').textContent));
  found = await measuredValues('volume 1');
  assert.ok(Math.abs(found.Cut / (4 * area * (1 - found['Empty cells'] / 100)) - 1) < 0.01, `${JSON.stringify(found)} ${area}`);
  assert.equal(found.Net, found.Cut);
  const [file] = await Promise.all([page.waitForEvent('download'), page.locator('[aria-label="Download as GeoJSON"]').click()]);
  const { features: [feature] } = JSON.parse(readFileSync(await file.path(), 'utf8'));
  assert.equal(feature.geometry.type, 'Polygon');
  // A link carries the polygon, whose volume the server computes again.
  await page.evaluate(() => window.dispatchEvent(new Event('pagehide')));
  const other = await openPage(page.url());
  await other.locator('#measure-card dt', { hasText: 'Empty cells' }).waitFor();
  assert.equal(await other.locator('.toast').count(), 0);
  await closePage(other);
  assert.ok(Math.abs(feature.properties.cut - found.Cut) < 1e-3 && feature.properties.cell_size === 0.5, JSON.stringify(feature.properties));
});

test('points are picked by the keyboard alone', async () => {
  await page.locator('[data-tool="pick"]').focus();
  await page.keyboard.press('Enter');
  assert.equal(await page.evaluate(() => document.activeElement.id), 'viewport');
  await page.locator('.crosshair').waitFor({ state: 'attached' });
  for (let i = 0; i < 6; i++) await page.keyboard.press('ArrowDown');
  await page.keyboard.press('Shift+ArrowLeft');
  await page.keyboard.press('Enter');
  await page.locator('#pick-card dl').waitFor();
  const row = await page.locator('#pick-card').evaluate((element) => Object.fromEntries(
    [...element.querySelectorAll('dt')].map((name) => [name.textContent, name.nextSibling.querySelector('span').textContent])));
  const { width, height } = await page.locator('#viewport').boundingBox();
  await assertIsInFile(row, { x: 0.5 * width - 0.0025 * height, y: 0.65 * height });
  await page.keyboard.press('Escape');
  assert.equal(await state(page, 'tool'), 'navigate');
  await page.locator('.crosshair').waitFor({ state: 'detached' });
});

test('a distance is measured by the keyboard alone, and a line ends at a second Enter', async () => {
  await page.locator('[data-tool="polyline"]').focus();
  await page.keyboard.press('Enter');
  for (let i = 0; i < 6; i++) await page.keyboard.press('ArrowDown');
  await page.keyboard.press('Enter');
  await page.locator('.measure-dot').first().waitFor({ state: 'attached' });
  for (let i = 0; i < 4; i++) await page.keyboard.press('ArrowRight');
  await page.keyboard.press('Enter');
  await page.keyboard.press('Enter');
  await page.locator('.measurement h3', { hasText: 'polyline 1' }).waitFor();
});

test('a height profile shows the points of the file beside its line', async () => {
  const pixels = [await pixelAt(page, 0.45, 0.6), await pixelAt(page, 0.9, 0.7)];
  const line = (await pointsAt(pixels)).map(positionOf);
  await measure('profile', pixels);
  await page.keyboard.press('Enter');
  const card = page.locator('#profile-card');
  await card.locator('.note', { hasText: 'points' }).waitFor();
  const width = card.locator('input');
  await width.fill('2');
  await width.press('Enter');
  const pointsWithin = (margin) => data.points.map(positionOf).filter((point) => {
    const [along, across] = inLine(point, line);
    return -margin <= along && along <= 1 + margin && Math.abs(across) <= 1 + margin;
  });
  // The corners of the line are points, on whose side of its ends rounding decides.
  const [least, most] = [pointsWithin(-RESOLUTION), pointsWithin(RESOLUTION)];
  await page.waitForFunction(([low, high]) => {
    const n = parseInt(document.querySelector('#profile-card .note').textContent, 10);
    return low <= n && n <= high;
  }, [least.length, most.length]);
  const [file] = await Promise.all([page.waitForEvent('download'), card.getByText('CSV').click()]);
  const rows = readFileSync(await file.path(), 'utf8').trim().split('\n').slice(1).map((row) => row.split(',').map(Number));
  assert.ok(100 < least.length && least.length <= rows.length && rows.length <= most.length);
  // Heights and coordinates are those of the file, digit by digit.
  const isKnown = (row) => most.some((point) => point[2] === row[2] && point.every((value, axis) => value === row[3 + axis]));
  assert.deepEqual(rows.filter((row) => !isKnown(row)), []);
  await page.locator('[aria-label="Delete profile 1"]').click();
  assert.ok(await card.isHidden());
});

/** Place of a point along a line of two points, from 0 to 1, and its level distance from it. */
function inLine(point, [a, b]) {
  const [x, y] = [b[0] - a[0], b[1] - a[1]];
  const [dx, dy] = [point[0] - a[0], point[1] - a[1]];
  const length = Math.hypot(x, y);
  return [(dx * x + dy * y) / length ** 2, (dy * x - dx * y) / length];
}

test('Escape cancels the unfinished measurement, then the tool', async () => {
  const pixel = await pixelAt(page, 0.6, 0.6);
  await measure('distance', [pixel]);
  await page.locator('.measure-dot').first().waitFor();
  await page.keyboard.press('Escape');
  await page.locator('.measure-dot').first().waitFor({ state: 'detached' });
  assert.equal(await state(page, 'tool'), 'distance');
  await page.keyboard.press('Escape');
  assert.equal(await state(page, 'tool'), 'navigate');
});
