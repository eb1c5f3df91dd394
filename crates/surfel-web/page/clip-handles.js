// Clip box and clip plane on the picture: their outlines, and handles that are dragged along their axes.

import { cornersOf, rayThrough } from './camera.js';
import * as clip from './clip.js';
import { addScaled, mix } from './vector.js';

const HANDLE_RADIUS = 7;
const ARROW = 0.06;
/** Pairs of corners, as `cornersOf` counts them, that differ in one axis. */
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
  const foot = handleOf(plane, bounds);
  const tip = addScaled(foot, plane.normal, ARROW * clip.sizeOf(bounds));
  return [
    ...view.polygon(outline, 'clip-plane'),
    ...view.path(outline, 'clip-edge', true),
    ...view.line(foot, tip, 'clip-normal'),
    ...view.dot(foot, HANDLE_RADIUS, 'handle', { 'data-handle': 'plane' }),
  ];
}

/** Where the plane is nearest to the middle of the world. */
function handleOf(plane, bounds) {
  return addScaled(mix(bounds.min, bounds.max, 0.5), plane.normal, clip.positionOf(plane, bounds));
}

/** What dragging the handle under the pointer does, from this place of the picture, or null where none is. */
export function grabHandle(viewer, event, place) {
  const handle = event.target.closest('[data-handle]')?.dataset.handle;
  if (!handle) return null;
  const [kind, axis, end] = handle.split(' ');
  return kind === 'plane' ? dragPlane(viewer, place) : dragFace(viewer, place, Number(axis), end);
}

function dragFace(viewer, place, axis, end) {
  const start = clip.parseBox(viewer.scene.clip_box);
  const { middle } = clip.facesOf(start).find((face) => face.axis === axis && face.end === end);
  const direction = [0, 1, 2].map((i) => (i === axis ? 1 : 0));
  return dragAlong(viewer, place, middle, direction, (way) => {
    const box = clip.withFace(start, { axis, end }, middle[axis] + way);
    return { clip_box: clip.formatBox(box) };
  });
}

function dragPlane(viewer, place) {
  const start = clip.parsePlane(viewer.scene.clip_plane);
  const { bounds } = viewer.info;
  return dragAlong(viewer, place, handleOf(start, bounds), start.normal, (way) => {
    const position = clip.positionOf(start, bounds) + way;
    return { clip_plane: clip.formatPlane(clip.planeAt(start, bounds, position)) };
  });
}

/** Sends `patchFor(way)` while the pointer is taken from `place` along a line through `point`. */
function dragAlong(viewer, place, point, direction, patchFor) {
  const wayTo = ({ x, y }) => clip.nearestAlong(point, direction, rayThrough(viewer.camera, viewer.size, x, y));
  const grabbed = wayTo(place);
  let patch = null;
  return {
    move(to) {
      patch = patchFor(wayTo(to) - grabbed);
      viewer.set(patch, true);
    },
    end() {
      if (patch) viewer.set(patch, false);
    },
  };
}
