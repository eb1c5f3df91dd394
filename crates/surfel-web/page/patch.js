// JSON merge patches (RFC 7386): what changes one scene into another.

const isObject = (value) => typeof value === 'object' && value !== null && !Array.isArray(value);

/** `target` as `patch` makes it; null in a patch removes a key. */
export function mergePatch(target, patch) {
  if (!isObject(patch)) return patch;
  const merged = isObject(target) ? { ...target } : {};
  for (const [key, value] of Object.entries(patch)) {
    if (value === null) delete merged[key];
    else merged[key] = mergePatch(merged[key], value);
  }
  return merged;
}

/** One patch that does what `first` and then `second` do. */
export function joinPatches(first, second) {
  if (!isObject(first) || !isObject(second)) return second;
  const joined = { ...first };
  for (const [key, value] of Object.entries(second)) {
    joined[key] = key in joined ? joinPatches(joined[key], value) : value;
  }
  return joined;
}

/** The patch that makes `to` of `from`. */
export function patchBetween(from, to) {
  const patch = {};
  for (const key of new Set([...Object.keys(from), ...Object.keys(to)])) {
    if (!(key in to)) patch[key] = null;
    else if (isObject(from[key]) && isObject(to[key])) {
      const inner = patchBetween(from[key], to[key]);
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

/** Value at a dotted path such as `sun.azimuth`. */
export function valueAt(scene, path) {
  return path.split('.').reduce((value, key) => value?.[key], scene);
}

/** A patch that sets only what is at a dotted path. */
export function patchOf(path, value) {
  return path.split('.').reduceRight((inner, key) => ({ [key]: inner }), value);
}
