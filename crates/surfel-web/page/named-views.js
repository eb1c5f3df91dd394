// Named views: cameras that are saved under names, with the rows of the panel that list them.

import { element, iconButton } from './dom.js';
import { areEqual } from './merge-patch.js';

const MAX_NAME_LENGTH = 100;

/** The views with another one of the `camera`, whose name has a number above those of all. */
export function withNewView(views, camera) {
  const numbers = views.map(({ name }) => Number(/^view (\d+)$/.exec(name)?.[1] ?? 0));
  return [...views, { name: `view ${Math.max(0, ...numbers) + 1}`, camera }];
}

/** The views with another name for one of them; unchanged if the name is empty or that of another view. */
export function renamed(views, oldName, newName) {
  const name = newName.trim().slice(0, MAX_NAME_LENGTH);
  if (!name || views.some((view) => view.name === name)) return views;
  return views.map((view) => (view.name === oldName ? { ...view, name } : view));
}

/** The list of views, the button that adds the current one, and the one that opens the camera's path. */
export function namedViewRows(viewer, navigation, openPathCard) {
  const list = element('ul', { class: 'named-views', 'aria-label': 'Saved views' });
  const viewsOf = () => viewer.scene.views ?? [];
  const change = (views) => viewer.changeSettings({ views });
  let shown = [];

  const item = ({ name, camera }) => {
    const field = element('input', {
      type: 'text', maxlength: MAX_NAME_LENGTH, 'aria-label': `Name of ${name}`, 'data-view': name,
      onchange: () => {
        const views = renamed(viewsOf(), name, field.value);
        field.value = name;
        if (views !== viewsOf()) change(views);
      },
    });
    field.value = name;
    return element('li', {}, field,
      element('button', { type: 'button', class: 'button', 'aria-label': `Go to ${name}`, onclick: () => navigation.transitionTo(camera) }, 'Go'),
      iconButton('delete', `Delete ${name}`, () => change(viewsOf().filter((view) => view.name !== name))));
  };
  const save = element('button', {
    type: 'button', class: 'button', 'data-action': 'save-view', title: 'Keeps this camera under a name\nviews',
    onclick: () => change(withNewView(viewsOf(), viewer.camera)),
  }, 'Save view');
  viewer.sceneChanged.listen(() => {
    if (!viewer.scene || areEqual(viewsOf(), shown)) return;
    shown = viewsOf();
    list.replaceChildren(...shown.map(item));
  });
  const path = element('button', {
    type: 'button', class: 'button', 'data-action': 'camera-path', title: 'Views at times, as a movie\ncamera_path', onclick: openPathCard,
  }, 'Camera path');
  return [list, element('div', { class: 'row' }, save, path)];
}
