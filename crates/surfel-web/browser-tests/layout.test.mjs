// Layout: in windows of all sizes, light and dark, no element is cut off.

import assert from 'node:assert/strict';
import { before, test } from 'node:test';
import { encodeHash } from '../page/link.js';
import { closePage, data, openPage, pixelAt, serve, settled, show, unfoldPanel } from './harness.mjs';

const PHONE = { hasTouch: true, isMobile: true };
const WINDOWS = {
  'desktop, light': { viewport: { width: 1280, height: 720 }, colorScheme: 'light' },
  'small window, dark': { viewport: { width: 820, height: 520 }, colorScheme: 'dark' },
  'phone, dark': { ...PHONE, viewport: { width: 390, height: 760 }, deviceScaleFactor: 2, colorScheme: 'dark' },
  'phone in landscape, light': { ...PHONE, viewport: { width: 760, height: 360 }, colorScheme: 'light' },
  'small phone, light': { ...PHONE, viewport: { width: 320, height: 568 }, colorScheme: 'light' },
};

/** Windows in which tools and cards have little room: of laptops, zoomed by 200 %, and of phones. */
const MORE_WINDOWS = {
  laptop: { viewport: { width: 1366, height: 625 } },
  'large window': { viewport: { width: 1920, height: 1080 } },
  'half a window': { viewport: { width: 960, height: 540 } },
  '1280 x 800 at 200 %': { viewport: { width: 640, height: 400 } },
  '1366 x 683 at 200 %': { viewport: { width: 683, height: 341 } },
  'large phone': { ...PHONE, viewport: { width: 390, height: 844 } },
  'large phone in landscape': { ...PHONE, viewport: { width: 844, height: 390 } },
};
const LEGENDS = { none: { color: 'normal' }, classes: { color: 'class' }, map: { color: 'elevation' }, drawn: { color: 'elevation', legend: true } };

let server;
before(async () => {
  server = await serve(['moving.toml'], '--spp', '1', '--light-samples', '1');
});

/** Elements that extend beyond the window and cannot be scrolled into it. */
const outside = (page) => page.evaluate(() => {
  const clips = (element) => /auto|scroll|hidden/.test(getComputedStyle(element).overflow);
  const isScrolled = (element) => {
    for (let above = element.parentElement; above && above !== document.body; above = above.parentElement) if (clips(above)) return true;
    return false;
  };
  const name = (element) => `${element.tagName.toLowerCase()}#${element.id}.${element.getAttribute('class')}`;
  const found = [...document.body.querySelectorAll('*')].filter((element) => {
    if (element.closest('.visually-hidden, svg') || isScrolled(element) || !element.checkVisibility()) return false;
    const { left, top, right, bottom, width, height } = element.getBoundingClientRect();
    const isVisible = 0 < width && 0 < height;
    return isVisible && (left < -1 || top < -1 || innerWidth + 1 < right || innerHeight + 1 < bottom);
  });
  const { scrollWidth, scrollHeight } = document.documentElement;
  const isScrolling = innerWidth < scrollWidth || innerHeight < scrollHeight;
  return [...found.map(name), ...(isScrolling ? [`scrolls to ${scrollWidth} x ${scrollHeight}`] : [])];
});

/** Containers that scroll sideways, as their content is too wide. */
const tooWide = (page) => page.evaluate(() =>
  ['#panel', '#sections', '#cards', '#toolbar', '#status', 'dialog[open]'].filter((selector) => {
    const part = document.querySelector(selector);
    return part?.checkVisibility() && part.clientWidth + 1 < part.scrollWidth;
  }));

async function assertLayout(page, situation) {
  assert.deepEqual([...(await outside(page)), ...(await tooWide(page)), ...(await outOfReach(page))], [], situation);
}

/** Tools that are not within the picture or under something else, and pairs of parts over the picture that overlap. */
const outOfReach = (page) => page.evaluate(() => {
  if (document.querySelector('dialog[open]')) return [];
  const boxOf = (element) => element.getBoundingClientRect();
  const overlap = (a, b) => 1 < Math.min(a.right, b.right) - Math.max(a.left, b.left) && 1 < Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
  const viewport = boxOf(document.getElementById('viewport'));
  const isWithin = ({ left, top, right, bottom }) =>
    viewport.left <= left && viewport.top <= top && right <= viewport.right && bottom <= viewport.bottom;
  const tools = [...document.querySelectorAll('#toolbar button')].filter((button) => {
    const box = boxOf(button);
    const top = document.elementFromPoint((box.left + box.right) / 2, (box.top + box.bottom) / 2);
    return !isWithin(box) || !button.contains(top);
  });
  const selectors = ['#toolbar', '#legend', '#hint', '#pick-card', '#measure-card', '#profile-card', '#axis-cube', '.is-folded #panel'];
  const parts = selectors.map((selector) => document.querySelector(selector)).filter((part) => part?.checkVisibility());
  const boxes = parts.map((part) => {
    const { left, top, right, bottom } = boxOf(part);
    // Of cards that scroll, only a part is seen.
    const frame = part.closest('#cards') ? boxOf(part.closest('#cards')) : viewport;
    return { left, right, top: Math.max(top, frame.top), bottom: Math.min(bottom, frame.bottom) };
  });
  const pairs = boxes.flatMap((box, i) => boxes.slice(i + 1).flatMap((other, j) =>
    (overlap(box, other) ? [`#${parts[i].id} overlaps #${parts[i + 1 + j].id}`] : [])));
  return [...tools.map((button) => `${button.ariaLabel} is out of reach`), ...pairs];
});

const LINE = [data.points[0], data.points.at(-1)].map(({ x, y, z }) => [x, y, z]);

for (const [name, options] of Object.entries({ ...WINDOWS, ...MORE_WINDOWS })) {
  test(`tools, legend, cards and chart have room: ${name}`, async () => {
    const page = await openPage(server.link, options);
    for (const [legend, patch] of Object.entries(LEGENDS)) {
      await show(page, patch);
      assert.deepEqual(await outOfReach(page), [], legend);
      await page.locator('#toolbar [data-tool="profile"]').click();
      assert.deepEqual(await outOfReach(page), [], `${legend}, with a hint`);
      await page.locator('#toolbar [data-tool="profile"]').click();
    }
    for (const legend of [false, true]) {
      const figures = [
        { kind: 'profile', name: 'profile 1', points: LINE, width: 1 },
        { kind: 'annotation', name: 'a text that is longer than its field', points: LINE.slice(0, 1) },
      ];
      await page.goto('about:blank');
      await page.goto(server.link + encodeHash({ color: 'elevation', legend }, figures));
      await settled(page);
      await page.locator('#measure-card').waitFor();
      assert.deepEqual([...(await outOfReach(page)), ...(await tooWide(page))], [], `measurements, ${legend}`);
      await page.locator('[aria-label="Show profile 1"]').click();
      await page.locator('#profile-card .note:not(:empty)').waitFor();
      assert.deepEqual(await outOfReach(page), [], `chart, ${legend}`);
      const canvas = await page.locator('#profile-card canvas').boundingBox();
      assert.ok(100 <= canvas.height, `${canvas.height}`);
      await page.locator('#toolbar [data-tool="volume"]').click();
      assert.deepEqual(await outOfReach(page), [], `chart and hint, ${legend}`);
    }
    await closePage(page);
  });
}

test('hints for fingers do not speak of clicks and keys', async () => {
  const page = await openPage(server.link, WINDOWS['phone, dark']);
  for (const tool of await page.locator('#toolbar [data-tool]').all()) {
    await tool.click();
    assert.doesNotMatch(await page.locator('#hint').textContent(), /click|enter/i);
  }
  await closePage(page);
});

const DIALOGS = { save: '#save-cancel', export: '#export-close', help: '#help-close' };

for (const [name, options] of Object.entries(WINDOWS)) {
  test(name, async () => {
    const page = await openPage(server.link, options);
    await assertLayout(page, 'at the start');
    await show(page, { color: 'elevation' });
    await assertLayout(page, 'with a legend');
    for (const [action, close] of Object.entries(DIALOGS)) {
      await page.locator(`[data-action="${action}"]`).click();
      await assertLayout(page, action);
      await page.locator(close).click();
    }
    await page.locator('[data-tool="pick"]').click();
    const pixel = await pixelAt(page, 0.6, 0.55);
    await page.mouse.click(pixel.x, pixel.y);
    await page.locator('#pick-card dl').waitFor();
    await assertLayout(page, 'with a card');
    if (await page.locator('#sections').isHidden()) await page.locator('#panel-fold').click();
    await unfoldPanel(page);
    await assertLayout(page, 'with the panel');
    await closePage(page);
  });
}

test('light and dark colour schemes differ', async () => {
  const colors = [];
  for (const colorScheme of ['light', 'dark']) {
    const page = await openPage(server.link, { colorScheme });
    colors.push(await page.locator('#panel').evaluate((panel) => getComputedStyle(panel).backgroundColor));
    await closePage(page);
  }
  assert.notEqual(colors[0], colors[1]);
});

test('all controls have accessible names', async () => {
  const page = await openPage(server.link);
  await unfoldPanel(page);
  const nameless = await page.evaluate(() => [...document.querySelectorAll('button, input, select, textarea')]
    .filter((element) => element.checkVisibility() && !element.labels?.length && !element.textContent.trim() && !element.ariaLabel)
    .map((element) => element.outerHTML));
  assert.deepEqual(nameless, []);
  await closePage(page);
});
