// What all tests use: a server of its own for each file of tests, pages on it, and what their pictures show.

import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { after } from 'node:test';
import { hashOf } from '../page/link.js';
import { makeData } from './data.mjs';

const TARGET = process.env.CARGO_TARGET_DIR ?? join(import.meta.dirname, '../../../target');
/** The program under test. */
export const SURFEL = process.env.SURFEL ?? join(TARGET, 'debug/surfel');
const CHROMIUM = process.env.CHROMIUM ?? '/usr/bin/chromium';
const PATIENCE_MS = 60_000;
/** Leads to this machine, but is no secure context to the browser, as those of other machines are none. */
export const PLAIN_HOST = 'surfel.test';
const FLAGS = [`--host-resolver-rules=MAP ${PLAIN_HOST} 127.0.0.1`, '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
  '--disable-background-networking', '--disable-component-update', '--disable-sync'];

/** Few rays a pixel, so that pictures end soon. */
export const QUICK = ['--spp', '2', '--samples', '2'];
const VIEWPORT = { width: 760, height: 420 };

/** `PLAYWRIGHT` is the folder into which `npm install playwright-core` was told to put it. */
const { chromium } = createRequire(join(process.env.PLAYWRIGHT ?? import.meta.dirname, 'x.js'))('playwright-core');

export const data = makeData();
const browser = await chromium.launch({ executablePath: CHROMIUM, args: FLAGS });
const servers = new Set();
after(async () => {
  await browser.close();
  for (const server of servers) server.kill('SIGKILL');
  data.remove();
});

/** A server of these files, as soon as it tells its link. */
export async function serve(files, ...options) {
  const port = options.includes('--port') ? [] : ['--port', '0'];
  const words = ['view', '--quiet', ...files, ...port, ...options];
  const server = spawn(SURFEL, words, { cwd: data.folder, stdio: ['ignore', 'pipe', 'inherit'] });
  servers.add(server);
  const link = await new Promise((resolve, reject) => {
    let told = '';
    server.stdout.on('data', (text) => {
      told += text;
      const found = told.match(/http:\S+(?=\s)/);
      if (found) resolve(found[0]);
    });
    server.on('exit', (status) => reject(new Error(`surfel ${words.join(' ')} ended with ${status}`)));
  });
  const stop = () => new Promise((resolve) => {
    servers.delete(server);
    server.on('exit', resolve);
    server.kill('SIGKILL');
  });
  return { link, port: new URL(link).port, stop };
}

/** Runs the program as a shell would, in the folder of the data. */
export function shell(command) {
  const words = `surfel() { "$SURFEL" "$@"; }\n${command}`;
  return execFileSync('bash', ['-c', words], { cwd: data.folder, env: { ...process.env, SURFEL }, stdio: ['ignore', 'pipe', 'inherit'] });
}

/** An empty page that takes notes of what goes wrong in it. */
export async function blankPage(options = {}) {
  const context = await browser.newContext({ viewport: VIEWPORT, reducedMotion: 'reduce', ...options });
  if (!options.isMobile) await context.grantPermissions(['clipboard-read', 'clipboard-write']);
  await context.addInitScript(defineReadPixels);
  await context.addInitScript(defineHeard);
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  page.faults = [];
  page.on('pageerror', (error) => page.faults.push(error.stack));
  page.on('console', (message) => {
    if (['error', 'warning'].includes(message.type())) page.faults.push(message.text());
  });
  return page;
}

/** A page that shows a finished picture. */
export async function openPage(link, options) {
  const page = await blankPage(options);
  await page.goto(link);
  await settled(page);
  return page;
}

/** Closes a page after its tests; nothing may have gone wrong in it. */
export async function closePage(page, faults = []) {
  await page.context().close();
  assert.deepEqual(page.faults, faults);
}

export const state = (page, key) => page.evaluate((name) => window.surfel.state[name], key);

/** Waits until the finished picture of all that was done is on the screen, with all that is drawn over it. */
export async function settled(page) {
  const calm = await page.evaluateHandle(() => ({ frame: 0, n_checks: 0 }));
  await page.waitForFunction((seen) => {
    const { lastFrame, lastInput, size, connected, agreed } = window.surfel?.state ?? {};
    const isFinished = connected && agreed && lastFrame?.finished && lastFrame.input === lastInput
      && lastFrame.width === size.width && lastFrame.height === size.height;
    // While the pivot is shown, the page has still to tell that the hand rests, and gets another picture for it.
    const isAtRest = !document.querySelector('.pivot');
    seen.n_checks = isFinished && isAtRest && (seen.n_checks === 0 || seen.frame === lastFrame.frame) ? seen.n_checks + 1 : 0;
    seen.frame = lastFrame?.frame;
    // What is done is sent in the next animation frame, and what comes is drawn over in the next.
    return seen.n_checks === 3;
  }, calm, { timeout: PATIENCE_MS });
}

/** In the page: counts what the server answers to picks, in `heard.n_picks`; the next ones wait for `heard.delays_ms`. */
function defineHeard() {
  const heard = { n_picks: 0, delays_ms: [] };
  window.heard = heard;
  window.WebSocket = class extends WebSocket {
    constructor(...words) {
      super(...words);
      this.addEventListener('message', (event) => {
        if (typeof event.data !== 'string' || JSON.parse(event.data).type !== 'picked') return;
        event.stopImmediatePropagation();
        setTimeout(() => {
          this.onmessage({ data: event.data });
          heard.n_picks += 1;
        }, heard.delays_ms.shift() ?? 0);
      });
    }
  };
}

/** From now on, `window.pictures` are all that the page has shown, each as `lastFrame` was. */
export const watchPictures = (page) => page.evaluate(() => {
  window.pictures = [];
  // The status line tells of each.
  const watch = new MutationObserver(() => window.pictures.push(window.surfel.state.lastFrame));
  watch.observe(document.getElementById('numbers'), { childList: true });
});

/** In the page: the bytes of the picture on the screen, read from a copy that leaves the page's canvas alone. */
function defineReadPixels() {
  window.readPixels = () => {
    const picture = document.getElementById('picture');
    const copy = new OffscreenCanvas(picture.width, picture.height).getContext('2d', { willReadFrequently: true });
    copy.drawImage(picture, 0, 0);
    return copy.getImageData(0, 0, picture.width, picture.height).data;
  };
}

/** A hash of the picture on the screen. */
export const pixels = (page) => page.evaluate(async () => {
  const hash = new Uint8Array(await crypto.subtle.digest('SHA-256', window.readPixels()));
  return [...hash].map((byte) => byte.toString(16).padStart(2, '0')).join('');
});

export async function finishedPixels(page) {
  await settled(page);
  return pixels(page);
}

/** How many colours the picture has. */
export const colorCount = (page) => page.evaluate(() => new Set(new Uint32Array(window.readPixels().buffer)).size);

/** Opens all parts of the panel. */
export const unfoldPanel = (page) => page.evaluate(() => {
  for (const part of document.querySelectorAll('#panel details')) part.open = true;
});

/** A place of the window, in CSS pixels, by shares of the picture's width and height. */
export async function placeAt(page, across, along) {
  const stage = await page.locator('#stage').boundingBox();
  return { x: Math.round(stage.x + across * stage.width), y: Math.round(stage.y + along * stage.height) };
}

export async function drag(page, from, to, { button = 'left', steps = 8 } = {}) {
  await page.mouse.move(from.x, from.y);
  await page.mouse.down({ button });
  await page.mouse.move(to.x, to.y, { steps });
  await page.mouse.up({ button });
}

/** Presses a button that copies. That it did, it shows only for a moment, which a slow machine might miss. */
export async function copyBy(button) {
  await button.evaluate((element) => {
    delete element.dataset.copied;
    const look = () => { if (element.matches('.is-done')) element.dataset.copied = ''; };
    new MutationObserver(look).observe(element, { attributeFilter: ['class'] });
  });
  await button.click();
  await button.and(button.page().locator('[data-copied]')).waitFor();
}

/** Shows the opening view as `patch` changes it, as a link typed into the address bar does. */
export async function show(page, patch) {
  await page.evaluate((to) => new Promise((resolve) => {
    if (location.hash === to) resolve();
    window.addEventListener('hashchange', () => resolve(), { once: true });
    location.hash = to;
  }), hashOf(patch));
  await settled(page);
}
