// Operates JupyterLab in Chromium: runs all cells of a notebook, and waits for the picture of the viewer in its cell.
//
//     node jupyter_page.mjs LINK SCREENSHOT
//
// Prints the origins that frame the viewer and the number of different colours in its picture.

import { createRequire } from 'node:module';
import { join } from 'node:path';

const TIMEOUT_MS = 120_000;
const FLAGS = ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
  '--disable-component-update', '--disable-sync'];
const { chromium } = createRequire(join(process.env.PLAYWRIGHT, 'x.js'))('playwright-core');
const [link, screenshot] = process.argv.slice(2);

const browser = await chromium.launch({ executablePath: process.env.CHROMIUM, args: FLAGS });
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 } });
  page.setDefaultTimeout(TIMEOUT_MS);
  page.on('console', (message) => {
    if (message.type() === 'error') console.error(message.text());
  });
  await page.goto(link);
  await page.locator('.jp-Notebook').waitFor();
  await page.waitForFunction(() => window.jupyterapp?.shell.currentWidget?.sessionContext?.session?.kernel?.status === 'idle');
  await page.evaluate(() => window.jupyterapp.commands.execute('notebook:run-all-cells'));
  const element = await page.locator('iframe[title="surfel viewer"]').elementHandle();
  const frame = await element.contentFrame();
  await frame.waitForFunction(() => window.surfel?.state?.lastFrame?.finished, undefined, { timeout: TIMEOUT_MS });
  const nColors = await frame.evaluate(() => {
    const picture = document.getElementById('picture');
    const copy = new OffscreenCanvas(picture.width, picture.height).getContext('2d');
    copy.drawImage(picture, 0, 0);
    return new Set(new Uint32Array(copy.getImageData(0, 0, picture.width, picture.height).data.buffer)).size;
  });
  const parents = await frame.evaluate(() => [...location.ancestorOrigins]);
  await element.scrollIntoViewIfNeeded();
  await page.screenshot({ path: screenshot });
  console.log(JSON.stringify({ parents, address: frame.url(), nColors }));
} finally {
  await browser.close();
}
