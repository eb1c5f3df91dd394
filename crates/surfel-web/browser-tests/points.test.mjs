// Points: filters and classes show a part of the cloud; the camera stays, and refused filters are taken back.

import assert from 'node:assert/strict';
import { after, before, beforeEach, test } from 'node:test';
import { closePage, finishedPixels, openPage, pixels, QUICK, reopen, serve, settled, state, unfoldPanel } from './harness.mjs';

let page;
let first;
before(async () => {
  page = await openPage((await serve(['town.ply'], ...QUICK)).link);
  await unfoldPanel(page);
  first = await finishedPixels(page);
});
beforeEach(async () => {
  // The last message of a refused filter has no picture.
  await reopen(page);
  await unfoldPanel(page);
});
after(() => closePage(page));

const filter = () => page.locator('[data-key="filter"]');
const error = () => page.locator('[data-row="filter"] .row-error');

async function setFilter(text) {
  await filter().fill(text);
  await filter().press('Enter');
}

test('a filter changes the picture and not the camera', async () => {
  const camera = await state(page, 'camera');
  await setFilter('z > 150 and intensity >= 0');
  await settled(page);
  assert.notEqual(await pixels(page), first);
  assert.deepEqual(await state(page, 'camera'), camera);
  assert.equal((await state(page, 'scene')).filter, 'z > 150 && intensity >= 0');
  assert.equal(await filter().inputValue(), 'z > 150 && intensity >= 0');
  await setFilter('');
  assert.equal(await finishedPixels(page), first);
});

const REFUSED = {
  'z >> 1': /expected/,
  'hight > 1': /hight.*classification/,
  'z > 1e6': /no point meets z > 1000000/,
};
for (const [text, reason] of Object.entries(REFUSED)) {
  test(`a filter is refused, and the last one stays: ${text}`, async () => {
    await setFilter('z > 150');
    const before = await finishedPixels(page);
    await setFilter(text);
    await error().waitFor();
    assert.match(await error().textContent(), reason);
    assert.equal(await filter().inputValue(), 'z > 150');
    assert.equal((await state(page, 'scene')).filter, 'z > 150');
    assert.equal(await pixels(page), before);
  });
}

test('classes have names, counts and colours, and one is always shown', async () => {
  const labels = await page.locator('[data-row="class"] .checklist label').allTextContents();
  assert.match(labels.join(), /^2 ground.*,6 building.*$/);
  await page.getByRole('checkbox', { name: '2 ground' }).uncheck();
  await settled(page);
  assert.deepEqual((await state(page, 'scene')).class, [6]);
  assert.ok(await page.getByRole('checkbox', { name: '6 building' }).isDisabled());
  await page.getByRole('checkbox', { name: '2 ground' }).check();
  assert.equal(await finishedPixels(page), first);
  assert.equal((await state(page, 'scene')).class, undefined);
});

test('points without returns and stations have no control of them', async () => {
  assert.ok(await page.locator('[data-row="returns"]').isHidden());
  assert.ok(await page.locator('[data-row="camera.station"]').isHidden());
});
