// The clock of scenes that move: play, pause, scrub and loop.

import { element, icon } from './dom.js';

export function animationRows(viewer, section) {
  let isPlaying = false;
  let startedAt = 0;
  let startTime = 0;
  const duration = () => viewer.info.duration_secs;
  const time = () => viewer.scene.time ?? 0;

  const play = element('button', { type: 'button', class: 'button', 'data-action': 'play', onclick: () => setPlaying(!isPlaying) });
  const scrub = element('input', { type: 'range', min: 0, max: 1000, 'aria-label': 'Time', title: 'time', 'data-key': 'time' });
  const clock = element('output', { 'data-output': 'time' });
  const loop = element('input', { type: 'checkbox', role: 'switch', id: 'animation-loop', 'data-key': 'animation.loop', checked: true });

  const lead = element('input', { type: 'checkbox', role: 'switch', id: 'animation-camera', 'data-key': 'camera.still' });

  const show = () => {
    scrub.value = (1000 * time()) / duration();
    scrub.style.setProperty('--share', `${scrub.value / 10}%`);
    clock.value = `${time().toFixed(2)} s`;
  };
  const setPlaying = (isOn) => {
    isPlaying = isOn;
    play.replaceChildren(icon(isOn ? 'pause' : 'play'), isOn ? 'Pause' : 'Play');
    if (!isOn) {
      viewer.set({ time: time() }, false);
      return;
    }
    startedAt = performance.now();
    startTime = duration() <= time() ? 0 : time();
    requestAnimationFrame(step);
  };
  const step = () => {
    if (!isPlaying) return;
    let now = startTime + (performance.now() - startedAt) / 1000;
    if (duration() <= now) {
      if (!loop.checked) {
        viewer.set({ time: duration() }, false);
        setPlaying(false);
        return;
      }
      now %= duration();
      [startTime, startedAt] = [now, performance.now()];
    }
    viewer.set({ time: now }, true);
    requestAnimationFrame(step);
  };
  scrub.addEventListener('input', () => {
    if (isPlaying) setPlaying(false);
    viewer.set({ time: (scrub.value / 1000) * duration() }, true);
  });
  scrub.addEventListener('change', () => viewer.set({ time: time() }, false));

  lead.addEventListener('change', () => {
    if (lead.checked) viewer.follow();
    else if (viewer.camera) viewer.look(viewer.camera, false);
  });

  play.replaceChildren(icon('play'), 'Play');
  const leadRow = toggleRow(lead, 'Follow', 'The camera goes where the scene moves it, until you move it yourself\ncamera.still');
  viewer.infoChanged.listen(() => {
    section().hidden = !(0 < duration());
    leadRow.hidden = !viewer.info.camera_moves;
  });
  viewer.sceneChanged.listen(() => { if (0 < duration()) show(); });
  viewer.cameraChanged.listen(() => { lead.checked = viewer.isLed; });
  return [element('div', { class: 'row animation' }, play, scrub, clock), toggleRow(loop, 'Loop'), leadRow];
}

function toggleRow(toggle, label, title = '') {
  return element('div', { class: 'row' },
    element('label', { for: toggle.id, title }, label), element('div', { class: 'field toggle' }, toggle));
}
