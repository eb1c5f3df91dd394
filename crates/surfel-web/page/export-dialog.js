// Export of the view as a command line, a scene file or a link; and loading of scene files.

import { copyText } from './copy.js';
import { download, element } from './dom.js';
import { NO_LINK, decodeHash } from './link.js';
import { setUpPointsExport } from './points-export.js';
import { stemOf } from './save-dialog.js';
import { showToast } from './toast.js';

const FORMATS = { command: 'Command', toml: 'TOML', json: 'JSON', link: 'Link' };

/** Returns a function that opens the dialog. */
export function setUpExportDialog(viewer, viewHistory) {
  const dialog = document.getElementById('export-dialog');
  const text = document.getElementById('export-text');
  const tabs = document.getElementById('export-tabs');
  const downloadButton = document.getElementById('export-download');
  const beginPoints = setUpPointsExport(viewer, dialog);
  let exported = {};
  let format = 'command';

  const show = () => {
    text.value = exported[format] ?? '';
    downloadButton.hidden = format !== 'toml' && format !== 'json';
    for (const tab of tabs.children) tab.setAttribute('aria-pressed', tab.dataset.format === format);
  };
  tabs.append(...Object.entries(FORMATS).map(([name, label]) => element('button', {
    type: 'button', class: 'chip', 'data-format': name,
    onclick: () => {
      format = name;
      show();
    },
  }, label)));
  document.getElementById('export-copy').addEventListener('click', async ({ currentTarget }) => {
    if (!(await copyText(text.value, currentTarget))) text.select();
  });
  downloadButton.addEventListener('click', () => download(new Blob([text.value]), `${stemOf(viewer.info.name)}.${format}`));
  document.getElementById('export-close').addEventListener('click', () => dialog.close());

  return async () => {
    exported = { link: viewHistory.updateAddress() };
    show();
    beginPoints();
    dialog.showModal();
    try {
      exported = { ...exported, ...(await viewer.request({ type: 'export', ...viewer.size })) };
    } catch (error) {
      showToast(error.message);
    }
    show();
  };
}

/** Loads scene files from the file button or dropped on the page, and links typed into the address bar. */
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
