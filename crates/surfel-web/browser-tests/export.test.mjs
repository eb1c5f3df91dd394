// Export: saved pictures equal those of the exported commands and scene files, byte for byte.

import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { pointAtDepth, project } from '../page/camera.js';
import { RESOLUTION } from './data.mjs';
import {
  closePage, colorCount, copyBy, data, drag, finishedPixels, openPage, PLAIN_HOST, pixelAt, QUICK, serve, settled, shell, show, state,
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
  'the initial view': {},
  'colours by elevation in a range': { color: 'elevation', cmap: 'magma', range: [147, 152.5] },
  'a clip box': { clip_box: '([562320,562335.5],[4183190,4183210],[140,160])' },
  'a clip plane': { clip_plane: [562330, 4183200, 149, 0.6, 0, 0.8], radius_scale: 1.5 },
  'glass and metal': { material: ['house.obj=glass:ior=1.3,color=#88ccff', 'town.ply=metal:roughness=0.4'], max_depth: 5 },
  'a hidden mesh, and colours of one file': { object_settings: ['house.obj:visible=false', 'town.ply:color=intensity'] },
  'an orthographic camera': { camera: { position: [562334, 4183150, 190], focal_point: CENTER, view_up: [0, 0, 1], view_angle: null, orthographic: 31.5 } },
  'another camera and light': {
    camera: { position: [562380.5, 4183230.25, 170.125], focal_point: CENTER, view_angle: 50 },
    light: ['sun', 'headlight'], sun: { azimuth: 123.4, elevation: 20, angle: 5, strength: 1.5 }, exposure: 0.7,
  },
  'soft light on few discs': { surface: 'disc', subsample: 'random:8000', sky: { strength: 2, ao_distance: 4 }, spp: 3, light_samples: 4, background: '#102030' },
};
const MOMENTS = {
  'the beginning': {},
  'a moment': { time: 0.7, color: 'intensity' },
  'the end, from elsewhere': { time: 2, camera: { position: [562380.5, 4183230.25, 170.125], focal_point: CENTER } },
};

const ORBIT_VIEWS = {
  'an orbiting camera': { time: 1 },
  'another orbiting camera': { time: 1, camera: { position: [562380.5, 4183230.25, 170.125], focal_point: CENTER } },
  'a camera locked against an orbit': { time: 1, camera: { position: [562380.5, 4183230.25, 170.125], focal_point: CENTER, lock: true } },
};
const FILE_CAMERA_VIEWS = {
  'the animated camera of a file': { time: 1.5 },
  'another camera than that of a file': {
    time: 1.5, camera: { name: null, position: [2, -5, 3], focal_point: [0, 0, 1], view_up: [0, 0, 1], view_angle: 40, lock: true },
  },
};

async function download(page, start) {
  const [file] = await Promise.all([page.waitForEvent('download'), start()]);
  return { name: file.suggestedFilename(), bytes: readFileSync(await file.path()) };
}

/** The PNG that the dialog saves, in the size of the window. */
async function savePicture(page) {
  await page.locator('[data-action="save"]').click();
  await page.locator('[data-preset="window"]').click();
  const { bytes } = await download(page, () => page.locator('#save-start').click());
  await page.locator('#save-note', { hasText: 'Saved.' }).waitFor();
  await page.locator('#save-cancel').click();
  return bytes;
}

/** The texts of the export dialog in each format. */
async function exportTexts(page) {
  await page.locator('[data-action="export"]').click();
  await page.waitForFunction(() => document.getElementById('export-text').value.startsWith('surfel'));
  const texts = {};
  for (const format of ['command', 'toml', 'json', 'link']) {
    await page.locator(`[data-format="${format}"]`).click();
    texts[format] = await page.locator('#export-text').inputValue();
  }
  await page.locator('[data-format="command"]').click();
  await page.locator('#export-close').click();
  return texts;
}

/** The pictures that the exported command, TOML and JSON render. */
function renderTexts({ command, toml, json }) {
  writeFileSync(join(data.folder, 'exported.toml'), toml);
  writeFileSync(join(data.folder, 'exported.json'), json);
  const commands = { command, toml: 'surfel render exported.toml -o picture.png', json: 'surfel render exported.json -o picture.png' };
  const run = (line) => shell(`${line.replace(/-o picture.png$/, '-q -o -')}`);
  return Object.entries(commands).map(([format, line]) => [format, run(line)]);
}

const pagesOf = (page, views) => Object.entries(views).map((view) => [page, ...view]);
const pages = [
  ...pagesOf(() => still, VIEWS), ...pagesOf(() => moving, MOMENTS),
  ...pagesOf(() => orbiting, ORBIT_VIEWS), ...pagesOf(() => passing, FILE_CAMERA_VIEWS),
];

for (const [pageOf, name, patch] of pages) {
  test(`exports render the same picture: ${name}`, async () => {
    const page = pageOf();
    await show(page, patch);
    const picture = await savePicture(page);
    const texts = await exportTexts(page);
    for (const [format, bytes] of renderTexts(texts)) assert.ok(picture.equals(bytes), `${format}\n${texts.command}`);
    const screen = await finishedPixels(page);
    const other = await openPage(texts.link, { viewport: page.viewportSize() });
    assert.equal(await finishedPixels(other), screen, 'the link');
    await closePage(other);
  });
}

test('a panorama turns about its position, and its exports render the same picture', async () => {
  const position = '562334,4183203,152';
  const server = await serve(['town.ply', 'house.obj'], ...QUICK, '--camera-panorama', '--camera-position', position);
  const page = await openPage(server.link, { viewport: { width: 900, height: 340 } });
  assert.ok(await colorCount(page) > 100);
  const [first, opening, size] = [await finishedPixels(page), await state(page, 'camera'), await state(page, 'size')];
  assert.deepEqual([opening.panorama, opening.position], [true, position.split(',').map(Number)]);
  const [from, to] = [await pixelAt(page, 0.4, 0.6), await pixelAt(page, 0.7, 0.6)];
  await drag(page, from, to);
  assert.notEqual(await finishedPixels(page), first);
  const turned = await state(page, 'camera');
  assert.deepEqual([turned.panorama, turned.position, turned.view_up], [true, opening.position, opening.view_up]);
  // The point under the pointer has followed it.
  const viewport = await page.locator('#viewport').boundingBox();
  const end = project(turned, size, pointAtDepth(opening, size, from.x - viewport.x, from.y - viewport.y, 5));
  assert.ok(Math.hypot(end.x - (to.x - viewport.x), end.y - (to.y - viewport.y)) < 1, JSON.stringify(end));
  const picture = await savePicture(page);
  const texts = await exportTexts(page);
  for (const [format, bytes] of renderTexts(texts)) assert.ok(picture.equals(bytes), `${format}\n${texts.command}`);
  await page.locator('#sections summary', { hasText: 'View' }).click();
  const projection = page.locator('[data-key="camera.projection"]');
  assert.equal(await projection.inputValue(), 'panorama');
  await projection.selectOption('perspective');
  await settled(page);
  assert.equal((await state(page, 'camera')).panorama, undefined);
  await closePage(page);
});

test('a saved picture has the requested size', async () => {
  await still.locator('[data-action="save"]').click();
  await still.locator('[name="width"]').fill('123');
  await still.locator('[name="height"]').fill('77');
  const { name, bytes } = await download(still, () => still.locator('#save-start').click());
  assert.equal(name, 'town.png');
  assert.deepEqual([bytes.readUInt32BE(16), bytes.readUInt32BE(20)], [123, 77]);
  await still.locator('#save-cancel').click();
});

test('saving can be cancelled, and too large a picture is rejected', async () => {
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

test('texts can be copied and downloaded', async () => {
  await still.locator('[data-action="export"]').click();
  await still.locator('[data-format="toml"]').click();
  await still.waitForFunction(() => document.getElementById('export-text').value.includes('camera'));
  const text = await still.locator('#export-text').inputValue();
  await copyBy(still.locator('#export-copy'));
  assert.equal(await still.evaluate(() => navigator.clipboard.readText()), text);
  const { name, bytes } = await download(still, () => still.locator('#export-download').click());
  assert.deepEqual([name, bytes.toString()], ['town.toml', text]);
  await still.locator('[data-format="command"]').click();
  await still.locator('#export-close').click();
});

/** Opens the export dialog at a format; returns its text. */
async function openFormat(page, format) {
  await page.locator('[data-action="export"]').click();
  await page.locator('[data-format="command"]').click();
  await page.waitForFunction(() => document.getElementById('export-text').value.startsWith('surfel'));
  await page.locator(`[data-format="${format}"]`).click();
  return page.locator('#export-text').inputValue();
}

test('texts can be copied over plain HTTP from another machine', async () => {
  const { link } = await serve(['town.ply'], ...QUICK, '--host', '0.0.0.0');
  const page = await openPage(link.replace(/\/\/[^:]+/, `//${PLAIN_HOST}`));
  assert.equal(await page.evaluate(() => navigator.clipboard), undefined);
  for (const format of ['command', 'toml', 'json', 'link']) {
    await page.bringToFront();
    const text = await openFormat(page, format);
    await copyBy(page.locator('#export-copy'));
    await page.locator('#export-copy:not(.is-done)').waitFor();
    await page.locator('#export-close').click();
    await still.bringToFront();
    assert.equal(await still.evaluate(() => navigator.clipboard.readText()), text, format);
  }
  await closePage(page);
});

test('the text is selected if copying is not allowed', async () => {
  const page = await openPage(still.url());
  await page.evaluate(() => {
    navigator.clipboard.writeText = () => Promise.reject(new Error('not allowed'));
    document.execCommand = () => false;
  });
  const text = await openFormat(page, 'json');
  // Keeps the toast until it is checked.
  await page.evaluate(() => { window.setTimeout = () => 0; });
  await page.locator('#export-copy').click();
  await page.locator('.toast', { hasText: 'Ctrl + C' }).waitFor();
  assert.equal(await page.evaluate(() => getSelection().toString()), text);
  assert.equal(await page.locator('#export-copy.is-done').count(), 0);
  const [dialog, toast] = [await page.locator('#export-dialog').boundingBox(), await page.locator('.toast').boundingBox()];
  // The region where both overlap, without the dialog's round corners.
  const [x, y] = [Math.max(dialog.x, toast.x) + 20, toast.y + 5];
  const clip = { x, y, width: toast.x + toast.width - 20 - x, height: Math.min(dialog.y + dialog.height, toast.y + toast.height) - 20 - y };
  const over = await page.screenshot({ clip });
  await page.locator('.toast').evaluate((shown) => { shown.hidden = true; });
  assert.ok(!over.equals(await page.screenshot({ clip })), 'the toast is above the dialog');
  await closePage(page);
});

/** Removes `.0`, as TOML writes whole numbers with it. */
const withoutTrailingZeros = (text) => text.replaceAll(/(\d)\.0\b/g, '$1');

const load = (page, name, text) => page.setInputFiles('#scene-file', { name, mimeType: 'text/plain', buffer: Buffer.from(text) });

test('an exported scene file restores the view', async () => {
  for (const [format, page, patch] of [['toml', still, VIEWS['another camera and light']], ['json', still, VIEWS['glass and metal']], ['toml', moving, MOMENTS['the end, from elsewhere']]]) {
    await show(page, patch);
    const [screen, texts] = [await finishedPixels(page), await exportTexts(page)];
    await show(page, {});
    const { frame } = await state(page, 'lastFrame');
    assert.notEqual(await finishedPixels(page), screen);
    await load(page, `view.${format}`, texts[format]);
    await page.waitForFunction((before) => before < window.surfel.state.lastFrame.frame, frame);
    await page.waitForFunction(() => window.surfel.state.lastFrame.finished);
    assert.equal(await finishedPixels(page), screen, format);
    assert.deepEqual(await state(page, 'shownCamera'), await state(page, 'camera'), 'the overlay uses the camera of the picture');
    // The command of the animated scene would repeat the settings of its objects.
    if (page === still) assert.equal(withoutTrailingZeros((await exportTexts(page)).command), withoutTrailingZeros(texts.command), format);
  }
});

test('a scene file of other objects is rejected', async () => {
  const screen = await finishedPixels(still);
  for (const [name, text, message] of [
    ['other.toml', '[[object]]\nfile = "other.ply"', 'is not shown here'],
    ['broken.toml', 'spp =', 'broken.toml'],
    ['unknown.json', '{"sppp": 3}', 'sppp'],
  ]) {
    await load(still, name, text);
    await still.locator('.toast', { hasText: message }).first().waitFor();
  }
  assert.equal(await finishedPixels(still), screen);
});

/** Drops a file on the page. */
async function drop(page, name, text) {
  const files = await page.evaluateHandle(([called, content]) => {
    const transfer = new DataTransfer();
    transfer.items.add(new File([content], called));
    return transfer;
  }, [name, text]);
  await page.dispatchEvent('#viewport', 'dragover', { dataTransfer: files });
  await page.locator('body.is-dropping').waitFor();
  await page.dispatchEvent('#viewport', 'drop', { dataTransfer: files });
  await page.locator('body:not(.is-dropping)').waitFor();
}

test('a scene file dropped on the page is shown', async () => {
  await show(still, VIEWS['a clip plane']);
  const [screen, { toml }] = [await finishedPixels(still), await exportTexts(still)];
  await show(still, {});
  const { frame } = await state(still, 'lastFrame');
  assert.notEqual(await finishedPixels(still), screen);
  await drop(still, 'view.toml', toml);
  await still.waitForFunction((before) => before < window.surfel.state.lastFrame.frame, frame);
  await still.waitForFunction(() => window.surfel.state.lastFrame.finished);
  assert.equal(await finishedPixels(still), screen);
  assert.equal((await state(still, 'scene')).radius_scale, 1.5);
});

test('invalid dropped files are rejected with a toast', async () => {
  const screen = await finishedPixels(still);
  for (const [name, text, message] of [
    ['notes.txt', 'spp = 3', 'notes.txt'],
    ['wrong.toml', 'spp = "many"', 'many'],
    ['lidar.json', JSON.stringify({ points: Array(100_000).fill(1.5) }), 'lidar.json is too large'],
    // Each line break takes two bytes in JSON.
    ['lines.toml', '\n'.repeat(200_000), 'lines.toml is too large'],
  ]) {
    await drop(still, name, text);
    await still.locator('.toast', { hasText: message }).waitFor();
  }
  assert.equal(await finishedPixels(still), screen);
  assert.ok(await still.locator('#banner').isHidden(), 'the connection is kept');
});

test('the points that are shown are downloaded with all their columns', async () => {
  await show(still, { clip_box: '([562316,562330],[4183187,4183215],[140,160])', filter: 'classification == 2' });
  const expected = data.points.filter(({ x, y, classification }) => x <= 562330 && y <= 4183215 && classification === 2);
  await still.locator('[data-action="export"]').click();
  for (const format of ['ply', 'laz']) {
    await still.locator(`[data-points="${format}"]`).click();
    const link = still.locator('[data-action="download-points"]');
    await link.waitFor();
    const note = await still.locator('.points-export .note').textContent();
    assert.equal(parseInt(note.replace(/\s/g, ''), 10), expected.length, note);
    const { name, bytes } = await download(still, () => link.click());
    assert.equal(name, `town-shown.${format}`);
    writeFileSync(join(data.folder, name), bytes);
    const found = shell(`surfel info ${name} --json`);
    assert.equal(JSON.parse(found).points, expected.length);
  }
  shell('surfel prepare town-shown.laz -o shown.csv --duplicates keep -q');
  const [names, ...rows] = readFileSync(join(data.folder, 'shown.csv'), 'utf8').trim().split('\n').map((row) => row.split(','));
  const column = (word) => names.findIndex((name) => name.toLowerCase().replaceAll(/[\W_]/g, '') === word);
  const [x, time] = [column('x'), column('gpstime')];
  assert.ok(rows.every((row, i) => Math.abs(row[x] - expected[i].x) < RESOLUTION / 2));
  assert.deepEqual(rows.map((row) => Number(row[time])), expected.map((point) => point.gps_time));
  await still.locator('#export-close').click();
});
