// Named views: their numbers and names.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { renamed, withNewView } from '../page/named-views.js';

test('new views have names of their own, also after deletions', () => {
  const views = withNewView(withNewView([{ name: 'north', camera: {} }], { view_angle: 1 }), { view_angle: 2 });
  assert.deepEqual(views.map(({ name }) => name), ['north', 'view 1', 'view 2']);
  assert.equal(withNewView(views.filter(({ name }) => name !== 'view 1'), {}).at(-1).name, 'view 3');
});

test('a view is renamed unless the name is empty or taken', () => {
  const views = [{ name: 'a', camera: { view_angle: 3 } }, { name: 'b', camera: {} }];
  assert.deepEqual(renamed(views, 'a', ' north side ')[0], { name: 'north side', camera: { view_angle: 3 } });
  for (const name of ['', '  ', 'b', 'a']) assert.equal(renamed(views, 'a', name), views);
  assert.equal(renamed(views, 'a', 'x'.repeat(200))[0].name.length, 100);
});
