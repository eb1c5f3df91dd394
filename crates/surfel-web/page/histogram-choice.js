// The choice of the column whose histogram is shown. The chart is loaded when the first one is chosen.

import { element, icon } from './dom.js';

/** The rows of the panel with the choice of the column and its histogram. */
export function histogramRows(viewer) {
  const choice = element('select', { id: 'histogram-column', 'data-key': 'histogram.column', onchange: () => request() });
  const chart = element('div', { class: 'histogram', hidden: true });
  let show = null;

  const request = async () => {
    const column = choice.value;
    chart.hidden = true;
    if (!column) return;
    try {
      const [{ histogram }, { histogramChart }] = await Promise.all([viewer.request({ type: 'histogram', column }), import('./histogram.js')]);
      if (choice.value !== column) return;
      show ??= histogramChart(viewer, chart);
      show(column, histogram);
      chart.hidden = false;
    } catch (error) {
      viewer.rejected({ text: error.message });
    }
  };

  viewer.infoChanged.listen(() => {
    const chosen = choice.value;
    const names = ['', ...viewer.info.columns];
    choice.replaceChildren(...names.map((name) => element('option', { value: name }, name || 'none')));
    choice.value = names.includes(chosen) ? chosen : '';
    request();
  });
  return [
    element('div', { class: 'row', 'data-row': 'histogram' },
      element('label', { for: choice.id, title: 'How many points have which values of a column' }, 'Histogram'),
      element('div', { class: 'field select' }, choice, icon('chevron'))),
    chart,
  ];
}
