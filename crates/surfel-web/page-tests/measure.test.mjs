// Measurements of known shapes, at national-grid coordinates.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { geoJson } from '../page/geojson.js';
import { decodeHash, encodeHash } from '../page/link.js';
import { isMeasurement, pathLength } from '../page/figures.js';
import {
  angleDegrees, area, circleThrough, corner, distances, levelArea, middle, perimeter, resultsOf,
} from '../page/measure.js';

const up = [0, 0, 1];
const [east, north] = [562337, 4183203];
const close = (a, b) => assert.ok(Math.abs(a - b) < 1e-6, `${a} is not ${b}`);

test('distances are straight, horizontal and vertical', () => {
  const found = distances([east, north, 10], [east + 3, north + 4, 10 - 12], up);
  close(found.straight, 13);
  close(found.horizontal, 5);
  close(found.vertical, -12);
});

test('the area of a roof and its level area', () => {
  const roof = [[east, north, 0], [east + 10, north, 0], [east + 10, north + 3, 4], [east, north + 3, 4]];
  close(area(roof), 50);
  close(levelArea(roof, up), 30);
  close(perimeter(roof), 30);
  close(area([...roof].reverse()), 50);
});

test('areas of concave polygons are exact', () => {
  const hook = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 2, 0], [1, 1, 0], [0, 1, 0]];
  close(area(hook), 3);
  close(levelArea(hook, [0, 1, 0]), 0);
});

test('labels are at the middle, the corner of a height above its first point', () => {
  assert.deepEqual(middle([[0, 0, 0], [2, 0, 0], [2, 2, 6], [0, 2, 6]]), [1, 1, 3]);
  assert.deepEqual(corner([1, 2, 3], [7, 8, 9], up), [1, 2, 9]);
});

test('results have names', () => {
  const height = resultsOf({ kind: 'height', points: [[0, 0, 5], [1, 1, 2]] }, up);
  assert.deepEqual(height, [{ name: 'Height', value: 3, dimension: 1 }]);
  const square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]];
  assert.deepEqual(resultsOf({ kind: 'area', points: square }, up).map(({ value }) => value), [1, 1, 4]);
});

test('angles, circles and lines have known sizes', () => {
  const corner = [[east + 3, north, 5], [east, north, 5], [east, north + 2, 5]];
  close(angleDegrees(corner), 90);
  close(angleDegrees([[1, 0, 0], [0, 0, 0], [-1, 0, 0]]), 180);
  close(pathLength(corner), 5);
  const turn = (degrees) => [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)];
  const circle = circleThrough([10, 130, 200].map((degrees) => [east + 2.5 * turn(degrees)[0], north, 7 + 2.5 * turn(degrees)[1]]));
  close(circle.radius, 2.5);
  circle.center.forEach((value, axis) => close(value, [east, north, 7][axis]));
  circle.axes.forEach((axis) => close(Math.hypot(...axis), 1));
  assert.equal(circleThrough([[0, 0, 0], [1, 1, 1], [3, 3, 3]]), null);
  assert.deepEqual(resultsOf({ kind: 'circle', points: [[0, 0, 0], [1, 1, 1], [3, 3, 3]] }, up)[1].value, Infinity);
});

test('measurements become GeoJSON in the coordinates of the file', () => {
  const points = [[east, north, 1], [east + 4, north, 1], [east + 4, north + 3, 1]];
  const info = { up, unit: 'm', epsg: 32633 };
  const { crs, features } = geoJson([{ kind: 'area', name: 'roof', points }, { kind: 'polyline', name: 'eaves', points }], info);
  assert.equal(crs.properties.name, 'urn:ogc:def:crs:EPSG::32633');
  assert.deepEqual(features[0].geometry, { type: 'Polygon', coordinates: [[...points, points[0]]] });
  assert.deepEqual(features[0].properties, { name: 'roof', kind: 'area', unit: 'm', area: 6, level_area: 6, perimeter: 12 });
  assert.deepEqual([features[1].geometry.type, features[1].properties.length], ['LineString', 7]);
  assert.equal(geoJson([], { up }).crs, undefined);
});

test('results in GeoJSON have no rounding errors', () => {
  const points = [[east, north, 105.24], [east, north, 107.01]];
  const { features: [height, note] } = geoJson([
    { kind: 'height', name: 'height 1', points }, { kind: 'annotation', name: 'ridge', points: [points[1]] },
  ], { up });
  assert.equal(height.properties.height, 1.77);
  assert.deepEqual(note, {
    type: 'Feature', properties: { name: 'ridge', kind: 'annotation' }, geometry: { type: 'Point', coordinates: points[1] },
  });
});

test('volumes have their results from the server, and links have none', () => {
  const points = [[0, 0, 0], [1, 0, 0], [0, 1, 0]];
  const figure = { kind: 'volume', name: 'volume 1', points, base: 'lowest' };
  assert.deepEqual(resultsOf(figure, [0, 0, 1]), []);
  const volume = { cut: 5, fill: 2, area: 0.5, base: 3, cell_size: 0.1, empty_fraction: 0.25 };
  const values = Object.fromEntries(resultsOf({ ...figure, volume }, [0, 0, 1]).map(({ name, value }) => [name, value]));
  assert.deepEqual(values, { Cut: 5, Fill: 2, Net: 3, 'Level area': 0.5, 'Base height': 3, 'Cell size': 0.1, 'Empty cells': 25 });
  assert.deepEqual(decodeHash(encodeHash({}, [{ ...figure, volume }])).measurements, [figure]);
  for (const changed of [{ base: 'mean' }, { base: -3 }, { cell_size: 2 }]) assert.ok(isMeasurement({ ...figure, ...changed }), JSON.stringify(changed));
  for (const changed of [{ base: 'top' }, { base: undefined }, { cell_size: 0 }, { cell_size: 'a' }, { points: points.slice(1) }]) {
    assert.ok(!isMeasurement({ ...figure, ...changed }), JSON.stringify(changed));
  }
});
