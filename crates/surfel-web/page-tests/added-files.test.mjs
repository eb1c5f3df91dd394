// Files that are added one after the other: an error of one does not stop the next one.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setUpAddedFiles } from '../page/added-files.js';
import { signal } from '../page/signal.js';
import { fakeDocument, settled } from './fake-dom.mjs';

/** Adds files of these names; returns the uploads and the requests that were made, and the toasts. */
function adding(...names) {
  const document = fakeDocument();
  const made = { uploads: [], requests: [] };
  globalThis.XMLHttpRequest = class {
    upload = {};
    isAborted = false;
    open() { made.uploads.push(this); }
    send() {}
    abort() { this.isAborted = true; }
  };
  const viewer = {
    info: { limits: { max_added_file_bytes: 100 }, bounds: { min: [0, 0, 0], max: [1, 1, 1] } },
    scene: {}, addedFiles: new Map(), connectionChanged: signal(), shown: [],
    changeSettings: ({ added_files }) => viewer.shown.push(added_files.at(-1)),
    request: (message, { progress, abort }) => new Promise((resolve, reject) => {
      abort.addEventListener('abort', () => reject(new Error('cancelled')));
      made.requests.push({ message, resolve, reject });
      progress({ address: `files/${message.name}` });
    }),
  };
  setUpAddedFiles(viewer)(names.map((name) => ({ name, size: 9 })));
  const toasts = () => document.getElementById('toasts').children.map(({ textContent }) => textContent);
  return { ...made, viewer, toasts };
}

const answer = (name) => ({ file: { id: name, name, bounds: { min: [0, 0, 0], max: [1, 1, 1] } } });

test('a late error of one upload leaves the next file alone', async () => {
  const { uploads, requests, viewer, toasts } = adding('a.ply', 'b.ply');
  requests[0].reject(new Error('a.ply is broken'));
  await settled();
  assert.deepEqual([uploads.length, uploads[0].isAborted, uploads[1].isAborted], [2, true, false]);
  uploads[0].onerror();
  requests[1].resolve(answer('b.ply'));
  await settled();
  assert.deepEqual([viewer.shown, toasts()], [['b.ply'], ['a.ply is broken']]);
});

test('a file that cannot be sent is named, and the next one is added', async () => {
  const { uploads, requests, viewer, toasts } = adding('folder', 'b.ply');
  uploads[0].onerror();
  await settled();
  requests[1].resolve(answer('b.ply'));
  await settled();
  assert.deepEqual(viewer.shown, ['b.ply']);
  assert.match(toasts()[0], /^folder could not be read or sent/);
});
