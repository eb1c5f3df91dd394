// The export of movies: the link to a movie goes with the connection, as the movie does.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { setUpMovieExport } from '../page/movie-export.js';
import { signal } from '../page/signal.js';
import { fakeDocument, settled } from './fake-dom.mjs';

test('a movie is downloaded until the connection is lost', async () => {
  fakeDocument();
  const viewer = {
    info: { name: 'town.laz' }, connectionChanged: signal(),
    request: async () => ({ address: 'downloads/1', n_frames: 12, n_bytes: 640 }),
  };
  const { part, update } = setUpMovieExport(viewer, null);
  const [link] = part.all('a');
  const [start] = part.all('button');
  part.all('select')[0].value = 'mp4';
  const note = part.all('p').at(-1);
  update(false);
  start.emit('click');
  await settled();
  assert.deepEqual([link.hidden, link.href, link.download], [false, 'downloads/1', 'town-movie.mp4']);
  assert.equal(note.textContent, '12 frames, 640\u00a0B');
  viewer.connectionChanged({ isConnected: false });
  assert.deepEqual([link.hidden, note.textContent, start.disabled], [true, '', false]);
});
