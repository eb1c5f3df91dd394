// The panel: each control changes the picture and the scene, and can be reset.

import assert from 'node:assert/strict';
import { after, before, beforeEach, test } from 'node:test';
import * as tables from '../page/controls.js';
import { valueAt } from '../page/merge-patch.js';
import { objectControls } from '../page/object-controls.js';
import {
  closePage, drag, finishedPixels, openPage, pixels, pixelAt, QUICK, reopen, serve, settled, state, unfoldPanel, recordPictures,
} from './harness.mjs';

const { surfaceControls, colorControls, pointControls, sunControls, skyControls, pictureControls, annotationControls, clipControls } = tables;
const FILES = ['house.obj', 'town.ply'];
const OBJECTS = [{ name: 'house.obj', kind: 'triangles', visible: true }, { name: 'town.ply', kind: 'points', visible: true }];
const CONTROLS = [surfaceControls, colorControls, pointControls, sunControls, skyControls, pictureControls, annotationControls, clipControls,
  ...OBJECTS.map(objectControls)].flat();

const BY_ELEVATION = [['color', 'elevation']];
const IN_BOX = [['clip_box', true]];
const ON_PLANE = [['clip_plane', true]];
const GLASS = [['material.house.obj', 'glass']];

// The value that each control is set to, after the controls in `given`; `unseen` is the reason why the picture stays the same.
const CASES = {
  surface: { value: 'sphere' },
  radius_scale: { value: 2 },
  reach: { given: [['surface', 'cylinder']], value: 2 },
  density: { given: [['surface', 'cylinder']], value: 16 },
  degree: { given: [['surface', 'mls']], value: 1 },
  align: { given: [['surface', 'splat']], value: 'each', unseen: 'all normals point to the camera' },
  gather_limit: { given: [['surface', 'splat']], value: 'nearest', unseen: 'neighbouring discs have about one radius' },
  min_distance: { value: 0 },
  edge_test: { value: 'off' },
  octree_depth: { given: [['surface', 'octree']], value: '3' },
  color: { value: 'intensity' },
  cmap: { given: BY_ELEVATION, value: 'magma' },
  range: { given: BY_ELEVATION, value: [147, 152.5] },
  gamma: { value: 2 },
  filter: { value: 'z > 149' },
  class: { value: [2] },
  'light.sun': { value: false },
  'sun.azimuth': { value: 30 },
  'sun.elevation': { value: 75.5 },
  'sun.angle': { value: 15 },
  'sun.strength': { value: 2 },
  'light.sky': { value: false },
  'sky.strength': { value: 2 },
  'sky.ao_distance': { value: 0.5 },
  'light.headlight': { value: true },
  exposure: { value: 1 },
  background: { value: 'transparent' },
  'background.top': { given: [['background', 'colors']], value: '#102030' },
  'background.bottom': { given: [['background', 'colors']], value: '#a08010' },
  legend: { given: BY_ELEVATION, value: true },
  caption: { value: 'The town' },
  spp: { value: 3 },
  light_samples: { value: 5 },
  max_depth: { given: [['material.house.obj', 'mirror']], value: 0 },
  clip_box: { value: true, unseen: 'the initial box contains the whole scene' },
  'clip_box.x': { given: IN_BOX, value: [562320, 562335] },
  'clip_box.y': { given: IN_BOX, value: [4183190, 4183205] },
  'clip_box.z': { given: IN_BOX, value: [148, 152] },
  clip_plane: { value: true },
  'clip_plane.axis': { given: ON_PLANE, value: 'x' },
  'clip_plane.normal': { given: [...ON_PLANE, ['clip_plane.axis', 'free']], value: [0, 0.6, 0.8] },
  'clip_plane.position': { given: ON_PLANE, value: -1 },
  'clip_plane.flip': { given: ON_PLANE },
  'object.house.obj.label': { value: 'The house', unseen: 'a label names a row' },
  'object.town.ply.label': { value: 'The town', unseen: 'a label names a row' },
  'object.house.obj.visible': { value: false },
  'object.town.ply.visible': { value: false },
  'object.town.ply.color': { value: 'class' },
  'material.town.ply': { value: 'metal' },
  'material.town.ply.color': { given: [['material.town.ply', 'matte']], value: '#3060a0' },
  'material.town.ply.roughness': { given: [['material.town.ply', 'metal']], value: 0.7 },
  'material.town.ply.ior': { given: [['material.town.ply', 'glass']], value: 1.2 },
  'material.town.ply.emissive_strength': { given: [['material.town.ply', 'emissive']], value: 3 },
  'material.house.obj': { value: 'mirror' },
  'material.house.obj.color': { given: GLASS, value: '#a03060' },
  'material.house.obj.roughness': { given: GLASS, value: 0.4 },
  'material.house.obj.ior': { given: GLASS, value: 1.3 },
  'material.house.obj.emissive_strength': { given: [['material.house.obj', 'emissive']], value: 2 },
};

// Controls of other scenes have tests of their own.
const FOR_OTHERS = ['point_size', 'returns', 'scale_bar', 'north'];

let page;
let first;
before(async () => {
  const server = await serve(FILES, ...QUICK);
  page = await openPage(server.link);
  await unfoldPanel(page);
  first = await finishedPixels(page);
});
beforeEach(async () => {
  if (await pixels(page) === first && (await state(page, 'lastFrame')).seq === await state(page, 'lastSeq')) return;
  // The test before this one failed, or its last message has no picture.
  await reopen(page);
  await unfoldPanel(page);
});
after(() => closePage(page));

const controlOf = (key) => CONTROLS.find((control) => control.key === key);
const field = (key) => page.locator(`[data-key="${key}"]`);

/** Sets a control as a user does, by its kind. */
const setters = {
  select: (key, value) => field(key).selectOption(value),
  toggle: (key, value) => field(key).setChecked(value),
  color: (key, value) => field(key).fill(value),
  button: (key) => field(key).click(),
  async text(key, value) {
    await field(key).fill(value);
    await field(key).press('Enter');
  },
  async checklist(key, values) {
    const { class: classes = [2, 6] } = await state(page, 'scene');
    for (const value of new Set([...values, ...classes])) await field(`${key}.${value}`).setChecked(values.includes(value));
  },
  async slider(key, value) {
    const number = page.locator(`[data-number="${key}"]`);
    await number.fill(String(value));
    await number.blur();
  },
  async numbers(key, values) {
    for (const [i, value] of values.entries()) {
      await field(`${key}.${i}`).fill(String(value));
      await field(`${key}.${i}`).blur();
    }
  },
};

async function setControl(key, value) {
  await setters[controlOf(key).kind](key, value);
  await settled(page);
}

/** Resets a control that has a reset button; others are reset with the controls in `given`. */
async function resetControl(key) {
  const button = page.locator(`[data-reset="${key}"]`);
  if (await button.isVisible()) await button.click();
  await settled(page);
}

/** The value of a control in the scene. */
async function sceneValue({ key, read }) {
  const [scene, info] = [await state(page, 'scene'), await state(page, 'info')];
  return read ? read(scene, { scene, info, legend: null }) : valueAt(scene, key);
}

/** Rounds numbers: a clip plane's normal and position are computed from its point. */
const rounded = (value) => JSON.parse(JSON.stringify(value), (_, part) => (typeof part === 'number' ? Number(part.toPrecision(6)) : part));

test('each control has a case', async () => {
  const { objects } = await state(page, 'info');
  assert.deepEqual(objects.map(({ name }) => name), FILES);
  assert.deepEqual([...Object.keys(CASES), ...FOR_OTHERS].sort(), CONTROLS.map(({ key }) => key).sort());
});

test('the size of points is chosen, and can be changed and chosen again', async () => {
  const other = await openPage((await serve(['town.ply'], ...QUICK)).link);
  await unfoldPanel(other);
  assert.ok(await other.locator('[data-number="point_size"]').isHidden());
  await other.locator('[data-key="surface"]').selectOption('points');
  await settled(other);
  const start = await finishedPixels(other);
  const { point_size: chosen } = await state(other, 'scene');
  assert.ok(1 <= chosen && chosen <= 8, `${chosen}`);
  const number = other.locator('[data-number="point_size"]');
  await number.fill('12');
  await number.blur();
  await settled(other);
  assert.equal((await state(other, 'scene')).point_size, 12);
  assert.notEqual(await finishedPixels(other), start);
  await other.locator('[data-automatic="point_size"]').click();
  await settled(other);
  assert.equal((await state(other, 'scene')).point_size, chosen);
  assert.equal(await finishedPixels(other), start);
  await closePage(other);
});

for (const control of CONTROLS.filter(({ key }) => !FOR_OTHERS.includes(key))) {
  const { given = [], value, unseen } = CASES[control.key];
  test(`${control.key} changes the picture`, async () => {
    for (const [key, needed] of given) await setControl(key, needed);
    const start = await finishedPixels(page);
    await setControl(control.key, value);
    const changed = await finishedPixels(page);
    if (unseen) assert.equal(changed, start, unseen);
    else assert.notEqual(changed, start);
    if (value !== undefined) assert.deepEqual(rounded(await sceneValue(control)), rounded(value));
    if (value !== undefined) await resetControl(control.key);
    for (const [key] of given.toReversed()) await resetControl(key);
    assert.equal(await finishedPixels(page), first, 'the controls are reset');
  });
}

test('each surface, colour and material gives another picture', async () => {
  const { surfaces, colors, materials } = await state(page, 'info');
  // `points` does not work with meshes. As all normals point to the camera, `splat` equals `splat-mean`.
  const traced = surfaces.filter((surface) => surface !== 'points' && surface !== 'splat-mean');
  for (const [key, choices] of [['surface', traced], ['color', colors], ['material.house.obj', materials]]) {
    const pictures = [];
    for (const choice of choices) {
      await setControl(key, choice);
      pictures.push(await finishedPixels(page));
    }
    await resetControl(key);
    assert.equal(new Set(pictures).size, choices.length, `${key}: ${choices}`);
  }
});

test('a setting that cannot be rendered is rejected and reverted', async () => {
  await setters.select('surface', 'points');
  await page.locator('.toast', { hasText: 'points for all of the scene' }).waitFor();
  await page.waitForFunction(() => window.surfel.state.scene.surface === 'smooth');
  await field('light.sky').click();
  assert.notEqual(await finishedPixels(page), first);
  await resetControl('light.sky');
});

test('automatic values can be restored', async () => {
  for (const [key, value] of [['exposure', 2], ['sky.ao_distance', 3]]) {
    const chosen = valueAt(await state(page, 'scene'), key);
    await setControl(key, value);
    await page.locator(`[data-automatic="${key}"]`).click();
    assert.equal(await finishedPixels(page), first, key);
    await page.waitForFunction(([name, wanted]) => name.split('.').reduce((scene, word) => scene[word], window.surfel.state.scene) === wanted, [key, chosen]);
  }
});

test('dragging a slider changes the value', async () => {
  const slider = field('sun.azimuth');
  await slider.scrollIntoViewIfNeeded();
  const box = await slider.boundingBox();
  const pixelOf = (fraction) => [box.x + fraction * box.width, box.y + box.height / 2];
  const { seq } = await state(page, 'lastFrame');
  await page.mouse.move(...pixelOf(0.3));
  await page.mouse.down();
  for (const fraction of [0.4, 0.5, 0.6, 0.7, 0.75]) await page.mouse.move(...pixelOf(fraction));
  await page.waitForFunction((before) => before < window.surfel.state.lastFrame.seq, seq);
  await page.mouse.up();
  assert.notEqual(await finishedPixels(page), first);
  const { azimuth } = (await state(page, 'scene')).sun;
  assert.ok(Math.abs(azimuth - 270) < 30, `${azimuth}`);
  await resetControl('sun.azimuth');
});

test('the sun has the position of date and hour', async () => {
  await page.fill('#sun-day', '2024-06-20');
  await page.fill('#sun-latitude', '50');
  await page.locator('#sun-latitude').blur();
  await page.locator('#sun-hour').fill('12');
  assert.notEqual(await finishedPixels(page), first);
  const { azimuth, elevation } = (await state(page, 'scene')).sun;
  assert.ok(Math.abs(azimuth - 180) < 5 && Math.abs(elevation - 63.4) < 0.3, `${azimuth} ${elevation}`);
  for (const key of ['sun.azimuth', 'sun.elevation']) await resetControl(key);
  assert.equal(await finishedPixels(page), first);
});

test('a rejected value is reverted, and the reason is shown beside its control', async () => {
  const error = page.locator('[data-row="filter"] .row-error');
  await setters.text('filter', 'hight > 1');
  await error.waitFor();
  await page.waitForFunction(() => !window.surfel.state.scene.filter);
  assert.equal(await pixels(page), first);
  assert.match(await error.textContent(), /^(?!filter).*hight/);
  assert.equal(await page.locator('.row-error:visible').count(), 1);
  await setControl('filter', 'z > 149');
  assert.ok(await error.isHidden(), 'another value removes the error');
  await setControl('filter', '');
});

test('messages after a rejection are answered', async () => {
  const before = await state(page, 'scene');
  await setters.text('filter', 'hight > 1');
  await page.locator('[data-row="filter"] .row-error').waitFor();
  await page.waitForFunction(() => !window.surfel.state.scene.filter);
  assert.deepEqual(await state(page, 'scene'), before);
  const { lastSeq: rejectedSeq, latencies_ms, lastFrame } = await page.evaluate(() => window.surfel.state);
  assert.ok(lastFrame.seq < rejectedSeq, 'no picture has the rejected value');
  await recordPictures(page);
  const start_ms = await page.evaluate(() => performance.now());
  await setControl('sun.azimuth', 30);
  await drag(page, await pixelAt(page, 0.4, 0.5), await pixelAt(page, 0.6, 0.5));
  await settled(page);
  const after = await page.evaluate(() => window.surfel.state);
  assert.deepEqual([after.lastFrame.seq, after.scene.filter, after.scene.sun.azimuth], [after.lastSeq, before.filter, 30]);
  // One latency for each message that was answered, none for the rejected one.
  const answered = after.latencies_ms.slice(latencies_ms.length);
  assert.ok(2 <= answered.length && answered.length <= after.lastSeq - rejectedSeq, `${answered}`);
  const pictures = await page.evaluate(() => window.pictures);
  const answers = pictures.filter(({ seq }, i) => seq !== pictures[i - 1]?.seq);
  assert.equal(answered.length, answers.length);
  assert.ok(answered.every((latency_ms, i) => 0 < latency_ms && latency_ms <= answers[i].shownAt - start_ms), `${answered}`);
  await resetControl('sun.azimuth');
});

test('the legend shows the colours', async () => {
  await setControl('color', 'elevation');
  const ticks = await page.locator('.legend-tick').allTextContents();
  assert.ok(ticks.length >= 2 && ticks.every((tick) => 145 <= Number(tick) && Number(tick) <= 155), `${ticks}`);
  await setControl('color', 'class');
  assert.deepEqual(await page.locator('.legend-classes li').allTextContents(), ['2 ground', '6 building']);
  await resetControl('color');
  assert.ok(await page.locator('#legend').isHidden());
});

test('the classes of the legend hide and show their points', async () => {
  await setControl('color', 'class');
  const [ground, building] = ['2', '6'].map((number) => page.locator(`#legend [data-class="${number}"]`));
  const shown = await finishedPixels(page);
  await building.click();
  await page.waitForFunction(() => window.surfel.state.scene.class?.join() === '2');
  assert.notEqual(await finishedPixels(page), shown);
  assert.deepEqual([await building.getAttribute('aria-pressed'), await ground.isDisabled()], ['false', true]);
  assert.ok(!(await page.locator('[data-key="class.6"]').isChecked()), 'the list shows the same');
  await building.focus();
  await page.keyboard.press('Enter');
  await page.waitForFunction(() => !window.surfel.state.scene.class);
  assert.equal(await finishedPixels(page), shown);
  assert.equal(await page.evaluate(() => document.activeElement.dataset.class), '6');
  await resetControl('color');
});

test('numbers beyond their limits are rejected with the limits, others beyond the slider are taken', async () => {
  for (const [key, typed, reason] of [['spp', 5000, /at most 1024/], ['sun.elevation', 500, /from -90 to 90/], ['camera.view_angle', 175, /from 1 to 170/]]) {
    const number = page.locator(`[data-number="${key}"]`);
    const before = await number.inputValue();
    await number.fill(String(typed));
    await number.press('Enter');
    const error = page.locator(`[data-row="${key}"] .row-error`);
    await error.waitFor();
    assert.match(await error.textContent(), reason);
    await number.blur();
    await page.waitForFunction(([name, value]) => document.querySelector(`[data-number="${name}"]`).value === value, [key, before]);
  }
  const radius = page.locator('[data-number="radius_scale"]');
  await radius.fill('0.001');
  await radius.press('Enter');
  await page.waitForFunction(() => window.surfel.state.scene.radius_scale === 0.001);
  await resetControl('radius_scale');
});
