// The sun stands where almanacs say.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { sunByHour, sunPosition } from '../page/sun.js';

const close = (a, b, tolerance) => assert.ok(Math.abs(a - b) < tolerance, `${a} is not ${b}`);

test('the published example of the SPA algorithm (Reda and Andreas 2004)', () => {
  // Golden, Colorado, 17 October 2003, 12:30:30 local time (UTC-7): zenith 50.11162, azimuth 194.34024.
  const sun = sunPosition(Date.UTC(2003, 9, 17, 19, 30, 30), 39.742476, -105.1786);
  close(sun.azimuth, 194.34024, 0.02);
  close(90 - sun.elevation, 50.11162, 0.02);
});

test('overhead on the tropic of Cancer at noon of the summer solstice', () => {
  const highest = Math.max(...[11.9, 12, 12.05, 12.1].map((hour) => sunByHour('2026-06-21', hour, 23.436).elevation));
  close(highest, 90, 0.7);
});

test('noon heights at the solstices are 90 minus latitude, plus and minus 23.44', () => {
  close(sunByHour('2026-06-21', 12.03, 50).elevation, 63.44, 0.05);
  close(sunByHour('2026-12-21', 11.97, 50).elevation, 16.56 + 0.05, 0.05);
});

test('it rises in the east and sets in the west at the equinox, and stands north in the south', () => {
  close(sunByHour('2026-03-20', 6.12, 45).azimuth, 90, 1);
  close(sunByHour('2026-03-20', 18.12, 45).azimuth, 270, 1);
  close(sunByHour('2026-03-20', 6.12, 45).elevation, 0, 1);
  const south = sunByHour('2026-12-21', 12, -45).azimuth;
  close(Math.min(south, 360 - south), 0, 2);
});

test('it does not set in the summer of the far north', () => {
  assert.ok(0 < sunByHour('2026-06-21', 0, 70).elevation);
  assert.ok(sunByHour('2026-12-21', 12, 70).elevation < 0);
});
