// Settings of single files and objects as the texts of a scene file.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { labelOf, settingOf, withSetting } from '../page/object-settings.js';

test('settings of objects are added, replaced and removed', () => {
  let list = withSetting(undefined, 'a:b.laz', 'visible', 'false');
  list = withSetting(list, 'a:b.laz', 'color', 'class');
  list = withSetting(list, 'c.obj', 'visible', 'false');
  assert.deepEqual(list, ['a:b.laz:visible=false', 'a:b.laz:color=class', 'c.obj:visible=false']);
  list = withSetting(list, 'a:b.laz', 'color', 'x=y');
  assert.equal(settingOf(list, 'a:b.laz', 'color'), 'x=y');
  assert.equal(settingOf(list, 'c.obj', 'color'), undefined);
  assert.deepEqual(withSetting(list, 'a:b.laz', 'visible', null), ['c.obj:visible=false', 'a:b.laz:color=x=y']);
});

test('objects are shown by their labels', () => {
  const list = withSetting([], 'a.laz', 'label', 'East: wall = 2');
  assert.equal(labelOf(list, { name: 'a.laz', label: null }), 'East: wall = 2');
  assert.equal(labelOf(list, { name: 'b.laz', label: 'West' }), 'West');
  assert.equal(labelOf(undefined, { name: 'b.laz', label: null }), 'b.laz');
});
