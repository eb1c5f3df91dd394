// Formatting of numbers and materials, sizes of pictures, and headers of messages.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { coordinate, count, counted, duration, exact, fileSize, measured, rounded, shortest, ticks, withUnit } from '../page/format.js';
import { coordinatesText } from '../page/cursor-coordinates.js';
import { formatMaterial, materialOf, parseMaterial, withMaterial } from '../page/materials.js';
import { readHeader, socketAddress } from '../page/connection.js';
import { pictureSize } from '../page/picture.js';

test('coordinates keep their digits and lose rounding errors', () => {
  assert.equal(exact(562339.8540000001), '562339.854');
  assert.equal(exact(4183203.123456), '4183203.123456');
  assert.equal(exact(0.1 + 0.2), '0.3');
  assert.equal(exact(0.031234567), '0.03123457');
  assert.equal(exact(-12), '-12');
  assert.equal(exact('ground'), 'ground');
});

test('other numbers are rounded', () => {
  assert.equal(rounded(1234.5678), '1\u202f234.6');
  assert.equal(rounded(0.00123456), '0.0012');
  assert.equal(count(2499578), '2\u202f499\u202f578');
  assert.deepEqual([0, 1, 1200].map((n) => counted(n, 'point')), ['0 points', '1 point', '1\u202f200 points']);
  assert.equal(duration(2.44), '2.4 s');
  assert.equal(duration(200), '3 min 20 s');
  assert.equal(duration(7380), '2 h 3 min');
  assert.deepEqual([0, 640, 12_345_000, 2e15].map(fileSize), ['0\u00a0B', '640\u00a0B', '12.3\u00a0MB', '2\u202f000\u00a0TB']);
});

test('small measurements keep their digits', () => {
  const small = [0.000125, 0.0000014, 0.123456789, -0.05];
  assert.deepEqual(small.map(measured), ['0.000125', '0.0000014', '0.123457', '-0.05']);
  assert.deepEqual([1e-17, 0, 1.23456789, 12345.678].map(measured), ['0', '0', '1.23457', '12\u202f345.7']);
});

test('scales have round ticks', () => {
  assert.deepEqual(ticks(147.21, 156.04, 4), [150, 155]);
  assert.deepEqual(ticks(0, 1, 5), [0, 0.2, 0.4, 0.6, 0.8, 1]);
  assert.deepEqual(ticks(3, 3, 4), []);
});

test('materials survive parsing and formatting', () => {
  for (const text of ['glass', 'statue.ply=glass', 'a=glass:ior=1.33,color=#88ccff', 'glass:ior=1.5']) {
    assert.equal(formatMaterial(parseMaterial(text)), text);
  }
  assert.deepEqual(parseMaterial('a=glass:ior=1.33').properties, { ior: '1.33' });
  assert.deepEqual(parseMaterial('emissive:emissive-strength=2').properties, { emissive_strength: '2' });
  assert.deepEqual(parseMaterial('12:30.laz=glass'), { name: '12:30.laz', kind: 'glass', properties: {} });
});

test('an object uses its own last material before that of all objects', () => {
  const list = ['a=metal', 'glass', 'a=mirror'];
  assert.equal(materialOf(list, 'a').kind, 'mirror');
  assert.equal(materialOf(list, 'b').kind, 'glass');
  assert.equal(materialOf(undefined, 'b'), null);
  assert.deepEqual(withMaterial(list, 'a', 'plastic', { roughness: 0.1 }), ['glass', 'a=plastic:roughness=0.1']);
  assert.deepEqual(withMaterial(list, 'a', null, {}), ['glass']);
});

test('pictures have the pixels of the screen, up to the server\'s limit', () => {
  assert.deepEqual(pictureSize(800, 600, 2, Infinity), { width: 1600, height: 1200 });
  const limited = pictureSize(1600, 900, 2, 1_000_000);
  assert.ok(limited.width * limited.height <= 1_000_000 && 990_000 < limited.width * limited.height);
});

test('the header of a picture is decoded', () => {
  const bytes = new DataView(new ArrayBuffer(20));
  bytes.setUint8(0, 2);
  bytes.setUint8(1, 1);
  bytes.setUint16(2, 3, true);
  bytes.setUint32(4, 70000, true);
  bytes.setUint32(8, 12, true);
  [1280, 720, 4, 16].forEach((value, i) => bytes.setUint16(12 + 2 * i, value, true));
  assert.deepEqual(readHeader(bytes.buffer), {
    kind: 2, finished: true, scene: 3, frame: 70000, seq: 12, width: 1280, height: 720, samples: 4, of_samples: 16, type: 'image/png',
  });
});

test('the socket address has the host of the page', () => {
  const at = (protocol) => socketAddress({ protocol, host: 'host:8000' });
  assert.equal(at('http:'), 'ws://host:8000/ws');
  assert.equal(at('https:'), 'wss://host:8000/ws');
});

test('coordinates have the decimals of the file', () => {
  assert.equal(coordinate(484913.1, 2), '484913.10');
  assert.equal(coordinate(484913.1, null), '484913.1');
  assert.equal(coordinate(0.12345679), '0.12345679');
});

test('units stand behind values', () => {
  assert.equal(withUnit('2.51', 'ft'), '2.51\u00a0ft');
  assert.equal(withUnit('2.51', null), '2.51');
});

test('numbers of single precision lose their noise', () => {
  assert.equal(shortest(Math.fround(0.01)), 0.01);
  assert.equal(shortest(Math.fround(24.9789995)), 24.979);
  assert.equal(shortest(484913.123456), 484913.123);
  assert.equal(shortest(-3), -3);
});

test('coordinates under the mouse are those of the file, and of triangles without rounding errors', () => {
  const point = { kind: 'point', position: [484913.1, 6632700.07, 107.254], decimals: [2, 2, 3] };
  assert.equal(coordinatesText(point, 'm'), '484913.10  6632700.07  107.254\u00a0m');
  assert.equal(coordinatesText({ kind: 'point', position: [0.1, 2, -3] }, null), '0.1  2  -3');
  assert.equal(coordinatesText({ kind: 'triangle', position: [562339.1250000012, 1, 2] }, null), '562339.125  1  2');
});
