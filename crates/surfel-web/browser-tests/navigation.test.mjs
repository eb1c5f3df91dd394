// Navigation: mouse, touch and keys do what the help says.

import assert from 'node:assert/strict';
import { after, before, beforeEach, test } from 'node:test';
import * as cameras from '../page/camera.js';
import { distance, dot } from '../page/vector.js';
import { closePage, drag, finishedPixels, openPage, pixels, pixelAt, QUICK, reopen, serve, settled, state, unfoldPanel } from './harness.mjs';

let server;
let page;
let first;
let opening;
before(async () => {
  server = await serve(['town.ply'], ...QUICK);
  // Wide enough to click next to the card.
  page = await openPage(server.link, { viewport: { width: 1100, height: 440 } });
  await unfoldPanel(page);
  first = await finishedPixels(page);
  opening = await state(page, 'camera');
});
beforeEach(async () => {
  await reopen(page);
  await unfoldPanel(page);
  await page.locator('#viewport').focus();
});
after(() => closePage(page));

const { axesOf, focalDistance, isOrthographic } = cameras;
const isNear = (a, b, tolerance, what) => assert.ok(distance(a, b) <= tolerance, `${what}: ${a} and ${b}`);

/** Waits for a finished picture, which differs from the first one; returns its camera. */
async function movedCamera() {
  assert.notEqual(await finishedPixels(page), first);
  return state(page, 'camera');
}

/** Waits until the camera differs from this one. */
const cameraChange = (camera) => page.waitForFunction(
  (before) => JSON.stringify(window.surfel.state.camera) !== before, JSON.stringify(camera));

/** Converts a position in the window to pixels of the picture. */
async function inPicture({ x, y }) {
  const viewport = await page.locator('#viewport').boundingBox();
  return { x: x - viewport.x, y: y - viewport.y };
}

test('dragging with the left button orbits about the pivot', async () => {
  await drag(page, await pixelAt(page, 0.5, 0.5), await pixelAt(page, 0.7, 0.6));
  const camera = await movedCamera();
  isNear(camera.focal_point, opening.focal_point, 1e-6, 'pivot');
  assert.ok(Math.abs(focalDistance(camera) - focalDistance(opening)) < 1e-6);
  assert.ok(Math.abs(dot(axesOf(camera).right, [0, 0, 1])) < 1e-9, 'the horizon is level');
  // Dragging down raises the camera.
  assert.ok(opening.position[2] < camera.position[2]);
});

for (const [name, button, key] of [['right', 'right'], ['middle', 'middle'], ['left with shift', 'left', 'Shift']]) {
  test(`dragging with the ${name} button pans`, async () => {
    const [from, to] = [await pixelAt(page, 0.5, 0.5), await pixelAt(page, 0.6, 0.4)];
    if (key) await page.keyboard.down(key);
    await drag(page, from, to, { button });
    if (key) await page.keyboard.up(key);
    const camera = await movedCamera();
    isNear(axesOf(camera).forward, axesOf(opening).forward, 1e-9, 'direction');
    const [size, start] = [await state(page, 'size'), await inPicture(from)];
    const grabbed = cameras.pointAtDepth(opening, size, start.x, start.y, focalDistance(opening));
    const pixel = cameras.project(camera, size, grabbed);
    const end = await inPicture(to);
    assert.ok(Math.hypot(pixel.x - end.x, pixel.y - end.y) < 1, `${pixel.x}, ${pixel.y}`);
  });
}

/** The position of the point that Alt + click picks. */
async function pick(pixel) {
  await page.keyboard.down('Alt');
  await page.mouse.click(pixel.x, pixel.y);
  await page.keyboard.up('Alt');
  const values = page.locator('#pick-card dd span');
  await values.first().waitFor();
  return (await values.allTextContents()).slice(0, 3).map(Number);
}

/** Freezes the time of events, so that a slow machine does not split a wheel movement or a double click. */
const stopClock = () => page.evaluate(() => {
  const now = performance.now();
  Object.defineProperty(Event.prototype, 'timeStamp', { get: () => now });
});

for (const projection of ['perspective', 'orthographic']) {
  test(`the wheel zooms toward the point under the pointer (${projection})`, async () => {
    await page.selectOption('[data-key="camera.projection"]', projection);
    await settled(page);
    const pixel = await pixelAt(page, 0.65, 0.6);
    const [start, point] = [await state(page, 'camera'), await pick(pixel)];
    // The point under the mouse has been asked for as well.
    await page.locator('#cursor:not(:empty)').waitFor();
    const n_answered = await page.evaluate(() => window.picks.n_answered);
    await stopClock();
    await page.mouse.wheel(0, -100);
    await page.waitForFunction((before) => before < window.picks.n_answered, n_answered);
    await settled(page);
    const [size, between] = [await state(page, 'size'), await state(page, 'camera')];
    const before = cameras.project(between, size, point);
    for (let i = 0; i < 3; i++) await page.mouse.wheel(0, -100);
    const camera = await movedCamera();
    const after = cameras.project(camera, size, point);
    assert.ok(Math.hypot(after.x - before.x, after.y - before.y) < 6, `${JSON.stringify([before, after])}`);
    if (projection === 'orthographic') assert.ok(camera.orthographic < 0.7 * start.orthographic);
    else assert.ok(focalDistance(camera) < 0.7 * focalDistance(start));
  });
}

test('a double click sets the pivot', async () => {
  const pixel = await pixelAt(page, 0.7, 0.6);
  const point = await pick(pixel);
  await stopClock();
  await page.mouse.dblclick(pixel.x, pixel.y);
  await cameraChange(opening);
  const camera = await movedCamera();
  isNear(camera.focal_point, point, 0.3, 'pivot');
  isNear(axesOf(camera).forward, axesOf(opening).forward, 1e-9, 'direction');
});

for (const [key, axis, sign] of [['w', 'forward', 1], ['s', 'forward', -1], ['a', 'right', -1], ['d', 'right', 1], ['q', 'up', -1], ['e', 'up', 1]]) {
  test(`${key} flies ${0 < sign ? '' : 'against '}${axis}`, async () => {
    await page.keyboard.down(key);
    await cameraChange(opening);
    await cameraChange(await state(page, 'camera'));
    await page.keyboard.up(key);
    const camera = await movedCamera();
    const offset = camera.position.map((value, i) => value - opening.position[i]);
    const along = sign * dot(offset, axesOf(opening)[axis]);
    assert.ok(0 < along && Math.abs(along - Math.hypot(...offset)) < 1e-6, `${offset}`);
  });
}

for (const [key, factor] of [['+', 0.8], ['=', 0.8], ['-', 1.25]]) {
  test(`${key} zooms`, async () => {
    await page.keyboard.press(key);
    const camera = await movedCamera();
    assert.ok(Math.abs(focalDistance(camera) / focalDistance(opening) - factor) < 1e-9);
    isNear(camera.focal_point, opening.focal_point, 1e-6, 'pivot');
  });
}

const SIDES = { front: [0, 1, 0], back: [0, -1, 0], left: [1, 0, 0], right: [-1, 0, 0], top: [0, 0, -1], bottom: [0, 0, 1] };

test('1 to 6 and the buttons show the six sides', async () => {
  const pictures = new Set();
  for (const [i, [side, forward]] of Object.entries(SIDES).entries()) {
    await page.locator('#viewport').focus();
    await page.keyboard.press(String(i + 1));
    const camera = await movedCamera();
    isNear(axesOf(camera).forward, forward, 1e-6, side);
    const picture = await pixels(page);
    pictures.add(picture);
    await page.keyboard.press('ArrowLeft');
    await page.locator(`[data-side="${side}"]`).click();
    assert.equal(await finishedPixels(page), picture, side);
  }
  assert.equal(pictures.size, 6);
});

test('transitions end at their target', async () => {
  await page.emulateMedia({ reducedMotion: 'no-preference' });
  await page.keyboard.press('5');
  await page.waitForFunction(() => window.surfel.state.camera.view_up[2] < 0.5);
  isNear(axesOf(await movedCamera()).forward, SIDES.top, 1e-6, 'direction');
  await page.emulateMedia({ reducedMotion: 'reduce' });
});

test('F fits the scene to the view', async () => {
  for (let i = 0; i < 6; i++) await page.keyboard.press('+');
  await page.keyboard.press('f');
  await settled(page);
  const [camera, size, { bounds }] = [await state(page, 'camera'), await state(page, 'size'), await state(page, 'info')];
  const places = cameras.cornersOf(bounds).map((corner) => cameras.project(camera, size, corner));
  assert.ok(places.every(({ x, y }) => 0 <= x && x <= size.width && 0 <= y && y <= size.height), JSON.stringify(places));
  const span = Math.max(...['x', 'y'].map((axis, i) => {
    const values = places.map((pixel) => pixel[axis]);
    return (Math.max(...values) - Math.min(...values)) / [size.width, size.height][i];
  }));
  assert.ok(0.7 < span, `${span} of the picture`);
});

test('O and P keep the size at the pivot', async () => {
  await page.keyboard.press('o');
  const flat = await movedCamera();
  const size = await state(page, 'size');
  const pixelSize = (camera) => cameras.pixelSizeAt(camera, size, focalDistance(camera));
  assert.ok(isOrthographic(flat) && Math.abs(pixelSize(flat) / pixelSize(opening) - 1) < 1e-6);
  await page.keyboard.press('p');
  assert.equal(await finishedPixels(page), first);
  await page.locator('[data-action="projection"]').click();
  assert.ok(isOrthographic(await movedCamera()));
});

for (const [key, axis, sign] of [['ArrowLeft', 'right', -1], ['ArrowRight', 'right', 1], ['ArrowUp', 'up', 1], ['ArrowDown', 'up', -1]]) {
  test(`${key} orbits about the pivot`, async () => {
    await page.keyboard.press(key);
    const camera = await movedCamera();
    const offset = camera.position.map((value, i) => value - opening.position[i]);
    assert.ok(0 < sign * dot(offset, axesOf(opening)[axis]), `${offset}`);
    assert.ok(Math.abs(focalDistance(camera) - focalDistance(opening)) < 1e-6);
  });
}

test('letters choose colours, but not while a field has the focus', async () => {
  for (const [key, color] of [['z', 'elevation'], ['i', 'intensity'], ['c', 'class'], ['r', 'rgb']]) {
    await page.keyboard.press(key);
    await page.waitForFunction((wanted) => window.surfel.state.scene.color === wanted, color);
  }
  assert.equal(await finishedPixels(page), first);
  await page.locator('[data-number="spp"]').focus();
  await page.keyboard.press('ArrowLeft');
  await page.keyboard.press('f');
  assert.deepEqual(await state(page, 'camera'), opening);
});

test('the angle of view keeps the pivot', async () => {
  await page.locator('[data-number="camera.view_angle"]').fill('70');
  await page.keyboard.press('Enter');
  const camera = await movedCamera();
  assert.equal(camera.view_angle, 70);
  isNear(camera.focal_point, opening.focal_point, 1e-6, 'pivot');
  assert.ok(focalDistance(camera) < focalDistance(opening));
});

test('the trackball may tilt the horizon', async () => {
  await page.locator('[data-key="camera.trackball"]').setChecked(true);
  for (const [from, to] of [[[0.5, 0.4], [0.7, 0.6]], [[0.5, 0.4], [0.5, 0.7]], [[0.4, 0.5], [0.8, 0.5]]]) {
    await drag(page, await pixelAt(page, ...from), await pixelAt(page, ...to));
  }
  assert.ok(0.01 < Math.abs(dot(axesOf(await movedCamera()).right, [0, 0, 1])));
});

test('the turntable turns until it is stopped', async () => {
  const button = page.locator('[data-action="turntable"]');
  await button.click();
  await cameraChange(opening);
  assert.equal(await button.textContent(), 'Stop');
  const { frame } = await state(page, 'lastFrame');
  await page.waitForFunction((shown) => shown + 2 < window.surfel.state.lastFrame.frame, frame);
  await page.locator('#viewport').focus();
  await page.keyboard.press('Escape');
  const camera = await movedCamera();
  assert.equal(await button.textContent(), 'Turn');
  assert.ok(Math.abs(camera.position[2] - opening.position[2]) < 1e-6);
});

/** Touches the screen with fingers, by the browser's debugging protocol. */
async function touch(touched, ...steps) {
  const session = await touched.context().newCDPSession(touched);
  for (const [i, fingers] of steps.entries()) {
    const touchPoints = fingers.map(({ x, y }, id) => ({ x, y, id }));
    await session.send('Input.dispatchTouchEvent', { type: i ? 'touchMove' : 'touchStart', touchPoints });
  }
  await session.send('Input.dispatchTouchEvent', { type: 'touchEnd', touchPoints: [] });
  await settled(touched);
  return state(touched, 'camera');
}

test('one finger orbits, two fingers pan and zoom', async () => {
  const phone = await openPage(server.link, { viewport: { width: 390, height: 700 }, hasTouch: true, isMobile: true });
  const start = await state(phone, 'camera');
  const pixel = (across, along) => pixelAt(phone, across, along);
  const turned = await touch(phone, [await pixel(0.5, 0.5)], [await pixel(0.6, 0.5)], [await pixel(0.7, 0.5)]);
  assert.ok(Math.abs(focalDistance(turned) - focalDistance(start)) < 1e-6);
  assert.ok(1 < distance(turned.position, start.position));
  const near = await touch(phone, [await pixel(0.4, 0.5), await pixel(0.6, 0.5)], [await pixel(0.3, 0.5), await pixel(0.7, 0.5)], [await pixel(0.2, 0.5), await pixel(0.8, 0.5)]);
  assert.ok(Math.abs(focalDistance(near) / focalDistance(turned) - 1 / 3) < 0.05, 'three times as near');
  isNear(axesOf(near).forward, axesOf(turned).forward, 1e-6, 'direction');
  const panned = await touch(phone, [await pixel(0.4, 0.5), await pixel(0.6, 0.5)], [await pixel(0.4, 0.6), await pixel(0.6, 0.6)], [await pixel(0.4, 0.7), await pixel(0.6, 0.7)]);
  assert.ok(Math.abs(focalDistance(panned) / focalDistance(near) - 1) < 0.05);
  assert.ok(0 < dot(panned.position.map((value, i) => value - near.position[i]), axesOf(near).up));
  await closePage(phone);
});

test('the axis cube turns the view to a side, by the mouse and by keys, and is hidden in panoramas', async () => {
  await page.locator('[data-cube-side="top"] polygon').click();
  isNear(axesOf(await movedCamera()).forward, [0, 0, -1], 1e-6, 'from the top');
  await page.locator('[data-cube-side="front"]').focus();
  await page.keyboard.press('ArrowRight');
  await page.keyboard.press('ArrowRight');
  assert.equal(await page.evaluate(() => document.activeElement.dataset.cubeSide), 'left');
  await page.keyboard.press('Enter');
  isNear(axesOf(await movedCamera()).forward, [1, 0, 0], 1e-6, 'from the left');
  assert.deepEqual(await page.locator('#axis-cube .is-facing').evaluateAll((sides) => sides.map((side) => side.dataset.cubeSide)), ['left']);
  const other = await openPage((await serve(['town.ply'], ...QUICK, '--camera-panorama')).link);
  assert.ok(await other.locator('#axis-cube').isHidden());
  await closePage(other);
});

test('one tool of the toolbar is reached by Tab, the others by arrows', async () => {
  const label = () => page.evaluate(() => document.activeElement.ariaLabel);
  await page.locator('#viewport').focus();
  await page.keyboard.press('Tab');
  assert.equal(await label(), 'Pick point');
  await page.keyboard.press('ArrowDown');
  assert.equal(await label(), 'Measure distance');
  await page.keyboard.press('End');
  assert.equal(await label(), 'Controls');
  await page.keyboard.press('ArrowRight');
  assert.equal(await label(), 'Pick point');
  await page.keyboard.press('ArrowLeft');
  assert.equal(await label(), 'Controls');
  assert.deepEqual(await page.locator('#toolbar [tabindex="0"]').evaluateAll((all) => all.map((one) => one.ariaLabel)), ['Controls']);
  // What is disabled is passed over.
  for (let i = 0; i < 6; i++) await page.keyboard.press('ArrowUp');
  assert.equal(await label(), 'View at the start');
  await page.keyboard.press('ArrowUp');
  assert.equal(await label(), 'Annotate a point');
  assert.deepEqual(await state(page, 'camera'), opening);
});
