// Annotations: what is drawn into the picture is seen on the screen, in drafts and in the saved file alike.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { after, before, beforeEach, test } from 'node:test';
import { closePage, drag, finishedPixels, openPage, pixelAt, QUICK, serve, settled, show, unfoldPanel } from './harness.mjs';

const CENTER = [562334, 4183205, 149];
const PLAN = { position: [562334, 4183205, 300], focal_point: CENTER, view_up: [0, 1, 0], view_angle: null, orthographic: 60 };
const ALL = { legend: true, scale_bar: true, north: true, caption: 'The town', color: 'elevation' };

let page;
let first;
before(async () => {
  page = await openPage((await serve(['town.ply'], ...QUICK)).link, { viewport: { width: 900, height: 500 } });
  await unfoldPanel(page);
  first = await finishedPixels(page);
});
beforeEach(() => show(page, {}));
after(() => closePage(page));

const field = (key) => page.locator(`[data-key="${key}"]`);

test('a scale bar and a north arrow need an orthographic camera', async () => {
  for (const key of ['scale_bar', 'north']) assert.ok(await field(key).isDisabled());
  assert.ok(await field('legend').isDisabled(), 'the colours of the file need no legend');
  await show(page, { camera: PLAN });
  const plan = await finishedPixels(page);
  for (const key of ['scale_bar', 'north']) {
    await field(key).check();
    assert.notEqual(await finishedPixels(page), plan, key);
    await field(key).uncheck();
    assert.equal(await finishedPixels(page), plan, key);
  }
});

test('annotations that the camera does not allow are left out of picture and file', async () => {
  await show(page, { scale_bar: true, north: true });
  assert.equal(await finishedPixels(page), first);
  await page.locator('[data-action="export"]').click();
  await page.waitForFunction(() => document.getElementById('export-text').value.startsWith('surfel'));
  assert.doesNotMatch(await page.locator('#export-text').inputValue(), /scale-bar|north/);
  await page.locator('#export-close').click();
});

test('the saved picture is the one on the screen', async () => {
  await show(page, { ...ALL, camera: PLAN });
  assert.ok(await page.locator('#legend').isHidden(), 'there are not two legends');
  await page.locator('[data-action="save"]').click();
  await page.locator('[data-preset="window"]').click();
  const [file] = await Promise.all([page.waitForEvent('download'), page.locator('#save-start').click()]);
  const saved = readFileSync(await file.path()).toString('base64');
  await page.locator('#save-note', { hasText: 'Saved.' }).waitFor();
  await page.locator('#save-cancel').click();
  const largest = await page.evaluate(async (base64) => {
    const bitmap = await createImageBitmap(new Blob([Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0))]));
    const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
    context.drawImage(bitmap, 0, 0);
    const pixels = context.getImageData(0, 0, bitmap.width, bitmap.height).data;
    return window.readPixels().reduce((most, value, i) => Math.max(most, Math.abs(value - pixels[i])), 0);
  }, saved);
  // The samples are summed in another order, so their rounding differs.
  assert.ok(largest <= 1, `${largest}`);
});

test('drafts have the caption in the size and place of the finished picture', async () => {
  await show(page, { caption: 'The town', background: '#000000', camera: { ...PLAN, orthographic: 4000 } });
  await page.evaluate(() => {
    /** True for the bright pixels of a row through the caption; it lies over a black background. */
    window.readCaption = () => {
      const { width, height } = document.getElementById('picture');
      const pixels = window.readPixels();
      return Array.from({ length: 100 }, (_, x) => (60 < pixels[4 * ((height - 22) * width + x)] ? 1 : 0));
    };
    window.drafts = [];
    // The status line changes with each picture.
    const record = () => {
      const { lastFrame, size } = window.surfel.state;
      if (lastFrame.width < size.width) window.drafts.push(window.readCaption());
    };
    new MutationObserver(record).observe(document.getElementById('numbers'), { childList: true });
  });
  const finished = await page.evaluate(() => window.readCaption());
  assert.ok(5 < finished.reduce((sum, value) => sum + value), 'the caption has letters');
  await drag(page, await pixelAt(page, 0.5, 0.5), await pixelAt(page, 0.6, 0.5), { steps: 20 });
  await settled(page);
  const drafts = await page.evaluate(() => window.drafts);
  assert.ok(0 < drafts.length, 'there were drafts');
  for (const draft of drafts) {
    const n_different = draft.filter((value, i) => value !== finished[i]).length;
    assert.ok(n_different <= 8, `${n_different} of 100 pixels`);
  }
});
