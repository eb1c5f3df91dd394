// Settings of single files and objects: parses and formats the list `NAME:KEY=VALUE` of a scene file.

/** The text of the setting `key` of an object; undefined if the object has none. The last entry counts. */
export function settingOf(list, name, key) {
  const head = `${name}:${key}=`;
  return (list ?? []).findLast((text) => text.startsWith(head))?.slice(head.length);
}

/** The name by which an object is shown: its label in the settings, else that of its file, else its name. */
export const labelOf = (list, { name, label }) => settingOf(list, name, 'label') ?? label ?? name;

/** The list with this setting of one object; null removes the object's entry. */
export function withSetting(list, name, key, value) {
  const head = `${name}:${key}=`;
  const others = (list ?? []).filter((text) => !text.startsWith(head));
  return value === null ? others : [...others, head + value];
}
