// Pointers on the picture: drags, wheels, clicks and pinches of mouse, pen and touch.

const CLICK_PIXELS = 4;
const DOUBLE_CLICK_MS = 350;
const DOUBLE_CLICK_PIXELS = 16;
const WHEEL_PAUSE_MS = 300;
const LINE_PIXELS = 16;
/** Takes over a drag that has no effect any more. */
const ENDED = { move() {}, end() {} };

/**
 * `actions` has `click(pixel, event)`, `doubleClick(pixel)` and `hover(pixel, event)`, in pixels of the picture;
 * `leave()` ends the hovering.
 * `grab(event, pixel)` may take over a drag by returning `{ move(pixel), end() }`.
 */
export function setUpPointer(viewport, viewer, navigation, actions) {
  const pointers = new Map();
  let drag = null;
  let lastClick = null;
  let wheel = null;

  const pixelOf = (event) => {
    const frame = viewport.getBoundingClientRect();
    return {
      x: ((event.clientX - frame.left) * viewer.size.width) / frame.width,
      y: ((event.clientY - frame.top) * viewer.size.height) / frame.height,
    };
  };

  // A drag of a view that is replaced meanwhile, as by undo, would bring parts of it back.
  viewer.viewReplaced.listen(() => { if (drag) Object.assign(drag, { grabbed: ENDED, isClick: false }); });

  viewport.addEventListener('contextmenu', (event) => {
    if (!event.target.closest('[data-ui]')) event.preventDefault();
  });

  viewport.addEventListener('pointerdown', (event) => {
    if (!viewer.camera || event.target.closest('[data-ui]')) return;
    viewport.focus({ preventScroll: true });
    actions.leave();
    navigation.stop();
    viewport.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, pixelOf(event));
    if (pointers.size === 1) {
      const isPan = event.button === 1 || event.button === 2 || (event.button === 0 && event.shiftKey);
      const grabbed = event.button === 0 ? actions.grab(event, pixelOf(event)) : null;
      drag = { isPan, grabbed, start: event, isClick: !grabbed, last: pixelOf(event) };
    } else if (drag) {
      drag.isClick = false;
    }
    event.preventDefault();
  });

  viewport.addEventListener('pointermove', (event) => {
    const pixel = pixelOf(event);
    if (!pointers.has(event.pointerId)) {
      if (wheel && CLICK_PIXELS < distance(wheel.client, clientOf(event))) wheel = null;
      actions.hover(pixel, event);
      return;
    }
    if (pointers.size === 2 && !drag?.grabbed) pinch(event.pointerId, pixel);
    else if (pointers.size === 1) dragTo(pixel, event);
    pointers.set(event.pointerId, pixel);
  });

  const release = (event) => {
    if (!pointers.delete(event.pointerId) || 0 < pointers.size) {
      if (drag) drag.last = [...pointers.values()][0] ?? drag.last;
      return;
    }
    const { grabbed, isClick, start } = drag;
    drag = null;
    actions.hover(pixelOf(event), event);
    grabbed?.end();
    if (isClick && event.type === 'pointerup' && start.button === 0) handleClick(pixelOf(event), start);
    else if (navigation.isActive) navigation.endInteraction();
  };
  viewport.addEventListener('pointerup', release);
  viewport.addEventListener('pointercancel', release);
  viewport.addEventListener('pointerleave', () => actions.leave());

  viewport.addEventListener('wheel', (event) => {
    if (!viewer.camera || event.target.closest('[data-ui]')) return;
    event.preventDefault();
    const pixel = pixelOf(event);
    const now = event.timeStamp;
    if (!wheel || WHEEL_PAUSE_MS < now - wheel.at) {
      wheel = { client: clientOf(event), target: null };
      const started = wheel;
      // Without an answer the zoom is toward the pixel.
      viewer.pick(pixel).then((point) => { started.target = point?.surface ?? null; }, () => {});
    }
    wheel.at = now;
    const pixels = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY : event.deltaY * LINE_PIXELS;
    // Trackpads report a pinch as a wheel with the control key held, in small steps.
    const factor = Math.exp(Math.max(-1, Math.min(1, pixels * (event.ctrlKey ? 0.01 : 0.0015))));
    navigation.zoom(factor, pixel, wheel.target);
    navigation.settle();
  }, { passive: false });

  function dragTo(pixel, event) {
    if (drag.isClick && distance(clientOf(drag.start), clientOf(event)) < CLICK_PIXELS) return;
    drag.isClick = false;
    if (drag.grabbed) drag.grabbed.move(pixel);
    else if (drag.isPan) navigation.pan(drag.last, pixel);
    else navigation.orbit(pixel.x - drag.last.x, pixel.y - drag.last.y);
    drag.last = pixel;
  }

  /** Pans and zooms with two fingers, so that the surface between them stays there. */
  function pinch(movedId, pixel) {
    const [other] = [...pointers].filter(([id]) => id !== movedId).map(([, position]) => position);
    const before = pointers.get(movedId);
    const [from, to] = [midpoint(before, other), midpoint(pixel, other)];
    navigation.pan(from, to);
    navigation.zoom(distance(before, other) / Math.max(1, distance(pixel, other)), to, null);
  }

  /** Tells clicks from double clicks by the time of the press; a busy page handles the event later. */
  function handleClick(pixel, event) {
    const now = event.timeStamp;
    const isDouble = lastClick && now - lastClick.at < DOUBLE_CLICK_MS &&
      distance(lastClick.client, clientOf(event)) < DOUBLE_CLICK_PIXELS;
    lastClick = isDouble ? null : { at: now, client: clientOf(event) };
    if (isDouble) actions.doubleClick(pixel);
    else actions.click(pixel, event);
  }
}

const clientOf = (event) => ({ x: event.clientX, y: event.clientY });
const distance = (a, b) => Math.hypot(a.x - b.x, a.y - b.y);
const midpoint = (a, b) => ({ x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 });
