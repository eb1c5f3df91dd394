// The card with the results of measurements and the texts of annotations.

import { copyButton } from './copy.js';
import { download, element, iconButton } from './dom.js';
import { MAX_NAME_LENGTH } from './figures.js';
import { exact, stemOf } from './format.js';
import { figurePainter, textOfResult } from './figure-painter.js';
import { geoJson } from './geojson.js';
import { resultsOf } from './measure.js';
import { setUpVolumes, volumeControls } from './volume.js';

export class MeasureCard {
  /** The elements with the results of each figure. */
  #values = [];

  constructor(viewer, overlay, measureTool) {
    this.viewer = viewer;
    this.overlay = overlay;
    this.tool = measureTool;
    this.card = document.getElementById('measure-card');
    overlay.add(figurePainter(viewer, measureTool));
    setUpVolumes(viewer, measureTool);
  }

  /** Shows all figures, or the results of figure `i` alone. */
  show(i) {
    const { figures } = this.tool;
    if (i === undefined) this.#list(figures);
    else this.#values[i].replaceChildren(...this.#rows(figures[i]));
    this.overlay.redraw();
    this.tool.figuresShown();
  }

  #list(figures) {
    this.card.hidden = figures.length === 0;
    const all = () => this.tool.figures.map((figure) => this.#textOf(figure)).join('\n');
    this.#values = figures.map((figure) => element('dl', { class: 'values' }, ...this.#rows(figure)));
    this.card.replaceChildren(
      element('header', {}, element('h2', {}, 'Measurements'), copyButton('Copy all', all),
        iconButton('export', 'Download as GeoJSON', () => this.#download()),
        iconButton('close', 'Delete all', () => this.tool.change([]))),
      ...figures.map((figure, i) => this.#item(figure, () => this.tool.figures[i], this.#values[i])));
    const i = figures.indexOf(this.tool.newAnnotation);
    this.tool.newAnnotation = null;
    const field = this.card.querySelectorAll('.measurement')[i]?.querySelector('input');
    field?.focus();
    field?.select();
  }

  #download() {
    const { info } = this.viewer;
    const content = JSON.stringify(geoJson(this.tool.figures, info), null, 1);
    download(new Blob([content], { type: 'application/geo+json' }), `${stemOf(info.name)}-measurements.geojson`);
  }

  #rows(figure) {
    const { info } = this.viewer;
    return resultsOf(figure, info.up).flatMap((result) =>
      [element('dt', {}, result.name), element('dd', {}, element('span', {}, textOfResult(result, info.unit)))]);
  }

  /** The part of the card for a figure; `current()` is the figure with the results so far, which `values` shows. */
  #item({ kind, name }, current, values) {
    const { tool } = this;
    const remove = () => tool.change(tool.figures.filter((other) => other !== current()));
    return element('section', { class: 'measurement' },
      element('header', {}, kind === 'annotation' ? this.#textField(current) : element('h3', {}, name),
        kind === 'profile' ? iconButton('profile', `Show ${name}`, () => tool.profileOpened(current())) : null,
        copyButton(`Copy ${name}`, () => this.#textOf(current())),
        iconButton('delete', `Delete ${name}`, remove)),
      kind === 'volume' ? volumeControls(current, (changed) => tool.replace(current(), changed)) : null,
      values);
  }

  /** The field for the text of an annotation, which keeps its text if it is left empty. */
  #textField(current) {
    const field = element('input', {
      type: 'text', maxlength: MAX_NAME_LENGTH, value: current().name, 'aria-label': 'Text of the annotation',
      onchange: () => {
        const name = field.value.trim();
        // The list is made again, and the field that was ended by Enter with it.
        if (document.activeElement === field) document.getElementById('viewport').focus();
        if (name) this.tool.replace(current(), { ...current(), name });
        else field.value = current().name;
      },
    });
    return field;
  }

  /** The text for the clipboard: full precision, separated by tabs. */
  #textOf(figure) {
    const results = resultsOf(figure, this.viewer.info.up).map(({ name, value }) => `${name}\t${exact(value)}`);
    const points = figure.points.map((point, i) => `point ${i + 1}\t${point.join('\t')}`);
    return [figure.name, ...results, ...points].join('\n');
  }
}
