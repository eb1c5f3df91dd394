// Copying texts, also where the page may not use the clipboard.

import { element, iconButton } from './dom.js';
import { showToast } from './toast.js';

const SHOWN_MS = 1200;

/** Copies `text`, and shows on `button` that it did; returns whether it could. */
export async function copyText(text, button) {
  const isCopied = (await copyByClipboard(text)) || copyBySelection(text, button);
  if (!isCopied) {
    showToast('The browser does not let this page copy. Select the text, and copy it with Ctrl + C.');
    return false;
  }
  button.classList.add('is-done');
  setTimeout(() => button.classList.remove('is-done'), SHOWN_MS);
  return true;
}

export function copyButton(label, text) {
  const button = iconButton('copy', label, () => copyText(text(), button));
  return button;
}

/** Closed to pages that come over plain HTTP from another machine, and to those that may not by the user's will. */
async function copyByClipboard(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    return false;
  }
}

function copyBySelection(text, button) {
  const area = element('textarea', { class: 'visually-hidden' });
  area.value = text;
  // Beside the button, as an open dialog takes the focus from all that is outside.
  button.after(area);
  area.select();
  const isCopied = document.execCommand('copy');
  area.remove();
  button.focus();
  return isCopied;
}
