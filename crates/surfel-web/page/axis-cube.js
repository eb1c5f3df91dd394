// The axis cube in a corner of the picture: it shows the orientation of the view, and turns the view to its sides.

import { SIDES, axesOf, sideAxes } from './camera.js';
import { svg } from './dom.js';
import { setUpRovingFocus } from './roving.js';
import { add, addScaled, cross, dot, scale } from './vector.js';

/** Half the length of an edge, in units of the drawing, whose width and height are 100. */
const HALF_EDGE = 27;
/** Cosine of the angle to the view direction above which a side is seen too much from the edge to be clicked. */
const MIN_FACING = 0.05;

/** The six sides as a camera sees them: their corners and label in units of the drawing, from its centre. */
export function cubeSides(camera, up) {
  const view = axesOf(camera);
  const toDrawing = (direction) => [dot(direction, view.right), -dot(direction, view.up)];
  return SIDES.map((side) => {
    const { forward, view_up } = sideAxes(side, up);
    const right = cross(forward, view_up);
    const middle = scale(forward, -HALF_EDGE);
    const corner = (x, y) => toDrawing(addScaled(add(middle, scale(right, x * HALF_EDGE)), view_up, y * HALF_EDGE));
    return {
      side,
      corners: [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)],
      /** The matrix of the label, which lies in the side. */
      label: [...toDrawing(right), ...toDrawing(scale(view_up, -1)), ...toDrawing(middle)],
      isFacing: MIN_FACING < dot(forward, view.forward),
    };
  });
}

export function setUpAxisCube(viewer, navigation) {
  const cube = document.getElementById('axis-cube');
  const sides = SIDES.map((side, i) => svg('g', { role: 'button', 'aria-label': `View from the ${side}`, 'data-cube-side': side },
    svg('title', {}, `${side} (${i + 1})`), svg('polygon'), svg('text', { 'aria-hidden': 'true' }, side)));
  const turn = (event) => {
    const side = event.target.closest('[data-cube-side]')?.dataset.cubeSide;
    if (side) navigation.viewFromSide(side);
  };
  cube.append(...sides);
  cube.addEventListener('click', turn);
  cube.addEventListener('keydown', (event) => {
    if (event.key !== 'Enter' && event.key !== ' ') return;
    turn(event);
    event.preventDefault();
  });
  setUpRovingFocus(cube, () => sides);

  viewer.cameraChanged.listen(() => {
    const { camera, info } = viewer;
    if (!camera || !info) return;
    // An SVG element has no property `hidden`.
    cube.toggleAttribute('hidden', Boolean(camera.panorama));
    if (camera.panorama) return;
    cubeSides(camera, info.up).forEach(({ corners, label, isFacing }, i) => {
      const [, polygon, text] = sides[i].children;
      polygon.setAttribute('points', corners.map((corner) => corner.map(short).join(',')).join(' '));
      text.setAttribute('transform', `matrix(${label.map(short).join(' ')})`);
      sides[i].classList.toggle('is-facing', isFacing);
    });
  });
}

const short = (value) => Number(value.toFixed(3));
