// The part of the camera path's card that exports the path as a movie: format, size, rate, progress and file.

import { element } from './dom.js';
import { FileRequest } from './file-request.js';
import { counted, fileSize, stemOf } from './format.js';

const FORMATS = { mp4: 'MP4 (H.264)', webm: 'WebM (VP9)', gif: 'GIF', png: 'animated PNG' };

/** `sceneFile` is the button beside those of the movie. Returns the part, a function that says whether the path is empty, and one that returns the size of frames. */
export function setUpMovieExport(viewer, sceneFile) {
  const number = (label, key, value, max, step = 1) => element('input', { type: 'number', min: 1, max, step, value, 'aria-label': label, 'data-movie': key });
  const [width, height, fps] = [number('Width', 'width', 1280, 32768), number('Height', 'height', 720, 32768), number('Frames a second', 'fps', 25, 240, 'any')];
  const format = element('select', { 'aria-label': 'Format of the movie', 'data-movie': 'format' },
    ...Object.entries(FORMATS).map(([value, label]) => element('option', { value }, label)));
  const bar = element('progress', { max: 1, 'aria-label': 'Progress of the movie', hidden: true });
  const note = element('p', { class: 'note', role: 'status' });
  const link = element('a', { class: 'button is-main', 'data-action': 'download-movie', hidden: true }, 'Download');
  const start = element('button', { type: 'button', class: 'button', 'data-action': 'movie', onclick: () => write() }, 'Export movie');
  const cancel = element('button', { type: 'button', class: 'button', 'data-action': 'cancel-movie', hidden: true, onclick: () => request.cancel() }, 'Cancel');
  const part = element('div', { class: 'movie' },
    element('h3', {}, 'Movie'),
    element('div', { class: 'chips' }, format, width, element('span', { 'aria-hidden': 'true' }, '×'), height, fps, element('span', { class: 'note' }, 'fps')),
    element('div', { class: 'chips' }, start, cancel, link, sceneFile), bar, note);
  let isEmpty = true;

  const request = new FileRequest(viewer, { bar, note, link, onRunningChanged: (isWriting) => {
    cancel.hidden = !isWriting;
    start.disabled = isWriting || isEmpty;
  } });

  const size = () => ({ width: width.valueAsNumber || 1280, height: height.valueAsNumber || 720 });

  const write = async () => {
    if (![width, height, fps].every((field) => field.reportValidity())) return;
    const message = { type: 'movie', format: format.value, ...size(), fps: fps.valueAsNumber || 25 };
    await request.run(message, { work: 'Rendering', first: 'Waiting' }, ({ address, n_frames, n_bytes }) => {
      request.offer(address, `${stemOf(viewer.info.name)}-movie.${message.format}`);
      return `${counted(n_frames, 'frame')}, ${fileSize(n_bytes)}`;
    });
  };

  const update = (isNowEmpty) => {
    isEmpty = isNowEmpty;
    if (!request.isRunning) start.disabled = isEmpty;
  };
  return { part, size, update };
}
