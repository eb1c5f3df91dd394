// The panel: sections of controls made from their table, kept in step with the scene.

import { element, icon, iconButton } from './dom.js';
import { fieldFactories } from './fields.js';
import { areEqual, patchAt, valueAt } from './merge-patch.js';
import { findControl } from './rejections.js';

/** A section of the panel that folds. */
export function section(title, isOpen, ...children) {
  return element('details', { class: 'section', open: isOpen, 'data-section': title.toLowerCase() },
    element('summary', {}, element('span', {}, title), icon('chevron')),
    element('div', { class: 'section-body' }, ...children));
}

/** The rows of the panel, which show the scene's values and the server's rejections of them. */
export class Panel {
  #rows = [];
  #lastChanged = null;

  constructor(viewer) {
    this.viewer = viewer;
    viewer.sceneChanged.listen(() => viewer.scene && this.#rows.forEach((row) => row.update()));
    viewer.cameraChanged.listen(() => viewer.scene
      && this.#rows.filter(({ control }) => control.followsCamera).forEach((row) => row.update()));
    viewer.rejected.listen((rejection) => this.#showRejection(rejection));
    viewer.viewReplaced.listen(() => this.#rows.forEach((row) => row.dropDrag()));
  }

  /** Adds rows for these controls; returns their elements. */
  addRows(controls) {
    return controls.map((control) => {
      const row = createRow(control, this.viewer, () => { this.#lastChanged = row; });
      this.#rows.push(row);
      if (this.viewer.scene) row.update();
      return row.element;
    });
  }

  /** Removes rows, given by their elements. */
  removeRows(elements) {
    this.#rows = this.#rows.filter((row) => !elements.includes(row.element));
    for (const removed of elements) removed.remove();
  }

  #showRejection({ key, text }) {
    const rows = this.#rows.filter((row) => !row.element.hidden);
    const controls = rows.map((row) => row.control);
    if (key) rows[findControl(controls, key, rows.indexOf(this.#lastChanged))]?.showError(text);
  }
}

function createRow(control, viewer, onChange) {
  const id = `field-${control.key.replaceAll(/[^\w-]/g, '_')}`;
  const read = (scene) => (control.read ? control.read(scene, viewer) : valueAt(scene, control.key));
  const patchFor = (value) => (control.write ? control.write(value, viewer.scene, viewer) : patchAt(control.key, value));
  const error = element('p', { class: 'row-error', role: 'alert', id: `${id}-error`, hidden: true });
  let rejectedValue;
  let isDragging = false;
  let lastPatch = null;
  const send = (patch, isMoving) => {
    error.hidden = true;
    onChange();
    viewer.changeSettings(patch, isMoving);
  };
  const change = (value, isMoving) => {
    isDragging = isMoving;
    lastPatch = patchFor(value);
    send(lastPatch, isMoving);
  };
  /** Ends a drag whose field does not report its end, as when a touch becomes a scroll. */
  const endDrag = () => {
    if (!isDragging) return;
    isDragging = false;
    send(lastPatch, false);
  };
  /** Ends a drag without its change: the view in which it began was replaced, as by undo. */
  const dropDrag = () => { isDragging = false; };
  const field = fieldFactories[control.kind](control, change, id);
  const sceneKey = control.sceneKey ?? control.key;
  // A control of a whole scene key resets that key; a control of a part resets the value that it reads.
  const valueToCompare = (scene) => (control.sceneKey ? read(scene) : valueAt(scene, control.key));
  const initialValue = () => valueToCompare(viewer.initialScene);
  const reset = () => send(control.sceneKey ? patchFor(initialValue()) : patchAt(control.key, initialValue() ?? null));
  const canReset = () => !(control.sceneKey && initialValue() === null) && control.kind !== 'button'
    && !areEqual(initialValue(), valueToCompare(viewer.scene));

  const resetButton = iconButton('reset', `${control.label}: reset`, reset, { class: 'icon-button reset', 'data-reset': control.key });
  const automatic = control.automatic ? element('button', {
    type: 'button', class: 'chip', title: 'Choose automatically', 'data-automatic': control.key,
    onclick: () => send(patchAt(control.key, null)),
  }, 'auto') : null;
  const title = control.help ? `${control.help}\n${sceneKey}` : sceneKey;
  const row = element('div', { class: control.isWide ? 'row is-wide' : 'row', 'data-row': control.key },
    element('label', { for: id, title }, control.label, control.unit && element('small', {}, control.unit)),
    field.element, automatic, resetButton, error);

  const update = () => {
    row.hidden = control.isVisible ? !control.isVisible(viewer.scene, viewer) : false;
    if (row.hidden) return;
    const value = read(viewer.scene);
    // While the user drags, the field is ahead of the scene.
    if (!isDragging) field.show(value, viewer);
    if (!areEqual(value, rejectedValue)) error.hidden = true;
    resetButton.classList.toggle('is-idle', !canReset());
  };
  // The field reports the end of a drag after these events.
  for (const event of ['pointerup', 'pointercancel']) field.element.addEventListener(event, () => setTimeout(endDrag));
  field.element.addEventListener('focusout', ({ relatedTarget }) => {
    if (field.element.contains(relatedTarget)) return;
    endDrag();
    // A field does not take over values while it has the focus.
    if (viewer.scene) update();
  });
  const showError = (text) => {
    // The rejected value is taken back before; the error stays until the value changes.
    rejectedValue = read(viewer.scene);
    error.textContent = text;
    error.hidden = false;
  };
  return { control, element: row, update, showError, dropDrag };
}
