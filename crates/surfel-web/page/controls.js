// The table of controls: each scene-file key that the panel shows, with its label, kind and range. Numbers beyond the
// range of a slider can be typed; the server rejects those that it does not take.

import * as clip from './clip.js';
import { areEqual } from './merge-patch.js';
import { distance, normalize, scale } from './vector.js';

// A control is { key, label, kind, … } with the properties of its kind in fields.js (range, options, names …). It shows
// the value at `key` of the scene, unless it has `read(scene, viewer)` and `write(value, scene, viewer)`, which returns a
// merge patch. `isVisible(scene, viewer)` hides it if false, `help` is its tooltip, `automatic` offers the automatic
// choice (null in a patch), `sceneKey` is the scene-file key of a control that shows only a part of that key's value.

const DEFAULT_GRADIENT = ['#6f7c8a', '#c9ced3'];
const BLUE_SKY = ['#4f7fb8', '#d5e2ee'];
const SLIDER = { kind: 'slider' };
/** Surfaces that blend discs, and those whose points stand for themselves. */
const BLENDED = ['splat', 'splat-mean', 'splat-fit', 'cylinder'];
const APART = ['points', 'sphere', 'gaussian'];

export const surfaceControls = [
  { key: 'surface', label: 'Kind', kind: 'select', options: ({ info }) => info.surfaces, help: 'Kind of surface' },
  { key: 'point_size', label: 'Point size', ...SLIDER, range: [1, 16], step: 0.5, unit: ' px', automatic: true,
    isVisible: ({ surface }) => surface === 'points', help: 'Diameter of each point in pixels' },
  { key: 'radius_scale', label: 'Radius', ...SLIDER, range: [0.25, 4], scale: 'logarithmic',
    read: (scene) => scene.radius_scale ?? 1, help: 'Factor of the radius of each point' },
  { key: 'reach', label: 'Reach', ...SLIDER, range: [0.5, 4], scale: 'logarithmic', automatic: true,
    isVisible: ({ surface }) => ['cylinder', 'mls', 'splat-fit'].includes(surface), help: 'How far points count, in radii' },
  { key: 'density', label: 'Density', ...SLIDER, range: [1, 16], step: 1, automatic: true,
    isVisible: ({ surface }) => surface === 'cylinder', help: 'Points that a hit needs' },
  { key: 'degree', label: 'Degree', ...SLIDER, range: [1, 3], step: 1, automatic: true,
    isVisible: ({ surface }) => surface === 'mls', help: 'Degree of the fitted polynomials' },
  { key: 'align', label: 'Alignment', kind: 'select', isVisible: ({ surface }) => surface === 'splat',
    options: () => ['both', 'nearest', 'each'], read: (scene) => scene.align ?? 'both', help: 'How normals are turned before they are blended' },
  { key: 'gather_limit', label: 'Gather limit', kind: 'select', isVisible: ({ surface }) => BLENDED.includes(surface),
    options: () => ['least', 'nearest'], read: (scene) => scene.gather_limit ?? 'least', help: 'Which disc says how far behind it others are blended' },
  { key: 'min_distance', label: 'Min distance', ...SLIDER, range: [0, 4], step: 0.01, automatic: true,
    isVisible: ({ surface }) => !APART.includes(surface), help: 'Distance before which new rays ignore hits, in radii' },
  { key: 'edge_test', label: 'Edge test', kind: 'select', help: 'How the edge of the surface is found',
    options: () => [{ value: 'angular-gap', label: 'angular gap' }, { value: 'off', label: 'off' }] },
  { key: 'octree_depth', label: 'Octree depth', kind: 'select', help: 'Levels of the octree; automatic: as fine as the points',
    isVisible: ({ surface }) => surface === 'octree' || surface === 'octree-splat',
    options: () => [{ value: 'auto', label: 'automatic' }, ...Array.from({ length: 16 }, (_, i) => String(i + 1))],
    read: (scene) => String(scene.octree_depth ?? 'auto') },
];

const hasMap = (scene, { legend }) => legend?.kind === 'map';

export const colorControls = [
  { key: 'color', label: 'Colour by', kind: 'select', options: ({ info }) => info.colors },
  { key: 'cmap', label: 'Colour map', kind: 'select', isVisible: hasMap,
    options: ({ info }) => [{ value: '', label: 'automatic' }, ...info.colormaps],
    read: (scene) => scene.cmap ?? '', write: (name) => ({ cmap: name || null }) },
  { key: 'range', label: 'Range', kind: 'numbers', names: ['low', 'high'], automatic: true, isVisible: hasMap,
    read: (scene, { legend }) => scene.range ?? (legend?.kind === 'map' ? [legend.low, legend.high] : null),
    write: (range) => ({ range }) },
  { key: 'gamma', label: 'Gamma', ...SLIDER, range: [0.5, 4], scale: 'logarithmic', automatic: true,
    isVisible: (scene, viewer) => scene.color === 'rgb' || hasMap(scene, viewer), help: 'Brightens dark colours or values' },
];

/** The classes that are shown unless the scene names some. */
const usualClasses = ({ noise_points: choice }, { info }) =>
  info.classes.filter((one) => choice === 'keep' || !one.is_hidden).map((one) => one.class);

export const pointControls = [
  { key: 'filter', label: 'Filter', kind: 'text', isWide: true, placeholder: 'z > 100 && intensity < 5000',
    help: 'Shows only points that meet a condition on their columns',
    note: ({ info }) => `Columns: ${info.columns.join(', ')}`,
    read: (scene) => scene.filter ?? '', write: (filter) => ({ filter: filter || null }) },
  { key: 'class', label: 'Classes', kind: 'checklist', isWide: true, isVisible: (_, { info }) => 0 < info.classes.length,
    help: 'Shows only points of these classes',
    options: ({ info }) => info.classes.map((one) => ({ ...one, value: one.class })),
    read: (scene, viewer) => scene.class ?? usualClasses(scene, viewer),
    write: (classes, scene, viewer) => ({ class: areEqual(classes, usualClasses(scene, viewer)) ? null : classes }) },
  { key: 'returns', label: 'Returns', kind: 'select', isVisible: (_, { info }) => info.has_returns,
    help: 'Shows only these returns of each laser pulse; only: of pulses that have one',
    options: () => [{ value: '', label: 'all' }, 'first', 'last', 'only'],
    read: (scene) => scene.returns ?? '', write: (returns) => ({ returns: returns || null }) },
];

function lightControl(name, label, help) {
  return {
    key: `light.${name}`, sceneKey: 'light', label, kind: 'toggle', help,
    read: (scene) => (scene.light ?? []).includes(name),
    write: (isOn, scene) => {
      const kinds = ['sun', 'sky', 'headlight'].filter((kind) => (kind === name ? isOn : scene.light?.includes(kind)));
      return { light: kinds.length ? kinds : ['none'] };
    },
  };
}

const hasLight = (name) => (scene) => (scene.light ?? []).includes(name);

export const sunControls = [
  lightControl('sun', 'Sun', 'Gives light and shadows'),
  { key: 'sun.azimuth', label: 'Azimuth', ...SLIDER, range: [0, 360], step: 0.1, unit: '°', isVisible: hasLight('sun'), help: 'Clockwise from north' },
  { key: 'sun.elevation', label: 'Elevation', ...SLIDER, range: [0, 90], step: 0.1, unit: '°', isVisible: hasLight('sun'), help: 'Above the horizon' },
  { key: 'sun.angle', label: 'Diameter', ...SLIDER, range: [0, 20], step: 0.01, unit: '°', isVisible: hasLight('sun'), help: 'Angular diameter; 0 gives hard shadows' },
  { key: 'sun.strength', label: 'Strength', ...SLIDER, range: [0, 4], step: 0.01, isVisible: hasLight('sun') },
];

export const skyControls = [
  lightControl('sky', 'Sky', 'Light from all directions, with ambient occlusion'),
  { key: 'sky.strength', label: 'Strength', ...SLIDER, range: [0, 4], step: 0.01, isVisible: hasLight('sky') },
  { key: 'sky.ao_distance', label: 'Occlusion', ...SLIDER, scale: 'logarithmic', isVisible: hasLight('sky'), automatic: true,
    range: ({ info }) => [0.001, 1].map((fraction) => fraction * clip.sizeOf(info.bounds)),
    help: 'Maximum distance of surfaces that occlude the sky' },
  lightControl('headlight', 'Headlight', 'Light from the camera, without shadows'),
];

/** The kind of a background; `gradient` is the default. */
function backgroundKind({ background }) {
  if (!Array.isArray(background)) return background?.startsWith('#') ? 'color' : background ?? 'gradient';
  const [top, bottom] = background;
  if (top === bottom) return 'color';
  return top === DEFAULT_GRADIENT[0] && bottom === DEFAULT_GRADIENT[1] ? 'gradient' : 'colors';
}

const backgroundColors = ({ background }) => {
  if (Array.isArray(background)) return background;
  return background?.startsWith('#') ? [background, background] : BLUE_SKY;
};
const hasBackground = (...kinds) => (scene) => kinds.includes(backgroundKind(scene));

export const pictureControls = [
  { key: 'exposure', label: 'Exposure', ...SLIDER, range: [-5, 5], step: 0.05, automatic: true, help: 'In stops' },
  { key: 'background', label: 'Background', kind: 'select',
    options: () => [
      { value: 'gradient', label: 'gradient' }, { value: 'color', label: 'one colour' }, { value: 'colors', label: 'two colours' },
      { value: 'transparent', label: 'transparent' }, { value: 'environment', label: 'environment or sky' },
    ],
    read: backgroundKind,
    write: (kind, scene) => ({
      background: { color: backgroundColors(scene)[0], colors: BLUE_SKY }[kind] ?? kind,
    }) },
  { key: 'background.top', sceneKey: 'background', label: 'Top', kind: 'color', isVisible: hasBackground('colors', 'color'),
    read: (scene) => backgroundColors(scene)[0],
    write: (top, scene) => ({
      background: backgroundKind(scene) === 'color' ? top : [top, backgroundColors(scene)[1]],
    }) },
  { key: 'background.bottom', sceneKey: 'background', label: 'Bottom', kind: 'color', isVisible: hasBackground('colors'),
    read: (scene) => backgroundColors(scene)[1],
    write: (bottom, scene) => ({ background: [backgroundColors(scene)[0], bottom] }) },
  { key: 'spp', label: 'Samples per pixel', ...SLIDER, range: [1, 256], scale: 'logarithmic', step: 1, help: 'Camera rays per pixel of the finished picture' },
  { key: 'light_samples', label: 'Light samples', ...SLIDER, range: [1, 256], scale: 'logarithmic', step: 1, help: 'Rays per pixel toward the sky, and toward each light with soft shadows' },
  { key: 'max_depth', label: 'Max bounces', ...SLIDER, range: [0, 32], step: 1, help: 'Maximum number of reflections and refractions' },
];

const withoutScale = (_, { camera }) => (camera?.orthographic === undefined ? 'needs orthographic' : '');

/** Controls of legend, scale bar and caption. `unavailable` says why a control is disabled. */
export const annotationControls = [
  { key: 'legend', label: 'Legend', kind: 'toggle', help: 'Classes with their colours, or the colour map with its values',
    unavailable: (_, { legend }) => (legend ? '' : 'the colours need none') },
  { key: 'scale_bar', label: 'Scale bar', kind: 'toggle', help: 'A bar of a round length', followsCamera: true, unavailable: withoutScale },
  { key: 'north', label: 'North arrow', kind: 'toggle', help: 'An arrow to the north, which is +Y, unless it is along the view',
    followsCamera: true, unavailable: withoutScale },
  { key: 'caption', label: 'Caption', kind: 'text', placeholder: 'a line of text', help: 'A line of text at the lower left',
    read: (scene) => scene.caption ?? '', write: (caption) => ({ caption: caption || null }) },
];

const boxOf = (scene) => clip.parseBox(scene.clip_box);
const planeOf = (scene) => clip.parsePlane(scene.clip_plane);
const hasPlane = (scene) => planeOf(scene) !== null;
const setPlane = (plane) => ({ clip_plane: clip.formatPlane(plane) });
const AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };

/** The normal as the user typed it. The server normalizes it, which would change the numbers while others are typed. */
let typedNormal = null;
const isTypedNormal = (plane) => {
  const typed = typedNormal && normalize(typedNormal);
  return Boolean(plane && typed) && distance(plane.normal, typed) < 1e-9;
};

const axisName = ({ normal }) => ['x', 'y', 'z'].find((_, axis) => 1 - 1e-9 < Math.abs(normal[axis])) ?? 'free';

export const clipControls = [
  { key: 'clip_box', label: 'Box', kind: 'toggle', help: 'Shows only the inside of a box',
    read: (scene) => boxOf(scene) !== null,
    write: (isOn, scene, { info }) => ({ clip_box: isOn ? clip.formatBox(clip.boxAround(info.bounds)) : null }) },
  ...['x', 'y', 'z'].map((label, axis) => ({
    key: `clip_box.${label}`, sceneKey: 'clip_box', label, kind: 'numbers', names: ['from', 'to'], isVisible: (scene) => boxOf(scene) !== null,
    read: (scene) => boxOf(scene) && [boxOf(scene).min[axis], boxOf(scene).max[axis]],
    write: ([low, high], scene, { info }) => {
      const box = boxOf(scene) ?? clip.boxAround(info.bounds);
      [box.min[axis], box.max[axis]] = [Math.min(low, high), Math.max(low, high)];
      return { clip_box: clip.formatBox(box) };
    } })),
  { key: 'clip_plane', label: 'Plane', kind: 'toggle', help: 'Hides one side of a plane',
    read: hasPlane,
    write: (isOn, scene, { info }) =>
      (isOn ? setPlane(clip.planeAt({ normal: info.up }, info.bounds, 0)) : { clip_plane: null }) },
  { key: 'clip_plane.axis', sceneKey: 'clip_plane', label: 'Plane axis', kind: 'select', options: () => ['x', 'y', 'z', 'free'], isVisible: hasPlane,
    read: (scene) => (hasPlane(scene) ? axisName(planeOf(scene)) : null),
    write: (name, scene, { info }) =>
      setPlane(clip.planeAt({ normal: AXES[name] ?? scale([1, 1, 1], Math.sqrt(1 / 3)) }, info.bounds, 0)) },
  { key: 'clip_plane.normal', sceneKey: 'clip_plane', label: 'Normal', kind: 'numbers', names: ['x', 'y', 'z'],
    isVisible: (scene) => hasPlane(scene) && axisName(planeOf(scene)) === 'free',
    read: (scene) => (isTypedNormal(planeOf(scene)) ? typedNormal : scene.clip_plane?.slice(3) ?? null),
    write: (normal, scene) => {
      typedNormal = normal;
      return { clip_plane: [...scene.clip_plane.slice(0, 3), ...normal] };
    } },
  { key: 'clip_plane.position', sceneKey: 'clip_plane', label: 'Position', ...SLIDER, isVisible: hasPlane,
    range: (viewer) => {
      const end = hasPlane(viewer.scene) ? clip.maxPosition(planeOf(viewer.scene).normal, viewer.info.bounds) : 1;
      return [-end, end];
    },
    read: (scene, { info }) => planeOf(scene) && clip.positionOf(planeOf(scene), info.bounds),
    write: (position, scene, { info }) => setPlane(clip.planeAt(planeOf(scene), info.bounds, position)),
    help: 'Along the normal, from the centre of the scene' },
  { key: 'clip_plane.flip', sceneKey: 'clip_plane', label: 'Side', kind: 'button', text: 'Show the other side', isVisible: hasPlane,
    write: (_, scene) => setPlane({ ...planeOf(scene), normal: scale(planeOf(scene).normal, -1) }) },
];
