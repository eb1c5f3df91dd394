// Shared by all tests: servers, pages on them, and the pictures that they show.

import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { after } from 'node:test';
import { decodeHash, encodeHash } from '../page/link.js';
import { makeData } from './data.mjs';

const TARGET = process.env.CARGO_TARGET_DIR ?? join(import.meta.dirname, '../../../target');
/** The program under test. */
export const SURFEL = process.env.SURFEL ?? join(TARGET, 'debug/surfel');
const CHROMIUM = process.env.CHROMIUM ?? '/usr/bin/chromium';
/** Much more than anything takes: saves and movies leave the processor to all other work. */
export const TIMEOUT_MS = 300_000;
/** A host name of this machine that is no secure context to the browser, like the names of other machines. */
export const PLAIN_HOST = 'surfel.test';
const FLAGS = [`--host-resolver-rules=MAP ${PLAIN_HOST} 127.0.0.1`, '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
  '--disable-background-networking', '--disable-component-update', '--disable-sync'];

/** Options with few rays a pixel, so that pictures are soon finished. */
export const QUICK = ['--spp', '2', '--light-samples', '2'];
const VIEWPORT = { width: 760, height: 420 };

/** `PLAYWRIGHT` is the folder into which npm installed playwright-core. */
const { chromium } = createRequire(join(process.env.PLAYWRIGHT ?? import.meta.dirname, 'x.js'))('playwright-core');

export const data = makeData();
const browser = await chromium.launch({ executablePath: CHROMIUM, args: FLAGS });
const servers = new Set();
after(async () => {
  await browser.close();
  for (const server of servers) server.kill('SIGKILL');
  data.remove();
});

/** Starts a server of these files; resolves once it has printed its link. */
export async function serve(files, ...options) {
  const port = options.includes('--port') ? [] : ['--port', '0'];
  const words = ['view', '--quiet', ...files, ...port, ...options];
  const server = spawn(SURFEL, words, { cwd: data.folder, stdio: ['ignore', 'pipe', 'inherit'] });
  servers.add(server);
  const link = await new Promise((resolve, reject) => {
    let output = '';
    server.stdout.on('data', (text) => {
      output += text;
      const found = output.match(/http:\S+(?=\s)/);
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

/** Runs a command line of the program in a shell, in the folder of the data. */
export function shell(command) {
  const words = `surfel() { "$SURFEL" "$@"; }\n${command}`;
  return execFileSync('bash', ['-c', words], { cwd: data.folder, env: { ...process.env, SURFEL }, stdio: ['ignore', 'pipe', 'inherit'] });
}

/** An empty page that records its errors and warnings in `faults`. */
export async function blankPage(options = {}) {
  const context = await browser.newContext({ viewport: VIEWPORT, reducedMotion: 'reduce', ...options });
  if (!options.isMobile) await context.grantPermissions(['clipboard-read', 'clipboard-write']);
  await context.addInitScript(defineReadPixels);
  await context.addInitScript(definePicks);
  const page = await context.newPage();
  page.setDefaultTimeout(TIMEOUT_MS);
  page.faults = [];
  page.on('pageerror', (error) => page.faults.push(error.stack));
  page.on('console', (message) => {
    if (['error', 'warning'].includes(message.type())) page.faults.push(message.text());
  });
  return page;
}

/** Opens a page and waits for its finished picture. */
export async function openPage(link, options) {
  const page = await blankPage(options);
  await page.goto(link);
  await settled(page);
  return page;
}

/** Opens the initial view again: the address of a page has its view, which a reload would keep. */
export async function reopen(page) {
  const link = page.url().replace(/#.*/, '');
  await page.goto('about:blank');
  await page.goto(link);
  await settled(page);
}

/** Closes a page after its tests; asserts that it has recorded only these faults. */
export async function closePage(page, faults = []) {
  await page.context().close();
  assert.deepEqual(page.faults, faults);
}

export const state = (page, key) => page.evaluate((name) => window.surfel.state[name], key);

/** Waits until the screen shows the finished picture of all changes, with its overlay. */
export async function settled(page) {
  const progress = await page.evaluateHandle(() => ({ frame: 0, n_checks: 0 }));
  await page.waitForFunction((seen) => {
    const { lastFrame, lastSeq, size, connected, synced } = window.surfel?.state ?? {};
    const isFinished = connected && synced && lastFrame?.finished && lastFrame.seq === lastSeq
      && lastFrame.width === size.width && lastFrame.height === size.height;
    // While the pivot is shown, the interaction has not ended, and its end requests another picture.
    const isIdle = !document.querySelector('.pivot');
    seen.n_checks = isFinished && isIdle && (seen.n_checks === 0 || seen.frame === lastFrame.frame) ? seen.n_checks + 1 : 0;
    seen.frame = lastFrame?.frame;
    // Changes are sent in the next animation frame, and the overlay is drawn in the one after a picture.
    return seen.n_checks === 3;
  }, progress, { timeout: TIMEOUT_MS });
}

/** Runs in the page: counts picks in `picks.n_sent` and their answers in `picks.n_answered`; delays the next answers by `picks.delays_ms`. */
function definePicks() {
  const picks = { n_sent: 0, n_answered: 0, delays_ms: [] };
  window.picks = picks;
  window.WebSocket = class extends WebSocket {
    constructor(...words) {
      super(...words);
      this.addEventListener('message', (event) => {
        if (typeof event.data !== 'string' || JSON.parse(event.data).type !== 'pick') return;
        event.stopImmediatePropagation();
        setTimeout(() => {
          this.onmessage({ data: event.data });
          picks.n_answered += 1;
        }, picks.delays_ms.shift() ?? 0);
      });
    }

    send(message) {
      if (typeof message === 'string' && JSON.parse(message).type === 'pick') picks.n_sent += 1;
      super.send(message);
    }
  };
}

/** Records each picture that the page shows from now on in `window.pictures`, as `lastFrame`. */
export const recordPictures = (page) => page.evaluate(() => {
  window.pictures = [];
  // The status line changes with each picture.
  const watch = new MutationObserver(() => window.pictures.push(window.surfel.state.lastFrame));
  watch.observe(document.getElementById('numbers'), { childList: true });
});

/** Runs in the page: reads the bytes of the picture from a copy, which leaves the page's canvas unchanged. */
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

/** Number of different colours in the picture. */
export const colorCount = (page) => page.evaluate(() => new Set(new Uint32Array(window.readPixels().buffer)).size);

/** Opens all sections of the panel. */
export const unfoldPanel = (page) => page.evaluate(() => {
  for (const part of document.querySelectorAll('#panel details')) part.open = true;
});

/** A position in the window in CSS pixels, given as fractions of the picture's width and height. */
export async function pixelAt(page, x, y) {
  const viewport = await page.locator('#viewport').boundingBox();
  return { x: Math.round(viewport.x + x * viewport.width), y: Math.round(viewport.y + y * viewport.height) };
}

export async function drag(page, from, to, { button = 'left', steps = 8 } = {}) {
  await page.mouse.move(from.x, from.y);
  await page.mouse.down({ button });
  await page.mouse.move(to.x, to.y, { steps });
  await page.mouse.up({ button });
}

/** Clicks on a copy button, and waits for its confirmation, which is recorded, as it is shown only for a moment. */
export async function copyBy(button) {
  await button.evaluate((element) => {
    delete element.dataset.copied;
    const record = () => { if (element.matches('.is-done')) element.dataset.copied = ''; };
    new MutationObserver(record).observe(element, { attributeFilter: ['class'] });
  });
  await button.click();
  await button.and(button.page().locator('[data-copied]')).waitFor();
}

/** Waits until a state is recorded whose patch fulfils the condition: the address has it. */
export async function recorded(page, condition) {
  const start = performance.now();
  while (!condition(decodeHash(new URL(page.url()).hash)?.patch ?? {})) {
    assert.ok(performance.now() - start < TIMEOUT_MS, `${page.url()} never fulfils ${condition}`);
    await page.waitForTimeout(20);
  }
}

/** Shows the initial scene with `patch`, as a link typed into the address bar does. */
export async function show(page, patch) {
  await page.evaluate((to) => new Promise((resolve) => {
    if (location.hash === to) resolve();
    window.addEventListener('hashchange', () => resolve(), { once: true });
    location.hash = to;
  }), encodeHash(patch));
  await settled(page);
}
