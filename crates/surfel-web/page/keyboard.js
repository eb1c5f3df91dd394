// Keys: flying while they are held, and everything that one press does.

const FLIGHT = {
  w: [0, 0, 1], s: [0, 0, -1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, -1, 0], e: [0, 1, 0],
};
const ARROWS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
/** The camera goes where the arrow points, as by a drag the other way: this share of the picture's height. */
const ARROW_STEP = 1 / 36;
const SIDES = ['front', 'back', 'left', 'right', 'top', 'bottom'];
const HASTE = 4;
const ZOOM_STEP = 0.8;

/** Rows of the help: keys, and what they do. */
export const KEY_HELP = [
  ['W A S D', 'fly forward, left, back, right'],
  ['Q E', 'fly down, up'],
  ['Shift', 'fly faster'],
  ['← ↑ → ↓', 'orbit'],
  ['+ −', 'nearer, farther'],
  ['1 … 6', 'front, back, left, right, top, bottom'],
  ['F', 'show everything'],
  ['O / P', 'orthographic / perspective'],
  ['R G B', 'colours of the scan'],
  ['Z', 'colour by elevation'],
  ['I', 'colour by intensity'],
  ['C', 'colour by class'],
  ['Enter', 'close the area that is being measured'],
  ['Esc', 'cancel, close'],
  ['?', 'this help'],
];

export const MOUSE_HELP = [
  ['Left drag', 'orbit about the pivot'],
  ['Right or middle drag, Shift + left drag', 'move the picture'],
  ['Wheel', 'zoom to what is under the pointer'],
  ['Double click', 'make what is there the pivot'],
  ['Alt + click', 'ask what is there'],
  ['One finger', 'orbit'],
  ['Two fingers', 'move and zoom'],
];

/** `act` has `escape()`, `enter()`, `help()`. */
export function followKeys(viewer, navigation, act) {
  const held = new Set();
  let last = 0;

  const fly = (now) => {
    if (held.size === 0) {
      last = 0;
      return;
    }
    const isFast = held.has('shift');
    const flown = [...held].map((key) => FLIGHT[key]).filter(Boolean);
    const direction = flown.reduce((sum, way) => sum.map((value, i) => value + way[i]), [0, 0, 0]);
    if (flown.length && last) {
      navigation.fly(direction, Math.min(0.1, (now - last) / 1000), isFast ? HASTE : 1);
      navigation.settle();
    }
    last = now;
    requestAnimationFrame(fly);
  };

  const colorBy = (source) => {
    if (viewer.info.colors.includes(source)) viewer.set({ color: source });
  };

  const presses = {
    f: () => navigation.fit(),
    o: () => navigation.setOrthographic(true),
    p: () => navigation.setOrthographic(false),
    r: () => colorBy('rgb'),
    g: () => colorBy('rgb'),
    b: () => colorBy('rgb'),
    z: () => colorBy('elevation'),
    i: () => colorBy('intensity'),
    c: () => colorBy('class'),
    '?': () => act.help(),
    '+': () => zoom(ZOOM_STEP),
    '=': () => zoom(ZOOM_STEP),
    '-': () => zoom(1 / ZOOM_STEP),
  };
  const zoom = (factor) => {
    navigation.zoomCenter(factor);
    navigation.settle();
  };

  window.addEventListener('keydown', (event) => {
    if (document.querySelector('dialog[open]')) return;
    if (event.key === 'Escape') act.escape();
    if (!viewer.camera || event.ctrlKey || event.metaKey || event.altKey || keepsItsKeys(event.target)) return;
    if (event.key === 'Enter' && !event.target.closest('button, summary, a')) act.enter();
    if (ARROWS[event.key]) {
      if (event.target.closest('#panel')) return;
      const [across, along] = ARROWS[event.key].map((step) => step * ARROW_STEP * viewer.size.height);
      navigation.orbit(across, along);
      navigation.settle();
      event.preventDefault();
      return;
    }
    const key = event.key.toLowerCase();
    if (SIDES[key - 1]) navigation.lookFrom(SIDES[key - 1]);
    else if (FLIGHT[key] || key === 'shift') {
      if (held.size === 0) requestAnimationFrame(fly);
      held.add(key);
    } else presses[key]?.();
  });
  window.addEventListener('keyup', (event) => held.delete(event.key.toLowerCase()));
  window.addEventListener('blur', () => held.clear());
}

/** Whether the element under the focus takes letters, digits and arrows itself. */
function keepsItsKeys(target) {
  return target.matches('select, textarea, input:not([type=checkbox], [type=button], [type=range])');
}
