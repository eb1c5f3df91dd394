// Materials of objects: parses and formats the list `NAME=kind:property=value,…` of a scene file.

/** Parses one entry to { name, kind, properties }; the name is null for all objects. */
export function parseMaterial(text) {
  const colon = text.lastIndexOf(':');
  // In `12:30.laz=glass` the colon belongs to the name.
  const hasProperties = /^:[a-z_-]+=/.test(text.slice(colon));
  const head = hasProperties ? text.slice(0, colon) : text;
  const tail = hasProperties ? text.slice(colon + 1) : '';
  const equals = head.lastIndexOf('=');
  const pairs = tail ? tail.split(',').map((pair) => pair.split('=').map((word) => word.trim())) : [];
  // The server writes `emissive-strength`, as a command line does.
  const properties = pairs.map(([property, value]) => [property.replaceAll('-', '_'), value]);
  return {
    name: equals < 0 ? null : head.slice(0, equals),
    kind: head.slice(equals + 1),
    properties: Object.fromEntries(properties),
  };
}

export function formatMaterial({ name, kind, properties }) {
  const tail = Object.entries(properties).map(([property, value]) => `${property}=${value}`).join(',');
  return (name === null ? '' : `${name}=`) + kind + (tail ? `:${tail}` : '');
}

/** The material of an object: the last entry with its name, else the last one for all objects; null if the file decides. */
export function materialOf(list, name) {
  const entries = (list ?? []).map(parseMaterial);
  const lastOf = (entryName) => entries.findLast((entry) => entry.name === entryName);
  return lastOf(name) ?? lastOf(null) ?? null;
}

/** The list with this material for one object; a kind of null removes the object's entry. */
export function withMaterial(list, name, kind, properties) {
  const others = (list ?? []).filter((text) => parseMaterial(text).name !== name);
  return kind === null ? others : [...others, formatMaterial({ name, kind, properties })];
}
