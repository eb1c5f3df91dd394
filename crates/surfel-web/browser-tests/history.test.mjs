// Undo and redo, what a reload keeps, and the limits of zoom.

import assert from 'node:assert/strict';
import { after, before, beforeEach, test } from 'node:test';
import { decodeHash } from '../page/link.js';
import { distance, mix } from '../page/vector.js';
import { closePage, drag, openPage, pixelAt, QUICK, reopen, serve, settled, state, unfoldPanel } from './harness.mjs';

let page;
let opening;
before(async () => {
  const server = await serve(['town.ply'], ...QUICK);
  page = await openPage(server.link, { viewport: { width: 1300, height: 640 } });
  opening = await state(page, 'camera');
});
beforeEach(async () => {
  await reopen(page);
  await unfoldPanel(page);
});
after(() => closePage(page));

const [undo, redo] = ['undo', 'redo'].map((action) => () => page.locator(`[data-action=${action}]`));
const colorField = () => page.locator('#panel [data-key=color]');
const color = async () => (await state(page, 'scene')).color;

/** Waits until the last change is recorded: the address has it. */
const recorded = (key) => page.waitForFunction((before) => location.hash !== before, key);
const address = () => page.evaluate(() => location.hash);

/** Makes a change and waits until it is part of the address. */
async function change(action) {
  const before = await address();
  await action();
  await recorded(before);
  await settled(page);
}

async function measureDistance() {
  await page.locator('[data-tool=distance]').click();
  for (const fractions of [[0.45, 0.6], [0.6, 0.75]]) {
    const { x, y } = await pixelAt(page, ...fractions);
    await page.mouse.click(x, y);
  }
  await page.locator('#measure-card h3').waitFor();
}

const measurements = () => page.locator('#measure-card h3').allTextContents();

test('settings are undone and redone by buttons', async () => {
  const first = await color();
  assert.ok(await undo().isDisabled() && await redo().isDisabled());
  await change(() => colorField().selectOption('elevation'));
  await change(() => colorField().selectOption('normal'));
  await change(() => undo().click());
  assert.equal(await color(), 'elevation');
  await change(() => undo().click());
  assert.equal(await color(), first);
  assert.ok(await undo().isDisabled());
  await change(() => redo().click());
  assert.equal(await color(), 'elevation');
  // A change after an undo replaces what was undone.
  await change(() => colorField().selectOption('intensity'));
  assert.ok(await redo().isDisabled());
});

test('the camera and measurements are undone and redone by keys', async () => {
  await change(async () => drag(page, await pixelAt(page, 0.5, 0.5), await pixelAt(page, 0.7, 0.6)));
  const turned = await state(page, 'camera');
  await change(measureDistance);
  await page.locator('#viewport').focus();
  await change(() => page.keyboard.press('Control+z'));
  assert.deepEqual(await measurements(), []);
  assert.deepEqual(await state(page, 'camera'), turned);
  await change(() => page.keyboard.press('Control+z'));
  assert.ok(distance((await state(page, 'camera')).position, opening.position) < 1e-6);
  await change(() => page.keyboard.press('Control+y'));
  await change(() => page.keyboard.press('Control+Shift+z'));
  assert.deepEqual(await measurements(), ['distance 1']);
});

test('keys undo while a list, a slider or a switch has the focus, and not while a text is typed', async () => {
  const first = await color();
  const controls = [
    [colorField(), () => colorField().selectOption('elevation')],
    [page.locator('#panel [data-key="sun.azimuth"]'), () => page.keyboard.press('ArrowRight')],
    [page.locator('#panel [data-key=clip_box]'), () => page.keyboard.press('Space')],
  ];
  for (const [control, action] of controls) {
    const before = await state(page, 'scene');
    await control.focus();
    await change(action);
    await change(() => page.keyboard.press('Control+z'));
    assert.deepEqual(await state(page, 'scene'), before);
  }
  await change(() => colorField().selectOption('elevation'));
  const caption = page.locator('#panel [data-key=caption]');
  await caption.focus();
  await page.keyboard.type('roofs');
  await page.keyboard.press('Control+z');
  assert.equal(await caption.inputValue(), '');
  assert.equal(await color(), 'elevation');
  await caption.blur();
  await change(() => undo().click());
  assert.equal(await color(), first);
});

test('undo ends a transition and the turntable', async () => {
  await page.emulateMedia({ reducedMotion: 'no-preference' });
  await page.locator('#viewport').focus();
  await page.keyboard.press('3');
  await page.waitForTimeout(120);
  await page.keyboard.press('Control+z');
  await settled(page);
  assert.deepEqual(await state(page, 'camera'), opening);
  assert.ok(!await redo().isDisabled());
  const turn = page.locator('[data-action=turntable]');
  await turn.click();
  await page.waitForFunction((y) => window.surfel.state.camera.position[1] !== y, opening.position[1]);
  await undo().click();
  await settled(page);
  assert.deepEqual(await state(page, 'camera'), opening);
  assert.equal(await turn.textContent(), 'Turn');
  await page.emulateMedia({ reducedMotion: 'reduce' });
});

test('undo in the middle of a drag stays, and the release changes nothing', async () => {
  const clipBox = page.locator('#panel [data-key=clip_box]');
  await change(() => clipBox.check());
  const middle = async (locator) => {
    const { x, y, width, height } = await locator.boundingBox();
    return { x: x + width / 2, y: y + height / 2 };
  };
  // The camera of the scene is that of the last settings, the other one that of the view.
  const view = async () => [{ ...await state(page, 'scene'), camera: null }, await state(page, 'camera')];
  const slider = page.locator('#panel [data-key="sun.azimuth"]');
  await slider.scrollIntoViewIfNeeded();
  for (const from of [await middle(slider), await middle(page.locator('[data-handle="box 2 max"]')), await pixelAt(page, 0.5, 0.2)]) {
    const before = await view();
    await page.mouse.move(from.x, from.y);
    await page.mouse.down();
    await page.mouse.move(from.x - 20, from.y + 20, { steps: 4 });
    assert.notDeepEqual(await view(), before);
    await page.keyboard.press('Control+z');
    await page.mouse.up();
    await settled(page);
    assert.deepEqual(await view(), before);
    assert.ok(!await redo().isDisabled());
  }
});

test('a reload keeps camera, settings and measurements', async () => {
  await change(async () => drag(page, await pixelAt(page, 0.5, 0.5), await pixelAt(page, 0.6, 0.6)));
  await change(() => colorField().selectOption('elevation'));
  await change(measureDistance);
  const camera = await state(page, 'camera');
  const text = await page.locator('#measure-card dl').textContent();
  await page.reload();
  await settled(page);
  assert.ok(distance((await state(page, 'camera')).position, camera.position) < 1e-6);
  assert.equal(await color(), 'elevation');
  assert.equal(await page.locator('#measure-card dl').textContent(), text);
  assert.equal(decodeHash(await address()).measurements.length, 1);
});

test('a scene file is undone and redone', async () => {
  const first = await color();
  await change(() => colorField().selectOption('elevation'));
  const file = { name: 'a.toml', mimeType: 'text/plain', buffer: Buffer.from('color = "normal"') };
  await change(() => page.locator('#scene-file').setInputFiles(file));
  assert.equal(await color(), 'normal');
  await change(() => undo().click());
  assert.equal(await color(), 'elevation');
  await change(() => undo().click());
  assert.equal(await color(), first);
  await change(() => redo().click());
  await change(() => redo().click());
  assert.equal(await color(), 'normal');
});

test('a refused value leaves no state behind', async () => {
  const filter = page.locator('#panel [data-key=filter]');
  await filter.fill('no_such_column == 1');
  await filter.press('Enter');
  await page.locator('.toast').waitFor();
  const first = await color();
  await change(() => colorField().selectOption('elevation'));
  await change(() => undo().click());
  assert.equal(await color(), first);
  assert.ok(await undo().isDisabled());
});

test('zoom ends at a nearest and a farthest place, and Home returns', async () => {
  const bounds = (await state(page, 'info')).bounds;
  const diagonal = distance(bounds.min, bounds.max);
  const { x, y } = await pixelAt(page, 0.5, 0.6);
  await page.mouse.move(x, y);
  for (const [delta, n] of [[-240, 150], [240, 300]]) {
    for (let i = 0; i < n; i++) await page.mouse.wheel(0, delta);
    await settled(page);
    const camera = await state(page, 'camera');
    const range = distance(camera.position, camera.focal_point);
    assert.ok(1e-5 * diagonal <= range, `${range} is too near`);
    const farthest = distance(camera.position, mix(bounds.min, bounds.max, 0.5));
    assert.ok(farthest <= 50 * diagonal, `${farthest} is too far`);
  }
  await page.locator('[data-action=home]').click();
  await settled(page);
  assert.deepEqual(await state(page, 'camera'), opening);
});

test('letters act on the picture, not while a control has the focus', async () => {
  await page.locator('#panel [data-key="sun.azimuth"]').focus();
  const before = await state(page, 'camera');
  await page.keyboard.press('1');
  await page.keyboard.press('o');
  await page.waitForTimeout(300);
  assert.deepEqual(await state(page, 'camera'), before);
  await page.locator('#viewport').focus();
  await page.keyboard.press('o');
  await settled(page);
  assert.ok((await state(page, 'camera')).orthographic);
});
