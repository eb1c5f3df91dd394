// The view that is shown: scene, camera and size, what the server says of them, and what it is told.

import { Connection, SAVED_PICTURE, socketAddress } from './connection.js';
import { viewPatch } from './link.js';
import { areEqual, joinPatches, mergePatch, patchBetween } from './patch.js';
import { signal } from './signal.js';

const KEPT_LATENCIES = 600;

export class Viewer {
  info = null;
  /** The scene as the server was started with, before any link's patch. */
  opening = null;
  scene = null;
  camera = null;
  /** The camera of the picture on the screen, a moment behind `camera`. */
  shownCamera = null;
  legend = null;
  size = { width: 1, height: 1 };
  tool = 'look';
  isConnected = false;
  lastFrame = null;
  latencies_ms = [];

  infoChanged = signal();
  sceneChanged = signal();
  cameraChanged = signal();
  frameShown = signal();
  toolChanged = signal();
  statisticsCame = signal();
  workChanged = signal();
  connectionChanged = signal();
  pictureCame = signal();
  refused = signal();

  #connection;
  #input = 0;
  #dueFlush = 0;
  #duePatch = null;
  #dueCamera = null;
  #isMoving = false;
  #lastCameraInput = 0;
  /** As the server last told it, and the patches that it did not yet know of. */
  #toldScene = null;
  #sceneNumber = null;
  #patchesUnderway = [];
  #camerasByInput = new Map();
  #sentAt = new Map();
  #questions = new Map();
  #question = 0;
  #helloPatch;
  #takesNextCamera = false;

  constructor(linkPatch) {
    this.#helloPatch = linkPatch;
    this.#connection = new Connection(socketAddress(location), {
      opened: () => this.#hello(),
      message: (message) => this.#receive(message),
      picture: (header, blob) => this.#receivePicture(header, blob),
      lost: (wait_ms) => this.#lost(wait_ms),
    });
  }

  connect() {
    this.#connection.open();
  }

  /** Number of the last message about settings or camera; pictures tell which one they obey. */
  get lastInput() {
    return this.#input;
  }

  /** Whether the camera goes where the scene moves it. */
  get isLed() {
    return Boolean(this.info?.camera_moves) && !this.camera?.still;
  }

  /** Whether the picture on the screen is of all settings that were changed here, but for those refused. */
  get isAgreed() {
    return !this.#duePatch && this.#patchesUnderway.length === 0 && this.lastFrame?.scene === this.#sceneNumber;
  }

  /** The scene with the camera that the hand holds. */
  present() {
    return this.isLed ? this.scene : { ...this.scene, camera: this.camera };
  }

  /** Tells the server of new settings, in the next animation frame. */
  set(patch, isMoving = false) {
    this.scene = mergePatch(this.scene, patch);
    this.#duePatch = { patch: joinPatches(this.#duePatch?.patch ?? {}, patch), isMoving };
    this.#schedule();
    this.sceneChanged();
  }

  /** Tells the server of a new camera, in the next animation frame. The scene does not move it any more. */
  look(camera, isMoving) {
    this.camera = this.info.camera_moves ? { ...camera, still: true } : camera;
    this.#isMoving = isMoving;
    this.#dueCamera = this.camera;
    this.#schedule();
    this.cameraChanged();
  }

  /** Lets the scene move the camera, as it did at first. */
  follow() {
    this.showLink({ ...viewPatch(this.opening, this.present()), camera: {} });
  }

  /** Shows the opening scene as `patch` changes it. */
  showLink(patch) {
    const wanted = mergePatch(this.opening, patch);
    this.scene = this.present();
    if (this.info.camera_moves && !wanted.camera.still) {
      this.#dueCamera = null;
      this.set(patchBetween(this.scene, wanted));
    } else {
      this.set(patchBetween({ ...this.scene, camera: null }, { ...wanted, camera: null }));
      this.look(wanted.camera, false);
    }
  }

  resize(size) {
    if (areEqual(size, this.size)) return;
    this.size = size;
    this.#connection.send({ type: 'size', ...size });
    this.cameraChanged();
  }

  use(tool) {
    this.tool = tool;
    this.toolChanged();
  }

  /** Shows what a scene file tells, or says why not. */
  async load(file) {
    const most = this.info?.limits.max_message_bytes;
    // A film dropped by mistake is not even read.
    const text = most < file.size ? null : await file.text();
    const message = { type: 'load', id: ++this.#question, name: file.name, text };
    if (text === null || most < byteLength(message)) this.refused(`${file.name} is too large for a scene file`);
    else if (!this.#connection.send(message)) this.refused(`${file.name}: there is no connection`);
    else {
      this.#takesNextCamera = true;
      this.#patchesUnderway = [];
    }
  }

  /** What the server answers; `abort` (an AbortSignal) cancels, `progress` hears how far it is. */
  ask(message, { progress, abort } = {}) {
    const id = ++this.#question;
    return new Promise((resolve, reject) => {
      this.#questions.set(id, { resolve, reject, progress });
      if (!this.#connection.send({ ...message, id })) this.#fail(id, 'there is no connection');
      abort?.addEventListener('abort', () => {
        this.#connection.send({ type: 'cancel', id });
        this.#fail(id, 'cancelled');
      });
    });
  }

  /** What is at a place in the picture; null where nothing is, or where the question could not be asked. */
  async pick({ x, y }) {
    try {
      return (await this.ask({ type: 'pick', x, y })).point;
    } catch {
      return null;
    }
  }

  /** A picture has been drawn. */
  shown(header) {
    this.#connection.send({ type: 'seen', frame: header.frame });
    const now = performance.now();
    const { frame, scene, input, width, height, kind, finished, samples, of_samples } = header;
    this.lastFrame = { frame, scene, input, width, height, kind, finished, samples, of_samples, shownAt: now };
    // Only the first picture of an input answers it; those that follow refine.
    if (this.#sentAt.has(input)) this.latencies_ms.push(now - this.#sentAt.get(input));
    this.latencies_ms.splice(0, this.latencies_ms.length - KEPT_LATENCIES);
    forgetBefore(this.#sentAt, input + 1);
    this.shownCamera = this.#camerasByInput.get(input) ?? this.camera;
    forgetBefore(this.#camerasByInput, input);
    this.frameShown();
  }

  #hello() {
    this.#connection.send({ type: 'hello', ...this.size, scene: this.#helloPatch });
  }

  #schedule() {
    this.#dueFlush ||= requestAnimationFrame(() => this.#flush());
  }

  #flush() {
    this.#dueFlush = 0;
    if (!this.isConnected) return;
    if (this.#duePatch) {
      const { patch, isMoving } = this.#duePatch;
      this.#duePatch = null;
      this.#send({ type: 'set', scene: patch, moving: isMoving });
      this.#patchesUnderway.push({ input: this.#input, patch });
    }
    if (this.#dueCamera) {
      this.#send({ type: 'camera', camera: this.#dueCamera, moving: this.#isMoving });
      this.#dueCamera = null;
      this.#lastCameraInput = this.#input;
    }
  }

  #send(message) {
    const input = ++this.#input;
    this.#camerasByInput.set(input, this.camera);
    this.#sentAt.set(input, performance.now());
    this.#connection.send({ ...message, input });
  }

  #receive(message) {
    const receivers = {
      welcome: () => this.#welcome(message),
      scene: () => this.#receiveScene(message),
      stats: () => this.statisticsCame(message),
      state: () => this.workChanged(message),
      picked: () => this.#answer(message),
      taken: () => this.#answer(message),
      progress: () => this.#questions.get(message.id)?.progress?.(message),
      error: () => this.#receiveError(message),
    };
    receivers[message.type]?.();
  }

  #welcome({ scene, info }) {
    const isAnother = this.info?.name !== info.name;
    this.info = info;
    this.opening = scene;
    this.#toldScene = mergePatch(scene, this.#helloPatch);
    [this.#sceneNumber, this.lastFrame] = [null, null];
    this.#patchesUnderway = [];
    this.#mergeUnderway();
    // Where a camera is that the scene moves comes with the first scene.
    if (isAnother) this.camera = info.camera_moves && !this.scene.camera.still ? null : this.scene.camera;
    this.#camerasByInput.set(this.#input, this.camera);
    this.#takesNextCamera = isAnother;
    if (isAnother) [this.#duePatch, this.#dueCamera] = [null, null];
    this.isConnected = true;
    this.connectionChanged({ isConnected: true });
    // What was changed meanwhile.
    this.#schedule();
    this.infoChanged();
    this.sceneChanged();
    this.cameraChanged();
  }

  #receiveScene({ number, scene, camera, legend, input }) {
    this.legend = legend;
    this.#toldScene = scene;
    this.#sceneNumber = number;
    this.#patchesUnderway = this.#patchesUnderway.filter((underway) => input < underway.input);
    this.#mergeUnderway();
    const isAtRest = !this.#dueCamera && !this.#isMoving && this.#lastCameraInput <= input;
    if ((isAtRest || this.#takesNextCamera) && !areEqual(camera, this.camera)) {
      this.camera = camera;
      // Pictures after `load` obey it and all messages before.
      for (const obeyed of [input, ...this.#camerasByInput.keys()]) this.#camerasByInput.set(obeyed, camera);
      this.cameraChanged();
    }
    this.#takesNextCamera = false;
    this.sceneChanged();
  }

  #mergeUnderway() {
    const patches = this.#patchesUnderway.map(({ patch }) => patch);
    if (this.#duePatch) patches.push(this.#duePatch.patch);
    this.scene = patches.reduce(mergePatch, this.#toldScene);
  }

  #receivePicture(header, blob) {
    if (header.kind === SAVED_PICTURE) {
      this.#answer({ id: header.frame, blob });
      return;
    }
    this.pictureCame(header, blob);
  }

  #receiveError({ id, input, text }) {
    if (this.camera) this.#takesNextCamera = false;
    if (input !== undefined) {
      this.#patchesUnderway = this.#patchesUnderway.filter((underway) => input < underway.input);
      this.#mergeUnderway();
      this.sceneChanged();
    }
    if (this.#questions.has(id)) this.#fail(id, text);
    else if (text !== 'cancelled') this.refused(text);
  }

  #answer(message) {
    this.#questions.get(message.id)?.resolve(message);
    this.#questions.delete(message.id);
  }

  #fail(id, text) {
    this.#questions.get(id)?.reject(new Error(text));
    this.#questions.delete(id);
  }

  #lost(wait_ms) {
    if (this.isConnected) this.#helloPatch = viewPatch(this.opening, this.present());
    this.isConnected = false;
    for (const id of [...this.#questions.keys()]) this.#fail(id, 'the connection was lost');
    this.connectionChanged({ isConnected: false, wait_ms });
  }
}

function forgetBefore(byInput, input) {
  for (const key of byInput.keys()) if (key < input) byInput.delete(key);
}

/** Of a message as it is sent. */
function byteLength(message) {
  return new TextEncoder().encode(JSON.stringify(message)).length;
}
