// The card with the attributes of a picked point, each of which can be copied.

import { copyButton } from './copy.js';
import { element, iconButton } from './dom.js';
import { coordinate, exact, withUnit } from './format.js';

const AXES = ['x', 'y', 'z'];

/** Names, values and units of a point's attributes. */
function rowsOf(point, unit) {
  return [
    ...AXES.map((name, i) => [name, coordinate(point.position[i], point.decimals?.[i]), unit]),
    ['object', point.object],
    ['index', String(point.index)],
    ['distance', exact(point.distance), unit],
    ['normal', point.normal.map((value) => value.toFixed(4)).join(', ')],
    ...point.columns.map(({ name, value }) => [name, exact(value)]),
  ];
}

export class PickCard {
  #point = null;

  constructor(viewer, overlay) {
    this.viewer = viewer;
    this.card = document.getElementById('pick-card');
    this.overlay = overlay;
    overlay.add((view) => (this.#point
      ? [...view.dot(this.#point.position, 6, 'pick-halo'), ...view.dot(this.#point.position, 6, 'pick')] : []));
    viewer.infoChanged.listen(() => this.close());
  }

  get isOpen() {
    return this.#point !== null;
  }

  show(point) {
    this.#point = point;
    const rows = rowsOf(point, this.viewer.info.unit);
    const all = () => rows.map(([name, value]) => `${name}\t${value}`).join('\n');
    this.card.replaceChildren(
      element('header', {},
        element('h2', {}, point.kind === 'triangle' ? 'Triangle' : 'Point'),
        copyButton('Copy all', all),
        iconButton('close', 'Close', () => this.close())),
      element('dl', { class: 'values' }, ...rows.flatMap(([name, value, unit]) => [
        element('dt', {}, name),
        element('dd', {}, element('span', {}, withUnit(value, unit)), copyButton(`Copy ${name}`, () => value))])));
    this.card.hidden = false;
    this.overlay.redraw();
  }

  close() {
    this.#point = null;
    this.card.hidden = true;
    this.overlay.redraw();
  }
}
