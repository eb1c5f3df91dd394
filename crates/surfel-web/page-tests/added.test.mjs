// Files that were added to a page: links without them, and the box around everything.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { boxAround, distanceBetween, withoutAdded, withoutSettings } from '../page/added.js';

const added = new Map([['1', { name: 'chair.ply' }], ['2', { name: 'table.obj' }]]);

test('links carry neither added files nor their settings', () => {
  const patch = {
    added_files: ['1', '2'], spp: 4,
    object_settings: ['chair.ply:color=white', 'scan.laz:visible=false'], material: ['table.obj=glass', 'matte', 'chair.ply.old=metal'],
  };
  assert.deepEqual(withoutAdded(patch, added), {
    spp: 4, object_settings: ['scan.laz:visible=false'], material: ['matte', 'chair.ply.old=metal'],
  });
  assert.deepEqual(withoutAdded({ spp: 4, material: null }, added), { spp: 4, material: null });
  // Files of another connection have no names any more.
  assert.deepEqual(withoutAdded({ added_files: ['3'], spp: 4 }, added), { spp: 4 });
});

test('a removed file leaves no settings', () => {
  assert.deepEqual(withoutSettings({ object_settings: ['chair.ply:visible=false'], spp: 1 }, 'chair.ply'), { object_settings: [] });
  assert.deepEqual(withoutSettings({ material: null }, 'chair.ply'), {});
});

test('the box around everything grows, and far files are told', () => {
  const box = (at, size) => ({ min: [at, at, at], max: [at + size, at + size, at + size] });
  assert.deepEqual(boxAround([box(0, 10), box(-5, 2)]), { min: [-5, -5, -5], max: [10, 10, 10] });
  assert.equal(distanceBetween(box(0, 10), box(20, 5)), 0);
  assert.ok(500_000 < distanceBetween(box(500_000, 10), box(0, 1)));
});
