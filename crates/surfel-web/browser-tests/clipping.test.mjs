// Clipping on the picture: handles move the faces of the box and the plane.

import assert from 'node:assert/strict';
import { after, before, beforeEach, test } from 'node:test';
import { cornersOf, project } from '../page/camera.js';
import * as clip from '../page/clip.js';
import { addScaled, dot, mix } from '../page/vector.js';
import { closePage, drag, finishedPixels, openPage, QUICK, serve, settled, show, state } from './harness.mjs';

const BOX = { min: [562322, 4183193, 145], max: [562345, 4183216, 155] };
const PLANES = { 'level plane': [562334, 4183205, 149, 0, 0, 1], 'slanting plane': [562334, 4183205, 149, 0.6, 0, 0.8] };
/** Length of a drag in world units; a pixel is smaller than `TOLERANCE`. */
const DRAG_LENGTH = 2;
const TOLERANCE = 0.1;

let page;
before(async () => {
  const server = await serve(['town.ply', 'house.obj'], ...QUICK);
  page = await openPage(server.link, { viewport: { width: 1200, height: 640 } });
});
beforeEach(() => show(page, {}));
after(() => closePage(page));

const handle = (name) => page.locator(`[data-handle="${name}"]`);

async function middleOf(locator) {
  const { x, y, width, height } = await locator.boundingBox();
  return { x: x + width / 2, y: y + height / 2 };
}

/** Position of a point of the world in the window. */
async function inWindow(point) {
  const [viewport, pixel] = [await page.locator('#viewport').boundingBox(), project(await state(page, 'camera'), await state(page, 'size'), point)];
  return { x: viewport.x + pixel.x, y: viewport.y + pixel.y };
}

/** Drags a handle to a point of the world; checks that picture and handle follow, and that the camera does not. */
async function dragHandle(name, target) {
  const [before, camera] = [await finishedPixels(page), await state(page, 'camera')];
  const end = await inWindow(target);
  await drag(page, await middleOf(handle(name)), end, { steps: 3 });
  assert.notEqual(await finishedPixels(page), before);
  assert.deepEqual(await state(page, 'camera'), camera);
  const found = await middleOf(handle(name));
  assert.ok(Math.hypot(found.x - end.x, found.y - end.y) < 2, `${name}: ${JSON.stringify([found, end])}`);
}

for (const { axis, end, middle, direction } of clip.facesOf(BOX)) {
  test(`the box's face at the ${end} of ${'xyz'[axis]} is dragged`, async () => {
    await show(page, { clip_box: clip.formatBox(BOX) });
    const target = addScaled(middle, direction, -DRAG_LENGTH);
    await dragHandle(`box ${axis} ${end}`, target);
    const found = clip.parseBox((await state(page, 'scene')).clip_box);
    assert.ok(Math.abs(found[end][axis] - target[axis]) < TOLERANCE, `${found[end][axis]}, not ${target[axis]}`);
    assert.deepEqual(clip.withFace(found, { axis, end }, middle[axis]), BOX, 'the other faces stay');
  });
}

for (const [name, plane] of Object.entries(PLANES)) {
  test(`a ${name} is dragged along its normal`, async () => {
    await show(page, { clip_plane: plane });
    const { bounds } = await state(page, 'info');
    const start = clip.parsePlane(plane);
    const position = clip.positionOf(start, bounds) + DRAG_LENGTH;
    await dragHandle('plane', clip.planeAt(start, bounds, position).point);
    const found = clip.parsePlane((await state(page, 'scene')).clip_plane);
    assert.ok(Math.abs(clip.positionOf(found, bounds) - position) < TOLERANCE, `${found.point}`);
    assert.ok(1 - 1e-9 < dot(found.normal, start.normal), `${found.normal}`);
  });
}

test('pictures follow while a handle is dragged', async () => {
  await show(page, { clip_box: clip.formatBox(BOX) });
  const [from, { seq }] = [await middleOf(handle('box 0 max')), await state(page, 'lastFrame')];
  await page.mouse.move(from.x, from.y);
  await page.mouse.down();
  await page.mouse.move(from.x - 40, from.y);
  await page.waitForFunction((before) => before < window.surfel.state.lastFrame.seq, seq);
  assert.notEqual((await state(page, 'scene')).clip_box, clip.formatBox(BOX));
  await page.mouse.up();
  await settled(page);
});

test('edges are curved in a panorama', async () => {
  const position = [562334, 4183203, 152];
  await show(page, { clip_box: clip.formatBox(BOX), camera: { panorama: true, view_angle: null, position, focal_point: [562334, 4183213, 152] } });
  const [camera, size, corners] = [await state(page, 'camera'), await state(page, 'size'), cornersOf(BOX)];
  const lines = await page.locator('.clip-edge').evaluateAll((all) =>
    all.map(({ x1, y1, x2, y2 }) => [x1, y1, x2, y2].map(({ baseVal }) => baseVal.value)));
  assert.deepEqual(lines.filter(([x1, , x2]) => size.width / 4 < Math.abs(x1 - x2)), [], 'no edge crosses the whole picture');
  for (const [a, b] of [[0, 1], [2, 3], [4, 5], [6, 7], [5, 7], [1, 5]]) {
    for (const fraction of [0.1, 0.25, 0.4, 0.75]) {
      const { x, y } = project(camera, size, mix(corners[a], corners[b], fraction));
      const off = Math.min(...lines.map(([x1, y1, x2, y2]) => distanceToLine(x, y, x1, y1, x2, y2)));
      assert.ok(off < 1, `${off} pixels off the edge from ${a} to ${b}`);
    }
  }
});

function distanceToLine(x, y, x1, y1, x2, y2) {
  const along = ((x - x1) * (x2 - x1) + (y - y1) * (y2 - y1)) / ((x2 - x1) ** 2 + (y2 - y1) ** 2);
  const fraction = Math.min(1, Math.max(0, along));
  return Math.hypot(x - x1 - fraction * (x2 - x1), y - y1 - fraction * (y2 - y1));
}
