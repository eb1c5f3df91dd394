// Sun position by date, hour and latitude, under the sun's controls.

import { element, icon } from './dom.js';
import { patchAt } from './merge-patch.js';
import { sunAtHour } from './sun.js';

export function sunClock(viewer) {
  const day = element('input', { type: 'date', id: 'sun-day', 'data-key': 'sun.day' });
  const hour = element('input', { type: 'range', id: 'sun-hour', min: 0, max: 24, step: 0.05, value: 12, 'data-key': 'sun.hour' });
  const clock = element('output', { for: 'sun-hour' });
  const latitude = element('input', { type: 'number', id: 'sun-latitude', min: -90, max: 90, step: 'any', value: 45, 'data-key': 'sun.latitude' });
  day.value = new Date().toISOString().slice(0, 10);

  const show = () => {
    const minutes = Math.round(hour.value * 60);
    clock.value = `${Math.floor(minutes / 60)}:${String(minutes % 60).padStart(2, '0')}`;
    hour.style.setProperty('--fraction', `${(100 * hour.value) / 24}%`);
  };
  const change = (isMoving) => {
    show();
    const degrees = Math.min(90, Math.max(-90, latitude.valueAsNumber));
    if (!day.value || !Number.isFinite(degrees)) return;
    const { azimuth, elevation } = sunAtHour(day.value, Number(hour.value), degrees);
    const rounded = (value) => Math.round(value * 100) / 100;
    viewer.changeSettings(patchAt('sun', { azimuth: rounded(azimuth), elevation: rounded(elevation) }), isMoving);
  };
  let isDragging = false;
  hour.addEventListener('input', () => {
    isDragging = true;
    change(true);
  });
  hour.addEventListener('change', () => {
    if (isDragging) change(false);
    isDragging = false;
  });
  // The end of a drag must not take back an undo.
  viewer.viewReplaced.listen(() => { isDragging = false; });
  for (const field of [day, latitude]) field.addEventListener('change', () => change(false));
  show();

  const row = (label, ...fields) => element('div', { class: 'row' },
    element('label', { for: fields[0].id }, label), element('div', { class: 'field slider' }, ...fields));
  const part = element('details', { class: 'inner', 'data-section': 'sun position by date' },
    element('summary', {}, icon('chevron'), 'Sun position by date'),
    row('Date', day), row('Hour', hour, clock), row('Latitude', latitude),
    element('p', { class: 'note' }, 'Solar time: the sun is highest about noon.'));
  viewer.sceneChanged.listen(() => { part.hidden = !viewer.scene.light?.includes('sun'); });
  return part;
}
