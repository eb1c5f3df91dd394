// Accessibility: axe finds no violations, and controls are large and distinct enough.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { before, test } from 'node:test';
import { encodeHash } from '../page/link.js';
import { closePage, data, openPage, pixelAt, QUICK, serve, settled, show, unfoldPanel } from './harness.mjs';

const AXE = createRequire(join(process.env.PLAYWRIGHT ?? import.meta.dirname, 'x.js')).resolve('axe-core/axe.min.js');
const axeSource = readFileSync(AXE, 'utf8');
const PHONE = { hasTouch: true, isMobile: true };
const SITUATIONS = {
  'desktop, light': { viewport: { width: 1280, height: 800 }, colorScheme: 'light' },
  'desktop, dark': { viewport: { width: 1280, height: 800 }, colorScheme: 'dark' },
  'forced colours': { viewport: { width: 1280, height: 800 }, forcedColors: 'active' },
  'phone, light': { ...PHONE, viewport: { width: 390, height: 844 }, colorScheme: 'light' },
  'phone in landscape, dark': { ...PHONE, viewport: { width: 844, height: 390 }, colorScheme: 'dark' },
  'a window at 200 %, light': { viewport: { width: 640, height: 400 }, colorScheme: 'light' },
};

let server;
before(async () => {
  server = await serve(['town.ply', 'house.obj'], ...QUICK);
});

/** The violations that axe finds, each with its elements. */
async function violations(page) {
  await page.evaluate(axeSource);
  const { violations: found } = await page.evaluate(() => window.axe.run(document, { resultTypes: ['violations'] }));
  return found.flatMap(({ id, nodes }) => nodes.map((node) => `${id}: ${node.target.join(' ')} ${node.any[0]?.message ?? ''}`));
}

const LINE = [data.points[0], data.points.at(-1)].map(({ x, y, z }) => [x, y, z]);
const FIGURES = [{ kind: 'profile', name: 'profile 1', points: LINE, width: 1 }, { kind: 'volume', name: 'volume 2', points: [...LINE, [LINE[0][0], LINE[1][1], 148]], base: 'lowest' }];
const LEGENDS = { classes: { color: 'class', class: [2] }, map: { color: 'elevation' }, drawn: { color: 'elevation', legend: true } };

for (const [name, options] of Object.entries(SITUATIONS)) {
  test(`axe finds no violations in legends, cards and charts: ${name}`, async () => {
    const page = await openPage(server.link, options);
    const found = [];
    const look = async (part) => found.push(...(await violations(page)).map((text) => `${part}: ${text}`));
    for (const [legend, patch] of Object.entries(LEGENDS)) {
      await show(page, patch);
      await look(legend);
    }
    await page.goto('about:blank');
    await page.goto(server.link + encodeHash({}, FIGURES));
    await settled(page);
    await page.locator('#measure-card').waitFor();
    await look('measurements');
    await page.locator('[aria-label="Show profile 1"]').click();
    await page.locator('#profile-card .note:not(:empty)').waitFor();
    await look('chart');
    await page.locator('#profile-card [aria-label="Close"]').click();
    // The server's answer, which ends the adding, is held back.
    await page.evaluate(() => { XMLHttpRequest.prototype.send = () => {}; });
    await page.setInputFiles('#scene-file', { name: 'new.xyz', mimeType: 'text/plain', buffer: Buffer.from('1 2 3') });
    await page.locator('#added-card').waitFor();
    await look('added files');
    assert.deepEqual([...new Set(found)], []);
    await closePage(page);
  });
}

const DIALOGS = { save: '#save-cancel', export: '#export-close', help: '#help-close' };

for (const [name, options] of Object.entries(SITUATIONS)) {
  test(`axe finds no violations: ${name}`, async () => {
    const page = await openPage(server.link, options);
    const found = [...(await violations(page))];
    for (const [action, close] of Object.entries(DIALOGS)) {
      await page.locator(`[data-action="${action}"]`).click();
      found.push(...(await violations(page)).map((text) => `${action}: ${text}`));
      await page.locator(close).click();
    }
    await page.locator('[data-tool="pick"]').click();
    const pixel = await pixelAt(page, 0.6, 0.55);
    await page.mouse.click(pixel.x, pixel.y);
    await page.locator('#pick-card dl').waitFor();
    found.push(...(await violations(page)).map((text) => `pick: ${text}`));
    if (await page.locator('#sections').isHidden()) await page.locator('#panel-fold').click();
    await show(page, { color: 'elevation' });
    await unfoldPanel(page);
    await page.selectOption('[data-key="histogram.column"]', 'intensity');
    await page.locator('[data-action="save-view"]').click();
    await settled(page);
    found.push(...(await violations(page)).map((text) => `panel: ${text}`));
    await page.locator('[data-action="camera-path"]').click();
    await page.locator('[data-action="add-key"]').click();
    await page.locator('.path-keys li').waitFor();
    found.push(...(await violations(page)).map((text) => `path: ${text}`));
    assert.deepEqual([...new Set(found)], []);
    await closePage(page);
  });
}

for (const viewport of [{ width: 390, height: 844 }, { width: 844, height: 390 }]) {
  test(`targets of fingers have 44 pixels at ${viewport.width} x ${viewport.height}`, async () => {
    const page = await openPage(server.link, { ...PHONE, viewport });
    await unfoldPanel(page);
    if (await page.locator('#sections').isHidden()) await page.locator('#panel-fold').click();
    const small = await page.evaluate(() => [...document.querySelectorAll('button, select, input:not([type="range"]), summary')].flatMap((target) => {
      if (!target.checkVisibility() || getComputedStyle(target).visibility === 'hidden') return [];
      // The label of a check box is a part of its target.
      const boxes = [target, ...(target.type === 'checkbox' ? target.labels : [])].map((element) => element.getBoundingClientRect());
      const [width, height] = ['width', 'height'].map((side) => Math.max(...boxes.map((box) => box[side])));
      return width < 43.5 || height < 43.5 ? [`${target.outerHTML.slice(0, 90)} ${width} x ${height}`] : [];
    }));
    assert.deepEqual(small, []);
    await closePage(page);
  });
}

test('switches differ from the panel by a contrast of 3 to 1', async () => {
  for (const colorScheme of ['light', 'dark']) {
    const page = await openPage(server.link, { colorScheme });
    await unfoldPanel(page);
    const contrasts = await page.evaluate(() => {
      const luminance = (color) => {
        const [r, g, b] = color.match(/[\d.]+/g).map(Number).map((value) => value / 255)
          .map((value) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
      };
      const contrast = (a, b) => (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
      const panel = luminance(getComputedStyle(document.getElementById('panel')).backgroundColor);
      return [...document.querySelectorAll('[role="switch"]')].filter((one) => one.checkVisibility()).flatMap((one) => {
        const track = luminance(getComputedStyle(one).backgroundColor);
        const thumb = luminance(getComputedStyle(one, '::before').backgroundColor);
        return [contrast(track, panel), contrast(track, thumb)];
      });
    });
    assert.ok(8 < contrasts.length && contrasts.every((value) => 3 <= value), `${colorScheme}: ${contrasts}`);
    await closePage(page);
  }
});
