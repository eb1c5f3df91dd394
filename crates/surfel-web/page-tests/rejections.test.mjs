// Rejections: the key that the server names leads to a control, and the text names the key.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { findControl, rejectionText } from '../page/rejections.js';

const CONTROLS = [
  { key: 'surface' }, { key: 'radius_scale' }, { key: 'light.sun', sceneKey: 'light' }, { key: 'sun.azimuth' },
  { key: 'light.sky', sceneKey: 'light' }, { key: 'clip_box' }, { key: 'clip_box.x', sceneKey: 'clip_box' },
];
const found = (key, lastChangedIdx) => CONTROLS[findControl(CONTROLS, key, lastChangedIdx)]?.key;

test('a key with or without its section leads to the control', () => {
  for (const key of ['sun.azimuth', 'sun-azimuth', 'sun_azimuth', 'light.sun-azimuth', 'azimuth']) {
    assert.equal(found(key), 'sun.azimuth', key);
  }
  assert.equal(found('radius-scale'), 'radius_scale');
  assert.equal(found('points.radius-scale'), 'radius_scale');
});

test('a control of the whole key is preferred to one of a part', () => {
  assert.equal(found('clip_box'), 'clip_box');
  assert.equal(found('clip-box', 6), 'clip_box');
});

test('of several controls of one key the last changed one is preferred', () => {
  assert.equal(found('light'), 'light.sun');
  assert.equal(found('light', 4), 'light.sky');
});

test('unknown keys lead to no control', () => {
  for (const key of ['spp', 'camera.position', 'zenith', '']) assert.equal(found(key), undefined, key);
});

test('the text begins with the key', () => {
  assert.equal(rejectionText({ key: 'spp', text: 'found 5000' }), 'spp: found 5000');
  assert.equal(rejectionText({ text: 'there is no connection' }), 'there is no connection');
});
