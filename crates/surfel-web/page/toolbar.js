// The toolbar over the picture, and the button that folds the panel.

import { isOrthographic } from './camera.js';
import { setUpRovingFocus } from './roving.js';

const HINTS = {
  pick: 'Click on a point to show its attributes.',
  distance: 'Click on two points to measure their distance.',
  height: 'Click on two points to measure their difference in height.',
  angle: 'Click on three points to measure the angle at the second.',
  circle: 'Click on three points of a circle to measure its diameter.',
  polyline: 'Click on the points of a line. Double click or Enter ends it.',
  profile: 'Click on the points of a line. Double click or Enter shows the heights along it.',
  area: 'Click on the corners. Double click or Enter closes the area.',
  annotation: 'Click on a point to pin a text to it.',
  volume: 'Click on the corners of an area. Double click or Enter computes cut and fill.',
};
/** Tools that measure points, which meshes lack. */
const POINT_TOOLS = ['profile', 'volume'];

/** A hint in the words of fingers where these are the pointers. */
function hintOf(tool) {
  const hint = HINTS[tool] ?? '';
  return matchMedia('(pointer: coarse)').matches ? hint.replace('Click', 'Tap').replace('Double click or Enter', 'Double tap') : hint;
}

/** `open` has `save()`, `export()` and `help()`, and `crosshair()` for tools that were chosen by a key. */
export function setUpToolbar(viewer, navigation, viewHistory, open) {
  const actions = {
    undo: () => viewHistory.undo(),
    redo: () => viewHistory.redo(),
    home: () => navigation.goHome(),
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
    if (tool) {
      viewer.selectTool(viewer.tool === tool ? 'navigate' : tool);
      // A key activates a button without a position of the mouse.
      if (event.detail === 0 && viewer.tool === tool) open.crosshair();
    }
    if (action && viewer.camera) actions[action]();
  });
  viewer.toolChanged.listen(() => {
    for (const button of tools) button.setAttribute('aria-pressed', button.dataset.tool === viewer.tool);
    hint.textContent = hintOf(viewer.tool);
    hint.hidden = !hint.textContent;
    document.getElementById('viewport').dataset.tool = viewer.tool;
  });

  const [undo, redo] = ['undo', 'redo'].map((action) => toolbar.querySelector(`[data-action=${action}]`));
  const updateFocus = setUpRovingFocus(toolbar, () => [...toolbar.querySelectorAll('button')]);
  const showHistory = () => {
    [undo.disabled, redo.disabled] = [!viewHistory.canUndo, !viewHistory.canRedo];
    updateFocus();
  };
  viewHistory.changed.listen(showHistory);
  showHistory();

  const pointTools = tools.filter(({ dataset }) => POINT_TOOLS.includes(dataset.tool));
  viewer.sceneChanged.listen(() => {
    const hasPoints = viewer.objects.some((object) => object.points);
    for (const button of pointTools) {
      button.disabled = !hasPoints;
      button.title = hasPoints ? button.ariaLabel : `${button.ariaLabel}: needs points, and this scene has none`;
    }
    if (!hasPoints && POINT_TOOLS.includes(viewer.tool)) viewer.selectTool('navigate');
    updateFocus();
  });

  const fold = document.getElementById('panel-fold');
  fold.addEventListener('click', () => {
    const isFolded = document.body.classList.toggle('is-folded');
    fold.setAttribute('aria-expanded', !isFolded);
  });
  // On a phone the panel covers much of the picture, so it starts folded.
  if (matchMedia('(max-width: 640px), (max-height: 480px) and (pointer: coarse)').matches) fold.click();

  viewer.infoChanged.listen(() => {
    const { name } = viewer.info;
    document.title = `${name} – surfel`;
    document.getElementById('name').textContent = name;
  });
}
