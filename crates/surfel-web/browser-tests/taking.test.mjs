// Taking it away: pictures, commands and scene files of the page are those of the command line, byte for byte.

import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { pointAtDepth, project } from '../page/camera.js';
import {
  closePage, colorCount, copyBy, data, drag, finishedPixels, openPage, PLAIN_HOST, placeAt, QUICK, serve, settled, shell, show, state,
} from './harness.mjs';

let still;
let moving;
let orbiting;
let passing;
before(async () => {
  const viewport = { width: 700, height: 300 };
  const open = async (...files) => openPage((await serve(files, ...QUICK)).link, { viewport });
  [still, moving] = [await open('town.ply', 'house.obj'), await open('moving.toml')];
  [orbiting, passing] = [await open('orbit.toml'), await open('past.gltf')];
});
after(async () => {
  await closePage(still);
  await closePage(moving);
  await closePage(orbiting);
  await closePage(passing);
});

const CENTER = [562334, 4183205, 149];
const VIEWS = {
  'as it opens': {},
  'colours by elevation in a range': { color: 'elevation', cmap: 'magma', range: [147, 152.5] },
  'a clip box': { clip_box: '([562320,562335.5],[4183190,4183210],[140,160])' },
  'a clip plane': { clip_plane: [562330, 4183200, 149, 0.6, 0, 0.8], radius_scale: 1.5 },
  'glass and metal': { material: ['house.obj=glass:ior=1.3,color=#88ccff', 'town.ply=metal:roughness=0.4'], max_depth: 5 },
  'an orthographic camera': { camera: { position: [562334, 4183150, 190], focal_point: CENTER, view_up: [0, 0, 1], view_angle: null, orthographic: 31.5 } },
  'a turned camera with other light': {
    camera: { position: [562380.5, 4183230.25, 170.125], focal_point: CENTER, view_angle: 50 },
    light: ['sun', 'headlight'], sun: { azimuth: 123.4, elevation: 20, angle: 5, strength: 1.5 }, exposure: 0.7,
  },
  'soft light on few discs': { surface: 'disc', select: 'random:8000', sky: { strength: 2, reach: 4 }, spp: 3, samples: 4, background: '#102030' },
};
const MOMENTS = {
  'the beginning': {},
  'a moment': { time: 0.7, color: 'intensity' },
  'the end, from elsewhere': { time: 2, camera: { position: [562380.5, 4183230.25, 170.125], focal_point: CENTER } },
};

const OF_ORBIT = {
  'where an orbit has the camera': { time: 1 },
  'where an orbit of another camera has it': { time: 1, camera: { position: [562380.5, 4183230.25, 170.125], focal_point: CENTER } },
  'a camera that an orbit leaves alone': { time: 1, camera: { position: [562380.5, 4183230.25, 170.125], focal_point: CENTER, still: true } },
};
const OF_FILE = {
  'where a file has its camera': { time: 1.5 },
  'elsewhere than a file has its camera': {
    time: 1.5, camera: { name: null, position: [2, -5, 3], focal_point: [0, 0, 1], view_up: [0, 0, 1], view_angle: 40, still: true },
  },
};

async function download(page, start) {
  const [file] = await Promise.all([page.waitForEvent('download'), start()]);
  return { name: file.suggestedFilename(), bytes: readFileSync(await file.path()) };
}

/** The PNG that the dialog saves, in the size of the window. */
async function saved(page) {
  await page.locator('[data-action="save"]').click();
  await page.locator('[data-preset="window"]').click();
  const { bytes } = await download(page, () => page.locator('#save-start').click());
  await page.locator('#save-note', { hasText: 'Saved.' }).waitFor();
  await page.locator('#save-cancel').click();
  return bytes;
}

/** What the dialog tells in each form. */
async function taken(page) {
  await page.locator('[data-action="take"]').click();
  await page.waitForFunction(() => document.getElementById('take-text').value.startsWith('surfel'));
  const texts = {};
  for (const form of ['command', 'toml', 'json', 'link']) {
    await page.locator(`[data-form="${form}"]`).click();
    texts[form] = await page.locator('#take-text').inputValue();
  }
  await page.locator('[data-form="command"]').click();
  await page.locator('#take-close').click();
  return texts;
}

/** The pictures that the copied command, TOML and JSON make. */
function rendered({ command, toml, json }) {
  writeFileSync(join(data.folder, 'taken.toml'), toml);
  writeFileSync(join(data.folder, 'taken.json'), json);
  const commands = { command, toml: 'surfel render taken.toml -o picture.png', json: 'surfel render taken.json -o picture.png' };
  const run = (line) => shell(`${line.replace(/-o picture.png$/, '-q -o -')}`);
  return Object.entries(commands).map(([form, line]) => [form, run(line)]);
}

const pagesOf = (page, views) => Object.entries(views).map((view) => [page, ...view]);
const pages = [
  ...pagesOf(() => still, VIEWS), ...pagesOf(() => moving, MOMENTS),
  ...pagesOf(() => orbiting, OF_ORBIT), ...pagesOf(() => passing, OF_FILE),
];

for (const [pageOf, name, patch] of pages) {
  test(`what is taken shows the same: ${name}`, async () => {
    const page = pageOf();
    await show(page, patch);
    const picture = await saved(page);
    const texts = await taken(page);
    for (const [form, bytes] of rendered(texts)) assert.ok(picture.equals(bytes), `${form}\n${texts.command}`);
    const screen = await finishedPixels(page);
    const other = await openPage(texts.link, { viewport: page.viewportSize() });
    assert.equal(await finishedPixels(other), screen, 'the link');
    await closePage(other);
  });
}

test('a panorama turns about its place, and what is taken of it shows the same', async () => {
  const place = '562334,4183203,152';
  const server = await serve(['town.ply', 'house.obj'], ...QUICK, '--camera-panorama', '--camera-position', place);
  const page = await openPage(server.link, { viewport: { width: 900, height: 340 } });
  assert.ok(await colorCount(page) > 100);
  const [first, opening, size] = [await finishedPixels(page), await state(page, 'camera'), await state(page, 'size')];
  assert.deepEqual([opening.panorama, opening.position], [true, place.split(',').map(Number)]);
  const [from, to] = [await placeAt(page, 0.4, 0.6), await placeAt(page, 0.7, 0.6)];
  await drag(page, from, to);
  assert.notEqual(await finishedPixels(page), first);
  const turned = await state(page, 'camera');
  assert.deepEqual([turned.panorama, turned.position, turned.view_up], [true, opening.position, opening.view_up]);
  // What was under the pointer went along.
  const stage = await page.locator('#stage').boundingBox();
  const end = project(turned, size, pointAtDepth(opening, size, from.x - stage.x, from.y - stage.y, 5));
  assert.ok(Math.hypot(end.x - (to.x - stage.x), end.y - (to.y - stage.y)) < 1, JSON.stringify(end));
  const picture = await saved(page);
  const texts = await taken(page);
  for (const [form, bytes] of rendered(texts)) assert.ok(picture.equals(bytes), `${form}\n${texts.command}`);
  await page.locator('#sections summary', { hasText: 'View' }).click();
  const projection = page.locator('[data-key="camera.projection"]');
  assert.equal(await projection.inputValue(), 'panorama');
  await projection.selectOption('perspective');
  await settled(page);
  assert.equal((await state(page, 'camera')).panorama, undefined);
  await closePage(page);
});

test('a saved picture has the size that was asked for', async () => {
  await still.locator('[data-action="save"]').click();
  await still.locator('[name="width"]').fill('123');
  await still.locator('[name="height"]').fill('77');
  const { name, bytes } = await download(still, () => still.locator('#save-start').click());
  assert.equal(name, 'town.png');
  assert.deepEqual([bytes.readUInt32BE(16), bytes.readUInt32BE(20)], [123, 77]);
  await still.locator('#save-cancel').click();
});

test('a save is cancelled, and too large a one refused', async () => {
  await still.locator('[data-action="save"]').click();
  await still.locator('[name="width"]').fill('8000');
  await still.locator('[name="height"]').fill('8000');
  await still.locator('#save-start').click();
  await still.locator('#save-note', { hasText: 'Rendering' }).waitFor();
  await still.locator('#save-cancel').click();
  await still.locator('#save-note', { hasText: 'Cancelled.' }).waitFor();
  await still.locator('[name="width"]').fill('20000');
  await still.locator('#save-start').click();
  await still.locator('#save-note', { hasText: 'up to 67 million pixels' }).waitFor();
  await still.locator('#save-cancel').click();
});

test('texts are copied and downloaded', async () => {
  await still.locator('[data-action="take"]').click();
  await still.locator('[data-form="toml"]').click();
  await still.waitForFunction(() => document.getElementById('take-text').value.includes('camera'));
  const text = await still.locator('#take-text').inputValue();
  await copyBy(still.locator('#take-copy'));
  assert.equal(await still.evaluate(() => navigator.clipboard.readText()), text);
  const { name, bytes } = await download(still, () => still.locator('#take-download').click());
  assert.deepEqual([name, bytes.toString()], ['town.toml', text]);
  await still.locator('[data-form="command"]').click();
  await still.locator('#take-close').click();
});

/** Opens the dialog at the form of this name, and tells what it shows. */
async function openForm(page, form) {
  await page.locator('[data-action="take"]').click();
  await page.locator('[data-form="command"]').click();
  await page.waitForFunction(() => document.getElementById('take-text').value.startsWith('surfel'));
  await page.locator(`[data-form="${form}"]`).click();
  return page.locator('#take-text').inputValue();
}

test('texts are copied over plain HTTP from another machine, too', async () => {
  const { link } = await serve(['town.ply'], ...QUICK, '--host', '0.0.0.0');
  const page = await openPage(link.replace(/\/\/[^:]+/, `//${PLAIN_HOST}`));
  assert.equal(await page.evaluate(() => navigator.clipboard), undefined);
  for (const form of ['command', 'toml', 'json', 'link']) {
    await page.bringToFront();
    const text = await openForm(page, form);
    await copyBy(page.locator('#take-copy'));
    await page.locator('#take-copy:not(.is-done)').waitFor();
    await page.locator('#take-close').click();
    await still.bringToFront();
    assert.equal(await still.evaluate(() => navigator.clipboard.readText()), text, form);
  }
  await closePage(page);
});

test('where nothing may be copied, the text is selected', async () => {
  const page = await openPage(still.url());
  await page.evaluate(() => {
    navigator.clipboard.writeText = () => Promise.reject(new Error('not allowed'));
    document.execCommand = () => false;
  });
  const text = await openForm(page, 'json');
  // What is told stays until it has been looked at.
  await page.evaluate(() => { window.setTimeout = () => 0; });
  await page.locator('#take-copy').click();
  await page.locator('.toast', { hasText: 'Ctrl + C' }).waitFor();
  assert.equal(await page.evaluate(() => getSelection().toString()), text);
  assert.equal(await page.locator('#take-copy.is-done').count(), 0);
  const [dialog, toast] = [await page.locator('#take-dialog').boundingBox(), await page.locator('.toast').boundingBox()];
  // Where both are, without the dialog's round corners.
  const [x, y] = [Math.max(dialog.x, toast.x) + 20, toast.y + 5];
  const clip = { x, y, width: toast.x + toast.width - 20 - x, height: Math.min(dialog.y + dialog.height, toast.y + toast.height) - 20 - y };
  const over = await page.screenshot({ clip });
  await page.locator('.toast').evaluate((shown) => { shown.hidden = true; });
  assert.ok(!over.equals(await page.screenshot({ clip })), 'what is told lies over the dialog');
  await closePage(page);
});

/** Numbers of a TOML file come back with a point. */
const withoutZeros = (text) => text.replaceAll(/(\d)\.0\b/g, '$1');

const load = (page, name, text) => page.setInputFiles('#scene-file', { name, mimeType: 'text/plain', buffer: Buffer.from(text) });

test('a scene file shows what it was taken from', async () => {
  for (const [form, page, patch] of [['toml', still, VIEWS['a turned camera with other light']], ['json', still, VIEWS['glass and metal']], ['toml', moving, MOMENTS['the end, from elsewhere']]]) {
    await show(page, patch);
    const [screen, texts] = [await finishedPixels(page), await taken(page)];
    await show(page, {});
    const { frame } = await state(page, 'lastFrame');
    assert.notEqual(await finishedPixels(page), screen);
    await load(page, `view.${form}`, texts[form]);
    await page.waitForFunction((before) => before < window.surfel.state.lastFrame.frame, frame);
    await page.waitForFunction(() => window.surfel.state.lastFrame.finished);
    assert.equal(await finishedPixels(page), screen, form);
    assert.deepEqual(await state(page, 'shownCamera'), await state(page, 'camera'), 'what is drawn over it lies where it belongs');
    // What a scene's object has of its own is told twice then.
    if (page === still) assert.equal(withoutZeros((await taken(page)).command), withoutZeros(texts.command), form);
  }
});

test('a scene file of other things is refused', async () => {
  const screen = await finishedPixels(still);
  for (const [name, text, told] of [
    ['other.toml', '[[object]]\nfile = "other.ply"', 'is not what is viewed here'],
    ['broken.toml', 'spp =', 'broken.toml'],
    ['unknown.json', '{"sppp": 3}', 'sppp'],
    ['town.ply', 'ply', 'is no scene file'],
  ]) {
    await load(still, name, text);
    await still.locator('.toast', { hasText: told }).first().waitFor();
  }
  assert.equal(await finishedPixels(still), screen);
});

/** Drags a file over the page and lets it fall, as far as the page can tell. */
async function drop(page, name, text) {
  const files = await page.evaluateHandle(([called, content]) => {
    const transfer = new DataTransfer();
    transfer.items.add(new File([content], called));
    return transfer;
  }, [name, text]);
  await page.dispatchEvent('#stage', 'dragover', { dataTransfer: files });
  await page.locator('body.is-dropping').waitFor();
  await page.dispatchEvent('#stage', 'drop', { dataTransfer: files });
  await page.locator('body:not(.is-dropping)').waitFor();
}

test('a scene file dropped on the page is shown', async () => {
  await show(still, VIEWS['a clip plane']);
  const [screen, { toml }] = [await finishedPixels(still), await taken(still)];
  await show(still, {});
  const { frame } = await state(still, 'lastFrame');
  assert.notEqual(await finishedPixels(still), screen);
  await drop(still, 'view.toml', toml);
  await still.waitForFunction((before) => before < window.surfel.state.lastFrame.frame, frame);
  await still.waitForFunction(() => window.surfel.state.lastFrame.finished);
  assert.equal(await finishedPixels(still), screen);
  assert.equal((await state(still, 'scene')).radius_scale, 1.5);
});

test('what is dropped and is no scene file is told of', async () => {
  const screen = await finishedPixels(still);
  for (const [name, text, told] of [
    ['notes.txt', 'spp = 3', 'notes.txt is no scene file'],
    ['wrong.toml', 'spp = "many"', 'many'],
    ['lidar.json', JSON.stringify({ points: Array(100_000).fill(1.5) }), 'lidar.json is too large'],
    // Each line break is two letters on its way.
    ['lines.toml', '\n'.repeat(200_000), 'lines.toml is too large'],
  ]) {
    await drop(still, name, text);
    await still.locator('.toast', { hasText: told }).waitFor();
  }
  assert.equal(await finishedPixels(still), screen);
  assert.ok(await still.locator('#banner').isHidden(), 'the connection holds');
});
