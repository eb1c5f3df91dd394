// Layout: in windows of all sizes, light and dark, no element is cut off.

import assert from 'node:assert/strict';
import { before, test } from 'node:test';
import { closePage, openPage, pixelAt, serve, show, unfoldPanel } from './harness.mjs';

const PHONE = { hasTouch: true, isMobile: true };
const WINDOWS = {
  'desktop, light': { viewport: { width: 1280, height: 720 }, colorScheme: 'light' },
  'small window, dark': { viewport: { width: 820, height: 520 }, colorScheme: 'dark' },
  'phone, dark': { ...PHONE, viewport: { width: 390, height: 760 }, deviceScaleFactor: 2, colorScheme: 'dark' },
  'phone in landscape, light': { ...PHONE, viewport: { width: 760, height: 360 }, colorScheme: 'light' },
  'small phone, light': { ...PHONE, viewport: { width: 320, height: 568 }, colorScheme: 'light' },
};

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
  assert.deepEqual([...(await outside(page)), ...(await tooWide(page))], [], situation);
}

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
