// The toolbar over the picture, and the button that folds the panel away.

import { isOrthographic } from './camera.js';

const HINTS = {
  pick: 'Click on a point to ask what it is.',
  distance: 'Click on two points.',
  height: 'Click on two points: their difference in height.',
  area: 'Click on the corners; double click or Enter closes the area.',
};

/** `open` has `save()`, `take()` and `help()`. */
export function followToolbar(viewer, navigation, open) {
  const actions = {
    fit: () => navigation.fit(),
    projection: () => navigation.setOrthographic(!isOrthographic(viewer.camera)),
    load: () => document.getElementById('scene-file').click(),
    ...open,
  };
  const toolbar = document.getElementById('toolbar');
  const tools = [...toolbar.querySelectorAll('[data-tool]')];
  const hint = document.getElementById('hint');
  toolbar.addEventListener('click', (event) => {
    const { tool, action } = event.target.closest('button')?.dataset ?? {};
    if (tool) viewer.use(viewer.tool === tool ? 'look' : tool);
    if (action && viewer.camera) actions[action]();
  });
  viewer.toolChanged.listen(() => {
    for (const button of tools) button.setAttribute('aria-pressed', button.dataset.tool === viewer.tool);
    hint.textContent = HINTS[viewer.tool] ?? '';
    hint.hidden = !hint.textContent;
    document.getElementById('stage').dataset.tool = viewer.tool;
  });

  const fold = document.getElementById('panel-fold');
  fold.addEventListener('click', () => {
    const isFolded = document.body.classList.toggle('is-folded');
    fold.setAttribute('aria-expanded', !isFolded);
  });
  // A sheet that covers half of a phone waits until it is asked for.
  if (matchMedia('(max-width: 640px)').matches) fold.click();

  viewer.infoChanged.listen(() => {
    const { name } = viewer.info;
    document.title = `${name} – surfel`;
    document.getElementById('name').textContent = name;
  });
}
