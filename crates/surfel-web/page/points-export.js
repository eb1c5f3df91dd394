// The part of the export dialog that downloads the points that are shown, as a file with the columns of theirs.

import { element } from './dom.js';
import { counted, duration, fileSize, stemOf } from './format.js';

const FORMATS = ['laz', 'ply'];

/** Puts the part into the dialog; returns a function that forgets the last file. */
export function setUpPointsExport(viewer, dialog) {
  const bar = element('progress', { max: 1, 'aria-label': 'Progress', hidden: true });
  const note = element('p', { class: 'note', role: 'status' });
  const link = element('a', { class: 'button is-main', 'data-action': 'download-points', hidden: true }, 'Download');
  const cancel = element('button', { type: 'button', class: 'button', hidden: true, onclick: () => abort?.abort() }, 'Cancel');
  const buttons = FORMATS.map((format) => element('button', {
    type: 'button', class: 'button', 'data-points': format, onclick: () => write(format),
  }, format.toUpperCase()));
  const part = element('section', { class: 'points-export' },
    element('h3', {}, 'Points that are shown'), element('div', { class: 'chips' }, ...buttons, cancel, link), bar, note);
  let abort = null;

  const show = (isWriting, text) => {
    bar.hidden = cancel.hidden = !isWriting;
    for (const button of buttons) button.disabled = isWriting;
    note.textContent = text;
  };

  const write = async (format) => {
    link.hidden = true;
    bar.removeAttribute('value');
    show(true, 'Writing');
    abort = new AbortController();
    const progress = ({ done, left_secs }) => {
      if (typeof done === 'number') bar.value = done;
      note.textContent = typeof left_secs === 'number' ? `Writing, ${duration(left_secs)} left` : 'Writing';
    };
    try {
      const { address, n_points, n_bytes } = await viewer.request({ type: 'points', format }, { progress, abort: abort.signal });
      link.href = address;
      link.download = `${stemOf(viewer.info.name)}-shown.${format}`;
      link.hidden = false;
      show(false, `${counted(n_points, 'point')}, ${fileSize(n_bytes)}`);
    } catch (error) {
      show(false, error.message === 'cancelled' ? 'Cancelled.' : error.message);
    }
    abort = null;
  };

  // The server keeps the file as long as the page is connected.
  viewer.connectionChanged.listen(() => {
    if (!link.hidden) show(false, '');
    link.hidden = true;
  });
  dialog.querySelector('footer').before(part);
  dialog.addEventListener('close', () => abort?.abort());
  return () => {
    part.hidden = !viewer.objects.some((object) => object.points);
    link.hidden = true;
    show(false, '');
  };
}
