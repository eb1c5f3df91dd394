// The histogram of a column, with two handles that set the filter.

import { element, svg } from './dom.js';
import { shortest } from './format.js';

/** Number of steps in the range of a handle: a little more than a whole one, so that rounding leaves out none. */
const N_STEPS = 200.001;
/** A condition that the handles write, at the end of a filter. */
const LAST_TERM = /^(?:(.*) && )?(\w+) (>=|<=) (-?\d[\d.]*(?:e[+-]?\d+)?)$/s;

/** A column's name as filters have it. */
export const filterName = (column) => column.replaceAll(/\W/g, '_');

/** Whether a text stands in one pair of parentheses. */
function isWrapped(text) {
  let depth = 0;
  const closes = [...text].findIndex((sign) => {
    depth += { '(': 1, ')': -1 }[sign] ?? 0;
    return depth === 0;
  });
  return text.startsWith('(') && closes === text.length - 1;
}

/** Splits a filter into a head, and the conditions at its end that handles can set, as `[column, relation, number]`. */
function splitFilter(filter) {
  const terms = [];
  let head = filter;
  for (let match = LAST_TERM.exec(head); match; match = LAST_TERM.exec(head)) {
    terms.unshift([match[2], match[3], Number(match[4])]);
    head = match[1] ?? '';
  }
  // `a || b && c` means `a || (b && c)`.
  return head.includes('||') && !isWrapped(head) ? { head: filter, terms: [] } : { head, terms };
}

/** The range of a column that a filter keeps, as far as handles can set it; its ends may be null. */
export function rangeIn(filter, column) {
  const { terms } = splitFilter(filter);
  const bound = (relation) => terms.findLast(([name, sign]) => name === column && sign === relation)?.[2] ?? null;
  return [bound('>='), bound('<=')];
}

/** The filter with another range of a column; null keeps an end open. */
export function withRange(filter, column, [low, high]) {
  const { head, terms } = splitFilter(filter);
  const others = terms.filter(([name]) => name !== column);
  const own = [[column, '>=', low], [column, '<=', high]].filter(([, , value]) => value !== null);
  const all = [...others, ...own].map((term) => term.join(' '));
  const first = all.length && head.includes('||') && !isWrapped(head) ? `(${head})` : head;
  return [...(first ? [first] : []), ...all].join(' && ');
}

/** The range between two handles; null where a handle is at the end of the histogram, as near as its steps let it. */
export function rangeOf(handles, { low, high }, step) {
  const [from, to] = handles.sort((a, b) => a - b);
  return [step < 2 * (from - low) ? shortest(from) : null, step < 2 * (high - to) ? shortest(to) : null];
}

/** Fills `place` with a chart; returns its `show(column, histogram)`. */
export function histogramChart(viewer, place) {
  let histogram = null;
  let column = '';
  /** Whether a handle is being dragged, which sets the filter once it is released. */
  let isDragging = false;
  const bars = svg('svg', { class: 'histogram-bars', preserveAspectRatio: 'none', 'aria-hidden': 'true' });
  const [low, high] = ['Lowest', 'Highest'].map((name) => element('input', {
    type: 'range', class: 'histogram-handle', 'data-handle-name': name, oninput: () => drag(), onchange: () => apply(),
  }));
  const readout = element('output', { class: 'note' });
  place.append(element('div', { class: 'histogram-plot' }, bars, low, high), readout);

  const show = (name, found) => {
    [column, histogram] = [filterName(name), found];
    const { counts, low: least, high: most } = histogram;
    const top = counts.reduce((largest, n) => Math.max(largest, n), 1);
    bars.setAttribute('viewBox', `0 0 ${counts.length} 1`);
    bars.replaceChildren(...counts.map((n, i) => {
      // A few points must be seen beside very many.
      const height = n === 0 ? 0 : Math.max(0.03, n / top);
      return svg('rect', { x: i, width: 0.9, y: 1 - height, height });
    }));
    const isWhole = Number.isInteger(least) && Number.isInteger(most) && Number.isInteger(histogram.width);
    for (const handle of [low, high]) {
      Object.assign(handle, { min: least, max: most, step: isWhole ? 1 : (most - least) / N_STEPS || 1 });
      handle.setAttribute('aria-label', `${handle.dataset.handleName} ${name}`);
    }
    showFilter();
  };

  /** Puts the handles where the filter has them. */
  const showFilter = () => {
    const [from, to] = rangeIn(viewer.scene.filter ?? '', column);
    [low.value, high.value] = [from ?? histogram.low, to ?? histogram.high];
    showHandles();
  };

  const showHandles = () => {
    const [from, to] = [low.valueAsNumber, high.valueAsNumber];
    [...bars.children].forEach((bar, i) => {
      const [start, end] = [histogram.low + i * histogram.width, histogram.low + (i + 1) * histogram.width];
      bar.classList.toggle('is-outside', end <= from || to < start);
    });
    for (const handle of [low, high]) handle.setAttribute('aria-valuetext', shortest(handle.valueAsNumber));
    readout.textContent = `${shortest(from)} to ${shortest(to)}`;
  };

  const drag = () => {
    isDragging = true;
    showHandles();
  };

  const apply = () => {
    isDragging = false;
    const range = rangeOf([low.valueAsNumber, high.valueAsNumber], histogram, Number(low.step));
    viewer.changeSettings({ filter: withRange(viewer.scene.filter ?? '', column, range) || null });
  };

  viewer.sceneChanged.listen(() => { if (viewer.scene && !isDragging) showFilter(); });
  viewer.viewReplaced.listen(() => { isDragging = false; });
  // A handle reports no change if it is dragged back to its place, or if a touch becomes a scroll; others it reports after these events.
  const endDrag = () => { if (isDragging) apply(); };
  for (const handle of [low, high]) for (const event of ['pointerup', 'pointercancel']) handle.addEventListener(event, () => setTimeout(endDrag));
  return show;
}
