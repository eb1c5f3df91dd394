// The dialog that saves a finished picture: its size, progress and file.

import { download, element } from './dom.js';
import { FileRequest } from './file-request.js';
import { stemOf } from './format.js';

const PRESETS = {
  window: ({ width, height }) => [width, height],
  double: ({ width, height }) => [2 * width, 2 * height],
  '1920 × 1080': () => [1920, 1080],
  '3840 × 2160': () => [3840, 2160],
};

export function setUpSaveDialog(viewer) {
  const dialog = document.getElementById('save-dialog');
  const form = dialog.querySelector('form');
  const { width, height } = form.elements;
  const bar = document.getElementById('save-progress');
  const note = document.getElementById('save-note');
  const start = document.getElementById('save-start');

  const presets = document.getElementById('save-presets');
  presets.append(...Object.entries(PRESETS).map(([name, sizeOf]) => element('button', {
    type: 'button', class: 'chip', 'data-preset': name,
    onclick: () => { [width.value, height.value] = sizeOf(viewer.size); },
  }, name)));

  const request = new FileRequest(viewer, { bar, note, onRunningChanged: (isSaving) => {
    form.classList.toggle('is-saving', isSaving);
    start.disabled = isSaving;
  } });

  form.addEventListener('submit', async (event) => {
    event.preventDefault();
    const size = { width: width.valueAsNumber, height: height.valueAsNumber };
    const maxPixels = viewer.info.limits.max_save_pixels;
    if (maxPixels < size.width * size.height) {
      request.report(`The server saves pictures of up to ${Math.round(maxPixels / 1e6)} million pixels.`);
      return;
    }
    await request.run({ type: 'save', ...size }, { work: 'Rendering' }, ({ blob }) => {
      download(blob, `${stemOf(viewer.info.name)}.png`);
      return 'Saved.';
    });
  });

  document.getElementById('save-cancel').addEventListener('click', () => {
    if (request.isRunning) request.cancel();
    else dialog.close();
  });
  dialog.addEventListener('close', () => request.cancel());

  return () => {
    [width.value, height.value] = PRESETS.window(viewer.size);
    request.report('');
    dialog.showModal();
  };
}
