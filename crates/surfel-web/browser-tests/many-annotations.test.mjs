// Links with very many annotations: the page lists them, pictures go on to follow the mouse, and undo and export have all.

import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { decodeHash, encodeHash } from '../page/link.js';
import { blankPage, closePage, data, pixelAt, QUICK, recorded, recordPictures, serve, settled, state } from './harness.mjs';

let server;
let page;
before(async () => {
  server = await serve(['town.ply'], ...QUICK);
  page = await blankPage({ viewport: { width: 1000, height: 600 } });
});
after(() => closePage(page));

/** Annotations at as many points of the town. */
const annotations = (n) => Array.from({ length: n }, (_, i) => {
  const { x, y, z } = data.points[(19 * i) % data.points.length];
  return { kind: 'annotation', name: `tree ${i + 1}`, points: [[x, y, z]] };
});

const count = () => page.locator('.measurement').count();
/** Waits until the card lists this many measurements. */
const listed = (n) => page.waitForFunction((wanted) => document.querySelectorAll('.measurement').length === wanted, n);

test('a thousand annotations', async () => {
  const all = annotations(1000);
  await page.goto(server.link + encodeHash({}, all));
  await listed(all.length);
  await settled(page);
  const n_labels = await page.locator('#overlay .label').count();
  assert.ok(20 < n_labels && n_labels < 1000, `${n_labels} labels have room`);
  await recordPictures(page);
  const { seq } = await state(page, 'lastFrame');
  const [start, middle, end] = [await pixelAt(page, 0.7, 0.5), await pixelAt(page, 0.75, 0.5), await pixelAt(page, 0.8, 0.55)];
  await page.mouse.move(start.x, start.y);
  await page.mouse.down();
  await page.mouse.move(middle.x, middle.y, { steps: 5 });
  await page.waitForFunction((before) => before < window.surfel.state.lastFrame.seq, seq);
  await page.mouse.move(end.x, end.y, { steps: 5 });
  await page.mouse.up();
  await settled(page);
  assert.ok(1 < new Set((await page.evaluate(() => window.pictures.map((one) => one.seq))).filter((one) => seq < one)).size);
  await page.locator('[aria-label="Delete tree 3"]').click();
  assert.equal(await count(), 999);
  await recorded(page, ({ camera }) => camera);
  await page.locator('#viewport').focus();
  await page.keyboard.press('Control+z');
  await listed(1000);
  await settled(page);
  await page.locator('[data-action=export]').click();
  await page.locator('[data-format=toml]').click();
  await page.waitForFunction(() => document.getElementById('export-text').value.includes('tree 1000'));
  const toml = await page.locator('#export-text').inputValue();
  assert.equal(toml.match(/tree \d+/g).length, 1000);
  await page.locator('#export-close').click();
});

test('a link of a megabyte of annotations', async () => {
  const all = annotations(9000);
  const hash = encodeHash({ color: 'elevation' }, all);
  assert.ok(1e6 < hash.length, `${hash.length}`);
  await page.goto('about:blank');
  await page.goto(server.link + hash);
  await listed(all.length);
  assert.equal((await state(page, 'scene')).color, 'elevation');
  await page.locator('[aria-label="Delete all"]').click();
  assert.equal(await count(), 0);
  await settled(page);
  // The address already differs from the link once the server has completed its settings.
  await page.waitForFunction(() => location.hash.length < 10_000);
  const { patch, measurements } = decodeHash(new URL(page.url()).hash);
  assert.deepEqual([patch.color, measurements], ['elevation', null]);
});
