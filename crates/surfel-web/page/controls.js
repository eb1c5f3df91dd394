// The table of controls: every key of a scene file that the panel shows, with its label, kind and range.

import * as clip from './clip.js';
import { materialOf, withMaterial } from './materials.js';
import { scale } from './vector.js';

// A control is { key, label, kind, … } with what its kind in fields.js wants (range, options, names …). Unless
// it has its own `read(scene, viewer)` and `write(value, scene, viewer)`, which returns a merge patch, it is the
// value at `key` of the scene. `shown(scene, viewer)` hides it, `help` says more, `automatic` offers the
// automatic choice (null in a patch), `of` names the scene file's key where `key` is only ours.

const DEFAULT_GRADIENT = ['#6f7c8a', '#c9ced3'];
const BLUE_SKY = ['#4f7fb8', '#d5e2ee'];
const SLIDING = { kind: 'slider' };

export const surfaceControls = [
  { key: 'surface', label: 'Kind', kind: 'select', options: ({ info }) => info.surfaces, help: 'The shape given to the points' },
  { key: 'radius_scale', label: 'Radius', ...SLIDING, range: [0.25, 4], limits: [0.01, 100], scale: 'logarithmic',
    read: (scene) => scene.radius_scale ?? 1, help: 'How far each point reaches, as a multiple' },
  { key: 'boundary', label: 'Ends at', kind: 'select', help: 'Where the surface has its rims',
    options: () => [{ value: 'gap', label: 'outermost points' }, { value: 'off', label: 'rims of discs' }] },
];

const hasMap = (scene, { legend }) => legend?.kind === 'map';

export const colorControls = [
  { key: 'color', label: 'Colour by', kind: 'select', options: ({ info }) => info.colors },
  { key: 'cmap', label: 'Colour map', kind: 'select', shown: hasMap,
    options: ({ info }) => [{ value: '', label: 'automatic' }, ...info.colormaps],
    read: (scene) => scene.cmap ?? '', write: (name) => ({ cmap: name || null }) },
  { key: 'range', label: 'Range', kind: 'numbers', names: ['low', 'high'], automatic: true, shown: hasMap,
    read: (scene, { legend }) => scene.range ?? (legend?.kind === 'map' ? [legend.low, legend.high] : null),
    write: (range) => ({ range }) },
];

function lightControl(name, label, help) {
  return {
    key: `light.${name}`, of: 'light', label, kind: 'toggle', help,
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
  { key: 'sun.azimuth', label: 'Azimuth', ...SLIDING, range: [0, 360], limits: [-360, 360], step: 0.1, unit: '°', shown: hasLight('sun'), help: 'Clockwise from north' },
  { key: 'sun.elevation', label: 'Elevation', ...SLIDING, range: [0, 90], limits: [-90, 90], step: 0.1, unit: '°', shown: hasLight('sun'), help: 'Over the horizon' },
  { key: 'sun.angle', label: 'Diameter', ...SLIDING, range: [0, 20], limits: [0, 180], step: 0.01, unit: '°', shown: hasLight('sun'), help: 'Seen from here; 0 gives hard shadows' },
  { key: 'sun.strength', label: 'Strength', ...SLIDING, range: [0, 4], limits: [0, 1000], step: 0.01, shown: hasLight('sun') },
];

export const skyControls = [
  lightControl('sky', 'Sky', 'Light from all sides, dimmed in corners'),
  { key: 'sky.strength', label: 'Strength', ...SLIDING, range: [0, 4], limits: [0, 1000], step: 0.01, shown: hasLight('sky') },
  { key: 'sky.reach', label: 'Occlusion', ...SLIDING, scale: 'logarithmic', shown: hasLight('sky'), automatic: true,
    range: ({ info }) => [0.001, 1].map((share) => share * clip.sizeOf(info.bounds)), limits: [1e-9, 1e12],
    help: 'How far away things still dim the sky' },
  lightControl('headlight', 'Headlight', 'Light from the camera, without shadows'),
];

/** How a background is given: `gradient` is the usual one. */
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
  { key: 'exposure', label: 'Exposure', ...SLIDING, range: [-5, 5], limits: [-20, 20], step: 0.05, automatic: true, help: 'In stops' },
  { key: 'background', label: 'Background', kind: 'select',
    options: () => [
      { value: 'gradient', label: 'gradient' }, { value: 'color', label: 'one colour' }, { value: 'colors', label: 'two colours' },
      { value: 'transparent', label: 'transparent' }, { value: 'surroundings', label: 'sky or environment' },
    ],
    read: backgroundKind,
    write: (kind, scene) => ({
      background: { color: backgroundColors(scene)[0], colors: BLUE_SKY }[kind] ?? kind,
    }) },
  { key: 'background.top', of: 'background', label: 'Top', kind: 'color', shown: hasBackground('colors', 'color'),
    read: (scene) => backgroundColors(scene)[0],
    write: (top, scene) => ({
      background: backgroundKind(scene) === 'color' ? top : [top, backgroundColors(scene)[1]],
    }) },
  { key: 'background.bottom', of: 'background', label: 'Bottom', kind: 'color', shown: hasBackground('colors'),
    read: (scene) => backgroundColors(scene)[1],
    write: (bottom, scene) => ({ background: [backgroundColors(scene)[0], bottom] }) },
  { key: 'spp', label: 'Camera rays', ...SLIDING, range: [1, 256], limits: [1, 65536], scale: 'logarithmic', step: 1, help: 'A pixel, in the finished picture' },
  { key: 'samples', label: 'Light rays', ...SLIDING, range: [1, 256], limits: [1, 65536], scale: 'logarithmic', step: 1, help: 'A pixel, toward sky and soft sun' },
  { key: 'max_depth', label: 'Reflections', ...SLIDING, range: [0, 32], limits: [0, 64], step: 1, help: 'Reflections and refractions of a ray, at most' },
];

const FILES_OWN = { value: '', label: 'of the file' };

/** Material, colour, roughness and index of refraction of one object. */
export function materialControls({ name }) {
  const found = (scene) => materialOf(scene.material, name);
  const property = (word, control) => ({
    key: `material.${name}.${word}`, of: 'material', ...control,
    read: (scene, viewer) => {
      const text = found(scene)?.properties[word];
      if (text === undefined) return control.usual?.(found(viewer.scene)?.kind);
      return control.kind === 'slider' ? Number(text) : text;
    },
    write: (value, scene) => {
      const { kind, properties: { [word]: _, ...others } } = found(scene);
      const properties = value === undefined ? others : { ...others, [word]: value };
      return { material: withMaterial(scene.material, name, kind, properties) };
    },
    shown: (scene) => control.kinds.includes(found(scene)?.kind),
  });
  return [
    { key: `material.${name}`, of: 'material', label: name, help: name, kind: 'select', options: ({ info }) => [FILES_OWN, ...info.materials],
      read: (scene) => found(scene)?.kind ?? '',
      write: (kind, scene) => ({ material: withMaterial(scene.material, name, kind || null, {}) }) },
    property('color', { label: 'Colour', kind: 'color', placeholder: 'of the points', kinds: ['matte', 'metal', 'glass', 'plastic', 'emissive', 'unlit'] }),
    property('roughness', { label: 'Roughness', ...SLIDING, range: [0, 1], limits: [0, 1], step: 0.01, kinds: ['metal', 'glass', 'plastic'],
      usual: (kind) => ({ metal: 0.25, plastic: 0.2 })[kind] ?? 0 }),
    property('ior', { label: 'Refraction', ...SLIDING, range: [1, 2.5], limits: [1, 4], step: 0.01, kinds: ['glass', 'plastic'],
      usual: () => 1.5, help: 'Index of refraction: water 1.33, glass 1.5' }),
    property('glow', { label: 'Glow', ...SLIDING, range: [0, 10], limits: [0, 10000], step: 0.1, kinds: ['emissive'], usual: () => 1 }),
  ];
}

const boxOf = (scene) => clip.parseBox(scene.clip_box);
const planeOf = (scene) => clip.parsePlane(scene.clip_plane);
const hasPlane = (scene) => planeOf(scene) !== null;
const setPlane = (plane) => ({ clip_plane: clip.formatPlane(plane) });
const AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };

const axisName = ({ normal }) => ['x', 'y', 'z'].find((_, axis) => 1 - 1e-9 < Math.abs(normal[axis])) ?? 'free';

export const clipControls = [
  { key: 'clip_box', label: 'Box', kind: 'toggle', help: 'Shows only what is inside',
    read: (scene) => boxOf(scene) !== null,
    write: (isOn, scene, { info }) => ({ clip_box: isOn ? clip.formatBox(clip.boxAround(info.bounds)) : null }) },
  ...['x', 'y', 'z'].map((label, axis) => ({
    key: `clip_box.${label}`, of: 'clip_box', label, kind: 'numbers', names: ['from', 'to'], shown: (scene) => boxOf(scene) !== null,
    read: (scene) => boxOf(scene) && [boxOf(scene).min[axis], boxOf(scene).max[axis]],
    write: ([low, high], scene, { info }) => {
      const box = boxOf(scene) ?? clip.boxAround(info.bounds);
      [box.min[axis], box.max[axis]] = [Math.min(low, high), Math.max(low, high)];
      return { clip_box: clip.formatBox(box) };
    } })),
  { key: 'clip_plane', label: 'Plane', kind: 'toggle', help: 'Hides what is on its far side',
    read: hasPlane,
    write: (isOn, scene, { info }) =>
      (isOn ? setPlane(clip.planeAt({ normal: info.up }, info.bounds, 0)) : { clip_plane: null }) },
  { key: 'clip_plane.axis', of: 'clip_plane', label: 'Across', kind: 'select', options: () => ['x', 'y', 'z', 'free'], shown: hasPlane,
    read: (scene) => (hasPlane(scene) ? axisName(planeOf(scene)) : null),
    write: (name, scene, { info }) =>
      setPlane(clip.planeAt({ normal: AXES[name] ?? scale([1, 1, 1], Math.sqrt(1 / 3)) }, info.bounds, 0)) },
  { key: 'clip_plane.normal', of: 'clip_plane', label: 'Normal', kind: 'numbers', names: ['x', 'y', 'z'],
    shown: (scene) => hasPlane(scene) && axisName(planeOf(scene)) === 'free',
    // As it is typed: made a unit vector in between, the numbers that stand already would change.
    read: (scene) => scene.clip_plane?.slice(3) ?? null,
    write: (normal, scene) => ({ clip_plane: [...scene.clip_plane.slice(0, 3), ...normal] }) },
  { key: 'clip_plane.position', of: 'clip_plane', label: 'Position', ...SLIDING, shown: hasPlane,
    range: (viewer) => {
      const reach = hasPlane(viewer.scene) ? clip.reachOf(planeOf(viewer.scene).normal, viewer.info.bounds) : 1;
      return [-reach, reach];
    },
    read: (scene, { info }) => planeOf(scene) && clip.positionOf(planeOf(scene), info.bounds),
    write: (position, scene, { info }) => setPlane(clip.planeAt(planeOf(scene), info.bounds, position)),
    help: 'Along the normal, from the middle' },
  { key: 'clip_plane.flip', of: 'clip_plane', label: 'Side', kind: 'button', text: 'Show the other side', shown: hasPlane,
    write: (_, scene) => setPlane({ ...planeOf(scene), normal: scale(planeOf(scene).normal, -1) }) },
];
