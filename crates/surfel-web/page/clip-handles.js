// Clip box and clip plane on the picture: their outlines, and handles that the user drags along their axes.

import { cornersOf, rayThrough } from './camera.js';
import * as clip from './clip.js';
import { addScaled, mix } from './vector.js';

const HANDLE_RADIUS = 7;
/** Length of the plane's normal, as a fraction of the diagonal of the bounds. */
const ARROW_FRACTION = 0.06;
/** Edges as pairs of indices of `cornersOf` that differ in one axis. */
const EDGES = [0, 1, 2, 3, 4, 5, 6, 7].flatMap((i) => [1, 2, 4].filter((bit) => !(i & bit)).map((bit) => [i, i | bit]));

export function clipPainter(viewer) {
  return (view) => {
    const box = clip.parseBox(viewer.scene.clip_box);
    const plane = clip.parsePlane(viewer.scene.clip_plane);
    return [...(box ? paintBox(view, box) : []), ...(plane ? paintPlane(view, plane, viewer.info.bounds) : [])];
  };
}

function paintBox(view, box) {
  const corners = cornersOf(box);
  const edges = EDGES.flatMap(([a, b]) => view.line(corners[a], corners[b], 'clip-edge'));
  const handles = clip.facesOf(box).flatMap(({ axis, end, middle }) =>
    view.dot(middle, HANDLE_RADIUS, `handle handle-${'xyz'[axis]}`, { 'data-handle': `box ${axis} ${end}` }));
  return [...edges, ...handles];
}

function paintPlane(view, plane, bounds) {
  const outline = clip.planeOutline(plane, bounds);
  const foot = handlePosition(plane, bounds);
  const tip = addScaled(foot, plane.normal, ARROW_FRACTION * clip.sizeOf(bounds));
  return [
    ...view.polygon(outline, 'clip-plane'),
    ...view.path(outline, 'clip-edge', true),
    ...view.line(foot, tip, 'clip-normal'),
    ...view.dot(foot, HANDLE_RADIUS, 'handle', { 'data-handle': 'plane' }),
  ];
}

/** The point of the plane that is nearest to the centre of `bounds`. */
function handlePosition(plane, bounds) {
  return addScaled(mix(bounds.min, bounds.max, 0.5), plane.normal, clip.positionOf(plane, bounds));
}

/** The drag of the handle under the pointer, which is at this pixel; null if there is no handle. */
export function grabHandle(viewer, event, pixel) {
  const handle = event.target.closest('[data-handle]')?.dataset.handle;
  if (!handle) return null;
  const [kind, axis, end] = handle.split(' ');
  return kind === 'plane' ? dragPlane(viewer, pixel) : dragFace(viewer, pixel, Number(axis), end);
}

function dragFace(viewer, pixel, axis, end) {
  const start = clip.parseBox(viewer.scene.clip_box);
  const { middle } = clip.facesOf(start).find((face) => face.axis === axis && face.end === end);
  const direction = [0, 1, 2].map((i) => (i === axis ? 1 : 0));
  return dragAlong(viewer, pixel, middle, direction, (offset) => {
    const box = clip.withFace(start, { axis, end }, middle[axis] + offset);
    return { clip_box: clip.formatBox(box) };
  });
}

function dragPlane(viewer, pixel) {
  const start = clip.parsePlane(viewer.scene.clip_plane);
  const { bounds } = viewer.info;
  return dragAlong(viewer, pixel, handlePosition(start, bounds), start.normal, (offset) => {
    const position = clip.positionOf(start, bounds) + offset;
    return { clip_plane: clip.formatPlane(clip.planeAt(start, bounds, position)) };
  });
}

/** Sends `patchFor(offset)` while the pointer is dragged from `pixel` along a line through `point`. */
function dragAlong(viewer, pixel, point, direction, patchFor) {
  const offsetAt = ({ x, y }) => clip.nearestAlong(point, direction, rayThrough(viewer.camera, viewer.size, x, y));
  const start = offsetAt(pixel);
  let patch = null;
  return {
    move(to) {
      patch = patchFor(offsetAt(to) - start);
      viewer.changeSettings(patch, true);
    },
    end() {
      if (patch) viewer.changeSettings(patch, false);
    },
  };
}
