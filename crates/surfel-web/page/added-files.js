// Files that are added to the page's view: sent to the server, which reads them and keeps them in memory.

import { distanceBetween } from './added.js';
import { element } from './dom.js';
import { duration, fileSize } from './format.js';
import { showToast } from './toast.js';

/** Returns a function that adds files, one after the other. */
export function setUpAddedFiles(viewer) {
  const title = element('h2', {});
  const bar = element('progress', { max: 1, 'aria-label': 'Progress' });
  const note = element('p', { class: 'note', role: 'status' });
  const cancel = element('button', { type: 'button', class: 'button', 'data-action': 'cancel-added', onclick: () => abort?.abort() }, 'Cancel');
  const card = element('section', { id: 'added-card', class: 'card', 'aria-label': 'Files that are being added', hidden: true },
    element('header', {}, title, cancel), bar, note);
  document.getElementById('cards').append(card);
  let abort = null;
  let queue = [];

  const show = (text, done) => {
    note.textContent = text;
    if (typeof done === 'number') bar.value = done;
    else bar.removeAttribute('value');
  };

  /** Sends the bytes of a file to an address of the server; a failure aborts `adding`, which may be over by then. */
  const send = (address, file, adding) => {
    const request = new XMLHttpRequest();
    request.open('POST', address);
    request.upload.onprogress = ({ loaded, total }) => show(`Sending, ${fileSize(loaded)} of ${fileSize(total)}`, loaded / total);
    // A folder, or a file that has changed or vanished since it was chosen.
    request.onerror = () => adding.abort(`${file.name} could not be read or sent. A folder cannot be added.`);
    adding.signal.addEventListener('abort', () => request.abort());
    request.send(file);
  };

  const add = async (file) => {
    const limit = viewer.info.limits.max_added_file_bytes;
    if (limit < file.size) throw new Error(`${file.name} has ${fileSize(file.size)}; files of up to ${fileSize(limit)} can be added.`);
    const adding = abort;
    const progress = ({ address, done, left_secs }) => {
      if (address) send(address, file, adding);
      else show(typeof left_secs === 'number' ? `Reading, ${duration(left_secs)} left` : 'Reading', done);
    };
    const answer = await viewer.request({ type: 'addFile', name: file.name, n_bytes: file.size }, { progress, abort: adding.signal });
    const { id } = answer.file;
    const away = distanceBetween(viewer.info.bounds, answer.file.bounds);
    viewer.addedFiles.set(id, answer.file);
    viewer.changeSettings({ added_files: [...(viewer.scene.added_files ?? []), id] });
    if (away) showToast(`${answer.file.name} lies far from all else. "Zoom to" in the list of objects leads to it.`);
  };

  const work = async () => {
    card.hidden = false;
    while (queue.length) {
      const [file] = queue;
      abort = new AbortController();
      title.textContent = `Adding ${file.name}`;
      show('Waiting');
      try {
        await add(file);
      } catch (error) {
        const { aborted, reason } = abort.signal;
        // The bytes of a file that the server has refused are sent no further.
        abort.abort();
        if (typeof reason === 'string') showToast(reason);
        else if (aborted) queue = queue.slice(0, 1);
        else showToast(error.message);
      }
      queue.shift();
    }
    card.hidden = true;
    abort = null;
  };

  viewer.connectionChanged.listen(({ isConnected }) => {
    const lost = [...viewer.addedFiles.values()].filter((file) => !file.isLost);
    if (isConnected || !lost.length) return;
    for (const file of lost) file.isLost = true;
    showToast(`The connection was lost, and with it ${namesOf(lost)}. Add them again.`, 'lost files');
  });

  return (files) => {
    queue.push(...files);
    if (!abort) work();
  };
}

const namesOf = (files) => files.map(({ name }) => name).join(', ');
