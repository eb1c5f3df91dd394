// The panel's section for the camera: projection, angle of view, stations, sides, and turntable.

import { SIDES, isOrthographic } from './camera.js';
import { element, icon } from './dom.js';
import { fieldFactories } from './fields.js';
import { namedViewRows } from './named-views.js';

/** Buttons that move the camera: name, title and action. */
const JUMPS = [
  ['home', 'View at the start (Home)', (navigation) => navigation.goHome()],
  ['fit', 'Fit to view (F)', (navigation) => navigation.fit()],
  ['previous', 'Previous view (Backspace)', (navigation) => navigation.goBack()],
];

export function viewRows(viewer, navigation, openPathCard) {
  const projection = fieldRow(viewer, {
    key: 'camera.projection', label: 'Projection', kind: 'select', title: 'O, P\ncamera.orthographic, camera.view_angle',
    options: () => ['perspective', 'orthographic'],
    // A panorama cannot be chosen; it is listed only while it is the projection.
    read: (camera) => (camera.panorama ? 'panorama' : isOrthographic(camera) ? 'orthographic' : 'perspective'),
    write: (value) => navigation.setOrthographic(value === 'orthographic'),
  });
  const angle = fieldRow(viewer, {
    key: 'camera.view_angle', label: 'Angle', kind: 'slider', range: [5, 120], limits: [1, 170], step: 1,
    title: 'Vertical angle of view in degrees\ncamera.view_angle',
    read: (camera) => camera.view_angle,
    write: (value, isMoving) => navigation.setViewAngle(value, isMoving),
    isVisible: (camera) => !isOrthographic(camera) && !camera.panorama,
  });
  const trackball = fieldRow(viewer, {
    key: 'camera.trackball', label: 'Trackball', kind: 'toggle', title: 'Rotates freely; the horizon may tilt',
    read: () => navigation.isTrackball,
    write: (isOn) => { navigation.isTrackball = isOn; },
  });
  const station = fieldRow(viewer, {
    key: 'camera.station', label: 'Station', kind: 'select', title: 'Looks from where the scanner of a scan stood\ncamera.station',
    options: ({ info }) => [
      ...(navigation.station ? [] : [{ value: '', label: 'choose a station' }]),
      ...info.stations.map(({ name }, i) => ({ value: String(i), label: name })),
    ],
    read: () => (navigation.station ? String(viewer.info.stations.indexOf(navigation.station)) : ''),
    write: (value) => navigation.transitionTo(viewer.info.stations[value].camera),
    isVisible: () => 0 < viewer.info.stations.length,
  });
  const jumps = element('div', { class: 'sides' }, ...JUMPS.map(([name, title, jump]) => element('button', {
    type: 'button', class: 'button', title, 'data-jump': name, onclick: () => jump(navigation),
  }, name)));
  const sides = element('div', { class: 'sides' }, ...SIDES.map((side, i) => element('button', {
    type: 'button', class: 'button', title: `${side} (${i + 1})`, 'data-side': side, onclick: () => navigation.viewFromSide(side),
  }, side)));
  const rows = [projection, angle, trackball, station, jumps, sides, turntable(viewer, navigation), ...namedViewRows(viewer, navigation, openPathCard)];
  // The position of an animated camera arrives with the first scene.
  const update = () => rows.forEach((row) => { row.inert = !viewer.camera; });
  viewer.cameraChanged.listen(update);
  update();
  return rows;
}

/** A row that shows a value of the camera instead of the scene. */
function fieldRow(viewer, control) {
  const id = `field-${control.key.replaceAll('.', '_')}`;
  const error = element('p', { class: 'row-error', role: 'alert', hidden: true });
  const [low, high] = control.limits ?? [];
  const field = fieldFactories[control.kind](control, (value, isMoving) => {
    error.hidden = !(value < low || high < value);
    if (error.hidden) control.write(value, isMoving);
    else error.textContent = `found ${value}, expected a number from ${low} to ${high}`;
  }, id);
  const row = element('div', { class: 'row', 'data-row': control.key },
    element('label', { for: id, title: control.title }, control.label), field.element, error);
  const update = () => {
    if (!viewer.camera) return;
    row.hidden = control.isVisible ? !control.isVisible(viewer.camera) : false;
    field.show(control.read(viewer.camera), viewer);
  };
  viewer.cameraChanged.listen(update);
  // A field does not take over values while it has the focus.
  row.addEventListener('focusout', update);
  return row;
}

function turntable(viewer, navigation) {
  const seconds = element('input', { type: 'number', id: 'turntable-seconds', min: 1, max: 600, value: 12, 'data-key': 'turntable.seconds' });
  const start = element('button', { type: 'button', class: 'button', 'data-action': 'turntable', 'aria-pressed': 'false' });
  const show = () => {
    const isTurning = 0 < navigation.turntable_secs;
    if (start.getAttribute('aria-pressed') === String(isTurning) && start.hasChildNodes()) return;
    start.setAttribute('aria-pressed', isTurning);
    start.replaceChildren(icon(isTurning ? 'pause' : 'play'), isTurning ? 'Stop' : 'Turn');
  };
  start.addEventListener('click', () => {
    if (0 < navigation.turntable_secs) navigation.stop();
    else navigation.startTurntable(Math.max(1, seconds.valueAsNumber || 12));
    show();
  });
  viewer.cameraChanged.listen(show);
  show();
  return element('div', { class: 'row' },
    element('label', { for: seconds.id, title: 'Seconds for one turn about the pivot' }, 'Turntable', element('small', {}, 's')),
    element('div', { class: 'field turntable' }, seconds, start));
}
