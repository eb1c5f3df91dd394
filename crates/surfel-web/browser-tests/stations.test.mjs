// Stations: the camera looks from where a scanner stood, looks around there, and finds back.

import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { axesOf } from '../page/camera.js';
import { distance, dot } from '../page/vector.js';
import { STATIONS } from './data.mjs';
import { closePage, drag, openPage, pixelAt, QUICK, serve, settled, show, state, unfoldPanel } from './harness.mjs';

let page;
before(async () => {
  page = await openPage((await serve(['room.ptx'], ...QUICK)).link);
  await unfoldPanel(page);
});
after(() => closePage(page));

const field = () => page.locator('[data-key="camera.station"]');
const isAt = async (place) => assert.ok(distance((await state(page, 'camera')).position, place) < 1e-3);

test('choosing a station moves the camera there, and the previous view leads back', async () => {
  const start = await state(page, 'camera');
  for (const [i, place] of STATIONS.entries()) {
    await field().selectOption({ label: `scan ${i + 1}` });
    await settled(page);
    await isAt(place);
  }
  await page.locator('[data-jump="previous"]').click();
  await settled(page);
  await isAt(STATIONS[0]);
  await page.locator('[data-jump="home"]').click();
  await settled(page);
  assert.deepEqual(await state(page, 'camera'), start);
  assert.equal(await field().inputValue(), '');
});

test('a drag at a station looks around', async () => {
  await field().selectOption({ label: 'scan 1' });
  await settled(page);
  const before = axesOf(await state(page, 'camera'));
  await drag(page, await pixelAt(page, 0.4, 0.5), await pixelAt(page, 0.6, 0.5));
  await settled(page);
  await isAt(STATIONS[0]);
  const { forward } = axesOf(await state(page, 'camera'));
  assert.ok(dot(forward, before.right) < -0.1, 'the view turns to the left, as the surface follows the pointer');
  assert.equal(await field().inputValue(), '0');
});

test('a link leads to a station', async () => {
  await field().selectOption({ label: 'scan 2' });
  await settled(page);
  const camera = await state(page, 'camera');
  await show(page, { camera });
  assert.equal(await field().inputValue(), '1');
});
