// Copies texts, with a fallback for pages that may not use the clipboard.

import { element, iconButton } from './dom.js';
import { showToast } from './toast.js';

const CONFIRMATION_MS = 1200;

/** Copies `text` and confirms it on `button`; returns whether it was copied. */
export async function copyText(text, button) {
  const isCopied = (await copyByClipboard(text)) || copyBySelection(text, button);
  if (!isCopied) {
    showToast('The browser does not let this page copy. Select the text, and copy it with Ctrl + C.');
    return false;
  }
  button.classList.add('is-done');
  setTimeout(() => button.classList.remove('is-done'), CONFIRMATION_MS);
  return true;
}

export function copyButton(label, text) {
  const button = iconButton('copy', label, () => copyText(text(), button));
  return button;
}

/** Copies by the clipboard API, which is closed to pages over plain HTTP from another machine and by user settings. */
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
  // Inserted next to the button: an open dialog keeps the focus inside itself.
  button.after(area);
  area.select();
  const isCopied = document.execCommand('copy');
  area.remove();
  button.focus();
  return isCopied;
}
