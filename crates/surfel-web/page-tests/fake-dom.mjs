// As much of a browser's document as the tests of the page's parts need.

const realSetTimeout = globalThis.setTimeout;

class FakeElement {
  children = [];
  dataset = {};
  clientWidth = 400;
  clientHeight = 200;
  classList = { add() {}, remove() {}, toggle() {} };
  style = { setProperty() {} };
  #listeners = {};

  constructor(tag) {
    this.tag = tag;
  }

  addEventListener(type, listener) {
    this.#listeners[type] = listener;
  }

  /** Calls the listener of an event, as a browser does. */
  emit(type, event = {}) {
    return this.#listeners[type]({ type, preventDefault() {}, ...event });
  }

  setAttribute(name, value) {
    if (name.startsWith('data-')) this.dataset[name.slice(5)] = value;
    else this[name] = value;
  }

  removeAttribute(name) {
    delete this[name];
  }

  append(...children) {
    this.children.push(...children);
  }

  replaceChildren(...children) {
    this.children = children;
    // A list of choices shows its first one.
    if (this.tag === 'select') this.value = children[0]?.value;
  }

  remove() {}

  focus() {}

  reportValidity() {
    return true;
  }

  setPointerCapture() {}

  closest() {
    return null;
  }

  contains(other) {
    return other === this || this.children.some((child) => child instanceof FakeElement && child.contains(other));
  }

  getBoundingClientRect() {
    return { left: 0, top: 0, width: this.clientWidth, height: this.clientHeight };
  }

  getContext() {
    return new Proxy({}, { get: () => () => {} });
  }

  get valueAsNumber() {
    return this.value === '' ? NaN : Number(this.value);
  }

  set valueAsNumber(value) {
    this.value = value;
  }

  get textContent() {
    return this.children.map((child) => child.textContent ?? child).join('');
  }

  set textContent(text) {
    this.children = [text];
  }

  /** The elements with this tag below this one. */
  all(tag) {
    const elements = this.children.filter((child) => child instanceof FakeElement);
    return elements.flatMap((child) => [...(child.tag === tag ? [child] : []), ...child.all(tag)]);
  }
}

/** Replaces the browser's globals; returns the document. */
export function fakeDocument() {
  const byId = new Map();
  const document = Object.assign(new FakeElement('document'), {
    body: new FakeElement('body'),
    createElement: (tag) => new FakeElement(tag),
    createElementNS: (_, tag) => new FakeElement(tag),
    getElementById: (id) => byId.get(id) ?? byId.set(id, new FakeElement(id)).get(id),
  });
  Object.assign(globalThis, {
    document,
    window: new FakeElement('window'),
    sessionStorage: { getItem: () => null, removeItem() {} },
    ResizeObserver: class { observe() {} },
    getComputedStyle: () => ({ getPropertyValue: () => '' }),
    devicePixelRatio: 1,
  });
  // A toast would keep the test waiting until it vanishes.
  globalThis.setTimeout = (run, wait_ms, ...rest) => realSetTimeout(run, wait_ms, ...rest).unref();
  return document;
}

/** A pause in which all promises are settled. */
export const settled = () => new Promise((resolve) => { setImmediate(resolve); });
