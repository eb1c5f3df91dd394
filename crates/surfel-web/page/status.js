// The status line: progress of long work, frame rate, size and samples of the picture.

import { element } from './dom.js';
import { count, duration, rounded } from './format.js';

/** Work shorter than this is not shown. */
const MIN_WORK_MS = 150;

export function setUpStatusLine(viewer) {
  const bar = document.getElementById('work-bar');
  const work = document.getElementById('work-text');
  const numbers = document.getElementById('numbers');
  let isWorking = false;
  let showTimer = 0;
  let progress = null;

  const showWork = () => {
    showTimer = 0;
    const { text, done, left_secs } = progress;
    work.textContent = typeof left_secs === 'number' ? `${text}, ${duration(left_secs)} left` : text;
    bar.hidden = false;
    if (typeof done === 'number') bar.value = done;
    else bar.removeAttribute('value');
  };
  const showIdle = () => {
    work.textContent = viewer.isConnected && viewer.lastFrame?.finished ? 'finished' : '';
  };
  const endWork = () => {
    clearTimeout(showTimer);
    showTimer = 0;
    isWorking = false;
    bar.hidden = true;
    showIdle();
  };
  viewer.progressChanged.listen((message) => {
    progress = message;
    if (message.text === null) endWork();
    else if (!isWorking) showTimer = setTimeout(showWork, MIN_WORK_MS);
    else if (!showTimer) showWork();
    isWorking = message.text !== null;
  });
  viewer.connectionChanged.listen(({ isConnected }) => isConnected || endWork());
  viewer.frameShown.listen(() => {
    if (!isWorking) showIdle();
    const { width, height } = viewer.lastFrame;
    const samples = samplesText(viewer.lastFrame);
    numbers.textContent = `${width} × ${height}   ${samples} ${samples === '1' ? 'sample' : 'samples'}`;
  });
  const rate = document.getElementById('rate');
  viewer.statsReceived.listen(({ frames_per_s }) => { rate.textContent = `${rounded(frames_per_s, 2)} frames/s`; });
}

/** A finished picture may go on to more samples than it has asked for. */
const samplesText = ({ samples, of_samples }) => (samples < of_samples ? `${samples} of ${of_samples}` : `${samples}`);

/** The table of statistics in the panel. */
export function statisticsTable(viewer) {
  const table = element('dl', { class: 'statistics' });
  const fill = (rows) => table.replaceChildren(
    ...rows.flatMap(([name, value]) => [element('dt', {}, name), element('dd', {}, value)]));
  viewer.statsReceived.listen((stats) => {
    const { info } = viewer;
    const latencies = viewer.latencies_ms.slice(-100).sort((a, b) => a - b);
    const median = latencies[Math.floor(latencies.length / 2)];
    fill([
      ['Frames', `${rounded(stats.frames_per_s, 3)} /s`],
      ['Tracing', `${rounded(stats.trace_ms, 3)} ms`],
      ['Encoding', `${rounded(stats.encode_ms, 3)} ms`],
      ...(median === undefined ? [] : [['Latency', `${rounded(median, 3)} ms`]]),
      ['Rays', `${rounded(stats.mrays_per_s, 3)} million/s`],
      ['Picture', `${stats.width} × ${stats.height}`],
      ['Samples', samplesText(stats)],
      ['Points', count(info.points)],
      ['Triangles', count(info.triangles)],
      ['Processor', `${info.threads} threads, ${info.simd}`],
      ...(info.coordinate_system ? [['Coordinates', info.coordinate_system]] : []),
      ['surfel', info.version],
    ]);
  });
  return table;
}
