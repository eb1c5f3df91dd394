// Camera mathematics in doubles: projection between picture and world, and camera movements.

import {
  add, addScaled, cross, distance, dot, length, mix, normalize, perpendicular, rotate, rotationBetween, scale,
  subtract,
} from './vector.js';

// Cameras are those of scene files: { position, focal_point, view_up } and one of `view_angle` (vertical, in
// degrees), `orthographic` (height of the picture in world units) and `panorama: true`.

const RADIANS = Math.PI / 180;
const DEFAULT_VIEW_ANGLE = 35;
/** Least distance of the focal point, and greatest distance from the centre, in diagonals of the scene. */
const NEAREST_ZOOM = 1e-5;
const FARTHEST_ZOOM = 50;

/** Unit directions to the right, up and forward of the picture. */
export function axesOf(camera) {
  const forward = normalize(subtract(camera.focal_point, camera.position)) ?? [0, 0, -1];
  if (camera.panorama) {
    const up = normalize(camera.view_up) ?? [0, 0, 1];
    const right = normalize(cross(forward, up)) ?? perpendicular(up);
    return { right, up, forward: cross(up, right) };
  }
  const right = normalize(cross(forward, camera.view_up)) ?? perpendicular(forward);
  return { right, up: cross(right, forward), forward };
}

export const isOrthographic = (camera) => camera.orthographic !== undefined;
export const focalDistance = (camera) => distance(camera.position, camera.focal_point);

const halfHeightTangent = (camera) => Math.tan(((camera.view_angle ?? DEFAULT_VIEW_ANGLE) * RADIANS) / 2);

/** Size of a pixel in world units at this depth; in a panorama, at the centre of the picture. */
export function pixelSizeAt(camera, size, depth) {
  if (isOrthographic(camera)) return camera.orthographic / size.height;
  if (camera.panorama) return (depth * Math.PI) / size.height;
  return (2 * depth * halfHeightTangent(camera)) / size.height;
}

/** Distance of `point` from the camera along the view axis; in a panorama, the straight distance. */
export function depthOf(camera, point) {
  const offset = subtract(point, camera.position);
  return camera.panorama ? length(offset) : dot(offset, axesOf(camera).forward);
}

/** Position of `point` in a picture of `size`, in pixels from the top left, and its depth; null behind the camera. */
export function project(camera, size, point) {
  const { right, up, forward } = axesOf(camera);
  const offset = subtract(point, camera.position);
  const depth = camera.panorama ? length(offset) : dot(offset, forward);
  if (!(0 < depth)) return null;
  let [dx, dy] = [dot(offset, right), dot(offset, up)];
  if (camera.panorama) {
    const level = Math.hypot(dx, dot(offset, forward));
    dy = (Math.atan2(dy, level) * size.height) / Math.PI;
    dx = (Math.atan2(dx, dot(offset, forward)) * size.width) / (2 * Math.PI);
  } else {
    const pixel = pixelSizeAt(camera, size, depth);
    [dx, dy] = [dx / pixel, dy / pixel];
  }
  return { x: size.width / 2 + dx, y: size.height / 2 - dy, depth };
}

/** Origin and unit direction of the ray through a pixel. */
export function rayThrough(camera, size, x, y) {
  const { right, up, forward } = axesOf(camera);
  const [dx, dy] = [x - size.width / 2, size.height / 2 - y];
  if (camera.panorama) {
    const [azimuth, elevation] = [(dx * 2 * Math.PI) / size.width, (dy * Math.PI) / size.height];
    const level = addScaled(scale(forward, Math.cos(azimuth)), right, Math.sin(azimuth));
    const direction = addScaled(scale(level, Math.cos(elevation)), up, Math.sin(elevation));
    return { origin: camera.position, direction };
  }
  const pixel = pixelSizeAt(camera, size, 1);
  const offset = addScaled(scale(right, dx * pixel), up, dy * pixel);
  if (isOrthographic(camera)) return { origin: add(camera.position, offset), direction: forward };
  return { origin: camera.position, direction: normalize(add(forward, offset)) };
}

/** The point behind a pixel at this depth. */
export function pointAtDepth(camera, size, x, y, depth) {
  const { origin, direction } = rayThrough(camera, size, x, y);
  const t = camera.panorama ? depth : depth / dot(direction, axesOf(camera).forward);
  return addScaled(origin, direction, t);
}

/** East and north for a world with this up, as the sun's azimuth is measured. */
function groundAxes(up) {
  const axis = Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
  const east = normalize(addScaled(axis, up, -dot(axis, up)));
  return { east, north: cross(up, east) };
}

/** The camera rotated about `pivot` so that the frame of axes `from` becomes `to`. */
function rotatedAbout(camera, pivot, from, to) {
  const rotated = (point) => {
    const offset = subtract(point, pivot);
    return from.reduce((sum, axis, k) => addScaled(sum, to[k], dot(offset, axis)), pivot);
  };
  return { ...camera, position: rotated(camera.position), focal_point: rotated(camera.focal_point) };
}

/** Orbits about `pivot` with a level horizon: `yaw_rad` turns about `up`, `pitch_rad` raises the view direction. */
export function orbit(camera, pivot, up, yaw_rad, pitch_rad) {
  const from = axesOf({ ...camera, panorama: undefined });
  const level = normalize(addScaled(from.right, up, -dot(from.right, up))) ?? perpendicular(up);
  const right = rotate(level, up, yaw_rad);
  const elevation = Math.asin(Math.min(1, Math.max(-1, dot(from.forward, up)))) + pitch_rad;
  const limited = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, elevation));
  const ahead = cross(up, right);
  const forward = addScaled(scale(ahead, Math.cos(limited)), up, Math.sin(limited));
  const pictureUp = cross(right, forward);
  const moved = rotatedAbout(camera, pivot, [from.right, from.up, from.forward], [right, pictureUp, forward]);
  // Looking straight up or down, `up` is no direction in the picture.
  const isSteep = 0.9999 < Math.abs(Math.sin(limited));
  return { ...moved, view_up: isSteep ? pictureUp : up };
}

/** Turns at its position for a drag by this many pixels, so that the surface under the pointer follows it. */
export function lookAround(camera, size, up, dx, dy) {
  const perPixel = ((camera.view_angle ?? DEFAULT_VIEW_ANGLE) * RADIANS) / size.height;
  return { ...orbit(camera, camera.position, up, dx * perPixel, dy * perPixel), position: camera.position };
}

/** A panorama turned to the left about its own up. */
export function turnPanorama(camera, yaw_rad) {
  const offset = rotate(subtract(camera.focal_point, camera.position), axesOf(camera).up, yaw_rad);
  return { ...camera, focal_point: add(camera.position, offset) };
}

/** Rotates about `pivot` around the picture's own axes, so that the horizon may tilt. */
export function trackball(camera, pivot, yaw_rad, pitch_rad) {
  const from = axesOf(camera);
  const rotated = (axis) => rotate(rotate(axis, from.right, pitch_rad), from.up, yaw_rad);
  const to = [from.right, from.up, from.forward].map(rotated);
  return { ...rotatedAbout(camera, pivot, [from.right, from.up, from.forward], to), view_up: to[1] };
}

/** The camera moved as a whole. */
export function translate(camera, offset) {
  return { ...camera, position: add(camera.position, offset), focal_point: add(camera.focal_point, offset) };
}

/** The camera after `translate`, or as it was where it would be farther away than zoom allows. */
export function translateWithin(bounds, camera, offset) {
  const moved = translate(camera, offset);
  const [before, after] = [camera, moved].map(({ position }) => distance(position, mix(bounds.min, bounds.max, 0.5)));
  return maxRange(bounds) < after && before < after ? camera : moved;
}

/** Moves the point at this depth from one pixel to another. */
export function pan(camera, size, from, to, depth) {
  const start = pointAtDepth(camera, size, from.x, from.y, depth);
  return translate(camera, subtract(start, pointAtDepth(camera, size, to.x, to.y, depth)));
}

/** Zooms toward `target`, whose pixel does not change; a `factor` below 1 is nearer. */
export function zoomTo(camera, target, factor) {
  if (!isOrthographic(camera)) {
    const toward = (point) => add(target, scale(subtract(point, target), factor));
    return { ...camera, position: toward(camera.position), focal_point: toward(camera.focal_point) };
  }
  const { forward } = axesOf(camera);
  const offset = subtract(target, camera.position);
  const sideways = addScaled(offset, forward, -dot(offset, forward));
  return { ...translate(camera, scale(sideways, 1 - factor)), orthographic: camera.orthographic * factor };
}

/** Maximum distance of a camera from the middle of `bounds`, and height of its orthographic picture; a single point has none. */
const maxRange = ({ min, max }) => FARTHEST_ZOOM * distance(min, max) || Infinity;

/** The camera after `zoomTo`, or as it was where it would be so near or far that nothing could be told apart. */
export function zoomWithin(bounds, camera, target, factor) {
  const zoomed = zoomTo(camera, target, factor);
  const center = mix(bounds.min, bounds.max, 0.5);
  const isTooNear = (zoomed.orthographic ?? focalDistance(zoomed)) < NEAREST_ZOOM * distance(bounds.min, bounds.max);
  const isTooFar = maxRange(bounds) < (zoomed.orthographic ?? distance(zoomed.position, center));
  return (factor < 1 ? isTooNear : isTooFar) ? camera : zoomed;
}

/** Whether a point is in `bounds`, or next to it. */
export function isNear({ min, max }, point) {
  const margin = 0.25 * distance(min, max);
  return point.every((value, axis) => min[axis] - margin <= value && value <= max[axis] + margin);
}

/** The camera centred on `point`, with the same direction and depth. */
export function centeredOn(camera, point) {
  const depth = depthOf(camera, point);
  const { forward } = axesOf(camera);
  const range = isOrthographic(camera) ? focalDistance(camera) : depth;
  return { ...camera, focal_point: point, position: addScaled(point, forward, -range) };
}

/** An orthographic camera with the same size at the focal point, placed so that no part of `bounds` is behind it. */
export function toOrthographic(camera, bounds) {
  const { panorama, view_angle, ...rest } = camera;
  const range = focalDistance(camera);
  const height = camera.orthographic ?? 2 * range * halfHeightTangent(camera);
  const center = mix(bounds.min, bounds.max, 0.5);
  const minRange = distance(center, camera.focal_point) + distance(bounds.min, bounds.max);
  const position = addScaled(camera.focal_point, axesOf(camera).forward, -Math.max(range, minRange));
  return { ...rest, position, orthographic: height };
}

/** A perspective camera with the same size at the focal point. */
export function toPerspective(camera, view_angle = DEFAULT_VIEW_ANGLE) {
  const { panorama, orthographic, ...rest } = camera;
  if (orthographic === undefined) return { ...rest, view_angle: camera.view_angle ?? view_angle };
  const range = orthographic / (2 * Math.tan((view_angle * RADIANS) / 2));
  return { ...rest, view_angle, position: addScaled(camera.focal_point, axesOf(camera).forward, -range) };
}

/** The camera with another vertical angle of view and the same size at the focal point. */
export function withViewAngle(camera, view_angle) {
  const height = 2 * focalDistance(camera) * halfHeightTangent(camera);
  return toPerspective({ ...camera, orthographic: height }, view_angle);
}

/** The six sides of a scene, in the order of the keys 1 to 6. */
export const SIDES = ['front', 'back', 'left', 'right', 'top', 'bottom'];

/** View direction and picture's up of one of the six sides. */
export function sideAxes(side, up) {
  const { east, north } = groundAxes(up);
  const sides = {
    front: [north, up], back: [scale(north, -1), up], left: [east, up], right: [scale(east, -1), up],
    top: [scale(up, -1), north], bottom: [up, north],
  };
  const [forward, view_up] = sides[side];
  return { forward, view_up };
}

/** The focal point seen from one of the six sides, at the same distance. */
export function fromSide(camera, side, up) {
  const { forward, view_up } = sideAxes(side, up);
  return { ...camera, view_up, position: addScaled(camera.focal_point, forward, -focalDistance(camera)) };
}

/** A camera with the same direction whose picture contains all of `bounds`. */
export function fit(camera, size, bounds) {
  const margin = 1.06;
  const { right, up, forward } = axesOf(camera);
  const center = mix(bounds.min, bounds.max, 0.5);
  const aspect = size.width / size.height;
  const corners = cornersOf(bounds).map((corner) => {
    const offset = subtract(corner, center);
    return { x: Math.abs(dot(offset, right)), y: Math.abs(dot(offset, up)), z: dot(offset, forward) };
  });
  const largest = (values) => values.reduce((largestSoFar, value) => Math.max(largestSoFar, value), 1e-9);
  const diagonal = distance(bounds.min, bounds.max);
  if (isOrthographic(camera)) {
    const height = 2 * margin * largest(corners.map(({ x, y }) => Math.max(y, x / aspect)));
    const position = addScaled(center, forward, -diagonal);
    return { ...camera, position, focal_point: center, orthographic: height };
  }
  const tangent = halfHeightTangent(camera) / margin;
  const range = largest(corners.map(({ x, y, z }) => Math.max(y, x / aspect) / tangent - z));
  return { ...camera, focal_point: center, position: addScaled(center, forward, -range) };
}

/** The eight corners of a box. */
export function cornersOf({ min, max }) {
  return [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [0, 1, 2].map((axis) => ((i >> axis) & 1 ? max : min)[axis]));
}

/** A camera of a scene file with the picture's up and the projection of the `current` one where it has none. */
export function completed(camera, current) {
  const { view_angle, orthographic, panorama, ...pose } = current;
  const hasProjection = camera.view_angle || camera.orthographic || camera.panorama;
  return { ...(hasProjection ? pose : current), ...camera };
}

/** Interpolates between two cameras of one projection; `t` is from 0 to 1. */
export function blend(from, to, t) {
  const [a, b] = [axesOf(from), axesOf(to)];
  const rotation = rotationBetween([a.right, a.up, a.forward], [b.right, b.up, b.forward]);
  const rotated = (axis) => rotate(axis, rotation.axis, t * rotation.angle_rad);
  const interpolate = (start, end) => start * Math.pow(end / start, t);
  const focal_point = mix(from.focal_point, to.focal_point, t);
  const range = interpolate(focalDistance(from), focalDistance(to));
  const camera = { ...to, focal_point, view_up: rotated(a.up) };
  camera.position = addScaled(focal_point, rotated(a.forward), -range);
  if (isOrthographic(to)) camera.orthographic = interpolate(from.orthographic, to.orthographic);
  return t < 1 ? camera : to;
}
