// The card with the attributes of a picked point, each of which can be copied.

import { copyButton } from './copy.js';
import { element, iconButton } from './dom.js';
import { exact } from './format.js';

const AXES = ['x', 'y', 'z'];

/** Names and values of a point's attributes. */
function rowsOf(point) {
  return [
    ...AXES.map((name, i) => [name, exact(point.position[i])]),
    ['object', point.object],
    ['index', String(point.index)],
    ['distance', exact(point.distance)],
    ['normal', point.normal.map((value) => value.toFixed(4)).join(', ')],
    ...point.columns.map(({ name, value }) => [name, exact(value)]),
  ];
}

export class PickCard {
  #point = null;

  constructor(viewer, overlay) {
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
    const rows = rowsOf(point);
    const all = () => rows.map(([name, value]) => `${name}\t${value}`).join('\n');
    this.card.replaceChildren(
      element('header', {},
        element('h2', {}, point.kind === 'triangle' ? 'Triangle' : 'Point'),
        copyButton('Copy all', all),
        iconButton('close', 'Close', () => this.close())),
      element('dl', { class: 'values' }, ...rows.flatMap(([name, value]) => [
        element('dt', {}, name), element('dd', {}, element('span', {}, value), copyButton(`Copy ${name}`, () => value))])));
    this.card.hidden = false;
    this.overlay.redraw();
  }

  close() {
    this.#point = null;
    this.card.hidden = true;
    this.overlay.redraw();
  }
}
