// The card that edits the path of the camera: views at times, played here and exported as a movie.

import { cameraAt, fitsPath, keysOf, pathPatch, withNewKey, withTime } from './camera-path.js';
import { download, element, icon, iconButton } from './dom.js';
import { setUpMovieExport } from './movie-export.js';
import { stemOf } from './format.js';
import { areEqual } from './merge-patch.js';
import { showToast } from './toast.js';

const INTERPOLATIONS = { cubic: 'smooth', linear: 'straight', ease: 'straight, with stops' };

/** Returns a function that opens and closes the card. */
export function setUpPathCard(viewer, navigation) {
  const list = element('ol', { class: 'path-keys', 'aria-label': 'Views of the path' });
  const play = element('button', { type: 'button', class: 'button', 'data-action': 'play-path', onclick: () => playOrStop() });
  const clock = element('output', { class: 'note', 'data-output': 'path-time' });
  const interpolation = element('select', {
    'aria-label': 'Path between the views', 'data-key': 'path.interpolation', onchange: () => change(keys()),
  }, ...Object.entries(INTERPOLATIONS).map(([value, label]) => element('option', { value }, label)));
  const addKey = element('button', {
    type: 'button', class: 'button', 'data-action': 'add-key', title: 'Adds this view to the path\ncamera_path', onclick: () => add(),
  }, 'Add view');
  const note = element('p', { class: 'note' });
  const sceneFile = element('button', {
    type: 'button', class: 'button', 'data-action': 'movie-scene-file', title: 'surfel animate movie.toml -o movie.mp4', onclick: () => saveSceneFile(),
  }, 'Scene file');
  const movie = setUpMovieExport(viewer, sceneFile);
  const card = element('section', { id: 'path-card', class: 'card', 'aria-label': 'Camera path', hidden: true },
    element('header', {}, element('h2', {}, 'Camera path'), iconButton('close', 'Close the camera path', () => show(false))),
    list, note,
    element('div', { class: 'chips' }, addKey, play, clock), element('div', { class: 'chips' }, interpolation), movie.part);
  document.getElementById('cards').append(card);
  let shown = null;

  const keys = () => keysOf(viewer.scene.camera_path);
  const duration = () => keys().at(-1)?.time ?? 0;
  const change = (changed) => viewer.changeSettings(pathPatch(changed, interpolation.value));
  const view = () => {
    const { position, focal_point, view_up, view_angle, orthographic } = viewer.camera;
    return { position, focal_point, view_up, ...(orthographic === undefined ? { view_angle } : { orthographic }) };
  };
  /** The view, if it can be a key beside these. */
  const fittingView = (others) => {
    const isFitting = !viewer.camera.panorama && fitsPath(others, view());
    if (!isFitting) showToast('All views of a path need one projection: perspective, or orthographic.');
    return isFitting ? view() : null;
  };

  const add = () => {
    const camera = fittingView(keys());
    if (camera) change(withNewKey(keys(), camera));
  };

  const item = ({ time, camera }, i) => {
    const name = `view ${i + 1}`;
    const field = element('input', {
      type: 'number', min: 0, step: 0.5, 'aria-label': `Seconds of ${name}`, 'data-path-time': i,
      onchange: () => {
        if (Number.isFinite(field.valueAsNumber)) change(withTime(keys(), i, field.valueAsNumber));
        else field.value = time;
      },
    });
    field.value = time;
    return element('li', {}, field, element('span', { class: 'note' }, 's'),
      element('button', { type: 'button', class: 'button', 'aria-label': `Go to ${name}`, onclick: () => navigation.transitionTo(camera) }, 'Go'),
      element('button', {
        type: 'button', class: 'button', 'aria-label': `Set ${name} to the current view`,
        onclick: () => {
          const replaced = fittingView(keys().filter((_, other) => other !== i));
          if (replaced) change(keys().map((key, other) => (other === i ? { ...key, camera: replaced } : key)));
        },
      }, 'Set'),
      iconButton('delete', `Delete ${name}`, () => change(keys().filter((_, other) => other !== i))));
  };

  const playOrStop = () => {
    if (navigation.isFollowing) navigation.stop();
    else navigation.follow((time) => cameraAt(keys(), interpolation.value, time), duration(), showTime);
  };
  const showTime = (time) => { clock.value = `${time.toFixed(1)} / ${duration().toFixed(1)} s`; };

  const update = () => {
    const path = viewer.scene?.camera_path ?? null;
    const isPlaying = navigation.isFollowing;
    if (play.dataset.playing !== String(isPlaying)) {
      play.dataset.playing = isPlaying;
      play.replaceChildren(icon(isPlaying ? 'pause' : 'play'), isPlaying ? 'Stop' : 'Play');
    }
    if (!viewer.scene || (areEqual(path, shown) && list.dataset.filled)) return;
    shown = path;
    list.dataset.filled = 'yes';
    list.replaceChildren(...keys().map(item));
    interpolation.value = path?.interpolation ?? 'cubic';
    const n = keys().length;
    note.textContent = n ? '' : 'Move to a view and add it; then move to the next one.';
    for (const button of [play, sceneFile]) button.disabled = n < 2;
    movie.update(n < 2);
    showTime(0);
  };

  const saveSceneFile = async () => {
    try {
      const { movie: text } = await viewer.request({ type: 'export', ...movie.size() });
      download(new Blob([text]), `${stemOf(viewer.info.name)}-movie.toml`);
    } catch (error) {
      showToast(error.message);
    }
  };

  const show = (isOpen) => {
    card.hidden = !isOpen;
    if (isOpen) addKey.focus();
  };
  viewer.sceneChanged.listen(update);
  viewer.cameraChanged.listen(update);
  update();
  return () => show(card.hidden);
}
