// The dialog that saves a finished picture: its size, progress and file.

import { download, element } from './dom.js';
import { duration, stemOf } from './format.js';

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
  let abort = null;

  const presets = document.getElementById('save-presets');
  presets.append(...Object.entries(PRESETS).map(([name, sizeOf]) => element('button', {
    type: 'button', class: 'chip', 'data-preset': name,
    onclick: () => { [width.value, height.value] = sizeOf(viewer.size); },
  }, name)));

  const show = (isSaving, text) => {
    form.classList.toggle('is-saving', isSaving);
    bar.hidden = !isSaving;
    start.disabled = isSaving;
    note.textContent = text;
  };

  form.addEventListener('submit', async (event) => {
    event.preventDefault();
    const size = { width: width.valueAsNumber, height: height.valueAsNumber };
    const maxPixels = viewer.info.limits.max_save_pixels;
    if (maxPixels < size.width * size.height) {
      show(false, `The server saves pictures of up to ${Math.round(maxPixels / 1e6)} million pixels.`);
      return;
    }
    bar.removeAttribute('value');
    show(true, 'Rendering');
    abort = new AbortController();
    const progress = ({ done, left_secs }) => {
      if (typeof done === 'number') bar.value = done;
      note.textContent = typeof left_secs === 'number' ? `Rendering, ${duration(left_secs)} left` : 'Rendering';
    };
    try {
      const { blob } = await viewer.request({ type: 'save', ...size }, { progress, abort: abort.signal });
      download(blob, `${stemOf(viewer.info.name)}.png`);
      show(false, 'Saved.');
    } catch (error) {
      show(false, error.message === 'cancelled' ? 'Cancelled.' : error.message);
    }
    abort = null;
  });

  document.getElementById('save-cancel').addEventListener('click', () => {
    if (abort) abort.abort();
    else dialog.close();
  });
  dialog.addEventListener('close', () => abort?.abort());

  return () => {
    [width.value, height.value] = PRESETS.window(viewer.size);
    show(false, '');
    dialog.showModal();
  };
}
