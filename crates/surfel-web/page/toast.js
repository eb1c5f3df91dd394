// Quiet messages that come and go, and the banner that stays while the connection is lost.

import { element } from './dom.js';

const SHOWN_MS = 6000;

export function showToast(text) {
  const toasts = document.getElementById('toasts');
  // The same again takes the place of what is still there.
  [...toasts.children].find((shown) => shown.textContent === text)?.remove();
  const toast = element('div', { class: 'toast' }, text);
  toasts.append(toast);
  // What was opened last lies on top: over dialogs, too.
  toasts.hidePopover?.();
  toasts.showPopover?.();
  setTimeout(() => toast.remove(), SHOWN_MS);
}

/** Tells when there is no connection, and for how long the next attempt waits. */
export function followConnection(viewer) {
  const banner = document.getElementById('banner');
  viewer.connectionChanged.listen(({ isConnected, wait_ms }) => {
    banner.hidden = isConnected;
    document.body.classList.toggle('is-offline', !isConnected);
    if (isConnected) return;
    const seconds = wait_ms < 1000 ? 'a moment' : `${Math.round(wait_ms / 1000)} s`;
    banner.textContent = `There is no connection to the server. Trying again in ${seconds}.`;
  });
  viewer.refused.listen((text) => showToast(text));
}
