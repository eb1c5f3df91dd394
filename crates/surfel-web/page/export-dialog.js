// The dialog that exports the view as a command line, a scene file or a link, and the points that are shown.

import { copyText } from './copy.js';
import { download, element } from './dom.js';
import { stemOf } from './format.js';
import { withoutResults } from './link.js';
import { setUpPointsExport } from './points-export.js';
import { showToast } from './toast.js';

const FORMATS = { command: 'Command', toml: 'TOML', json: 'JSON', link: 'Link' };

/** Returns a function that opens the dialog. */
export function setUpExportDialog(viewer, viewHistory, measureTool) {
  const dialog = document.getElementById('export-dialog');
  const text = document.getElementById('export-text');
  const tabs = document.getElementById('export-tabs');
  const downloadButton = document.getElementById('export-download');
  const note = element('p', { class: 'note' });
  text.after(note);
  const beginPoints = setUpPointsExport(viewer, dialog);
  let exported = {};
  let format = 'command';

  const show = () => {
    text.value = exported[format] ?? '';
    const names = viewer.addedObjects.map(({ name }) => name).join(', ');
    const where = format === 'link' ? 'are not part of a link; others do not see them' : 'must lie where the command runs, or beside the scene file';
    note.textContent = names && `Added files (${names}) ${where}.`;
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
    const measurements = measureTool.figures.map(withoutResults);
    try {
      exported = { ...exported, ...(await viewer.request({ type: 'export', ...viewer.size, measurements })) };
    } catch (error) {
      showToast(error.message);
    }
    show();
  };
}
