// Camera mathematics: projection is consistent, and each movement keeps its invariants.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { cubeSides } from '../page/axis-cube.js';
import * as cameras from '../page/camera.js';
import { cross, distance, dot, length } from '../page/vector.js';

const size = { width: 64, height: 48 };
const placed = { position: [500003, -4, 2], focal_point: [500000, 1, 0.5], view_up: [0, 0, 1] };
const perspective = { ...placed, view_angle: 40 };
const orthographic = { ...placed, orthographic: 8 };
const panorama = { ...placed, panorama: true };
const bounds = { min: [499990, -8, -1], max: [500012, 9, 4] };
const up = [0, 0, 1];

const near = (a, b, tolerance = 1e-6) => assert.ok(distance(a, b) < tolerance, `${a} is not ${b}`);
const close = (a, b, tolerance = 1e-6) => assert.ok(Math.abs(a - b) < tolerance, `${a} is not ${b}`);

test('points on a ray project to its pixel', () => {
  for (const camera of [perspective, orthographic, panorama]) {
    for (const [x, y] of [[0.5, 0.5], [32, 24], [63.5, 10.25]]) {
      const pixel = cameras.project(camera, size, cameras.pointAtDepth(camera, size, x, y, 5));
      close(pixel.x, x);
      close(pixel.y, y);
      close(pixel.depth, 5);
    }
  }
});

test('axes are unit, orthogonal and right-handed', () => {
  const steep = { ...perspective, focal_point: [500003, -4, 0] };
  for (const camera of [perspective, orthographic, panorama, steep]) {
    const { right, up: pictureUp, forward } = cameras.axesOf(camera);
    for (const axis of [right, pictureUp, forward]) close(length(axis), 1);
    near(cross(right, forward), pictureUp);
    close(dot(right, pictureUp), 0);
  }
});

test('points behind the camera are not in the picture', () => {
  assert.equal(cameras.project(perspective, size, [500006, -9, 3.5]), null);
});

test('an orbit keeps the pivot in place and the horizon level', () => {
  const moved = cameras.orbit(perspective, perspective.focal_point, up, 0.7, -0.2);
  near(moved.focal_point, perspective.focal_point);
  close(cameras.focalDistance(moved), cameras.focalDistance(perspective));
  close(dot(cameras.axesOf(moved).right, up), 0);
  const pivot = [500001, 2, 0];
  const orbited = cameras.orbit(perspective, pivot, up, 0.4, 0);
  const [before, after] = [perspective, orbited].map((camera) => cameras.project(camera, size, pivot));
  close(before.x, after.x);
  close(before.y, after.y);
});

test('an orbit stops at the zenith and comes back', () => {
  const over = cameras.orbit(perspective, perspective.focal_point, up, 0, -10);
  near(cameras.axesOf(over).forward, [0, 0, -1]);
  near(cameras.axesOf(over).right, cameras.axesOf(perspective).right);
  const back = cameras.orbit(over, over.focal_point, up, 0.3, 0.5);
  close(dot(cameras.axesOf(back).forward, up), -Math.cos(0.5));
  near(back.view_up, up);
});

test('a trackball rotates freely', () => {
  const moved = cameras.trackball(perspective, perspective.focal_point, 0, 4);
  close(cameras.focalDistance(moved), cameras.focalDistance(perspective));
  near(cameras.axesOf(moved).right, cameras.axesOf(perspective).right);
});

test('panning keeps the grabbed point under the pointer', () => {
  for (const camera of [perspective, orthographic]) {
    const grabbed = cameras.pointAtDepth(camera, size, 10, 40, 6);
    const moved = cameras.pan(camera, size, { x: 10, y: 40 }, { x: 50, y: 5 }, 6);
    const pixel = cameras.project(moved, size, grabbed);
    close(pixel.x, 50);
    close(pixel.y, 5);
  }
});

test('zooming keeps the pixel of its target', () => {
  for (const camera of [perspective, orthographic]) {
    const target = cameras.pointAtDepth(camera, size, 12, 9, 5);
    const pixel = cameras.project(cameras.zoomTo(camera, target, 0.5), size, target);
    close(pixel.x, 12);
    close(pixel.y, 9);
  }
  const nearer = cameras.zoomTo(perspective, perspective.focal_point, 0.5);
  close(cameras.focalDistance(nearer), cameras.focalDistance(perspective) / 2);
});

test('changing the projection keeps the size at the pivot', () => {
  const flat = cameras.toOrthographic(perspective, bounds);
  const again = cameras.toPerspective(flat, 40);
  near(again.position, perspective.position);
  const wide = cameras.withViewAngle(perspective, 70);
  for (const camera of [flat, wide]) {
    const pixel = (one) => cameras.pixelSizeAt(one, size, cameras.focalDistance(one));
    close(pixel(camera), pixel(perspective));
  }
  assert.deepEqual(Object.keys(flat).sort(), ['focal_point', 'orthographic', 'position', 'view_up']);
});

test('fit shows all corners, one of them near the edge of the picture', () => {
  for (const camera of [perspective, orthographic]) {
    for (const wide of [size, { width: 30, height: 90 }]) {
      const fitted = cameras.fit(camera, wide, bounds);
      const edges = cameras.cornersOf(bounds).map((corner) => {
        const { x, y } = cameras.project(fitted, wide, corner);
        return Math.max(Math.abs(2 * x - wide.width) / wide.width, Math.abs(2 * y - wide.height) / wide.height);
      });
      const edge = Math.max(...edges);
      assert.ok(0.85 < edge && edge <= 1, `${edge}`);
    }
  }
});

test('views from the six sides have their own up', () => {
  near(cameras.axesOf(cameras.fromSide(perspective, 'front', up)).forward, [0, 1, 0]);
  near(cameras.axesOf(cameras.fromSide(perspective, 'right', up)).forward, [-1, 0, 0]);
  const top = cameras.axesOf(cameras.fromSide(perspective, 'top', up));
  near(top.right, [1, 0, 0]);
  near(top.up, [0, 1, 0]);
  near(cameras.axesOf(cameras.fromSide(perspective, 'front', [0, 1, 0])).forward, [0, 0, -1]);
});

test('centring keeps direction and depth', () => {
  const point = [500001, 2, 0];
  const moved = cameras.centeredOn(perspective, point);
  near(cameras.axesOf(moved).forward, cameras.axesOf(perspective).forward);
  close(cameras.depthOf(moved, point), cameras.depthOf(perspective, point));
  close(cameras.project(moved, size, point).x, 32);
});

test('a blend starts and ends at its cameras', () => {
  for (const side of ['front', 'back', 'left', 'top', 'bottom']) {
    const start = cameras.fromSide(perspective, 'front', up);
    const end = cameras.fromSide({ ...perspective, focal_point: [500005, 3, 1] }, side, up);
    near(cameras.blend(start, end, 0).position, start.position);
    near(cameras.blend(start, end, 1).position, end.position);
    const almost = cameras.axesOf(cameras.blend(start, end, 0.999999));
    near(almost.forward, cameras.axesOf(end).forward, 1e-4);
    near(almost.right, cameras.axesOf(end).right, 1e-4);
  }
});

test('a panorama shows north at its centre and east to the right', () => {
  const north = { position: [1, 2, 3], focal_point: [1, 5, 4], view_up: up, panorama: true };
  const wide = { width: 80, height: 40 };
  near(cameras.rayThrough(north, wide, 40, 20).direction, [0, 1, 0]);
  near(cameras.rayThrough(north, wide, 60, 20).direction, [1, 0, 0]);
  near(cameras.rayThrough(north, wide, 13, 0).direction, [0, 0, 1]);
  close(cameras.depthOf(north, [1, 2, 7]), 4);
});

test('the axis cube shows a side in full from its front, with its label upright', () => {
  const start = { position: [3, -8, 5], focal_point: [0, 0, 0], view_up: up, view_angle: 35 };
  for (const side of cameras.SIDES) {
    const sides = cubeSides(cameras.fromSide(start, side, up), up);
    const facing = sides.filter(({ isFacing }) => isFacing);
    assert.deepEqual(facing.map((one) => one.side), [side]);
    const [right, down] = [facing[0].label.slice(0, 2), facing[0].label.slice(2, 4)];
    for (const [found, expected] of [[right, [1, 0]], [down, [0, 1]]]) assert.ok(Math.hypot(found[0] - expected[0], found[1] - expected[1]) < 1e-9);
  }
  const facing = cubeSides(start, up).filter(({ isFacing }) => isFacing).map((one) => one.side);
  assert.deepEqual(facing, ['front', 'right', 'top']);
});
