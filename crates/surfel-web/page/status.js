// The status line: work under way with its time left, and how fast and how fine pictures come.

import { element } from './dom.js';
import { count, duration, rounded } from './format.js';

export function followStatus(viewer) {
  const bar = document.getElementById('work-bar');
  const work = document.getElementById('work-text');
  const numbers = document.getElementById('numbers');
  let isWorking = false;

  viewer.workChanged.listen(({ text, done, left_secs }) => {
    isWorking = text !== null;
    const left = typeof left_secs === 'number' ? `, ${duration(left_secs)} left` : '';
    work.textContent = isWorking ? text + left : '';
    bar.hidden = !isWorking;
    if (typeof done === 'number') bar.value = done;
    else bar.removeAttribute('value');
  });
  viewer.connectionChanged.listen(({ isConnected }) => {
    if (isConnected) return;
    work.textContent = '';
    bar.hidden = true;
  });
  viewer.frameShown.listen(() => {
    if (!isWorking) work.textContent = viewer.lastFrame.finished ? 'finished' : '';
    const { width, height, samples, of_samples } = viewer.lastFrame;
    numbers.textContent = `${width} × ${height}   ${samples} of ${of_samples} samples`;
  });
  const rate = document.getElementById('rate');
  viewer.statisticsCame.listen(({ frames_per_s }) => { rate.textContent = `${rounded(frames_per_s, 2)} frames/s`; });
}

/** The table of statistics in the panel. */
export function statisticsTable(viewer) {
  const table = element('dl', { class: 'statistics' });
  const fill = (rows) => table.replaceChildren(
    ...rows.flatMap(([name, value]) => [element('dt', {}, name), element('dd', {}, value)]));
  viewer.statisticsCame.listen((stats) => {
    const { info } = viewer;
    const latencies = viewer.latencies_ms.slice(-100).sort((a, b) => a - b);
    const median = latencies[Math.floor(latencies.length / 2)];
    fill([
      ['Frames', `${rounded(stats.frames_per_s, 3)} /s`],
      ['Tracing', `${rounded(stats.trace_ms, 3)} ms`],
      ['Encoding', `${rounded(stats.encode_ms, 3)} ms`],
      ...(median === undefined ? [] : [['From input to picture', `${rounded(median, 3)} ms`]]),
      ['Rays', `${rounded(stats.mrays_per_s, 3)} million/s`],
      ['Picture', `${stats.width} × ${stats.height}`],
      ['Samples', `${stats.samples} of ${stats.of_samples}`],
      ['Points', count(stats.n_points)],
      ['Triangles', count(stats.n_triangles)],
      ['Processor', `${info.threads} threads, ${info.simd}`],
      ...(info.coordinate_system ? [['Coordinates', info.coordinate_system]] : []),
      ['surfel', info.version],
    ]);
  });
  return table;
}
