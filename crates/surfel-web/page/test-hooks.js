// Read-only state of the page for browser tests, under `window.surfel`.

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
    get lastSeq() { return viewer.lastSeq; },
    get synced() { return viewer.isSynced; },
    get lastFrame() { return copy(viewer.lastFrame); },
    /** Duration from each message to the first picture that obeys it. */
    get latencies_ms() { return [...viewer.latencies_ms]; },
  };
  window.surfel = Object.freeze({ state: Object.freeze(state) });
}
