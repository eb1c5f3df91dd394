// Files dropped on the page: those that are not loaded are named.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setUpSceneLoading } from '../page/scene-loading.js';
import { fakeDocument } from './fake-dom.mjs';

/** What happens when files of these names are dropped. */
function dropped(names, isConnected) {
  const document = fakeDocument();
  const happened = { shown: [], added: [] };
  const viewer = { isConnected, loadScene: ({ name }) => happened.shown.push(name) };
  setUpSceneLoading(viewer, {}, (files) => happened.added.push(...files.map(({ name }) => name)));
  document.emit('drop', { dataTransfer: { files: names.map((name) => ({ name })) } });
  const toasts = document.getElementById('toasts').children.map(({ textContent }) => textContent);
  return { ...happened, toasts };
}

test('a scene file is shown, and other files are added', () => {
  const happened = dropped(['a.laz', 'b.toml', 'c.ply'], true);
  assert.deepEqual(happened, { shown: ['b.toml'], added: ['a.laz', 'c.ply'], toasts: [] });
});

test('files that are not loaded are named', () => {
  const several = dropped(['a.toml', 'b.json', 'c.toml'], true);
  assert.deepEqual(several.shown, ['a.toml']);
  assert.deepEqual(several.toasts, ['b.json, c.toml: only one scene file is shown']);
  const offline = dropped(['a.laz', 'b.laz'], false);
  assert.deepEqual(offline.added, []);
  assert.deepEqual(offline.toasts, ['a.laz, b.laz: there is no connection']);
});
