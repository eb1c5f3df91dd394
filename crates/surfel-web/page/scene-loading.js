// Files from the file button or dropped on the page: scene files are shown, others are added. Links typed into the address
// bar.

import { readLink } from './link.js';
import { showToast } from './toast.js';

const isSceneFile = ({ name }) => /\.(toml|json)$/i.test(name);
/** Key of the session's storage for the names of added files, which a reload loses. */
const ADDED = 'added files';

/** `addFiles` adds files to the view. */
export function setUpSceneLoading(viewer, measureTool, addFiles) {
  const load = (files) => {
    const [scene, ...otherScenes] = [...files].filter(isSceneFile);
    const others = [...files].filter((file) => !isSceneFile(file));
    if (scene) viewer.loadScene(scene);
    if (otherScenes.length) showToast(`${namesOf(otherScenes)}: only one scene file is shown`);
    if (others.length && viewer.isConnected) addFiles(others);
    else if (others.length) showToast(`${namesOf(others)}: there is no connection`);
  };
  const input = document.getElementById('scene-file');
  input.addEventListener('change', () => {
    load([...input.files]);
    input.value = '';
  });
  document.addEventListener('dragover', (event) => {
    event.preventDefault();
    document.body.classList.add('is-dropping');
  });
  document.addEventListener('dragleave', (event) => {
    if (!event.relatedTarget) document.body.classList.remove('is-dropping');
  });
  document.addEventListener('drop', (event) => {
    event.preventDefault();
    document.body.classList.remove('is-dropping');
    load(event.dataTransfer.files);
  });
  window.addEventListener('hashchange', ({ newURL }) => {
    if (!viewer.isConnected) return;
    // The history may have written the address of the last view over it meanwhile.
    const { patch, measurements } = readLink(new URL(newURL).hash, showToast);
    viewer.showLink(patch);
    measureTool.figures = measurements ?? viewer.initialMeasurements;
  });
  const lost = storage()?.getItem(ADDED);
  if (lost) showToast(`${lost}: added to the page, and not kept when it is loaded again. Add it again.`);
  storage()?.removeItem(ADDED);
  window.addEventListener('pagehide', () => {
    const names = namesOf(viewer.addedObjects);
    if (names) storage()?.setItem(ADDED, names);
  });
}

/** The storage of the tab; null where the browser keeps none for this site. */
function storage() {
  try {
    return sessionStorage;
  } catch {
    return null;
  }
}

const namesOf = (files) => files.map(({ name }) => name).join(', ');
