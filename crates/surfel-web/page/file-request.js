// Files that take the server long: the progress of a request, its end, how it is cancelled, and the link to the file.

import { duration } from './format.js';

/**
 * The requests of a part of the page, one at a time. `bar` shows their progress, and `note` what came of them;
 * `onRunningChanged(isRunning)` is called when one begins or ends. `link`, if there is one, leads to the file.
 */
export class FileRequest {
  #viewer;
  #parts;
  #abort = null;

  constructor(viewer, parts) {
    this.#viewer = viewer;
    this.#parts = parts;
    const { link } = parts;
    // The server keeps the file as long as the page is connected.
    if (link) viewer.connectionChanged.listen(() => { if (!link.hidden) this.forget(); });
  }

  get isRunning() {
    return this.#abort !== null;
  }

  cancel() {
    this.#abort?.abort();
  }

  /** Hides the link and the note. */
  forget() {
    this.#hideLink();
    this.report('');
  }

  /** Shows a text as the note. */
  report(text) {
    this.#show(false, text);
  }

  /**
   * Sends a message. `work` is what the server does, as in `Rendering, 3 s left`, and `first` the note before its
   * first progress. `finish` gets the answer and returns the text that stays.
   */
  async run(message, { work, first = work }, finish) {
    const { bar, note } = this.#parts;
    this.#hideLink();
    bar.removeAttribute('value');
    this.#show(true, first);
    this.#abort = new AbortController();
    const progress = ({ done, left_secs }) => {
      if (typeof done === 'number') bar.value = done;
      note.textContent = typeof left_secs === 'number' ? `${work}, ${duration(left_secs)} left` : work;
    };
    try {
      this.report(finish(await this.#viewer.request(message, { progress, abort: this.#abort.signal })));
    } catch (error) {
      this.report(error.message === 'cancelled' ? 'Cancelled.' : error.message);
    }
    this.#abort = null;
  }

  /** Shows the link to a file, which is saved under this name. */
  offer(address, name) {
    const { link } = this.#parts;
    link.href = address;
    link.download = name;
    link.hidden = false;
  }

  #show(isRunning, text) {
    const { bar, note, onRunningChanged } = this.#parts;
    bar.hidden = !isRunning;
    note.textContent = text;
    onRunningChanged(isRunning);
  }

  #hideLink() {
    if (this.#parts.link) this.#parts.link.hidden = true;
  }
}
