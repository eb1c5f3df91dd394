// Keyboard: flying while keys are held, and commands of single keys.

import { SIDES } from './camera.js';

const FLY_DIRECTIONS = {
  w: [0, 0, 1], s: [0, 0, -1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, -1, 0], e: [0, 1, 0],
};
const ORBIT_DIRECTIONS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const CROSSHAIR_DIRECTIONS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
/** Length of the drag that an arrow key stands for, as a fraction of the picture's height. */
const ORBIT_STEP = 1 / 36;
const FAST_FLY_SPEED = 4;
const ZOOM_STEP = 0.8;

/** Rows of the help dialog: keys, and their action. */
export const KEY_HELP = [
  ['W A S D', 'fly forward, left, back, right'],
  ['Q E', 'fly down, up'],
  ['Shift', 'fly faster'],
  ['← ↑ → ↓', 'orbit; with a tool, move the crosshair, with Shift finely'],
  ['+ −', 'zoom in, zoom out'],
  ['1 … 6', 'view from the front, back, left, right, top, bottom'],
  ['F', 'fit to view'],
  ['Home', 'view at the start'],
  ['Backspace', 'previous view'],
  ['Ctrl + Z', 'undo'],
  ['Ctrl + Shift + Z', 'redo'],
  ['O / P', 'orthographic / perspective'],
  ['R G B', 'colour by RGB'],
  ['Z', 'colour by elevation'],
  ['I', 'colour by intensity'],
  ['C', 'colour by class'],
  ['Enter', 'pick at the crosshair; end the measured line, area or profile'],
  ['Esc', 'cancel or close'],
  ['?', 'show this help'],
];

export const MOUSE_HELP = [
  ['Left drag', 'orbit about the pivot; at a station, look around'],
  ['Right or middle drag, Shift + left drag', 'pan'],
  ['Wheel', 'zoom toward the point under the pointer'],
  ['Double click', 'set the pivot to this point'],
  ['Alt + click', 'pick point'],
  ['One finger', 'orbit'],
  ['Two fingers', 'pan and zoom'],
];

/** `actions` has `escape()`, `enter()`, `help()`, and `moveCrosshair(direction, isFine)`, which returns whether there is one. */
export function setUpKeyboard(viewer, navigation, viewHistory, actions) {
  const held = new Set();
  let last = 0;

  const fly = (now) => {
    if (held.size === 0) {
      last = 0;
      return;
    }
    const isFast = held.has('shift');
    const directions = [...held].map((key) => FLY_DIRECTIONS[key]).filter(Boolean);
    const direction = directions.reduce((sum, one) => sum.map((value, i) => value + one[i]), [0, 0, 0]);
    // The camera of other data may not have arrived yet.
    if (directions.length && last && viewer.camera) {
      navigation.fly(direction, Math.min(0.1, Math.max(0, now - last) / 1000), isFast ? FAST_FLY_SPEED : 1);
      navigation.settle();
    }
    last = now;
    requestAnimationFrame(fly);
  };

  const colorBy = (source) => {
    if (viewer.info.colors.includes(source)) viewer.changeSettings({ color: source });
  };

  const commands = {
    f: () => navigation.fit(),
    home: () => navigation.goHome(),
    backspace: () => navigation.goBack(),
    o: () => navigation.setOrthographic(true),
    p: () => navigation.setOrthographic(false),
    r: () => colorBy('rgb'),
    g: () => colorBy('rgb'),
    b: () => colorBy('rgb'),
    z: () => colorBy('elevation'),
    i: () => colorBy('intensity'),
    c: () => colorBy('class'),
    '?': () => actions.help(),
    '+': () => zoom(ZOOM_STEP),
    '=': () => zoom(ZOOM_STEP),
    '-': () => zoom(1 / ZOOM_STEP),
  };
  const zoom = (factor) => {
    navigation.zoomCenter(factor);
    navigation.settle();
  };

  const undoOrRedo = (event) => {
    const key = event.key.toLowerCase();
    const isRedo = key === 'y' || (key === 'z' && event.shiftKey);
    if (!isRedo && key !== 'z') return;
    if (isRedo) viewHistory.redo();
    else viewHistory.undo();
    event.preventDefault();
  };

  window.addEventListener('keydown', (event) => {
    if (document.querySelector('dialog[open]')) return;
    if (event.key === 'Escape') actions.escape();
    if (!viewer.camera || event.altKey) return;
    if (event.ctrlKey || event.metaKey) {
      if (!undoesTyping(event.target)) undoOrRedo(event);
      return;
    }
    if (usesKeys(event.target)) return;
    if (event.key === 'Enter' && !event.target.closest('button, summary, a')) actions.enter();
    if (ORBIT_DIRECTIONS[event.key]) {
      if (event.target.closest('#panel')) return;
      event.preventDefault();
      if (actions.moveCrosshair(CROSSHAIR_DIRECTIONS[event.key], event.shiftKey)) return;
      const [dx, dy] = ORBIT_DIRECTIONS[event.key].map((step) => step * ORBIT_STEP * viewer.size.height);
      navigation.orbit(dx, dy);
      navigation.settle();
      return;
    }
    const key = event.key.toLowerCase();
    if (SIDES[key - 1]) navigation.viewFromSide(SIDES[key - 1]);
    else if (FLY_DIRECTIONS[key] || key === 'shift') {
      if (held.size === 0) requestAnimationFrame(fly);
      held.add(key);
    } else commands[key]?.();
  });
  window.addEventListener('keyup', (event) => held.delete(event.key.toLowerCase()));
  window.addEventListener('blur', () => held.clear());
}

/** Whether the focused element is a field whose text the browser itself undoes. */
function undoesTyping(target) {
  return target.matches('textarea, input:not([type="range"], [type="checkbox"], [type="color"])');
}

/** Whether the focused element is a control that keys are meant for. A button that was clicked keeps its focus, but not the keys. */
function usesKeys(target) {
  return target.matches('select, textarea, input, :is(button, summary, a, [role="button"]):focus-visible');
}
