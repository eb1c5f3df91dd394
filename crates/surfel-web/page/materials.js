// Materials of objects: the list `NAME=kind:property=value,…` of a scene file, taken apart and put together.

/** One entry as { name (null for all objects), kind, properties }. */
export function parseMaterial(text) {
  const colon = text.lastIndexOf(':');
  const hasProperties = 0 <= colon && text.slice(colon).includes('=');
  const head = hasProperties ? text.slice(0, colon) : text;
  const tail = hasProperties ? text.slice(colon + 1) : '';
  const equals = head.lastIndexOf('=');
  const pairs = tail ? tail.split(',').map((pair) => pair.split('=').map((word) => word.trim())) : [];
  return {
    name: equals < 0 ? null : head.slice(0, equals),
    kind: head.slice(equals + 1),
    properties: Object.fromEntries(pairs),
  };
}

export function formatMaterial({ name, kind, properties }) {
  const tail = Object.entries(properties).map(([property, value]) => `${property}=${value}`).join(',');
  return (name === null ? '' : `${name}=`) + kind + (tail ? `:${tail}` : '');
}

/** The material of an object: its own before that of all, the last one given; null for the file's own. */
export function materialOf(list, name) {
  const entries = (list ?? []).map(parseMaterial);
  const last = (wanted) => entries.findLast((entry) => entry.name === wanted);
  return last(name) ?? last(null) ?? null;
}

/** The list with this material for one object; kind null takes its own entry out. */
export function withMaterial(list, name, kind, properties) {
  const others = (list ?? []).filter((text) => parseMaterial(text).name !== name);
  return kind === null ? others : [...others, formatMaterial({ name, kind, properties })];
}
