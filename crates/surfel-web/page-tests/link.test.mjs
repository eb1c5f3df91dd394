// Links and the patches in them come back as they went.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { hashOf, patchOfHash, viewPatch } from '../page/link.js';
import { joinPatches, mergePatch, patchBetween, patchOf, valueAt } from '../page/patch.js';

const opening = {
  resolution: '1280x720', color: 'rgb', sun: { azimuth: 230, elevation: 40 }, light: ['sun', 'sky'],
  camera: { position: [562346.94056, 4183168.26694, 170.3557], view_angle: 35 },
};
const present = {
  resolution: '800x600', color: 'class', sun: { azimuth: 12.5, elevation: 40 }, light: ['sun', 'sky'],
  camera: { position: [1, 2, 3], orthographic: 8 }, clip_box: '([0,1],[0,1],[0,1])',
};

test('the view of a link, laid over the opening scene, is the scene it was made of', () => {
  const patch = patchOfHash(hashOf(viewPatch(opening, present)));
  assert.deepEqual(patch, {
    color: 'class', sun: { azimuth: 12.5 }, clip_box: '([0,1],[0,1],[0,1])',
    camera: { position: [1, 2, 3], view_angle: null, orthographic: 8 },
  });
  assert.deepEqual(mergePatch(opening, patch), { ...present, resolution: '1280x720' });
});

test('the opening view needs no hash', () => {
  assert.equal(hashOf(viewPatch(opening, opening)), '');
});

test('hashes are plain letters, keep any name, and a micrometre', () => {
  const patch = { material: ['Säule №1 🏛=glass'], camera: { position: [4183168.26694470001, -1 / 3] } };
  const hash = hashOf(patch);
  assert.match(hash, /^#view=[A-Za-z0-9_-]+$/);
  const back = patchOfHash(hash);
  assert.deepEqual(back.material, patch.material);
  assert.ok(Math.abs(back.camera.position[0] - 4183168.2669447) < 1e-6);
});

test('what is no link is none', () => {
  for (const hash of ['', '#', '#top', '#view=', '#view=!!!', '#view=YWJj', '#view=WzFd']) {
    assert.equal(patchOfHash(hash), null, hash);
  }
});

test('patches merge as RFC 7386 says', () => {
  assert.deepEqual(mergePatch({ a: 'b', c: { d: 'e', f: 'g' } }, { a: 'z', c: { f: null } }), { a: 'z', c: { d: 'e' } });
  assert.deepEqual(mergePatch({ a: [1] }, { a: { b: { c: null } } }), { a: { b: {} } });
  assert.deepEqual(mergePatch([1, 2], { a: 'b' }), { a: 'b' });
});

test('joined patches do what both did one after the other', () => {
  const [first, second] = [{ sun: { azimuth: 1, angle: 2 }, color: null }, { sun: { angle: null }, color: 'rgb' }];
  const target = { sun: { angle: 7 }, color: 'class' };
  assert.deepEqual(mergePatch(target, joinPatches(first, second)), mergePatch(mergePatch(target, first), second));
});

test('paths lead to values and back', () => {
  assert.equal(valueAt(opening, 'sun.azimuth'), 230);
  assert.equal(valueAt(opening, 'fog.depth'), undefined);
  assert.deepEqual(patchOf('sun.azimuth', 5), { sun: { azimuth: 5 } });
  assert.deepEqual(patchBetween({ a: [1, 2] }, { a: [1, 3] }), { a: [1, 3] });
});
