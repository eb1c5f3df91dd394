// Taking the view away: the command line, the scene file, a link; and loading scene files.

import { copyText } from './copy.js';
import { download, element } from './dom.js';
import { hashOf, patchOfHash, viewPatch } from './link.js';
import { stemOf } from './save-dialog.js';
import { showToast } from './toast.js';

const FORMS = { command: 'Command', toml: 'TOML', json: 'JSON', link: 'Link' };

/** The address that shows the present view, also put into the address bar. */
function linkOf(viewer) {
  const hash = hashOf(viewPatch(viewer.opening, viewer.present()));
  history.replaceState(null, '', hash || location.pathname + location.search);
  return location.href;
}

export function prepareTakeDialog(viewer) {
  const dialog = document.getElementById('take-dialog');
  const text = document.getElementById('take-text');
  const tabs = document.getElementById('take-tabs');
  const save = document.getElementById('take-download');
  let taken = {};
  let form = 'command';

  const show = () => {
    text.value = taken[form] ?? '';
    save.hidden = form !== 'toml' && form !== 'json';
    for (const tab of tabs.children) tab.setAttribute('aria-pressed', tab.dataset.form === form);
  };
  tabs.append(...Object.entries(FORMS).map(([name, label]) => element('button', {
    type: 'button', class: 'chip', 'data-form': name,
    onclick: () => {
      form = name;
      show();
    },
  }, label)));
  document.getElementById('take-copy').addEventListener('click', async ({ currentTarget }) => {
    if (!(await copyText(text.value, currentTarget))) text.select();
  });
  save.addEventListener('click', () => download(new Blob([text.value]), `${stemOf(viewer.info.name)}.${form}`));
  document.getElementById('take-close').addEventListener('click', () => dialog.close());

  return async () => {
    taken = { link: linkOf(viewer) };
    show();
    dialog.showModal();
    try {
      taken = { ...taken, ...(await viewer.ask({ type: 'take', ...viewer.size })) };
    } catch (error) {
      showToast(error.message);
    }
    show();
  };
}

/** Scene files from the file button or dropped on the page, and links typed into the address bar. */
export function followLoading(viewer) {
  const load = async (file) => {
    if (!/\.(toml|json)$/i.test(file.name)) showToast(`${file.name} is no scene file: .toml or .json`);
    else await viewer.load(file);
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
  window.addEventListener('hashchange', () => viewer.isConnected && viewer.showLink(patchOfHash(location.hash) ?? {}));
}
