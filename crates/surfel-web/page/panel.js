// The panel: sections of controls made from their table, kept in step with the scene.

import { element, icon, iconButton } from './dom.js';
import { makers } from './fields.js';
import { areEqual, patchOf, valueAt } from './patch.js';

/** A part of the panel that folds; `badge` may show what it holds. */
export function section(title, isOpen, ...children) {
  return element('details', { class: 'section', open: isOpen, 'data-section': title.toLowerCase() },
    element('summary', {}, element('span', {}, title), icon('chevron')),
    element('div', { class: 'section-body' }, ...children));
}

/** Rows for these controls, which follow the scene. */
export function controlRows(controls, viewer) {
  const rows = controls.map((control) => row(control, viewer));
  const update = () => viewer.scene && rows.forEach((one) => one.update());
  viewer.sceneChanged.listen(update);
  return rows.map((one) => one.element);
}

function row(control, viewer) {
  const id = `field-${control.key.replaceAll(/[^\w-]/g, '_')}`;
  const read = (scene) => (control.read ? control.read(scene, viewer) : valueAt(scene, control.key));
  const patchFor = (value) => (control.write ? control.write(value, viewer.scene, viewer) : patchOf(control.key, value));
  let isHeld = false;
  const change = (value, isMoving) => {
    isHeld = isMoving;
    viewer.set(patchFor(value), isMoving);
  };
  const field = makers[control.kind](control, change, id);
  const key = control.of ?? control.key;
  // A key of the scene file goes back as it stands there; a part of one by what it reads.
  const opening = () => (control.of ? read(viewer.opening) : valueAt(viewer.opening, control.key));
  const present = () => (control.of ? read(viewer.scene) : valueAt(viewer.scene, control.key));
  const goBack = () => viewer.set(control.of ? patchFor(opening()) : patchOf(control.key, opening() ?? null));
  const canGoBack = () => !(control.of && opening() === null) && control.kind !== 'button' && !areEqual(opening(), present());

  const reset = iconButton('reset', `${control.label}: as it was`, goBack, { class: 'icon-button reset', 'data-reset': control.key });
  const automatic = control.automatic ? element('button', {
    type: 'button', class: 'chip', title: 'Chosen automatically', 'data-automatic': control.key,
    onclick: () => viewer.set(patchOf(control.key, null)),
  }, 'auto') : null;
  const title = control.help ? `${control.help}\n${key}` : key;
  const made = element('div', { class: 'row', 'data-row': control.key },
    element('label', { for: id, title }, control.label, control.unit && element('small', {}, control.unit)),
    field.element, automatic, reset);

  const update = () => {
    made.hidden = control.shown ? !control.shown(viewer.scene, viewer) : false;
    if (made.hidden) return;
    // What is being dragged knows better than a scene that is underway.
    if (!isHeld) field.show(read(viewer.scene), viewer);
    reset.classList.toggle('is-idle', !canGoBack());
  };
  return { element: made, update };
}
