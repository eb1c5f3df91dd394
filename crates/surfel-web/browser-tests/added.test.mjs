// Files that are dropped on the page: they join the scene, come and go by undo, and broken ones are refused.

import assert from 'node:assert/strict';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, beforeEach, test } from 'node:test';
import { closePage, data, finishedPixels, openPage, pixels, QUICK, recorded, reopen, serve, settled, shell, state, unfoldPanel } from './harness.mjs';

let server;
let page;
let first;
before(async () => {
  server = await serve(['town.ply', 'house.obj'], ...QUICK);
  page = await openPage(server.link, { viewport: { width: 900, height: 500 } });
  first = await finishedPixels(page);
});
beforeEach(async () => {
  await reopen(page);
  await unfoldPanel(page);
});
after(() => closePage(page));

const [X, Y, Z] = [562316.125, 4183187.5, 148];
/** A pyramid in the middle of the town, beside the house. */
const PYRAMID = [[12, 3, 2], [18, 3, 2], [18, 9, 2], [12, 9, 2], [15, 6, 12]].map(([x, y, z]) => `v ${X + x} ${Y + y} ${Z + z}`)
  .concat(['f 1 2 5', 'f 2 3 5', 'f 3 4 5', 'f 4 1 5', '']).join('\n');
/** Points without colours over the town. */
const ROOF = Array.from({ length: 2500 }, (_, i) => `${X + 4 + (i % 50) / 4} ${Y + 20 + Math.floor(i / 50) / 4} ${Z + 9}`).join('\n');

/** Drops files on the page, given by names and contents. */
async function drop(on, files) {
  const transfer = await on.evaluateHandle((all) => {
    const made = new DataTransfer();
    for (const [name, bytes] of all) made.items.add(new File([Uint8Array.from(bytes)], name));
    return made;
  }, files.map(([name, content]) => [name, [...Buffer.from(content)]]));
  await on.dispatchEvent('#viewport', 'dragover', { dataTransfer: transfer });
  await on.dispatchEvent('#viewport', 'drop', { dataTransfer: transfer });
}

const row = (name) => page.locator(`[data-object="${name}"]`);
const undo = async () => {
  await page.waitForFunction(() => !document.querySelector('[data-action="undo"]').disabled);
  await page.locator('[data-action="undo"]').click();
};

test('a dropped mesh joins the scene; undo, redo and removal take it away and back', async () => {
  await drop(page, [['pyramid.obj', PYRAMID]]);
  await row('pyramid.obj').locator('summary', { hasText: '4 triangles' }).waitFor();
  const shown = await finishedPixels(page);
  assert.notEqual(shown, first);
  await undo();
  assert.equal(await finishedPixels(page), first);
  assert.equal(await row('pyramid.obj').count(), 0);
  await page.locator('[data-action="redo"]').click();
  assert.equal(await finishedPixels(page), shown);
  await unfoldPanel(page);
  await page.selectOption('[data-key="material.pyramid.obj"]', 'metal');
  assert.notEqual(await finishedPixels(page), shown);
  await page.locator('[aria-label="Remove pyramid.obj"]').click();
  assert.equal(await finishedPixels(page), first);
  assert.deepEqual((await state(page, 'scene')).material ?? [], []);
});

test('a dropped cloud without the colours of the scene has its own, and is hidden alone', async () => {
  await page.selectOption('[data-key="color"]', 'rgb');
  await drop(page, [['roof.xyz', ROOF]]);
  await row('roof.xyz').locator('summary', { hasText: /2.500 points/ }).waitFor();
  assert.notEqual(await finishedPixels(page), first);
  await unfoldPanel(page);
  await page.locator('[data-key="object.roof.xyz.visible"]').uncheck();
  assert.equal(await finishedPixels(page), first);
});

test('the list leads to each file', async () => {
  const { position } = await state(page, 'camera');
  await page.locator('[aria-label="Zoom to house.obj"]').click();
  await settled(page);
  const { focal_point: house, position: near } = await state(page, 'camera');
  assert.ok(Math.hypot(house[0] - X - 23, house[1] - Y - 9) < 0.1, `${house}`);
  assert.notDeepEqual(near, position);
});

test('several files are added one after the other, and one name is told from another', async () => {
  await drop(page, [['house.obj', PYRAMID], ['roof.xyz', ROOF], ['house.obj', PYRAMID]]);
  await row('house (3).obj').waitFor();
  const names = await page.locator('[data-object]').evaluateAll((rows) => rows.map((one) => one.dataset.object));
  assert.deepEqual(names, ['town.ply', 'house.obj', 'house (2).obj', 'roof.xyz', 'house (3).obj']);
  await unfoldPanel(page);
  await page.locator('[data-key="object.house (2).obj.visible"]').uncheck();
  await settled(page);
  assert.deepEqual((await state(page, 'scene')).object_settings, ['house (2).obj:visible=false']);
});

test('the exported command and scene file make the same picture beside the added file', async () => {
  await drop(page, [['roof.xyz', ROOF], ['pyramid.obj', PYRAMID]]);
  await row('pyramid.obj').waitFor();
  await settled(page);
  for (const [name, text] of [['roof.xyz', ROOF], ['pyramid.obj', PYRAMID]]) writeFileSync(join(data.folder, name), text);
  await page.locator('[data-action="save"]').click();
  await page.locator('[data-preset="window"]').click();
  const [saved] = await Promise.all([page.waitForEvent('download'), page.locator('#save-start').click()]);
  const expected = readFileSync(await saved.path());
  await page.locator('#save-cancel').click();
  await page.locator('[data-action="export"]').click();
  const text = page.locator('#export-text');
  await page.waitForFunction(() => document.getElementById('export-text').value.startsWith('surfel'));
  const command = await text.inputValue();
  await page.locator('[data-format="toml"]').click();
  const toml = await text.inputValue();
  await page.locator('[data-format="link"]').click();
  assert.match(await page.locator('#export-dialog .note').first().textContent(), /roof.xyz, pyramid.obj.*not part of a link/);
  const link = await text.inputValue();
  await page.locator('#export-close').click();
  assert.ok(!`${command}${toml}`.includes('added-'), command);
  assert.deepEqual(shell(command.replace(/-o picture.png$/, '-q -o -')), expected);
  writeFileSync(join(data.folder, 'added.toml'), toml);
  assert.deepEqual(shell('surfel render added.toml -q -o -'), expected);
  const other = await openPage(link, { viewport: { width: 900, height: 500 } });
  assert.equal(await pixels(other), first);
  await closePage(other);
});

test('broken files and files that nobody reads are refused by their names', async () => {
  const broken = [
    ['empty.ply', ''], ['notes.txt', 'spp = 3'], ['scan.laz', 'LASF and nothing else'], ['archive.zip', 'PK\x03\x04'],
    ['movie.mp4', 'ftyp'], ['half.ply', 'ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n'],
    ['scene.gltf', '{"asset": {"version": "2.0"}, "scenes": [{"nodes": [7]}]}'], ['mesh.obj', 'v 1 2 3\nf 1 2 3\n'],
    ['scan.e57', 'ASTM-E57'], ['scan.pcd', '# .PCD v0.7\nFIELDS x'], ['scan.ptx', '3\n3\n'], ['mesh.stl', 'solid'], ['cloud.bin', 'abc'],
  ];
  for (const [name, content] of broken) {
    await drop(page, [[name, content]]);
    await page.locator('.toast', { hasText: name }).first().waitFor();
  }
  assert.equal(await finishedPixels(page), first);
  assert.ok(await page.locator('#banner').isHidden(), 'the connection is kept');
});

test('a file beyond the limit is refused before it is sent', async () => {
  let nSent = 0;
  page.on('request', (request) => { nSent += request.url().includes('/files/') ? 1 : 0; });
  await page.evaluate(() => {
    const file = new File(['1 2 3'], 'large.laz');
    Object.defineProperty(file, 'size', { value: 1e10 });
    const event = new Event('drop', { bubbles: true, cancelable: true });
    event.dataTransfer = { files: [file] };
    document.getElementById('viewport').dispatchEvent(event);
  });
  await page.locator('.toast', { hasText: /large.laz has 10.GB; files of up to/ }).waitFor();
  assert.equal(nSent, 0);
});

test('adding is shown and cancelled', async () => {
  await page.route('**/files/*', () => {});
  await drop(page, [['pyramid.obj', PYRAMID], ['roof.xyz', ROOF]]);
  await page.locator('#added-card h2', { hasText: 'Adding pyramid.obj' }).waitFor();
  await page.locator('[data-action="cancel-added"]').click();
  await page.locator('#added-card').waitFor({ state: 'hidden' });
  await page.unroute('**/files/*');
  assert.equal(await finishedPixels(page), first);
  await drop(page, [['pyramid.obj', PYRAMID]]);
  await row('pyramid.obj').waitFor();
});

test('a reload tells what it loses', async () => {
  await drop(page, [['pyramid.obj', PYRAMID]]);
  await row('pyramid.obj').waitFor();
  await settled(page);
  await page.reload();
  await page.locator('.toast', { hasText: 'pyramid.obj' }).waitFor();
  assert.equal(await finishedPixels(page), first);
});

test('a lost connection tells what it loses, and undo goes around it', async () => {
  const own = await serve(['town.ply', 'house.obj'], ...QUICK);
  const other = await openPage(own.link, { viewport: { width: 900, height: 500 } });
  await drop(other, [['pyramid.obj', PYRAMID]]);
  await other.locator('[data-object="pyramid.obj"]').waitFor({ state: 'attached' });
  await settled(other);
  // The address does not hold the file, so a further change tells that it has been recorded.
  await unfoldPanel(other);
  await other.selectOption('[data-key="color"]', 'elevation');
  await recorded(other, ({ color }) => color === 'elevation');
  await other.locator('[data-action="undo"]').click();
  await recorded(other, ({ color }) => color !== 'elevation');
  await own.stop();
  await other.locator('.toast', { hasText: /lost, and with it pyramid.obj/ }).waitFor();
  await serve(['town.ply', 'house.obj'], ...QUICK, '--port', own.port);
  await other.waitForFunction(() => window.surfel.state.connected);
  // A change, which the next picture obeys.
  await other.locator('[data-action="home"]').click();
  assert.equal(await finishedPixels(other), first);
  await other.locator('[data-action="undo"]').click();
  assert.equal(await finishedPixels(other), first);
  await other.context().close();
});

test('two files of one name have rows of their own', async () => {
  const [a, b] = ['a', 'b'].map((folder) => join(data.folder, folder));
  shell('mkdir -p a b && cp house.obj a/part.obj && cp house.obj b/part.obj');
  const own = await serve([`${a}/part.obj`, `${b}/part.obj`, 'town.ply'], ...QUICK);
  const other = await openPage(own.link);
  await unfoldPanel(other);
  await other.locator('[data-key="object.part.obj.visible"]').uncheck();
  await settled(other);
  assert.ok(await other.locator('[data-key="object.part (2).obj.visible"]').isChecked());
  // The second one still stands in the same place.
  const start = await finishedPixels(other);
  await other.locator('[data-key="object.part (2).obj.visible"]').uncheck();
  assert.notEqual(await finishedPixels(other), start);
  assert.deepEqual((await state(other, 'scene')).object_settings, ['part.obj:visible=false', 'part (2).obj:visible=false']);
  await closePage(other);
});

test('profiles and volumes wait for points', async () => {
  const own = await serve(['house.obj'], ...QUICK);
  const meshes = await openPage(own.link);
  const tools = ['profile', 'volume'].map((tool) => meshes.locator(`#toolbar [data-tool="${tool}"]`));
  for (const tool of tools) {
    assert.ok(await tool.isDisabled());
    assert.match(await tool.getAttribute('title'), /needs points/);
  }
  assert.ok(await meshes.locator('#toolbar [data-tool="distance"]').isEnabled());
  await drop(meshes, [['roof.xyz', ROOF]]);
  await meshes.waitForFunction(() => !document.querySelector('#toolbar [data-tool="volume"]').disabled);
  assert.doesNotMatch(await tools[0].getAttribute('title'), /needs/);
  await closePage(meshes);
});
