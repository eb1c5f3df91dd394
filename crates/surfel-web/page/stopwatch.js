// Durations, also on clocks that jump.

/** Returns a function of the time, as of an animation frame, to the milliseconds since this call. Time that is set back does not count. */
export function stopwatch() {
  let elapsed_ms = 0;
  let last = performance.now();
  return (now = performance.now()) => {
    elapsed_ms += Math.max(0, now - last);
    last = now;
    return elapsed_ms;
  };
}
