// Links: the address of a view holds, after `#`, the patch between the initial scene and the view, and measurements.

import { isMeasurement } from './figures.js';
import { areEqual, createPatch } from './merge-patch.js';

/** The content of an address without a link. */
const NO_LINK = { patch: {}, measurements: null };
const PREFIX = '#view=';
/** Maximum depth of objects and lists in a link; the server reads no message of more than 128. */
const MAX_DEPTH = 100;
/** Keys of the window and the files, which are not part of a view, and of measurements, which are not part of its patch. */
const KEYS_OUTSIDE_VIEW = ['resolution', 'object', 'info', 'output', 'measurements'];

/** The patch that changes `initialScene` into `scene`. */
export function viewPatch(initialScene, scene) {
  const patch = createPatch(initialScene, scene);
  for (const key of KEYS_OUTSIDE_VIEW) delete patch[key];
  return patch;
}

/** The hash of an address for a patch and measurements; empty if there are none but the initial ones. */
export function encodeHash(patch, measurements = [], initialMeasurements = []) {
  const own = measurements.map(withoutResults);
  const content = areEqual(own, initialMeasurements) ? patch : { ...patch, measurements: own };
  if (Object.keys(content).length === 0) return '';
  const text = JSON.stringify(content, (_, value) => (typeof value === 'number' ? rounded(value) : value));
  const bytes = new TextEncoder().encode(text);
  const base64 = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(''));
  return PREFIX + base64.replaceAll('+', '-').replaceAll('/', '_').replace(/=+$/, '');
}

/** The content of an address; `report` is called with a text on what is left out of it because it is invalid. */
export function readLink(hash, report) {
  const link = decodeHash(hash);
  if (!link && hash.startsWith(PREFIX)) report('The link is broken or incomplete: it has no effect.');
  if (link?.n_invalid) report('The link has invalid measurements, which are left out.');
  return link ?? NO_LINK;
}

/**
 * The `{ patch, measurements, n_invalid }` in the hash of an address; null if it has no valid patch. Measurements are null
 * where the link keeps the initial ones. Invalid measurements are counted and left out.
 */
export function decodeHash(hash) {
  if (!hash.startsWith(PREFIX)) return null;
  const base64 = hash.slice(PREFIX.length).replaceAll('-', '+').replaceAll('_', '/');
  try {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const content = JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(bytes));
    if (typeof content !== 'object' || content === null || Array.isArray(content) || !isWithin(MAX_DEPTH, content)) return null;
    const { measurements, ...patch } = content;
    if (measurements === undefined) return { patch, measurements: null, n_invalid: 0 };
    const all = Array.isArray(measurements) ? measurements : [measurements];
    const valid = all.filter(isMeasurement).map(withoutResults);
    return { patch, measurements: valid, n_invalid: all.length - valid.length };
  } catch {
    return null;
  }
}

/** Whether objects and lists are nested at most `depth` deep. */
function isWithin(depth, value) {
  if (typeof value !== 'object' || value === null) return true;
  return 0 < depth && Object.values(value).every((part) => isWithin(depth - 1, part));
}

/** A figure without the results of a volume, which come from the server. */
export function withoutResults(figure) {
  if (!figure?.volume) return figure;
  const { volume, ...others } = figure;
  return others;
}

/** Rounds to thirteen digits: micrometres on a national grid, and short links. */
function rounded(value) {
  return Number(value.toPrecision(13));
}
