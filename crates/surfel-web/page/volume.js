// Volumes of polygons over a base plane: their requests to the server, and their controls.

import { element } from './dom.js';
import { showToast } from './toast.js';

/** Duration without a change of the settings after which volumes are computed again. */
const REST_MS = 600;
const BASES = { lowest: 'lowest corner', mean: 'mean of the corners', height: 'height' };

/** Requests the volumes of figures that have none, one at a time; all again after a change of the settings or a reconnection. */
export function setUpVolumes(viewer, measureTool) {
  let failed = new WeakSet();
  let isAsking = false;
  let nChanges = 0;
  let timer = 0;

  const request = async (figure) => {
    isAsking = true;
    const asked = nChanges;
    const { points, base, cell_size } = figure;
    const answer = await viewer.request({ type: 'volume', points, up: viewer.info.up, base, cell_size }).catch((error) => error);
    isAsking = false;
    // After a change the answer is that of other points: the figure is asked for again.
    if (asked === nChanges) {
      if (answer.volume) measureTool.complete(figure, { ...figure, volume: answer.volume });
      else {
        failed.add(figure);
        showToast(answer.message);
      }
    }
    requestNext();
  };
  const requestNext = () => {
    // Before the first picture the server has no points.
    if (isAsking || !viewer.isConnected || !viewer.lastFrame) return;
    const figure = measureTool.figures.find((one) => one.kind === 'volume' && !one.volume && !failed.has(one));
    if (figure) request(figure);
  };
  measureTool.figuresShown.listen(requestNext);
  viewer.frameShown.listen(requestNext);
  viewer.sceneChanged.listen(() => {
    nChanges += 1;
    clearTimeout(timer);
    const outdated = measureTool.figures.filter(({ volume }) => volume);
    timer = setTimeout(() => {
      failed = new WeakSet();
      for (const figure of outdated) {
        const { volume, ...without } = figure;
        measureTool.complete(figure, without);
      }
      requestNext();
    }, REST_MS);
  });
}

/** The controls of a volume's base and cell size; `current()` is the figure, `replace` takes the changed one. */
export function volumeControls(current, replace) {
  const figure = current();
  const isHeight = typeof figure.base === 'number';
  /** Replaces the figure, whose results no longer hold. */
  const change = (settings) => {
    const { volume, ...others } = { ...current(), ...settings };
    replace(others);
  };
  const base = element('select', {
    'aria-label': `Base of ${figure.name}`,
    onchange: () => change({ base: base.value === 'height' ? current().volume?.base ?? 0 : base.value }),
  }, ...Object.entries(BASES).map(([value, label]) => element('option', { value }, label)));
  base.value = isHeight ? 'height' : figure.base;
  const height = isHeight ? numberField('Height', figure.base, (value) => Number.isFinite(value) && change({ base: value })) : null;
  const cell = numberField('Cell size', figure.cell_size, (value) => change({ cell_size: 0 < value ? value : undefined }));
  cell.querySelector('input').placeholder = 'automatic';
  return element('div', { class: 'volume' }, element('label', {}, 'Base ', base), height, cell);
}

function numberField(label, value, change) {
  const input = element('input', { type: 'number', step: 'any', value, onchange: () => change(input.valueAsNumber) });
  return element('label', {}, `${label} `, input);
}
