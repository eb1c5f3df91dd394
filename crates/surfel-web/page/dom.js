// Helpers for elements, icons and downloads.

const SVG = 'http://www.w3.org/2000/svg';

/** Creates an HTML element. Attributes that begin with `on` are listeners; false and undefined ones are left out. */
export function element(tag, attributes = {}, ...children) {
  return populate(document.createElement(tag), attributes, children);
}

export function svg(tag, attributes = {}, ...children) {
  return populate(document.createElementNS(SVG, tag), attributes, children);
}

function populate(created, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith('on')) created.addEventListener(name.slice(2), value);
    else if (value !== false && value !== undefined) created.setAttribute(name, value === true ? '' : value);
  }
  created.append(...children.filter((child) => child !== null && child !== undefined));
  return created;
}

/** An icon that index.html defines. */
export function icon(name) {
  return svg('svg', { class: 'icon', 'aria-hidden': 'true' }, svg('use', { href: `#icon-${name}` }));
}

export function iconButton(name, label, onclick, attributes = {}) {
  return element('button', { type: 'button', class: 'icon-button', title: label, 'aria-label': label, onclick, ...attributes },
    icon(name));
}

export function download(blob, name) {
  const address = URL.createObjectURL(blob);
  element('a', { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 60000);
}
