// Rows of the panel for each file and object: visibility, zoom, colour and material; added files can be removed.

import { withoutSettings } from './added.js';
import { element, iconButton } from './dom.js';
import { counted } from './format.js';
import { materialOf, withMaterial } from './materials.js';
import { labelOf, settingOf, withSetting } from './object-settings.js';
import { section } from './panel.js';

const SLIDER = { kind: 'slider' };
const FROM_FILE = { value: '', label: 'From file' };

/** Material, colour, roughness and index of refraction of one object. */
function materialControls({ name, kind: content }) {
  const materialIn = (scene) => materialOf(scene.material, name);
  const property = (word, control) => ({
    key: `material.${name}.${word}`, sceneKey: 'material', ...control,
    read: (scene, viewer) => {
      const text = materialIn(scene)?.properties[word];
      if (text === undefined) return control.default?.(materialIn(viewer.scene)?.kind);
      return control.kind === 'slider' ? Number(text) : text;
    },
    write: (value, scene) => {
      const { kind, properties: { [word]: _, ...others } } = materialIn(scene);
      const properties = value === undefined ? others : { ...others, [word]: value };
      return { material: withMaterial(scene.material, name, kind, properties) };
    },
    isVisible: (scene) => control.kinds.includes(materialIn(scene)?.kind),
  });
  return [
    { key: `material.${name}`, sceneKey: 'material', label: 'Material', help: name, kind: 'select', options: ({ info }) => [FROM_FILE, ...info.materials],
      read: (scene) => materialIn(scene)?.kind ?? '',
      write: (kind, scene) => ({ material: withMaterial(scene.material, name, kind || null, {}) }) },
    property('color', { label: 'Colour', kind: 'color', placeholder: content === 'points' ? 'from the points' : 'from the file', kinds: ['matte', 'metal', 'glass', 'plastic', 'emissive', 'unlit'] }),
    property('roughness', { label: 'Roughness', ...SLIDER, range: [0, 1], step: 0.01, kinds: ['metal', 'glass', 'plastic'],
      default: (kind) => ({ metal: 0.25, plastic: 0.2 })[kind] ?? 0 }),
    property('ior', { label: 'IOR', ...SLIDER, range: [1, 2.5], step: 0.01, kinds: ['glass', 'plastic'],
      default: () => 1.5, help: 'Index of refraction: water 1.33, glass 1.5' }),
    property('emissive_strength', { label: 'Emission', ...SLIDER, range: [0, 10], step: 0.1, kinds: ['emissive'], default: () => 1 }),
  ];
}

/** A control of one setting of an object. */
function objectControl({ name }, key, control) {
  return {
    key: `object.${name}.${key}`, sceneKey: 'object_settings', ...control,
    read: (scene) => control.fromText(settingOf(scene.object_settings, name, key)),
    write: (value, scene) => ({ object_settings: withSetting(scene.object_settings, name, key, control.toText(value)) }),
  };
}

const visibilityControl = (object) => objectControl(object, 'visible', {
  label: object.name, help: `Shows ${object.name}`, kind: 'toggle',
  fromText: (text) => (text === undefined ? object.visible : text === 'true'),
  toText: (isOn) => (isOn === object.visible ? null : String(isOn)),
});

const labelControl = (object) => objectControl(object, 'label', {
  label: 'Name', kind: 'text', help: 'Name in this list; settings and commands go on using that of the file', placeholder: object.name,
  fromText: (text) => text ?? object.label ?? '',
  toText: (text) => (text === (object.label ?? '') ? null : text || object.name),
});

const colorControl = (object) => objectControl(object, 'color', {
  label: 'Colour by', kind: 'select', help: `Colours of the points of ${object.name}`,
  options: ({ info }) => [{ value: '', label: object.color ?? 'as the scene' }, ...info.colors],
  fromText: (text) => text ?? '',
  toText: (source) => source || null,
});

/** The controls of one of several objects. A mesh has those that act on it. */
export function objectControls(object) {
  const colors = object.kind === 'points' ? [colorControl(object)] : [];
  return [visibilityControl(object), labelControl(object), ...colors, ...materialControls(object)];
}

/** The section of all objects. One alone has its material; several can also be hidden and coloured apart. */
export function objectSection(viewer, panel, navigation) {
  const objects = section('Objects', false);
  let shown = null;
  viewer.sceneChanged.listen(() => {
    const body = objects.querySelector('.section-body');
    const names = viewer.objects.map(({ name }) => name).join('\n');
    if (!viewer.scene) return;
    if (names === shown) {
      showLabels(body, viewer);
      return;
    }
    shown = names;
    panel.removeRows([...body.querySelectorAll('.row')]);
    const all = viewer.objects;
    body.replaceChildren(...(all.length === 1 ? singleRows(all[0], panel) : all.map((object) => objectPart(object, panel, viewer, navigation))));
    showLabels(body, viewer);
  });
  return objects;
}

function singleRows(object, panel) {
  return [...panel.addRows(materialControls(object)), ...notesOf(object)];
}

function objectPart(object, panel, viewer, navigation) {
  const { name } = object;
  const size = object.kind === 'points' ? counted(object.points, 'point') : counted(object.triangles, 'triangle');
  const [visibility, ...details] = panel.addRows(objectControls(object));
  if (object.bounds) visibility.append(iconButton('fit', `Zoom to ${name}`, () => navigation.fit(object.bounds), { 'data-of-object': 'fit' }));
  if (object.id) visibility.append(iconButton('delete', `Remove ${name}`, () => remove(viewer, object), { 'data-of-object': 'delete' }));
  return element('div', { class: 'object', 'data-object': object.name },
    visibility, ...notesOf(object), element('details', { class: 'inner' }, element('summary', {}, size), ...details));
}

/** Shows each object in the list by its label. */
function showLabels(body, { objects, scene }) {
  for (const object of objects) {
    const part = body.querySelector(`[data-object="${CSS.escape(object.name)}"]`);
    const label = labelOf(scene.object_settings, object);
    if (!part || part.dataset.label === label) continue;
    part.dataset.label = label;
    part.querySelector('label').firstChild.textContent = label;
    for (const [action, word] of [['fit', 'Zoom to'], ['delete', 'Remove']]) {
      const button = part.querySelector(`[data-of-object="${action}"]`);
      for (const name of button ? ['title', 'aria-label'] : []) button.setAttribute(name, `${word} ${label}`);
    }
  }
}

/** Removes an added file from the scene. It is kept, so that this can be undone. */
function remove(viewer, { id, name }) {
  const others = viewer.scene.added_files.filter((other) => other !== id);
  viewer.changeSettings({ ...withoutSettings(viewer.scene, name), added_files: others.length ? others : null });
}

/** The notes of the reader about the files of an object. */
const notesOf = ({ notes }) => notes.map((text) => element('p', { class: 'note' }, text));
