// Sun positions agree with almanacs, and the hour sets them.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { signal } from '../page/signal.js';
import { sunAtHour, sunPosition } from '../page/sun.js';
import { sunClock } from '../page/sun-clock.js';
import { fakeDocument } from './fake-dom.mjs';

const close = (a, b, tolerance) => assert.ok(Math.abs(a - b) < tolerance, `${a} is not ${b}`);

test('the published example of the SPA algorithm (Reda and Andreas 2004)', () => {
  // Golden, Colorado, 17 October 2003, 12:30:30 local time (UTC-7): zenith 50.11162, azimuth 194.34024.
  const sun = sunPosition(Date.UTC(2003, 9, 17, 19, 30, 30), 39.742476, -105.1786);
  close(sun.azimuth, 194.34024, 0.02);
  close(90 - sun.elevation, 50.11162, 0.02);
});

test('the sun is overhead on the Tropic of Cancer at noon of the summer solstice', () => {
  const highest = Math.max(...[11.9, 12, 12.05, 12.1].map((hour) => sunAtHour('2026-06-21', hour, 23.436).elevation));
  close(highest, 90, 0.7);
});

test('noon elevations at the solstices are 90 minus latitude, plus and minus 23.44', () => {
  close(sunAtHour('2026-06-21', 12.03, 50).elevation, 63.44, 0.05);
  close(sunAtHour('2026-12-21', 11.97, 50).elevation, 16.56 + 0.05, 0.05);
});

test('the sun rises in the east, sets in the west, and is in the north south of the equator', () => {
  close(sunAtHour('2026-03-20', 6.12, 45).azimuth, 90, 1);
  close(sunAtHour('2026-03-20', 18.12, 45).azimuth, 270, 1);
  close(sunAtHour('2026-03-20', 6.12, 45).elevation, 0, 1);
  const south = sunAtHour('2026-12-21', 12, -45).azimuth;
  close(Math.min(south, 360 - south), 0, 2);
});

test('the sun does not set in the arctic summer', () => {
  assert.ok(0 < sunAtHour('2026-06-21', 0, 70).elevation);
  assert.ok(sunAtHour('2026-12-21', 12, 70).elevation < 0);
});

test('an hour that is being dragged is taken back by an undo', () => {
  const document = fakeDocument();
  const changes = [];
  const viewer = { scene: { light: ['sun'] }, sceneChanged: signal(), viewReplaced: signal(), changeSettings: (patch, isMoving) => changes.push(isMoving) };
  const clock = sunClock(viewer);
  const [day, hour, latitude] = clock.all('input');
  Object.assign(hour, { value: 15 });
  latitude.value = 45;
  hour.emit('input');
  hour.emit('change');
  assert.deepEqual(changes, [true, false]);
  hour.emit('input');
  viewer.viewReplaced();
  hour.emit('change');
  day.value = '2026-06-21';
  day.emit('change');
  assert.deepEqual(changes, [true, false, true, false]);
});
