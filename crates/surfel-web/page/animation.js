// Controls of animated scenes: play, pause, scrub, loop, and whether the animation moves the camera.

import { element, icon } from './dom.js';
import { stopwatch } from './stopwatch.js';

export function animationRows(viewer, section) {
  let isPlaying = false;
  let elapsed_ms = null;
  let startTime = 0;
  const duration = () => viewer.info.duration_secs;
  const time = () => viewer.scene.time ?? 0;

  const play = element('button', { type: 'button', class: 'button', 'data-action': 'play', onclick: () => setPlaying(!isPlaying) });
  const scrub = element('input', { type: 'range', min: 0, max: 1000, 'aria-label': 'Time', title: 'time', 'data-key': 'time' });
  const clock = element('output', { 'data-output': 'time' });
  const loop = element('input', { type: 'checkbox', role: 'switch', id: 'animation-loop', 'data-key': 'animation.loop', checked: true });

  const follow = element('input', { type: 'checkbox', role: 'switch', id: 'animation-camera', 'data-key': 'camera.lock' });

  const show = () => {
    scrub.value = (1000 * time()) / duration();
    scrub.style.setProperty('--fraction', `${scrub.value / 10}%`);
    clock.value = `${time().toFixed(2)} s`;
  };
  const setPlaying = (isOn) => {
    isPlaying = isOn;
    play.replaceChildren(icon(isOn ? 'pause' : 'play'), isOn ? 'Pause' : 'Play');
    if (!isOn) {
      viewer.changeSettings({ time: time() }, false);
      return;
    }
    elapsed_ms = stopwatch();
    startTime = duration() <= time() ? 0 : time();
    requestAnimationFrame(step);
  };
  const step = () => {
    if (!isPlaying) return;
    let now = startTime + elapsed_ms() / 1000;
    if (duration() <= now) {
      if (!loop.checked) {
        viewer.changeSettings({ time: duration() }, false);
        setPlaying(false);
        return;
      }
      now %= duration();
      [startTime, elapsed_ms] = [now, stopwatch()];
    }
    viewer.changeSettings({ time: now }, true);
    requestAnimationFrame(step);
  };
  scrub.addEventListener('input', () => {
    if (isPlaying) setPlaying(false);
    viewer.changeSettings({ time: (scrub.value / 1000) * duration() }, true);
  });
  scrub.addEventListener('change', () => viewer.changeSettings({ time: time() }, false));

  follow.addEventListener('change', () => {
    if (follow.checked) viewer.resumeAnimation();
    else if (viewer.camera) viewer.setCamera(viewer.camera, false);
  });

  const pause = () => { if (isPlaying) setPlaying(false); };
  viewer.viewReplaced.listen(pause);
  viewer.viewRequested.listen(pause);
  play.replaceChildren(icon('play'), 'Play');
  const followRow = toggleRow(follow, 'Follow', 'The animation moves the camera until you move it yourself\ncamera.lock');
  viewer.infoChanged.listen(() => {
    section().hidden = !(0 < duration());
    followRow.hidden = !viewer.info.camera_moves;
  });
  viewer.sceneChanged.listen(() => { if (0 < duration()) show(); });
  viewer.cameraChanged.listen(() => { follow.checked = viewer.isCameraAnimated; });
  return [element('div', { class: 'row animation' }, play, scrub, clock), toggleRow(loop, 'Loop'), followRow];
}

function toggleRow(toggle, label, title = '') {
  return element('div', { class: 'row' },
    element('label', { for: toggle.id, title }, label), element('div', { class: 'field toggle' }, toggle));
}
