// What browser tests may read of the page, under `window.surfel`.

export function exposeState(viewer) {
  const copy = (value) => (value === null ? null : structuredClone(value));
  const state = {
    get connected() { return viewer.isConnected; },
    get camera() { return copy(viewer.camera); },
    get shownCamera() { return copy(viewer.shownCamera); },
    get scene() { return copy(viewer.scene); },
    get info() { return copy(viewer.info); },
    get size() { return copy(viewer.size); },
    get tool() { return viewer.tool; },
    get lastInput() { return viewer.lastInput; },
    get agreed() { return viewer.isAgreed; },
    get lastFrame() { return copy(viewer.lastFrame); },
    /** From each input to the first picture that obeys it. */
    get latencies_ms() { return [...viewer.latencies_ms]; },
  };
  window.surfel = Object.freeze({ state: Object.freeze(state) });
}
