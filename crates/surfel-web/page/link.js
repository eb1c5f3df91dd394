// Links: the address of a view holds, after `#`, the patch between the initial scene and the view.

import { createPatch } from './merge-patch.js';

const PREFIX = '#view=';
/** Keys of the window and the files, which are not part of a view. */
const KEYS_OUTSIDE_VIEW = ['resolution', 'object', 'info', 'output'];

/** The patch that changes `initialScene` into `scene`. */
export function viewPatch(initialScene, scene) {
  const patch = createPatch(initialScene, scene);
  for (const key of KEYS_OUTSIDE_VIEW) delete patch[key];
  return patch;
}

/** The hash of an address for a patch; empty for an empty patch. */
export function encodeHash(patch) {
  if (Object.keys(patch).length === 0) return '';
  const text = JSON.stringify(patch, (_, value) => (typeof value === 'number' ? rounded(value) : value));
  const bytes = new TextEncoder().encode(text);
  const base64 = btoa(String.fromCharCode(...bytes));
  return PREFIX + base64.replaceAll('+', '-').replaceAll('/', '_').replace(/=+$/, '');
}

/** The patch in the hash of an address; null if there is no valid one. */
export function decodeHash(hash) {
  if (!hash.startsWith(PREFIX)) return null;
  const base64 = hash.slice(PREFIX.length).replaceAll('-', '+').replaceAll('_', '/');
  try {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const patch = JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(bytes));
    return typeof patch === 'object' && !Array.isArray(patch) ? patch : null;
  } catch {
    return null;
  }
}

/** Rounds to thirteen digits: micrometres on a national grid, and short links. */
function rounded(value) {
  return Number(value.toPrecision(13));
}
