// Height profiles: places in the world, charts, and files.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { borders, chartOf, levelLength, nearestPoint } from '../page/profile.js';
import { csvOf, svgOf } from '../page/profile-files.js';

const up = [0, 0, 1];
const [east, north] = [484000, 6632000];
/** East for 30, then north for 40, at different heights. */
const line = [[east, north, 5], [east + 30, north, 90], [east + 30, north + 40, 7]];
const profile = {
  distances: [0, 10, 35, 70], offsets: [0, 2, -1, 0], heights: [100, 104, 103, 100],
  positions: [[east, north, 100], [east + 10.13, north + 2, 104], [east + 31, north + 5, 103], [east + 30, north + 40, 100]],
  colors: [[1, 2, 3], [4, 5, 6], [7, 8, 9], [10, 11, 12]], n_found: 4,
};

test('a profile has a length and a strip', () => {
  assert.equal(levelLength(line, up), 70);
  assert.deepEqual(borders(line, 4, up)[0], [[east, north + 2, 5], [east + 30, north + 2, 90]]);
  assert.equal(levelLength([line[0], [east, north, 70]], up), 0);
});

test('a chart contains all points', () => {
  const chart = chartOf(profile, 70, { width: 800, height: 200 });
  for (let i = 0; i < 4; i++) {
    const [x, y] = [chart.x(profile.distances[i]), chart.y(profile.heights[i])];
    assert.ok(0 < x && x < 800 && 0 < y && y < 200, `${x} ${y}`);
  }
  assert.ok(chart.y(104) < chart.y(100) && chart.x(0) < chart.x(70));
  assert.ok(Math.abs(chart.exaggeration - ((chart.y(100) - chart.y(104)) / 4) / ((chart.x(70) - chart.x(0)) / 70)) < 1e-9);
  assert.equal(nearestPoint(profile, chart, { x: chart.x(10) + 3, y: chart.y(104) }, 12), 1);
  assert.equal(nearestPoint(profile, chart, { x: chart.x(10) + 30, y: chart.y(104) }, 12), -1);
  const flat = chartOf({ ...profile, heights: [5, 5, 5, 5] }, 70, { width: 800, height: 200 });
  assert.ok(Number.isFinite(flat.y(5)) && flat.yTicks.length < 20);
});

test('profiles become CSV with the coordinates of the files, and SVG', () => {
  const lines = csvOf(profile).split('\n');
  assert.equal(lines[0], 'distance,offset,height,x,y,z,red,green,blue');
  assert.equal(lines[2], `10,2,104,${east + 10.13},${north + 2},104,4,5,6`);
  assert.equal(lines.length, 6);
  const svg = svgOf(profile, chartOf(profile, 70, { width: 1200, height: 400 }), 'm');
  assert.equal(svg.match(/<circle /g).length, 4);
  assert.match(svg, /fill="rgb\(7 8 9\)"/);
});
