// Layout: on every size of window, by day and by night, everything is in its place.

import assert from 'node:assert/strict';
import { before, test } from 'node:test';
import { closePage, openPage, placeAt, serve, show, unfoldPanel } from './harness.mjs';

const PHONE = { hasTouch: true, isMobile: true };
const WINDOWS = {
  'a desk by day': { viewport: { width: 1280, height: 720 }, colorScheme: 'light' },
  'a small window by night': { viewport: { width: 820, height: 520 }, colorScheme: 'dark' },
  'a phone by night': { ...PHONE, viewport: { width: 390, height: 760 }, deviceScaleFactor: 2, colorScheme: 'dark' },
  'a phone on its side by day': { ...PHONE, viewport: { width: 760, height: 360 }, colorScheme: 'light' },
  'a small phone by day': { ...PHONE, viewport: { width: 320, height: 568 }, colorScheme: 'light' },
};

let server;
before(async () => {
  server = await serve(['moving.toml'], '--spp', '1', '--samples', '1');
});

/** Elements that reach out of the window, though nothing scrolls them into it. */
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
    const isThere = 0 < width && 0 < height;
    return isThere && (left < -1 || top < -1 || innerWidth + 1 < right || innerHeight + 1 < bottom);
  });
  const { scrollWidth, scrollHeight } = document.documentElement;
  const isScrolling = innerWidth < scrollWidth || innerHeight < scrollHeight;
  return [...found.map(name), ...(isScrolling ? [`scrolls to ${scrollWidth} x ${scrollHeight}`] : [])];
});

/** Parts that scroll sideways: something in them is wider than they are. */
const tooWide = (page) => page.evaluate(() =>
  ['#panel', '#sections', '#cards', '#toolbar', '#status', 'dialog[open]'].filter((selector) => {
    const part = document.querySelector(selector);
    return part?.checkVisibility() && part.clientWidth + 1 < part.scrollWidth;
  }));

async function isInPlace(page, what) {
  assert.deepEqual([...(await outside(page)), ...(await tooWide(page))], [], what);
}

const DIALOGS = { save: '#save-cancel', take: '#take-close', help: '#help-close' };

for (const [name, options] of Object.entries(WINDOWS)) {
  test(name, async () => {
    const page = await openPage(server.link, options);
    await isInPlace(page, 'at the start');
    await show(page, { color: 'elevation' });
    await isInPlace(page, 'with a legend');
    for (const [action, close] of Object.entries(DIALOGS)) {
      await page.locator(`[data-action="${action}"]`).click();
      await isInPlace(page, action);
      await page.locator(close).click();
    }
    await page.locator('[data-tool="pick"]').click();
    const place = await placeAt(page, 0.6, 0.55);
    await page.mouse.click(place.x, place.y);
    await page.locator('#pick-card dl').waitFor();
    await isInPlace(page, 'with a card');
    if (await page.locator('#sections').isHidden()) await page.locator('#panel-fold').click();
    await unfoldPanel(page);
    await isInPlace(page, 'with the panel');
    await closePage(page);
  });
}

test('light and dark are different', async () => {
  const colors = [];
  for (const colorScheme of ['light', 'dark']) {
    const page = await openPage(server.link, { colorScheme });
    colors.push(await page.locator('#panel').evaluate((panel) => getComputedStyle(panel).backgroundColor));
    await closePage(page);
  }
  assert.notEqual(colors[0], colors[1]);
});

test('everything that can be pressed has a name', async () => {
  const page = await openPage(server.link);
  await unfoldPanel(page);
  const nameless = await page.evaluate(() => [...document.querySelectorAll('button, input, select, textarea')]
    .filter((element) => element.checkVisibility() && !element.labels?.length && !element.textContent.trim() && !element.ariaLabel)
    .map((element) => element.outerHTML));
  assert.deepEqual(nameless, []);
  await closePage(page);
});
