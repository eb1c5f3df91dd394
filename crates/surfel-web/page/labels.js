// Labels of figures over the picture: above their points and each other, as many as there is room for.

import { svg } from './dom.js';

const LINE_HEIGHT = 16;
const GAP = 10;
const SPACING = 3;
/** Width of a letter, and of the margins. */
const [LETTER_WIDTH, MARGIN] = [6.7, 14];
/** Maximum number of labels that one moves above; a pile of more hides the picture. */
const MAX_SHIFTS = 8;
/** Size of the cells in which labels are looked up. */
const CELL_SIZE = 64;

export class Labels {
  /** The frames of the labels so far by the cells that they touch. */
  #cells = new Map();
  #leaders = [];
  #labels = [];

  /** `view` is that of a painter of the overlay. */
  constructor(view) {
    this.view = view;
  }

  /** The elements of all labels, over the lines from those that were moved to their points. */
  get elements() {
    return [...this.#leaders, ...this.#labels];
  }

  /**
   * Adds a label with lines of text, of which the first is a name, above a point, and within the picture from side to side.
   * None is added outside of the picture, without room, or if what it labels, `points`, is hidden.
   */
  add(point, lines, points) {
    const { size, toPixel, isHidden } = this.view;
    const foot = toPixel(point);
    const isInside = foot && 0 <= foot.x && foot.x <= size.width && 0 <= foot.y && foot.y <= size.height;
    if (!isInside || isHidden(points)) return;
    const width = MARGIN + LETTER_WIDTH * Math.max(...lines.map((text) => text.length));
    const height = 8 + LINE_HEIGHT * lines.length;
    // A label that is wider than the picture begins at its left.
    const x = Math.max(width / 2, Math.min(size.width - width / 2, foot.x));
    const frame = { x, y: foot.y - height / 2 - GAP, width, height };
    if (!this.#moveAbove(frame)) return;
    for (const cell of cellsOf(frame)) this.#cells.set(cell, [...this.#framesIn(cell), frame]);
    const bottom = frame.y + height / 2;
    if (bottom < foot.y - 2 * GAP) this.#leaders.push(svg('line', { class: 'label-leader', x1: foot.x, y1: foot.y, x2: foot.x, y2: bottom }));
    this.#labels.push(labelOf(frame, lines));
  }

  /** Moves a frame above those that it overlaps; returns whether it found room in the picture. */
  #moveAbove(frame) {
    for (let n = 0; n <= MAX_SHIFTS; n++) {
      const below = this.#overlapping(frame);
      if (!below) return n === 0 || 0 <= frame.y - frame.height / 2;
      frame.y = below.y - (below.height + frame.height) / 2 - SPACING;
    }
    return false;
  }

  #overlapping(frame) {
    for (const cell of cellsOf(frame)) {
      const found = this.#framesIn(cell).find((other) => overlaps(frame, other));
      if (found) return found;
    }
    return null;
  }

  #framesIn(cell) {
    return this.#cells.get(cell) ?? [];
  }
}

const overlaps = (a, b) => Math.abs(a.x - b.x) < (a.width + b.width) / 2 && Math.abs(a.y - b.y) < (a.height + b.height) / 2;

/** Names of the cells that a frame touches. */
function cellsOf({ x, y, width, height }) {
  const range = (center, length) => [center - length / 2, center + length / 2].map((end) => Math.floor(end / CELL_SIZE));
  const [[left, right], [top, bottom]] = [range(x, width), range(y, height)];
  const cells = [];
  for (let row = top; row <= bottom; row++) for (let column = left; column <= right; column++) cells.push(`${column} ${row}`);
  return cells;
}

function labelOf({ x, y, width, height }, lines) {
  const texts = lines.map((text, i) =>
    svg('text', { class: i === 0 ? 'label-name' : undefined, x, y: y - height / 2 + LINE_HEIGHT * (i + 1) }, text));
  const frame = svg('rect', { x: x - width / 2, y: y - height / 2, width, height, rx: 6 });
  return svg('g', { class: 'label' }, frame, ...texts);
}
