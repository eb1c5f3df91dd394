// Named views, files with settings of their own, and the histogram of a column.

import assert from 'node:assert/strict';
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, beforeEach, test } from 'node:test';
import { closePage, data, finishedPixels, openPage, pixels, QUICK, recorded, reopen, serve, settled, state, unfoldPanel } from './harness.mjs';

let server;
let page;
let first;
before(async () => {
  server = await serve(['town.ply', 'house.obj'], ...QUICK);
  page = await openPage(server.link, { viewport: { width: 900, height: 500 } });
  first = await finishedPixels(page);
});
beforeEach(async () => {
  await reopen(page);
  await unfoldPanel(page);
});
after(() => closePage(page));

const views = async () => (await state(page, 'scene')).views ?? [];
/** Rounds numbers, as links do. */
const rounded = (value) => JSON.parse(JSON.stringify(value), (_, part) => (typeof part === 'number' ? Number(part.toPrecision(12)) : part));
const names = () => page.locator('[data-view]').evaluateAll((fields) => fields.map(({ value }) => value));

test('views are saved, renamed, visited, deleted, and these changes undone', async () => {
  const opening = await state(page, 'camera');
  await page.locator('[data-action="save-view"]').click();
  await settled(page);
  await page.locator('[data-side="top"]').click();
  await settled(page);
  await page.locator('[data-action="save-view"]').click();
  await settled(page);
  assert.deepEqual(await names(), ['view 1', 'view 2']);
  await page.locator('[data-view="view 1"]').fill('from the south');
  await page.locator('[data-view="view 1"]').press('Enter');
  await settled(page);
  await page.locator('[aria-label="Go to from the south"]').click();
  assert.equal(await finishedPixels(page), first);
  assert.deepEqual((await state(page, 'camera')).position, opening.position);
  // What follows before this state is recorded would be undone with it.
  await recorded(page, (patch) => patch.views?.[0].name === 'from the south');
  await page.locator('[aria-label="Delete view 2"]').click();
  await settled(page);
  assert.deepEqual((await views()).map(({ name }) => name), ['from the south']);
  await page.locator('[data-action="undo"]').click();
  await settled(page);
  assert.deepEqual(await names(), ['from the south', 'view 2']);
  // A name that is taken is no name for another view.
  await page.locator('[data-view="view 2"]').fill('from the south');
  await page.locator('[data-view="view 2"]').press('Enter');
  assert.deepEqual(await names(), ['from the south', 'view 2']);
});

test('links and scene files carry the views', async () => {
  await page.locator('[data-action="save-view"]').click();
  await settled(page);
  const [saved] = rounded(await views());
  await page.locator('[data-action="export"]').click();
  const text = page.locator('#export-text');
  await page.waitForFunction(() => document.getElementById('export-text').value.startsWith('surfel'));
  assert.ok(!(await text.inputValue()).includes('views'));
  await page.locator('[data-format="toml"]').click();
  const toml = await text.inputValue();
  assert.match(toml, /\[\[views\]\]\nname = "view 1"/);
  await page.locator('[data-format="link"]').click();
  const link = await text.inputValue();
  await page.locator('#export-close').click();
  const other = await openPage(link);
  assert.deepEqual(rounded((await state(other, 'scene')).views), [saved]);
  await closePage(other);
  await reopen(page);
  assert.deepEqual(await views(), []);
  await page.locator('#scene-file').setInputFiles({ name: 'views.toml', mimeType: 'text/plain', buffer: Buffer.from(toml) });
  await page.waitForFunction(() => window.surfel.state.scene.views?.length === 1);
  assert.deepEqual(rounded(await views()), [saved]);
});

test('each file has a row with its number of points; a mesh has what acts on it', async () => {
  const row = (name) => page.locator(`[data-object="${name}"]`);
  await row('town.ply').locator('summary', { hasText: 'points' }).waitFor();
  await row('house.obj').locator('summary', { hasText: '10 triangles' }).waitFor();
  assert.equal(await row('town.ply').locator('[data-row$=".color"]').count(), 2);
  assert.equal(await row('house.obj').locator('[data-row="object.house.obj.color"]').count(), 0);
  await page.locator('[data-key="object.house.obj.visible"]').uncheck();
  const hidden = await finishedPixels(page);
  assert.notEqual(hidden, first);
  await page.waitForFunction(() => !document.querySelector('[data-action="undo"]').disabled);
  await page.locator('[data-action="undo"]').click();
  assert.equal(await finishedPixels(page), first);
  await page.locator('[data-action="redo"]').click();
  assert.equal(await finishedPixels(page), hidden);
});

test('rows are renamed; scene files and links carry the names, and settings go on using those of the files', async () => {
  const row = page.locator('[data-object="house.obj"]');
  const title = () => row.locator('label').first().textContent();
  const rename = async (name) => {
    const field = page.locator('[data-key="object.house.obj.label"]');
    await field.evaluate((it) => { it.closest('details').open = true; });
    await field.fill(name);
    await field.press('Enter');
    await settled(page);
  };
  assert.equal(await title(), 'house.obj');
  await rename('East: wing');
  assert.equal(await title(), 'East: wing');
  await row.locator('[aria-label="Zoom to East: wing"]').waitFor();
  assert.equal(await finishedPixels(page), first);
  assert.deepEqual((await state(page, 'scene')).object_settings, ['house.obj:label=East: wing']);
  await page.locator('[data-key="object.house.obj.visible"]').uncheck();
  await settled(page);
  assert.deepEqual((await state(page, 'scene')).object_settings, ['house.obj:label=East: wing', 'house.obj:visible=false']);
  await page.locator('[data-action="export"]').click();
  const text = page.locator('#export-text');
  await page.waitForFunction(() => document.getElementById('export-text').value.startsWith('surfel'));
  await page.locator('[data-format="toml"]').click();
  const toml = await text.inputValue();
  assert.match(toml, /label = "East: wing"/);
  await page.locator('[data-format="link"]').click();
  const link = await text.inputValue();
  await page.locator('#export-close').click();
  const other = await openPage(link);
  assert.equal(await other.locator('[data-object="house.obj"] label').first().textContent(), 'East: wing');
  await closePage(other);
  await reopen(page);
  await unfoldPanel(page);
  await page.waitForFunction(() => document.querySelector('[data-object="house.obj"] label').textContent === 'house.obj');
  await page.locator('#scene-file').setInputFiles({ name: 'names.toml', mimeType: 'text/plain', buffer: Buffer.from(toml) });
  await page.waitForFunction(() => document.querySelector('[data-object="house.obj"] label').textContent === 'East: wing');
  await rename('');
  assert.equal(await title(), 'house.obj');
});

test('clouds that lie among each other are hidden apart, and keep their places', async () => {
  const points = data.points.filter((_, i) => i % 3 === 0).map(({ x, y, z }) => `${x} ${y} ${z + 3}`);
  writeFileSync(join(data.folder, 'canopy.xyz'), points.join('\n'));
  const both = await serve(['town.ply', 'canopy.xyz'], ...QUICK);
  const other = await openPage(both.link);
  await unfoldPanel(other);
  const start = await finishedPixels(other);
  await other.locator('[data-key="object.town.ply.visible"]').uncheck();
  assert.notEqual(await finishedPixels(other), start);
  await other.locator('[data-key="object.town.ply.visible"]').check();
  assert.equal(await finishedPixels(other), start);
  await closePage(other);
});

test('the handles of a histogram set the filter', async () => {
  await page.selectOption('[data-key="histogram.column"]', 'classification');
  await page.locator('.histogram-bars rect').first().waitFor({ state: 'attached' });
  const heights = await page.locator('.histogram-bars rect').evaluateAll((bars) => bars.map((bar) => Number(bar.getAttribute('height'))));
  const n = (value) => data.points.filter(({ classification }) => classification === value).length;
  assert.equal(heights.length, 5);
  assert.ok(Math.abs(heights[0] / heights[4] - n(2) / n(6)) < 0.01, `${heights}`);
  const [low, high] = ['Lowest', 'Highest'].map((name) => page.locator(`[data-handle-name="${name}"]`));
  await low.focus();
  await page.keyboard.press('ArrowRight');
  await settled(page);
  assert.equal((await state(page, 'scene')).filter, 'classification >= 3');
  assert.notEqual(await pixels(page), first);
  assert.equal(await page.locator('.histogram-bars .is-outside').count(), 1);
  await page.locator('[data-key="filter"]').fill('classification >= 2 && classification <= 4');
  await page.locator('[data-key="filter"]').press('Enter');
  await settled(page);
  assert.deepEqual([await low.inputValue(), await high.inputValue()], ['2', '4']);
  await high.press('End');
  await settled(page);
  assert.equal((await state(page, 'scene')).filter, undefined);
});
