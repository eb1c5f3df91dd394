// The part of the export dialog that downloads the points that are shown, as a file with the columns of theirs.

import { element } from './dom.js';
import { FileRequest } from './file-request.js';
import { counted, fileSize, stemOf } from './format.js';

const FORMATS = ['laz', 'ply'];

/** Puts the part into the dialog; returns a function that forgets the last file. */
export function setUpPointsExport(viewer, dialog) {
  const bar = element('progress', { max: 1, 'aria-label': 'Progress', hidden: true });
  const note = element('p', { class: 'note', role: 'status' });
  const link = element('a', { class: 'button is-main', 'data-action': 'download-points', hidden: true }, 'Download');
  const cancel = element('button', { type: 'button', class: 'button', hidden: true, onclick: () => request.cancel() }, 'Cancel');
  const buttons = FORMATS.map((format) => element('button', {
    type: 'button', class: 'button', 'data-points': format, onclick: () => write(format),
  }, format.toUpperCase()));
  const part = element('section', { class: 'points-export' },
    element('h3', {}, 'Points that are shown'), element('div', { class: 'chips' }, ...buttons, cancel, link), bar, note);

  const request = new FileRequest(viewer, { bar, note, link, onRunningChanged: (isWriting) => {
    cancel.hidden = !isWriting;
    for (const button of buttons) button.disabled = isWriting;
  } });

  const write = (format) => request.run({ type: 'points', format }, { work: 'Writing' }, ({ address, n_points, n_bytes }) => {
    request.offer(address, `${stemOf(viewer.info.name)}-shown.${format}`);
    return `${counted(n_points, 'point')}, ${fileSize(n_bytes)}`;
  });

  dialog.querySelector('footer').before(part);
  dialog.addEventListener('close', () => request.cancel());
  return () => {
    part.hidden = !viewer.objects.some((object) => object.points);
    request.forget();
  };
}
