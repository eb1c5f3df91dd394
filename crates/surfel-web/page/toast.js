// Notifications: toasts that vanish after a while, and a banner while the connection is lost.

import { element } from './dom.js';
import { rejectionText } from './rejections.js';

const TOAST_MS = 6000;
const MAX_TOASTS = 3;

/** Shows a text; it replaces that of the same cause, which is the text itself unless it is named. */
export function showToast(text, cause = text) {
  const toasts = document.getElementById('toasts');
  [...toasts.children].find((shown) => shown.dataset.cause === cause)?.remove();
  const toast = element('div', { class: 'toast', 'data-cause': cause }, text);
  toasts.append(toast);
  while (MAX_TOASTS < toasts.children.length) toasts.firstChild.remove();
  // Opening the popover again puts it on top of dialogs opened since.
  toasts.hidePopover?.();
  toasts.showPopover?.();
  setTimeout(() => toast.remove(), TOAST_MS);
}

/** Why the server refuses connections; empty if it does not, or if it cannot be reached. */
async function refusalReason() {
  try {
    return (await (await fetch('ws')).json()).error ?? '';
  } catch {
    return '';
  }
}

/** Shows the state of the connection, and the server's rejections. */
export function setUpNotifications(viewer) {
  const banner = document.getElementById('banner');
  let lastReason = '';
  viewer.connectionChanged.listen(async ({ isConnected, wait_ms }) => {
    banner.hidden = isConnected;
    document.body.classList.toggle('is-offline', !isConnected);
    if (isConnected) return;
    const seconds = wait_ms < 1000 ? 'a moment' : `${Math.round(wait_ms / 1000)} s`;
    const show = (reason) => {
      banner.textContent = `There is no connection to the server${reason && ` (${reason})`}. The next attempt is in ${seconds}.`;
    };
    show(lastReason);
    lastReason = await refusalReason();
    show(lastReason);
  });
  viewer.rejected.listen((rejection) => showToast(rejectionText(rejection), rejection.key));
}
