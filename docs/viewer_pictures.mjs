// Makes the pictures of viewer.md: `viewer.jpg`, five scenes in windows of four sizes, and `viewer_drag.webp`, a recorded drag.
//
//   SURFEL=target/release/surfel PLAYWRIGHT=~/.cache/surfel-playwright CLOUDS=folder node docs/viewer_pictures.mjs
//
// All 40 pictures, each scene in each size in the light and in the dark colour scheme, are written to the folder SHOTS (`viewer`
// in the temporary folder), to be looked at. CLOUDS has the files named below; scenes whose file is absent are left out, and
// then the sheet is not written. ffmpeg writes the drag, at the speed at which it was recorded, but without long pauses.

import { execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { blankPage, data, pixelAt, serve, settled, shell, state } from '../crates/surfel-web/browser-tests/harness.mjs';
import { project } from '../crates/surfel-web/page/camera.js';
import { encodeHash } from '../crates/surfel-web/page/link.js';

const { CLOUDS = '.', SHOTS = join(tmpdir(), 'viewer') } = process.env;
const OPTIONS = ['--spp', '4', '--light-samples', '4'];
const PHONE = { hasTouch: true, isMobile: true, deviceScaleFactor: 2 };
const SIZES = [
  { viewport: { width: 1440, height: 900 } },
  { viewport: { width: 1024, height: 768 } },
  { ...PHONE, viewport: { width: 844, height: 390 } },
  { ...PHONE, viewport: { width: 390, height: 844 } },
];
const SCHEMES = ['light', 'dark'];
/** Height of a picture in the sheet in pixels. */
const SHEET_HEIGHT = 350;
const SHEET_GAP = 8;
const DEMO = 'demo.laz';
const DRAG_SECS = 4;
const MAX_PAUSE_SECS = 1.5;
/** Most bytes of what is committed. */
const [MAX_SHEET_BYTES, MAX_DRAG_BYTES] = [400_000, 600_000];

/** Opens sections of the panel, which starts folded on phones, and closes the others. */
async function openSections(page, ...names) {
  if (await page.locator('#sections').isHidden()) await page.locator('#panel-fold').click();
  await page.evaluate((wanted) => {
    for (const part of document.querySelectorAll('#panel details')) part.open = wanted.includes(part.dataset.section);
  }, names);
}

/** Clicks on the pixel that shows a point of the world, unless something covers it. */
async function clickOn(page, point) {
  const [viewport, size] = [await page.locator('#viewport').boundingBox(), await state(page, 'size')];
  const { x, y } = project(await state(page, 'camera'), size, point);
  const [left, top] = [viewport.x + (x * viewport.width) / size.width, viewport.y + (y * viewport.height) / size.height];
  const isFree = await page.evaluate(([a, b]) => !document.elementFromPoint(a, b)?.closest('[data-ui], #panel'), [left, top]);
  if (isFree) await page.mouse.click(left, top);
  return isFree;
}

// The files: pumpA.e57 of the libE57 sample data; the airborne scan ign_lidar_697k.laz of PDAL's tests (las_with_several_extra_byte_bloc.laz);
// the depth camera's frame region_growing_rgb_tutorial.pcd of PointCloudLibrary/data; the mesh armadillo_26k.ply, decimated from
// that of the Stanford 3D Scanning Repository. The demo is made by `surfel demo`.
const SCENES = [
  {
    name: 'terrestrial scan', file: 'pumpA.e57',
    figures: [{ kind: 'distance', name: 'distance 1', points: [[-0.960953, -1.766647, -0.041306], [-0.986679, -1.874771, -1.51033]] }],
    async prepare(page, { width }) {
      // On a phone the card would hide the scan.
      if (width < 1000) return;
      await page.locator('#toolbar [data-tool=pick]').click();
      if (await clickOn(page, [-0.986679, -1.874771, -0.51033])) await page.locator('#pick-card dl').waitFor();
    },
  },
  {
    name: 'airborne scan', file: 'ign_lidar_697k.laz', patch: { color: 'class' },
    figures: [{ kind: 'profile', name: 'profile 1', points: [[484790, 6632800, 105], [484955.73, 6632767.58, 103.13]], width: 3 }],
    async prepare(page, { height }) {
      if (height < 800) return;
      await page.locator('[aria-label="Show profile 1"]').click();
      await page.locator('#profile-card .note:not(:empty)').waitFor();
    },
  },
  {
    name: 'ruin', file: DEMO, patch: { color: 'elevation' },
    figures: [
      { kind: 'annotation', name: 'column', points: [[562342.661, 4183205.882, 150.487]] },
      { kind: 'height', name: 'height 1', points: [[562347.611, 4183205.562, 149.029], [562347.609, 4183205.978, 153.161]] },
    ],
  },
  {
    name: 'depth camera', file: 'region_growing_rgb_tutorial.pcd', patch: { clip_box: '([-0.5,1],[-0.4,0.4],[0.9,2.4])' },
    async prepare(page) {
      await openSections(page, 'points', 'clipping');
      await page.locator('#histogram-column').selectOption('red');
      await page.locator('.histogram-bars rect').first().waitFor();
    },
  },
  {
    name: 'statue', file: 'armadillo_26k.ply', options: ['--camera-azimuth-angle', '20'], patch: { material: ['*=plastic:color=#b86f4a'] },
    prepare: (page) => openSections(page, 'objects', 'view'),
  },
];

/** Where a scene's file lies; null if it is absent. */
function pathOf(file) {
  if (file === DEMO && !existsSync(join(data.folder, DEMO))) shell('surfel demo --quiet --points 600000');
  return [join(data.folder, file), join(CLOUDS, file)].find((path) => existsSync(path)) ?? null;
}

const shotOf = (sceneIdx, sizeIdx, scheme) => join(SHOTS, `${SCENES[sceneIdx].name.replaceAll(' ', '-')}-${SIZES[sizeIdx].viewport.width}-${scheme}.png`);

SCENES.forEach(({ name, file, options = [], patch = {}, figures = [], prepare = () => {} }, sceneIdx) => test(name, async (context) => {
  const path = pathOf(file);
  if (!path) {
    context.skip(`${file} is not in CLOUDS`);
    return;
  }
  mkdirSync(SHOTS, { recursive: true });
  const server = await serve([path], ...OPTIONS, ...options);
  for (const [sizeIdx, size] of SIZES.entries()) {
    for (const colorScheme of SCHEMES) {
      const page = await blankPage({ ...size, colorScheme });
      await page.goto(server.link + encodeHash(patch, figures.length ? figures : undefined));
      await settled(page);
      await prepare(page, size.viewport);
      await settled(page);
      // The questions about hidden labels follow the picture.
      await page.waitForTimeout(500);
      await page.screenshot({ path: shotOf(sceneIdx, sizeIdx, colorScheme) });
      await page.context().close();
    }
  }
  await server.stop();
}));

test('the sheet', async (context) => {
  // Both schemes of each size are seen, in turn.
  const shots = SCENES.map((_, sceneIdx) => SIZES.map((_, sizeIdx) => shotOf(sceneIdx, sizeIdx, SCHEMES[(sceneIdx + sizeIdx) % 2])));
  const missing = shots.flat().filter((path) => !existsSync(path));
  if (missing.length) {
    context.skip(`${missing.join(', ')} missing`);
    return;
  }
  const widths = SIZES.map(({ viewport: { width, height } }) => Math.round((SHEET_HEIGHT * width) / height));
  const width = widths.reduce((sum, one) => sum + one + SHEET_GAP, SHEET_GAP);
  const height = SHEET_GAP + SCENES.length * (SHEET_HEIGHT + SHEET_GAP);
  const page = await blankPage({ viewport: { width, height } });
  const image = (path) => `<img height="${SHEET_HEIGHT}" src="data:image/png;base64,${readFileSync(path).toString('base64')}">`;
  await page.setContent(`<style>body { margin: ${SHEET_GAP}px 0 0 ${SHEET_GAP}px; background: #fff; line-height: 0 }
    img { margin: 0 ${SHEET_GAP}px ${SHEET_GAP}px 0 }</style>${shots.map((row) => `<div>${row.map(image).join('')}</div>`).join('')}`);
  const sheet = await page.screenshot({ type: 'jpeg', quality: 72 });
  if (MAX_SHEET_BYTES < sheet.length) throw new Error(`the sheet has ${sheet.length} bytes`);
  writeFileSync(join(import.meta.dirname, 'viewer.jpg'), sheet);
  await page.context().close();
});

/** The frames that the browser shows during `run`, each `{ jpeg, at_secs }`. */
async function screencast(page, run) {
  const frames = [];
  const session = await page.context().newCDPSession(page);
  session.on('Page.screencastFrame', ({ data: jpeg, metadata, sessionId }) => {
    frames.push({ jpeg: Buffer.from(jpeg, 'base64'), at_secs: metadata.timestamp });
    session.send('Page.screencastFrameAck', { sessionId });
  });
  await session.send('Page.startScreencast', { format: 'jpeg', quality: 90 });
  await run();
  await session.send('Page.stopScreencast');
  return frames;
}

test('the drag', async () => {
  const server = await serve([pathOf(DEMO)]);
  const page = await blankPage({ viewport: { width: 960, height: 560 } });
  await page.goto(server.link);
  await settled(page);
  await page.locator('#panel-fold').click();
  await settled(page);
  const start = await pixelAt(page, 0.35, 0.45);
  const frames = await screencast(page, async () => {
    await page.mouse.move(start.x, start.y);
    await page.mouse.down();
    const begin = performance.now();
    for (let secs = 0; secs < DRAG_SECS; secs = (performance.now() - begin) / 1000) {
      const turn = Math.sin((Math.PI / 2) * (secs / DRAG_SECS));
      await page.mouse.move(start.x + 320 * turn, start.y - 40 * Math.sin(Math.PI * turn));
    }
    await page.mouse.up();
    await settled(page);
  });
  const folder = mkdtempSync(join(tmpdir(), 'surfel-drag-'));
  const list = frames.map(({ jpeg, at_secs }, i) => {
    const name = join(folder, `${i}.jpg`);
    writeFileSync(name, jpeg);
    const duration_secs = Math.min(MAX_PAUSE_SECS, (frames[i + 1]?.at_secs ?? Infinity) - at_secs);
    return `file ${name}\nduration ${duration_secs.toFixed(3)}\n`;
  });
  writeFileSync(join(folder, 'list.txt'), `ffconcat version 1.0\n${list.join('')}`);
  const target = join(import.meta.dirname, 'viewer_drag.webp');
  execFileSync('ffmpeg', ['-loglevel', 'error', '-y', '-f', 'concat', '-safe', '0', '-i', join(folder, 'list.txt'),
    '-vf', 'fps=15,scale=720:-1', '-c:v', 'libwebp_anim', '-quality', '45', '-loop', '0', target]);
  rmSync(folder, { recursive: true });
  const { length } = readFileSync(target);
  if (MAX_DRAG_BYTES < length) throw new Error(`the drag has ${length} bytes`);
  console.log(`${frames.length} frames, ${length} bytes`);
  await page.context().close();
  await server.stop();
});
