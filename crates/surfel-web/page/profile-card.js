// The card with the chart of a height profile.

import { download, element, iconButton } from './dom.js';
import { count, counted, rounded, stemOf, withUnit } from './format.js';
import { chartOf, levelLength, nearestPoint } from './profile.js';
import { csvOf, svgOf } from './profile-files.js';
import { showToast } from './toast.js';

const POINT_SIZE = 2;
const MAX_POINTER_DISTANCE = 12;
/** Duration without a change of the settings after which the points are requested again. */
const REST_MS = 600;

export class ProfileCard {
  #figure = null;
  #profile = null;
  #chart = null;
  /** World position of the point under the pointer. */
  #marked = null;
  #timer = 0;

  constructor(viewer, overlay, measureTool) {
    this.viewer = viewer;
    this.overlay = overlay;
    this.measureTool = measureTool;
    this.card = document.getElementById('profile-card');
    this.canvas = element('canvas', { 'aria-label': 'Height profile' });
    this.readout = element('p', { class: 'note', 'aria-live': 'polite' });
    this.canvas.addEventListener('pointermove', (event) => this.#mark({ x: event.offsetX, y: event.offsetY }));
    this.canvas.addEventListener('pointerleave', () => this.#mark(null));
    new ResizeObserver(() => this.#draw()).observe(this.canvas);
    this.downloads = ['csv', 'svg'].map((format) => element('button', {
      type: 'button', class: 'chip', onclick: () => this.#download(format),
    }, format.toUpperCase()));
    overlay.add((view) => (this.#marked ? view.dot(this.#marked, 6, 'pick') : []));
    measureTool.figuresShown.listen(() => this.#follow());
    viewer.sceneChanged.listen(() => {
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => this.#request(), REST_MS);
    });
  }

  open(figure) {
    this.#clear(figure);
    const shown = Number(figure.width.toPrecision(3));
    const width = element('input', {
      type: 'number', min: 0, step: 'any', value: shown, 'aria-label': 'Width of the strip',
      onchange: () => {
        if (0 < width.valueAsNumber) this.measureTool.replace(this.#figure, { ...this.#figure, width: width.valueAsNumber });
        else {
          width.value = shown;
          this.readout.textContent = 'The width must be a positive number.';
        }
      },
    });
    this.card.replaceChildren(
      element('header', {}, element('h2', {}, figure.name),
        element('label', {}, 'Width ', width),
        ...this.downloads,
        iconButton('close', 'Close', () => this.close())),
      this.canvas, this.readout);
    this.card.hidden = false;
    document.body.classList.add('has-profile');
    this.#request();
  }

  close() {
    this.#clear(null);
    this.card.hidden = true;
    document.body.classList.remove('has-profile');
  }

  /** Shows nothing until there is an answer for this figure. */
  #clear(figure) {
    this.#figure = figure;
    this.#profile = this.#chart = this.#marked = null;
    // A canvas whose size is set is empty.
    this.canvas.width = 0;
    this.readout.textContent = this.summary = '';
    for (const button of this.downloads) button.disabled = true;
    this.overlay.redraw();
  }

  /** Shows the figure of the same name, which may have changed; closes if there is none. */
  #follow() {
    if (!this.#figure) return;
    const now = this.measureTool.figures.find(({ kind, name }) => kind === 'profile' && name === this.#figure.name);
    if (!now) this.close();
    else if (now !== this.#figure) this.open(now);
  }

  async #request() {
    const figure = this.#figure;
    if (!figure || !this.viewer.isConnected) return;
    const { points, width } = figure;
    try {
      const { profile } = await this.viewer.request({ type: 'profile', points, width, up: this.viewer.info.up });
      if (this.#figure !== figure) return;
      this.#profile = profile;
      for (const button of this.downloads) button.disabled = false;
      this.#draw();
    } catch (error) {
      showToast(error.message);
    }
  }

  #chartOf(size) {
    return chartOf(this.#profile, levelLength(this.#figure.points, this.viewer.info.up), size);
  }

  #draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!this.#profile || !width) return;
    const { distances, heights, colors, n_found } = this.#profile;
    this.#chart = this.#chartOf({ width, height });
    const { x, y, xTicks, yTicks, digits, exaggeration } = this.#chart;
    const scale = devicePixelRatio;
    [this.canvas.width, this.canvas.height] = [Math.round(width * scale), Math.round(height * scale)];
    const context = this.canvas.getContext('2d');
    context.scale(scale, scale);
    const style = getComputedStyle(this.card);
    [context.strokeStyle, context.fillStyle, context.font] = [style.getPropertyValue('--line'), style.color, '11px sans-serif'];
    for (const tick of xTicks) {
      context.strokeRect(x(tick), 12, 0, height - 40);
      context.textAlign = 'center';
      context.fillText(rounded(tick), x(tick), height - 12);
    }
    for (const tick of yTicks) {
      context.strokeRect(x(0), y(tick), width - x(0) - 14, 0);
      context.textAlign = 'right';
      context.fillText(rounded(tick, digits), x(0) - 6, y(tick) + 4);
    }
    distances.forEach((distance, i) => {
      context.fillStyle = `rgb(${colors[i].join(' ')})`;
      context.fillRect(x(distance) - POINT_SIZE / 2, y(heights[i]) - POINT_SIZE / 2, POINT_SIZE, POINT_SIZE);
    });
    const shown = distances.length < n_found ? `${count(distances.length)} of ${counted(n_found, 'point')}` : counted(n_found, 'point');
    this.summary = n_found ? `${shown}, vertical exaggeration ${rounded(exaggeration, 2)}` : 'There are no points in this strip.';
    this.#mark(null);
  }

  /** Shows the point next to a pixel of the chart, here and in the picture. */
  #mark(pixel) {
    const i = pixel && this.#chart ? nearestPoint(this.#profile, this.#chart, pixel, MAX_POINTER_DISTANCE) : -1;
    const { unit } = this.viewer.info;
    this.#marked = i < 0 ? null : this.#profile.positions[i];
    const at = () => `distance ${withUnit(rounded(this.#profile.distances[i], 6), unit)}, height ${withUnit(rounded(this.#profile.heights[i], 8), unit)}`;
    this.readout.textContent = i < 0 ? this.summary : at();
    this.overlay.redraw();
  }

  #download(format) {
    const { info } = this.viewer;
    const { positions, n_found } = this.#profile;
    const contents = {
      csv: () => csvOf(this.#profile),
      svg: () => svgOf(this.#profile, this.#chartOf({ width: 1200, height: 400 }), info.unit),
    };
    const isThinned = positions.length < n_found;
    const part = isThinned ? `-${positions.length}-of-${n_found}-points` : '';
    if (isThinned) showToast(`The file has ${count(positions.length)} of ${counted(n_found, 'point')}, a random choice.`);
    download(new Blob([contents[format]()]), `${stemOf(info.name)}-${this.#figure.name.replaceAll(' ', '-')}${part}.${format}`);
  }
}
