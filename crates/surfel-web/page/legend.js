// The legend on the picture, unless the picture contains one: a colour map with its scale, or classes with their colours.

import { pointControls } from './controls.js';
import { element } from './dom.js';
import { rounded, ticks } from './format.js';
import { areEqual } from './merge-patch.js';

const N_TICKS = 4;

const classControl = pointControls.find(({ key }) => key === 'class');

export function setUpLegend(viewer) {
  const card = document.getElementById('legend');
  let shown = null;
  viewer.sceneChanged.listen(() => {
    const legend = viewer.scene?.legend ? null : viewer.legend;
    const classes = legend?.entries?.every((entry) => 'class' in entry) ? classControl.read(viewer.scene, viewer) : null;
    if (areEqual([legend, classes], shown)) return;
    shown = [legend, classes];
    card.hidden = !legend;
    if (!legend) return;
    const focused = card.querySelector(':focus')?.dataset.class;
    const content = legend.kind === 'map' ? mapScale(legend) : classes ? classSwitches(classes, viewer) : labelList(legend);
    card.replaceChildren(element('h2', {}, legend.title), content);
    card.querySelector(`[data-class="${focused}"]`)?.focus();
  });
}

function mapScale({ low, high, colors }) {
  const bar = element('div', { class: 'legend-bar' });
  bar.style.backgroundImage = gradient(colors, 'to top');
  const digits = Math.max(4, Math.ceil(Math.log10(Math.max(Math.abs(low), Math.abs(high)) / (high - low))) + 3);
  const marks = ticks(low, high, N_TICKS).map((value) => {
    const mark = element('span', { class: 'legend-tick' }, rounded(value, digits));
    mark.style.bottom = `${(100 * (value - low)) / (high - low)}%`;
    return mark;
  });
  return element('div', { class: 'legend-map' }, bar, element('div', { class: 'legend-scale' }, ...marks));
}

function labelList({ entries }) {
  return element('ul', { class: 'legend-classes' }, ...entries.map(({ name, color }) => element('li', {}, swatchOf(color), name)));
}

/** All classes as buttons that hide and show them, also those that the legend of the server lacks as they are hidden. The last one stays. */
function classSwitches(shown, viewer) {
  const all = viewer.info.classes;
  return element('ul', { class: 'legend-classes' }, ...all.map(({ class: number, name, color }) => {
    const isShown = shown.includes(number);
    const toggle = () => {
      const classes = all.map((one) => one.class).filter((other) => (other === number ? !isShown : shown.includes(other)));
      viewer.changeSettings(classControl.write(classes, viewer.scene, viewer));
    };
    return element('li', {}, element('button', {
      type: 'button', 'data-class': number, 'aria-pressed': String(isShown), disabled: isShown && shown.length === 1, onclick: toggle,
      title: isShown ? 'Hide this class' : 'Show this class',
    }, swatchOf(color), name));
  }));
}

function swatchOf(color) {
  const swatch = element('span', { class: 'swatch' });
  swatch.style.background = color;
  return swatch;
}

export const gradient = (colors, direction) => `linear-gradient(${direction}, ${colors.join(', ')})`;

/** A stripe with the current colour map. */
export function colormapPreview(viewer) {
  const stripe = element('div', { class: 'colormap-preview', 'aria-hidden': 'true' });
  viewer.sceneChanged.listen(() => {
    const isMap = viewer.legend?.kind === 'map';
    stripe.hidden = !isMap;
    if (isMap) stripe.style.backgroundImage = gradient(viewer.legend.colors, 'to right');
  });
  return stripe;
}
