// Links: a whole view, as the patch that makes it of the opening scene, in the address after `#`.

import { patchBetween } from './patch.js';

const PREFIX = '#view=';
/** Keys that belong to the window or the files, not to the view. */
const NOT_OF_THE_VIEW = ['resolution', 'object', 'info', 'output'];

/** The patch that shows `scene` to whoever opens `opening`. */
export function viewPatch(opening, scene) {
  const patch = patchBetween(opening, scene);
  for (const key of NOT_OF_THE_VIEW) delete patch[key];
  return patch;
}

/** The part of an address from `#` on; empty for the opening view itself. */
export function hashOf(patch) {
  if (Object.keys(patch).length === 0) return '';
  const text = JSON.stringify(patch, (_, value) => (typeof value === 'number' ? rounded(value) : value));
  const bytes = new TextEncoder().encode(text);
  const base64 = btoa(String.fromCharCode(...bytes));
  return PREFIX + base64.replaceAll('+', '-').replaceAll('/', '_').replace(/=+$/, '');
}

/** The patch in the `#…` of an address; null where there is none that can be read. */
export function patchOfHash(hash) {
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

/** Thirteen digits: a micrometre on a national grid, and short links. */
function rounded(value) {
  return Number(value.toPrecision(13));
}
