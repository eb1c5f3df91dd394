// The camera's mathematics: places in the picture and in the world, and cameras moved, in doubles.

import {
  add, addScaled, cross, distance, dot, length, mix, normalize, perpendicular, rotate, rotationBetween, scale,
  subtract,
} from './vector.js';

// Cameras are those of scene files: { position, focal_point, view_up } and one of `view_angle` (vertical, in
// degrees), `orthographic` (height of the picture in world units) and `panorama: true`.

const RADIANS = Math.PI / 180;
const DEFAULT_VIEW_ANGLE = 35;

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

const tangentOf = (camera) => Math.tan(((camera.view_angle ?? DEFAULT_VIEW_ANGLE) * RADIANS) / 2);

/** What a pixel spans in world units at this depth; in a panorama, in the middle of the picture. */
export function pixelSizeAt(camera, size, depth) {
  if (isOrthographic(camera)) return camera.orthographic / size.height;
  if (camera.panorama) return (depth * Math.PI) / size.height;
  return (2 * depth * tangentOf(camera)) / size.height;
}

/** Distance of `point` along the view axis; in a panorama, which has none, from the camera. */
export function depthOf(camera, point) {
  const offset = subtract(point, camera.position);
  return camera.panorama ? length(offset) : dot(offset, axesOf(camera).forward);
}

/** Place of `point` in a picture of `size`, in pixels from the top left, and its depth; null behind the camera. */
export function project(camera, size, point) {
  const { right, up, forward } = axesOf(camera);
  const offset = subtract(point, camera.position);
  const depth = camera.panorama ? length(offset) : dot(offset, forward);
  if (!(0 < depth)) return null;
  let [across, along] = [dot(offset, right), dot(offset, up)];
  if (camera.panorama) {
    const level = Math.hypot(across, dot(offset, forward));
    along = (Math.atan2(along, level) * size.height) / Math.PI;
    across = (Math.atan2(across, dot(offset, forward)) * size.width) / (2 * Math.PI);
  } else {
    const pixel = pixelSizeAt(camera, size, depth);
    [across, along] = [across / pixel, along / pixel];
  }
  return { x: size.width / 2 + across, y: size.height / 2 - along, depth };
}

/** Origin and unit direction of the ray through a place in the picture. */
export function rayThrough(camera, size, x, y) {
  const { right, up, forward } = axesOf(camera);
  const [across, along] = [x - size.width / 2, size.height / 2 - y];
  if (camera.panorama) {
    const [turn, height] = [(across * 2 * Math.PI) / size.width, (along * Math.PI) / size.height];
    const level = addScaled(scale(forward, Math.cos(turn)), right, Math.sin(turn));
    const direction = addScaled(scale(level, Math.cos(height)), up, Math.sin(height));
    return { origin: camera.position, direction };
  }
  const pixel = pixelSizeAt(camera, size, 1);
  const aside = addScaled(scale(right, across * pixel), up, along * pixel);
  if (isOrthographic(camera)) return { origin: add(camera.position, aside), direction: forward };
  return { origin: camera.position, direction: normalize(add(forward, aside)) };
}

/** What lies under a place in the picture at this depth. */
export function pointAtDepth(camera, size, x, y, depth) {
  const { origin, direction } = rayThrough(camera, size, x, y);
  const steps = camera.panorama ? depth : depth / dot(direction, axesOf(camera).forward);
  return addScaled(origin, direction, steps);
}

/** East and north for a world with this up, the directions from which the sun's azimuth counts. */
function groundAxes(up) {
  const axis = Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
  const east = normalize(addScaled(axis, up, -dot(axis, up)));
  return { east, north: cross(up, east) };
}

/** The camera carried about `pivot` so that its frame of axes becomes another. */
function carried(camera, pivot, from, to) {
  const turned = (point) => {
    const offset = subtract(point, pivot);
    return from.reduce((sum, axis, k) => addScaled(sum, to[k], dot(offset, axis)), pivot);
  };
  return { ...camera, position: turned(camera.position), focal_point: turned(camera.focal_point) };
}

/** Orbit about `pivot` with a level horizon: `turn_rad` about `up`, `tilt_rad` raises the view. */
export function orbit(camera, pivot, up, turn_rad, tilt_rad) {
  const from = axesOf({ ...camera, panorama: undefined });
  const level = normalize(addScaled(from.right, up, -dot(from.right, up))) ?? perpendicular(up);
  const right = rotate(level, up, turn_rad);
  const elevation = Math.asin(Math.min(1, Math.max(-1, dot(from.forward, up)))) + tilt_rad;
  const limited = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, elevation));
  const ahead = cross(up, right);
  const forward = addScaled(scale(ahead, Math.cos(limited)), up, Math.sin(limited));
  const pictureUp = cross(right, forward);
  const moved = carried(camera, pivot, [from.right, from.up, from.forward], [right, pictureUp, forward]);
  // Straight down `up` tells no direction in the picture.
  const isSteep = 0.9999 < Math.abs(Math.sin(limited));
  return { ...moved, view_up: isSteep ? pictureUp : up };
}

/** A panorama turned about its own up, to the left. */
export function lookAround(camera, turn_rad) {
  const offset = rotate(subtract(camera.focal_point, camera.position), axesOf(camera).up, turn_rad);
  return { ...camera, focal_point: add(camera.position, offset) };
}

/** Free turning about `pivot`, about the picture's own axes. */
export function trackball(camera, pivot, turn_rad, tilt_rad) {
  const from = axesOf(camera);
  const turned = (axis) => rotate(rotate(axis, from.right, tilt_rad), from.up, turn_rad);
  const to = [from.right, from.up, from.forward].map(turned);
  return { ...carried(camera, pivot, [from.right, from.up, from.forward], to), view_up: to[1] };
}

/** The camera moved as a whole. */
export function translate(camera, offset) {
  return { ...camera, position: add(camera.position, offset), focal_point: add(camera.focal_point, offset) };
}

/** What was under one place, at this depth, comes to lie under another. */
export function pan(camera, size, from, to, depth) {
  const start = pointAtDepth(camera, size, from.x, from.y, depth);
  return translate(camera, subtract(start, pointAtDepth(camera, size, to.x, to.y, depth)));
}

/** Closer to `target`, which stays where it is in the picture; `factor` below 1 is nearer. */
export function zoomTo(camera, target, factor) {
  if (!isOrthographic(camera)) {
    const toward = (point) => add(target, scale(subtract(point, target), factor));
    return { ...camera, position: toward(camera.position), focal_point: toward(camera.focal_point) };
  }
  const { forward } = axesOf(camera);
  const offset = subtract(target, camera.position);
  const aside = addScaled(offset, forward, -dot(offset, forward));
  return { ...translate(camera, scale(aside, 1 - factor)), orthographic: camera.orthographic * factor };
}

/** Centred on `point`, seen from the same side at the same depth. */
export function centeredOn(camera, point) {
  const depth = depthOf(camera, point);
  const { forward } = axesOf(camera);
  const away = isOrthographic(camera) ? focalDistance(camera) : depth;
  return { ...camera, focal_point: point, position: addScaled(point, forward, -away) };
}

/** Without perspective, what is at the focal point as large as before, and nothing of `bounds` behind the camera. */
export function toOrthographic(camera, bounds) {
  const { panorama, view_angle, ...rest } = camera;
  const away = focalDistance(camera);
  const height = camera.orthographic ?? 2 * away * tangentOf(camera);
  const center = mix(bounds.min, bounds.max, 0.5);
  const needed = distance(center, camera.focal_point) + distance(bounds.min, bounds.max);
  const position = addScaled(camera.focal_point, axesOf(camera).forward, -Math.max(away, needed));
  return { ...rest, position, orthographic: height };
}

/** With perspective, what is at the focal point as large as before. */
export function toPerspective(camera, view_angle = DEFAULT_VIEW_ANGLE) {
  const { panorama, orthographic, ...rest } = camera;
  if (orthographic === undefined) return { ...rest, view_angle: camera.view_angle ?? view_angle };
  const away = orthographic / (2 * Math.tan((view_angle * RADIANS) / 2));
  return { ...rest, view_angle, position: addScaled(camera.focal_point, axesOf(camera).forward, -away) };
}

/** Another vertical angle of view, what is at the focal point as large as before. */
export function withViewAngle(camera, view_angle) {
  const height = 2 * focalDistance(camera) * tangentOf(camera);
  return toPerspective({ ...camera, orthographic: height }, view_angle);
}

/** Directions of view of the six sides, with what is up in their pictures. */
function sideAxes(side, up) {
  const { east, north } = groundAxes(up);
  const sides = {
    front: [north, up], back: [scale(north, -1), up], left: [east, up], right: [scale(east, -1), up],
    top: [scale(up, -1), north], bottom: [up, north],
  };
  const [forward, view_up] = sides[side];
  return { forward, view_up };
}

/** The focal point seen from one of the six sides, from as far as before. */
export function fromSide(camera, side, up) {
  const { forward, view_up } = sideAxes(side, up);
  return { ...camera, view_up, position: addScaled(camera.focal_point, forward, -focalDistance(camera)) };
}

/** All of `bounds` in the picture, seen in the same direction. */
export function fit(camera, size, bounds) {
  const margin = 1.06;
  const { right, up, forward } = axesOf(camera);
  const center = mix(bounds.min, bounds.max, 0.5);
  const aspect = size.width / size.height;
  const corners = cornersOf(bounds).map((corner) => {
    const offset = subtract(corner, center);
    return { x: Math.abs(dot(offset, right)), y: Math.abs(dot(offset, up)), z: dot(offset, forward) };
  });
  const largest = (values) => values.reduce((most, value) => Math.max(most, value), 1e-9);
  const diagonal = distance(bounds.min, bounds.max);
  if (isOrthographic(camera)) {
    const height = 2 * margin * largest(corners.map(({ x, y }) => Math.max(y, x / aspect)));
    const position = addScaled(center, forward, -diagonal);
    return { ...camera, position, focal_point: center, orthographic: height };
  }
  const tangent = tangentOf(camera) / margin;
  const away = largest(corners.map(({ x, y, z }) => Math.max(y, x / aspect) / tangent - z));
  return { ...camera, focal_point: center, position: addScaled(center, forward, -away) };
}

/** The eight corners of a box. */
export function cornersOf({ min, max }) {
  return [0, 1, 2, 3, 4, 5, 6, 7].map((i) => [0, 1, 2].map((axis) => ((i >> axis) & 1 ? max : min)[axis]));
}

/** A camera between two of one kind, on the way that keeps what both look at in view. */
export function blend(from, to, share) {
  const [a, b] = [axesOf(from), axesOf(to)];
  const turn = rotationBetween([a.right, a.up, a.forward], [b.right, b.up, b.forward]);
  const turned = (axis) => rotate(axis, turn.axis, share * turn.angle_rad);
  const between = (near, far) => near * Math.pow(far / near, share);
  const focal_point = mix(from.focal_point, to.focal_point, share);
  const away = between(focalDistance(from), focalDistance(to));
  const camera = { ...to, focal_point, view_up: turned(a.up) };
  camera.position = addScaled(focal_point, turned(a.forward), -away);
  if (isOrthographic(to)) camera.orthographic = between(from.orthographic, to.orthographic);
  return share < 1 ? camera : to;
}
