// Undo and redo: the states that the user has shown. The address in the browser is that of the current one.

import { withoutAdded } from './added.js';
import { encodeHash, viewPatch } from './link.js';
import { areEqual } from './merge-patch.js';
import { signal } from './signal.js';

/** Duration without a change after which a state is recorded. */
const REST_MS = 400;
const MAX_STATES = 200;

export class ViewHistory {
  changed = signal();
  /** The states in their order, each `{ patch, measurements }`. */
  #states = [];
  #currentIdx = -1;
  /** Whether the user has changed something since the current state was recorded or shown. */
  #isChanged = false;
  #timer = 0;
  #dataName = null;

  constructor(viewer, measureTool) {
    this.viewer = viewer;
    this.measureTool = measureTool;
    const noteChange = () => {
      const isFirst = !this.#isChanged;
      this.#isChanged = true;
      if (isFirst) this.changed();
      this.#schedule();
    };
    viewer.changedByUser.listen(noteChange);
    measureTool.changed.listen(noteChange);
    viewer.sceneChanged.listen(() => {
      // The first state, so that a change can be undone that is made before the first picture is finished.
      if (this.#currentIdx < 0 && viewer.isConnected) this.#record();
      this.#schedule();
    });
    viewer.infoChanged.listen(() => this.#forgetOtherData());
    window.addEventListener('pagehide', () => this.updateAddress());
  }

  get canUndo() {
    return 0 < this.#currentIdx || this.#isChanged;
  }

  get canRedo() {
    return this.#currentIdx + 1 < this.#states.length && !this.#isChanged;
  }

  undo() {
    if (this.#isChanged) this.#record();
    this.#show(this.#currentIdx - 1);
  }

  redo() {
    if (this.canRedo) this.#show(this.#currentIdx + 1);
  }

  /** Puts the link to the current state into the address bar; returns it. */
  updateAddress() {
    const { viewer } = this;
    if (viewer.initialScene) {
      const { patch, measurements } = this.#state();
      history.replaceState(null, '', encodeHash(withoutAdded(patch, viewer.addedFiles), measurements, viewer.initialMeasurements) || location.pathname + location.search);
    }
    return location.href;
  }

  #state() {
    const { viewer, measureTool } = this;
    return { patch: viewPatch(viewer.initialScene, viewer.currentScene()), measurements: measureTool.figures };
  }

  #schedule() {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => {
      const { viewer } = this;
      // The server may still complete or reject what was changed.
      if (!viewer.isConnected || viewer.isMoving || !viewer.isSynced) this.#schedule();
      else this.#record();
    }, REST_MS);
  }

  #record() {
    const state = this.#state();
    if (!areEqual(state, this.#states[this.#currentIdx])) {
      // Without a change by the user, the server has completed the current state.
      if (this.#isChanged || this.#currentIdx < 0) this.#currentIdx += 1;
      this.#states.splice(this.#currentIdx, this.#isChanged ? Infinity : 1, state);
      const nSpare = Math.max(0, this.#states.length - MAX_STATES);
      this.#states.splice(0, nSpare);
      this.#currentIdx -= nSpare;
    }
    this.#isChanged = false;
    this.updateAddress();
    this.changed();
  }

  #show(stateIdx) {
    const state = this.#states[stateIdx];
    if (!state || !this.viewer.isConnected) return;
    this.#currentIdx = stateIdx;
    const { addedFiles } = this.viewer;
    const isLost = state.patch.added_files?.some((id) => addedFiles.get(id)?.isLost);
    this.viewer.showLink(isLost ? withoutAdded(state.patch, addedFiles) : state.patch);
    this.measureTool.figures = state.measurements;
    this.#isChanged = false;
    this.changed();
  }

  /** Forgets everything once the server shows other files. */
  #forgetOtherData() {
    const { name } = this.viewer.info;
    const isOther = this.#dataName !== null && this.#dataName !== name;
    this.#dataName = name;
    if (!isOther) return;
    [this.#states, this.#currentIdx] = [[], -1];
    this.measureTool.figures = this.viewer.initialMeasurements;
    this.#isChanged = false;
    this.changed();
  }
}
