// Fields of the panel, a factory for each kind: an element that shows a value and reports changes.

import { element, icon } from './dom.js';
import { count, shortest } from './format.js';
import { areEqual } from './merge-patch.js';

const SLIDER_STEPS = 1000;

// Each factory takes a control (see controls.js), a callback `change(value, isMoving)`, and the id of the field that
// the label refers to; it returns { element, show(value, viewer) }.
export const fieldFactories = { slider, select, toggle, color, numbers, text, checklist, button };

function slider(control, change, id) {
  let ends = Array.isArray(control.range) ? control.range : [0, 1];
  const range = element('input', { type: 'range', id, min: 0, max: SLIDER_STEPS, step: 1, 'data-key': control.key });
  const number = numberInput(control.label);
  number.dataset.number = control.key;
  const value = () => rounded(control, valueOf(control, ends, range.value / SLIDER_STEPS));
  const paint = () => range.style.setProperty('--fraction', `${(100 * range.value) / SLIDER_STEPS}%`);
  range.addEventListener('input', () => {
    number.value = value();
    paint();
    change(value(), true);
  });
  range.addEventListener('change', () => change(value(), false));
  number.addEventListener('change', () => {
    if (Number.isFinite(number.valueAsNumber)) change(number.valueAsNumber, false);
  });
  const show = (shown, viewer) => {
    if (typeof control.range === 'function') ends = control.range(viewer);
    const isNumber = typeof shown === 'number';
    // A value such as `auto` is shown as the placeholder.
    number.placeholder = isNumber ? '' : shown ?? '–';
    if (document.activeElement !== number) number.value = isNumber ? rounded(control, shown) : '';
    if (!isNumber) return;
    range.value = Math.round(fractionOf(control, ends, shown) * SLIDER_STEPS);
    range.setAttribute('aria-valuetext', rounded(control, shown));
    paint();
  };
  return { element: element('div', { class: 'field slider' }, range, number), show };
}

/** Position of a value between the ends of its slider, from 0 to 1. */
function fractionOf({ scale }, [low, high], value) {
  const fraction = scale === 'logarithmic' ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
  return Math.min(1, Math.max(0, fraction));
}

function valueOf({ scale }, [low, high], fraction) {
  return scale === 'logarithmic' ? low * Math.pow(high / low, fraction) : low + fraction * (high - low);
}

function rounded(control, value) {
  if (control.step) return Number((Math.round(value / control.step) * control.step).toPrecision(12));
  return Number(value.toPrecision(3));
}

function numberInput(label) {
  return element('input', { type: 'number', step: 'any', 'aria-label': label, inputmode: 'decimal' });
}

function select(control, change, id) {
  const field = element('select', { id, 'data-key': control.key, onchange: () => change(field.value, false) });
  const show = (value, viewer) => {
    const options = control.options(viewer);
    const known = options.map(optionOf);
    if (value !== undefined && !known.some((option) => option.value === value)) known.unshift(optionOf(value));
    const texts = known.map((option) => `${option.value}\n${option.label}`).join('\n\n');
    if (field.dataset.options !== texts) {
      field.dataset.options = texts;
      field.replaceChildren(...known.map((option) => element('option', { value: option.value }, option.label)));
    }
    field.value = value ?? '';
  };
  return { element: element('div', { class: 'field select' }, field, icon('chevron')), show };
}

const optionOf = (option) => (typeof option === 'object' ? option : { value: option, label: option });

function toggle(control, change, id) {
  const box = element('input', {
    type: 'checkbox', role: 'switch', id, 'data-key': control.key, onchange: () => change(box.checked, false),
  });
  const reason = element('span', { class: 'note', id: `${id}-reason` });
  const show = (value, viewer) => {
    box.checked = Boolean(value);
    reason.textContent = control.unavailable?.(viewer.scene, viewer) ?? '';
    box.disabled = reason.textContent !== '';
  };
  if (control.unavailable) box.setAttribute('aria-describedby', reason.id);
  return { element: element('div', { class: 'field toggle' }, box, reason), show };
}

function color(control, change, id) {
  const field = element('input', {
    type: 'color', id, 'data-key': control.key,
    oninput: () => change(field.value, true), onchange: () => change(field.value, false),
  });
  const text = element('output', {});
  const show = (value) => {
    field.value = value ?? '#ffffff';
    text.value = value ?? control.placeholder ?? '';
  };
  return { element: element('div', { class: 'field color' }, field, text), show };
}

/** Number inputs side by side, one for each of the control's `names`. */
function numbers(control, change, id) {
  const inputs = control.names.map((name, i) => {
    const input = numberInput(`${control.label}: ${name}`);
    Object.assign(input, { placeholder: name, title: name });
    input.dataset.key = `${control.key}.${i}`;
    input.addEventListener('change', () => {
      const values = inputs.map((one) => one.valueAsNumber);
      if (values.every(Number.isFinite)) change(values, false);
    });
    return input;
  });
  inputs[0].id = id;
  const show = (values) => inputs.forEach((input, i) => {
    if (document.activeElement !== input) input.value = values ? shortest(values[i]) : '';
  });
  return { element: element('div', { class: 'field numbers' }, ...inputs), show };
}

function text(control, change, id) {
  const field = element('input', {
    type: 'text', id, 'data-key': control.key, placeholder: control.placeholder, maxlength: 1000, spellcheck: 'false', autocomplete: 'off',
  });
  let isTyping = false;
  field.addEventListener('input', () => { isTyping = true; });
  field.addEventListener('change', () => {
    isTyping = false;
    change(field.value.trim(), false);
  });
  // A text that is typed back to what it was brings no change.
  field.addEventListener('blur', () => { isTyping = false; });
  const note = control.note ? element('p', { class: 'note', id: `${id}-note` }) : null;
  if (note) field.setAttribute('aria-describedby', note.id);
  const show = (value, viewer) => {
    if (!isTyping) field.value = value;
    if (note) note.textContent = control.note(viewer);
  };
  return { element: element('div', { class: 'field text' }, field, note), show };
}

/** Check boxes of the control's options, each `{ value, name, color, points }`. The last one that is checked stays so. */
function checklist(control, change, id) {
  const list = element('div', { class: 'field checklist', id, role: 'group', 'aria-label': control.label });
  let shown = null;
  const boxes = () => [...list.querySelectorAll('input')];
  const checked = () => boxes().flatMap((box, i) => (box.checked ? [shown[i].value] : []));
  const item = ({ value, name, color, points }) => {
    const box = element('input', { type: 'checkbox', 'data-key': `${control.key}.${value}`, onchange: () => change(checked(), false) });
    const swatch = element('span', { class: 'swatch' });
    swatch.style.background = color;
    return element('label', {}, box, swatch, element('span', {}, name), element('small', {}, count(points)));
  };
  const show = (values, viewer) => {
    const options = control.options(viewer);
    if (!areEqual(options, shown)) {
      shown = options;
      list.replaceChildren(...options.map(item));
    }
    boxes().forEach((box, i) => {
      box.checked = values.includes(shown[i].value);
      box.disabled = box.checked && values.length === 1;
    });
  };
  return { element: list, show };
}

function button(control, change, id) {
  const field = element('button', {
    type: 'button', class: 'button', id, 'data-key': control.key, onclick: () => change(true, false),
  }, control.text);
  return { element: element('div', { class: 'field' }, field), show: () => {} };
}
