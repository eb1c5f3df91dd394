// Settings of single files and objects as the texts of a scene file.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { settingOf, withSetting } from '../page/object-settings.js';

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
