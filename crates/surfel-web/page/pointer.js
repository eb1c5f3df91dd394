// Mouse, pen and touch on the picture: drags, wheels, clicks and pinches become moves and places.

const CLICK_PIXELS = 4;
const DOUBLE_CLICK_MS = 350;
const DOUBLE_CLICK_PIXELS = 16;
const WHEEL_PAUSE_MS = 300;
const LINE_PIXELS = 16;

/**
 * `act` has `click(place, event)`, `doubleClick(place)` and `hover(place)`, places in pixels of the picture;
 * `grab(event, place)` may take a drag for itself by returning `{ move(place), end() }`.
 */
export function followPointer(stage, viewer, navigation, act) {
  const pointers = new Map();
  let drag = null;
  let lastClick = null;
  let wheel = null;

  const placeOf = (event) => {
    const frame = stage.getBoundingClientRect();
    return {
      x: ((event.clientX - frame.left) * viewer.size.width) / frame.width,
      y: ((event.clientY - frame.top) * viewer.size.height) / frame.height,
    };
  };

  stage.addEventListener('contextmenu', (event) => event.preventDefault());

  stage.addEventListener('pointerdown', (event) => {
    if (!viewer.camera || event.target.closest('[data-ui]')) return;
    stage.focus({ preventScroll: true });
    navigation.stop();
    stage.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, placeOf(event));
    if (pointers.size === 1) {
      const isPan = event.button === 1 || event.button === 2 || (event.button === 0 && event.shiftKey);
      const taken = event.button === 0 ? act.grab(event, placeOf(event)) : null;
      drag = { isPan, taken, start: event, isClick: !taken, last: placeOf(event) };
    } else if (drag) {
      drag.isClick = false;
    }
    event.preventDefault();
  });

  stage.addEventListener('pointermove', (event) => {
    const place = placeOf(event);
    if (!pointers.has(event.pointerId)) {
      if (wheel && CLICK_PIXELS < distance(wheel.client, clientOf(event))) wheel = null;
      act.hover(place);
      return;
    }
    if (pointers.size === 2) pinch(event.pointerId, place);
    else if (pointers.size === 1) dragTo(place, event);
    pointers.set(event.pointerId, place);
  });

  const release = (event) => {
    if (!pointers.delete(event.pointerId) || 0 < pointers.size) {
      if (drag) drag.last = [...pointers.values()][0] ?? drag.last;
      return;
    }
    const { taken, isClick, start } = drag;
    drag = null;
    if (taken) taken.end();
    else if (isClick && event.type === 'pointerup' && start.button === 0) clicked(placeOf(event), start);
    else if (navigation.isActive) navigation.rest();
  };
  stage.addEventListener('pointerup', release);
  stage.addEventListener('pointercancel', release);

  stage.addEventListener('wheel', (event) => {
    if (!viewer.camera || event.target.closest('[data-ui]')) return;
    event.preventDefault();
    const place = placeOf(event);
    const now = event.timeStamp;
    if (!wheel || WHEEL_PAUSE_MS < now - wheel.at) {
      wheel = { client: clientOf(event), target: null };
      const started = wheel;
      viewer.pick(place).then((point) => { started.target = point?.surface ?? null; });
    }
    wheel.at = now;
    const pixels = event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? event.deltaY : event.deltaY * LINE_PIXELS;
    // Trackpads report a pinch as a wheel with the control key held, in small steps.
    const factor = Math.exp(Math.max(-1, Math.min(1, pixels * (event.ctrlKey ? 0.01 : 0.0015))));
    navigation.zoom(factor, place, wheel.target);
    navigation.settle();
  }, { passive: false });

  function dragTo(place, event) {
    if (drag.isClick && distance(clientOf(drag.start), clientOf(event)) < CLICK_PIXELS) return;
    drag.isClick = false;
    if (drag.taken) drag.taken.move(place);
    else if (drag.isPan) navigation.pan(drag.last, place);
    else navigation.orbit(place.x - drag.last.x, place.y - drag.last.y);
    drag.last = place;
  }

  /** Two fingers: what is between them stays there. */
  function pinch(movedId, place) {
    const [other] = [...pointers].filter(([id]) => id !== movedId).map(([, at]) => at);
    const before = pointers.get(movedId);
    const [from, to] = [between(before, other), between(place, other)];
    navigation.pan(from, to);
    navigation.zoom(distance(before, other) / Math.max(1, distance(place, other)), to, null);
  }

  /** By the time of the press, not that at which a busy page hears of it. */
  function clicked(place, event) {
    const now = event.timeStamp;
    const isDouble = lastClick && now - lastClick.at < DOUBLE_CLICK_MS &&
      distance(lastClick.client, clientOf(event)) < DOUBLE_CLICK_PIXELS;
    lastClick = isDouble ? null : { at: now, client: clientOf(event) };
    if (isDouble) act.doubleClick(place);
    else act.click(place, event);
  }
}

const clientOf = (event) => ({ x: event.clientX, y: event.clientY });
const distance = (a, b) => Math.hypot(a.x - b.x, a.y - b.y);
const between = (a, b) => ({ x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 });
