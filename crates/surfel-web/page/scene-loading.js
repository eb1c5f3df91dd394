// Loading of scene files from the file button or dropped on the page, and of links typed into the address bar.

import { NO_LINK, decodeHash } from './link.js';
import { showToast } from './toast.js';

export function setUpSceneLoading(viewer, measureTool) {
  const load = async (file) => {
    if (!/\.(toml|json)$/i.test(file.name)) showToast(`${file.name} is not a scene file (.toml or .json)`);
    else await viewer.loadScene(file);
  };
  const input = document.getElementById('scene-file');
  input.addEventListener('change', () => {
    if (input.files[0]) load(input.files[0]);
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
    if (event.dataTransfer.files[0]) load(event.dataTransfer.files[0]);
  });
  window.addEventListener('hashchange', () => {
    if (!viewer.isConnected) return;
    const { patch, measurements } = decodeHash(location.hash) ?? NO_LINK;
    viewer.showLink(patch);
    measureTool.figures = measurements;
  });
}
