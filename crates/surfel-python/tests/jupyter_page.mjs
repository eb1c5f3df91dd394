// Operates JupyterLab in Chromium: runs all cells of a notebook, and waits for the picture of the viewer in its cell.
//
//     node jupyter_page.mjs LINK SCREENSHOT
//
// Prints the origins that frame the viewer and the number of different colours in its picture. Each step ends within
// four minutes; one that does not is named, with what the page showed and which messages it had exchanged with the kernel.

import { createRequire } from 'node:module';
import { join } from 'node:path';

const STEP_TIMEOUT_MS = 240_000;
/** Chromium sends no animation frames to a frame out of view, so conditions are looked at by the clock. */
const BY_CLOCK = { polling: 200 };
const N_LISTED_MESSAGES = 60;
const FLAGS = ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
  '--disable-component-update', '--disable-sync'];
const { chromium } = createRequire(join(process.env.PLAYWRIGHT, 'x.js'))('playwright-core');
const [link, screenshot] = process.argv.slice(2);
const events = [];

/** The result of a step; fails with the name of the step if it takes too long. */
async function step(name, promise, timeout_ms = STEP_TIMEOUT_MS) {
  let timer;
  const late = new Promise((_, reject) => {
    timer = setTimeout(() => reject(new Error(`not within ${timeout_ms / 1000} s: ${name}`)), timeout_ms);
  });
  try {
    return await Promise.race([promise, late]);
  } finally {
    clearTimeout(timer);
  }
}

const record = (text) => events.push(`${(performance.now() / 1000).toFixed(1)} ${text}`);

/** Records errors of the page, and the types of the messages that it exchanges with the kernel. */
function watch(page) {
  page.on('console', (message) => message.type() === 'error' && record(message.text()));
  page.on('pageerror', (error) => record(error.message));
  page.on('websocket', (socket) => {
    if (!socket.url().includes('/channels')) return;
    const types = ({ payload }) => [...String(payload).matchAll(/"(?:msg_type|execution_state)": ?"([^"]*)"/g)].map((it) => it[1]);
    socket.on('framesent', (frame) => record(`> ${types(frame).join(' ')}`));
    socket.on('framereceived', (frame) => record(`< ${types(frame).join(' ')}`));
    socket.on('close', () => record('closed'));
  });
}

/** The visible part of the notebook: the state of the kernel, the prompts of the cells and their outputs. */
const describe = (page) => page.evaluate(() => {
  const { session } = window.jupyterapp?.shell.currentWidget?.sessionContext ?? {};
  const texts = (selector) => [...document.querySelectorAll(selector)].map((it) => it.textContent.trim());
  return JSON.stringify({
    kernel: session?.kernel?.status, connection: session?.kernel?.connectionStatus, prompts: texts('.jp-InputPrompt'),
    outputs: texts('.jp-OutputArea-output'), dialogs: texts('.jp-Dialog'), frames: [...document.querySelectorAll('iframe')].map((it) => it.src),
  });
});

async function operate(page) {
  page.setDefaultTimeout(STEP_TIMEOUT_MS);
  await step('JupyterLab opens', page.goto(link));
  await step('the notebook opens', page.locator('.jp-Notebook').waitFor());
  await step('the kernel is idle', page.waitForFunction(() => window.jupyterapp?.shell.currentWidget?.sessionContext?.session?.kernel?.status === 'idle', undefined, BY_CLOCK));
  record('run');
  await step('the cells run', page.evaluate(() => window.jupyterapp.commands.execute('notebook:run-all-cells')));
  record('ran');
  const element = await step('the frame of the viewer is there', page.locator('iframe[title="surfel viewer"]').elementHandle());
  const frame = await step('the frame has a page', element.contentFrame());
  await step('the picture is finished', frame.waitForFunction(() => {
    const { synced, lastFrame } = window.surfel?.state ?? {};
    return synced && lastFrame?.finished && document.getElementById('work-bar').hidden;
  }, undefined, BY_CLOCK));
  const found = await step('the picture is read', frame.evaluate(() => {
    const picture = document.getElementById('picture');
    const copy = new OffscreenCanvas(picture.width, picture.height).getContext('2d');
    copy.drawImage(picture, 0, 0);
    const { buffer } = copy.getImageData(0, 0, picture.width, picture.height).data;
    return { parents: [...location.ancestorOrigins], address: location.href, nColors: new Set(new Uint32Array(buffer)).size };
  }));
  await step('the cell is in view', element.scrollIntoViewIfNeeded());
  await step('the screenshot is taken', page.screenshot({ path: screenshot }));
  return found;
}

const browser = await step('Chromium starts', chromium.launch({ executablePath: process.env.CHROMIUM, args: FLAGS }));
const page = await step('a tab opens', browser.newPage({ viewport: { width: 1280, height: 900 } }));
watch(page);
try {
  console.log(JSON.stringify(await operate(page)));
} catch (error) {
  console.error(error.message);
  console.error(await step('the page is described', describe(page), 10_000).catch(({ message }) => message));
  console.error(events.slice(-N_LISTED_MESSAGES).join('\n'));
  await step('the screenshot is taken', page.screenshot({ path: screenshot }), 10_000).catch(({ message }) => console.error(message));
  process.exitCode = 1;
}
await step('Chromium ends', browser.close(), 20_000).catch(({ message }) => console.error(message));
// What Chromium leaves open would keep this process.
process.exit();
