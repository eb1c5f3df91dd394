// Links, and the patches that they contain.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { encodeHash, decodeHash, readLink, viewPatch } from '../page/link.js';
import { combinePatches, mergePatch, createPatch, patchAt, valueAt } from '../page/merge-patch.js';

const initialScene = {
  resolution: '1280x720', color: 'rgb', sun: { azimuth: 230, elevation: 40 }, light: ['sun', 'sky'],
  camera: { position: [562346.94056, 4183168.26694, 170.3557], view_angle: 35 },
};
const currentScene = {
  resolution: '800x600', color: 'class', sun: { azimuth: 12.5, elevation: 40 }, light: ['sun', 'sky'],
  camera: { position: [1, 2, 3], orthographic: 8 }, clip_box: '([0,1],[0,1],[0,1])',
};

test('the patch of a link restores the scene', () => {
  const { patch } = decodeHash(encodeHash(viewPatch(initialScene, currentScene)));
  assert.deepEqual(patch, {
    color: 'class', sun: { azimuth: 12.5 }, clip_box: '([0,1],[0,1],[0,1])',
    camera: { position: [1, 2, 3], view_angle: null, orthographic: 8 },
  });
  assert.deepEqual(mergePatch(initialScene, patch), { ...currentScene, resolution: '1280x720' });
});

test('the initial scene needs no hash', () => {
  assert.equal(encodeHash(viewPatch(initialScene, initialScene)), '');
});

test('hashes are URL-safe, and keep any name and micrometres', () => {
  const patch = { material: ['Säule №1 🏛=glass'], camera: { position: [4183168.26694470001, -1 / 3] } };
  const hash = encodeHash(patch);
  assert.match(hash, /^#view=[A-Za-z0-9_-]+$/);
  const { patch: back } = decodeHash(hash);
  assert.deepEqual(back.material, patch.material);
  assert.ok(Math.abs(back.camera.position[0] - 4183168.2669447) < 1e-6);
});

test('links carry valid measurements', () => {
  const figure = { kind: 'distance', name: 'distance 1', points: [[1, 2, 3], [4, 5, 6]] };
  assert.deepEqual(decodeHash(encodeHash({}, [figure])), { patch: {}, measurements: [figure], n_invalid: 0 });
  const invalid = [
    null, 7, {}, { ...figure, kind: 'toString' }, { ...figure, name: 5 }, { ...figure, name: 'a'.repeat(101) },
    { ...figure, points: [[1, 2, 3]] }, { ...figure, points: [[1, 2], [3, 4]] }, { ...figure, points: [[1, 2, 'x'], [1, 2, 3]] },
    { ...figure, kind: 'area' },
  ];
  const many = Array(2000).fill(figure);
  const mixed = decodeHash(encodeHash({ color: 'rgb' }, [...invalid, ...many]));
  assert.deepEqual(mixed, { patch: { color: 'rgb' }, measurements: many, n_invalid: invalid.length });
  assert.deepEqual(decodeHash(encodeHash({ measurements: 'text' })), { patch: {}, measurements: [], n_invalid: 1 });
});

test('links carry measurements unless they are those of the scene', () => {
  const figure = { kind: 'annotation', name: 'ridge', points: [[1, 2, 3]] };
  assert.equal(encodeHash({}, [figure], [figure]), '');
  assert.equal(decodeHash(encodeHash({ color: 'rgb' }, [figure], [figure])).measurements, null);
  assert.deepEqual(decodeHash(encodeHash({}, [], [figure])).measurements, []);
  assert.deepEqual(viewPatch({ measurements: [figure] }, { color: 'rgb' }), { color: 'rgb' });
});

test('invalid hashes are ignored', () => {
  for (const hash of ['', '#', '#top', '#view=', '#view=!!!', '#view=YWJj', '#view=WzFd']) {
    assert.equal(decodeHash(hash), null, hash);
  }
});

test('a link that is nested deeper than the server reads is broken', () => {
  const nested = (depth) => `#view=${btoa(`${'{"a":'.repeat(depth)}1${'}'.repeat(depth)}`).replace(/=+$/, '')}`;
  assert.ok(decodeHash(nested(100)));
  for (const depth of [101, 130, 10_000, 150_000]) assert.equal(decodeHash(nested(depth)), null, `${depth}`);
});

test('what is invalid in a link is reported', () => {
  const reports = (hash) => {
    const texts = [];
    readLink(hash, (text) => texts.push(text));
    return texts;
  };
  const hash = encodeHash({ color: 'elevation' }, [{ kind: 'distance', name: 'distance 1', points: [[1, 2, 3], [4, 5, 6]] }]);
  for (const fine of ['', '#', '#top', hash]) assert.deepEqual(reports(fine), []);
  for (const broken of ['#view=', '#view=!!!', hash.slice(0, 26)]) assert.match(reports(broken)[0], /broken or incomplete/, broken);
  assert.match(reports(encodeHash({ measurements: [7] }))[0], /invalid measurements/);
  assert.deepEqual(readLink('#view=!!!', () => {}), { patch: {}, measurements: null });
});

test('patches merge as RFC 7386 defines', () => {
  assert.deepEqual(mergePatch({ a: 'b', c: { d: 'e', f: 'g' } }, { a: 'z', c: { f: null } }), { a: 'z', c: { d: 'e' } });
  assert.deepEqual(mergePatch({ a: [1] }, { a: { b: { c: null } } }), { a: { b: {} } });
  assert.deepEqual(mergePatch([1, 2], { a: 'b' }), { a: 'b' });
});

test('a combined patch has the effect of both', () => {
  const [first, second] = [{ sun: { azimuth: 1, angle: 2 }, color: null }, { sun: { angle: null }, color: 'rgb' }];
  const target = { sun: { angle: 7 }, color: 'class' };
  assert.deepEqual(mergePatch(target, combinePatches(first, second)), mergePatch(mergePatch(target, first), second));
});

test('paths address values', () => {
  assert.equal(valueAt(initialScene, 'sun.azimuth'), 230);
  assert.equal(valueAt(initialScene, 'fog.depth'), undefined);
  assert.deepEqual(patchAt('sun.azimuth', 5), { sun: { azimuth: 5 } });
  assert.deepEqual(createPatch({ a: [1, 2] }, { a: [1, 3] }), { a: [1, 3] });
});
