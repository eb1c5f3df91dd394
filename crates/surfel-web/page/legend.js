// The legend on the picture, unless the picture contains one: a colour map with its scale, or classes with their colours.

import { element } from './dom.js';
import { rounded, ticks } from './format.js';
import { areEqual } from './merge-patch.js';

const N_TICKS = 4;

export function setUpLegend(viewer) {
  const card = document.getElementById('legend');
  let shown = null;
  viewer.sceneChanged.listen(() => {
    const legend = viewer.scene?.legend ? null : viewer.legend;
    if (areEqual(legend, shown)) return;
    shown = legend;
    card.hidden = !legend;
    if (!legend) return;
    card.replaceChildren(element('h2', {}, legend.title), legend.kind === 'map' ? mapScale(legend) : classList(legend));
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

function classList({ entries }) {
  return element('ul', { class: 'legend-classes' }, ...entries.map(({ name, color }) => {
    const swatch = element('span', { class: 'swatch' });
    swatch.style.background = color;
    return element('li', {}, swatch, name);
  }));
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
