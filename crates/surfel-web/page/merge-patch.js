// JSON merge patches (RFC 7396) between scenes.

const isObject = (value) => typeof value === 'object' && value !== null && !Array.isArray(value);

/** `target` with `patch` applied; null in a patch removes a key. */
export function mergePatch(target, patch) {
  if (!isObject(patch)) return patch;
  const merged = isObject(target) ? { ...target } : {};
  for (const [key, value] of Object.entries(patch)) {
    if (value === null) delete merged[key];
    else merged[key] = mergePatch(merged[key], value);
  }
  return merged;
}

/** One patch with the effect of `first`, then `second`. */
export function combinePatches(first, second) {
  if (!isObject(first) || !isObject(second)) return second;
  const combined = { ...first };
  for (const [key, value] of Object.entries(second)) {
    combined[key] = key in combined ? combinePatches(combined[key], value) : value;
  }
  return combined;
}

/** The patch that changes `from` into `to`. */
export function createPatch(from, to) {
  const patch = {};
  for (const key of new Set([...Object.keys(from), ...Object.keys(to)])) {
    if (!(key in to)) patch[key] = null;
    else if (isObject(from[key]) && isObject(to[key])) {
      const inner = createPatch(from[key], to[key]);
      if (Object.keys(inner).length) patch[key] = inner;
    } else if (!areEqual(from[key], to[key])) patch[key] = to[key];
  }
  return patch;
}

export function areEqual(a, b) {
  if (a === b) return true;
  if (Array.isArray(a) && Array.isArray(b)) return a.length === b.length && a.every((value, i) => areEqual(value, b[i]));
  if (!isObject(a) || !isObject(b)) return false;
  const keys = Object.keys(a);
  return keys.length === Object.keys(b).length && keys.every((key) => key in b && areEqual(a[key], b[key]));
}

/** The value at a dotted path such as `sun.azimuth`. */
export function valueAt(scene, path) {
  return path.split('.').reduce((value, key) => value?.[key], scene);
}

/** A patch that sets only the value at a dotted path. */
export function patchAt(path, value) {
  return path.split('.').reduceRight((inner, key) => ({ [key]: inner }), value);
}
