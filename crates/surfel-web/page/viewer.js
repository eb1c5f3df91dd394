// The state of the view: scene, camera and size, as the user changes them and as the server confirms them.

import { boxAround, withoutAdded } from './added.js';
import { Connection, socketAddress } from './connection.js';
import { viewPatch } from './link.js';
import { areEqual, combinePatches, createPatch, mergePatch } from './merge-patch.js';
import { rejectionText } from './rejections.js';
import { signal } from './signal.js';

const MAX_LATENCIES = 600;
/** Minimum duration between two messages about the view: some screens show more pictures a second than the server takes. */
const MIN_FLUSH_INTERVAL_MS = 8;
/** Maximum size of a message before the server has said its own limit. */
const MAX_HELLO_BYTES = 262_144;
/** Requests for what the view shows: they are sent once all changes before them have taken effect. */
const VIEW_REQUESTS = ['export', 'save', 'movie', 'points'];

export class Viewer {
  info = null;
  /** The scene as the server was started with, without the patch of a link. */
  initialScene = null;
  scene = null;
  camera = null;
  /** The camera of the picture on the screen, which lags behind `camera`. */
  shownCamera = null;
  legend = null;
  size = { width: 1, height: 1 };
  tool = 'navigate';
  isConnected = false;
  lastFrame = null;
  latencies_ms = [];
  /** The files that were added to this page, by their ids; those that are not shown any more can come back by undo. */
  addedFiles = new Map();

  infoChanged = signal();
  sceneChanged = signal();
  /** Emits when settings or the camera are changed here, not by the server. */
  changedByUser = signal();
  /** Emits before scene and camera are replaced by those of a link, an earlier state, a scene file or other data. */
  viewReplaced = signal();
  /** Emits before something is asked of the server that it makes of the view at rest. */
  viewRequested = signal();
  /** Emits the measurements of a scene file that the user has chosen. */
  measurementsLoaded = signal();
  cameraChanged = signal();
  frameShown = signal();
  toolChanged = signal();
  statsReceived = signal();
  progressChanged = signal();
  connectionChanged = signal();
  pictureReceived = signal();
  /** Emits `{ key, text }`: the reason of a rejection, and the setting at fault if the server names one. */
  rejected = signal();

  #connection;
  #seq = 0;
  #flushRequest = 0;
  #flushedAt = -Infinity;
  #queuedPatch = null;
  #queuedCamera = null;
  #isMoving = false;
  #lastCameraSeq = 0;
  /** The scene that the server confirmed last. */
  #confirmedScene = null;
  #sceneNumber = null;
  /** The patches that were sent and are not part of the confirmed scene yet. */
  #pendingPatches = [];
  #cameraBySeq = new Map();
  #sendTimeBySeq = new Map();
  #requests = new Map();
  /** Requests for what the view shows that are not sent yet. */
  #waitingRequests = [];
  #lastRequestId = 0;
  #helloPatch;
  /** Id of the request for a scene file that the server has not answered. */
  #loadId = null;

  constructor(linkPatch) {
    this.#helloPatch = linkPatch;
    this.#connection = new Connection(socketAddress(location), {
      opened: () => this.#sendHello(),
      message: (message) => this.#receive(message),
      picture: (header, files) => this.pictureReceived(header, files),
      saved: (id, blob) => this.#resolveRequest({ id, blob }),
      lost: (wait_ms) => this.#handleLoss(wait_ms),
      awaitsFile: () => [...this.#requests.values()].some(({ type }) => type === 'save'),
    });
  }

  connect() {
    this.#connection.start();
  }

  /** The added files that are shown. */
  get addedObjects() {
    return (this.scene?.added_files ?? []).map((id) => this.addedFiles.get(id)).filter(Boolean);
  }

  /** The measurements of the scene as the server was started with. */
  get initialMeasurements() {
    return this.initialScene.measurements ?? [];
  }

  /** All files and objects. */
  get objects() {
    return [...this.info.objects, ...this.addedObjects];
  }

  /** Sequence number of the last message about settings or camera; each picture carries that of the last one it obeys. */
  get lastSeq() {
    return this.#seq;
  }

  /** Whether the camera is being moved. */
  get isMoving() {
    return this.#isMoving;
  }

  /** Whether the scene's animation moves the camera. */
  get isCameraAnimated() {
    return Boolean(this.info?.camera_moves) && !this.camera?.lock;
  }

  /** Whether the picture on the screen shows all settings that were changed here, rejected ones aside. */
  get isSynced() {
    return this.#isConfirmed && this.lastFrame?.scene === this.#sceneNumber;
  }

  /** Whether all changes of the settings have taken effect or were rejected. */
  get #isConfirmed() {
    return !this.#queuedPatch && this.#pendingPatches.length === 0 && this.#loadId === null;
  }

  /** The scene with the user's camera. */
  currentScene() {
    return this.isCameraAnimated ? this.scene : { ...this.scene, camera: this.camera };
  }

  /** Changes settings, and sends them in the next animation frame. */
  changeSettings(patch, isMoving = false) {
    this.scene = mergePatch(this.scene, patch);
    this.#queuedPatch = { patch: combinePatches(this.#queuedPatch?.patch ?? {}, patch), isMoving };
    this.#scheduleFlush();
    this.sceneChanged();
    this.changedByUser();
  }

  /** Changes the camera, and sends it in the next animation frame. The scene's animation no longer moves it. */
  setCamera(camera, isMoving) {
    this.camera = this.info.camera_moves ? { ...camera, lock: true } : camera;
    this.#isMoving = isMoving;
    this.#queuedCamera = this.camera;
    this.#scheduleFlush();
    this.cameraChanged();
    this.changedByUser();
  }

  /** Lets the server find a camera with these keys of a scene file. */
  findCamera(camera) {
    const lock = this.info.camera_moves || undefined;
    // A camera that waits would be sent after the settings, and replace what the server finds.
    this.#queuedCamera = null;
    this.changeSettings({ camera: createPatch(this.camera, { ...camera, lock }) });
  }

  /** Lets the scene's animation move the camera again. */
  resumeAnimation() {
    this.#showPatch({ ...viewPatch(this.initialScene, this.currentScene()), camera: {} });
  }

  /** Shows the initial scene with `patch` applied. */
  showLink(patch) {
    this.viewReplaced();
    this.#showPatch(patch);
  }

  #showPatch(patch) {
    const target = mergePatch(this.initialScene, patch);
    this.scene = this.currentScene();
    if (this.info.camera_moves && !target.camera.lock) {
      this.#queuedCamera = null;
      this.changeSettings(createPatch(this.scene, target));
    } else {
      this.changeSettings(createPatch({ ...this.scene, camera: null }, { ...target, camera: null }));
      this.setCamera(target.camera, false);
    }
  }

  resize(size) {
    if (areEqual(size, this.size)) return;
    this.size = size;
    this.#connection.send({ type: 'size', ...size });
    this.cameraChanged();
  }

  selectTool(tool) {
    this.tool = tool;
    this.toolChanged();
  }

  /** Sends a scene file to the server, which shows its settings or rejects it. */
  async loadScene(file) {
    const maxBytes = this.#maxMessageBytes;
    // A large file dropped by mistake is not even read.
    const text = maxBytes < file.size ? null : await file.text();
    const message = { type: 'loadScene', id: ++this.#lastRequestId, name: file.name, text };
    if (text === null || maxBytes < byteLength(message)) this.rejected({ text: `${file.name} is too large for a scene file` });
    else if (!this.isConnected) this.rejected({ text: `${file.name}: there is no connection` });
    else {
      // What was changed before the file must not be sent after it.
      this.viewReplaced();
      this.#flush();
      this.#connection.send(message);
      this.#loadId = message.id;
    }
  }

  /** Resolves to the server's answer. The AbortSignal `abort` cancels; `progress` is called with progress messages. */
  request(message, { progress, abort } = {}) {
    const id = ++this.#lastRequestId;
    if (VIEW_REQUESTS.includes(message.type)) this.viewRequested();
    return new Promise((resolve, reject) => {
      this.#requests.set(id, { type: message.type, resolve, reject, progress });
      this.#waitingRequests.push({ ...message, id });
      this.#sendRequests();
      abort?.addEventListener('abort', () => {
        this.#connection.send({ type: 'cancel', id });
        this.#rejectRequest(id, 'cancelled');
      });
    });
  }

  /** The point behind a pixel; null if there is no surface. Rejects with the reason if the server does not answer. */
  async pick({ x, y }) {
    return (await this.request({ type: 'pick', x, y })).point;
  }

  /** Records that a picture was drawn, and acknowledges it. */
  acknowledge(header) {
    this.#connection.send({ type: 'ack', frame: header.frame });
    const now = performance.now();
    const { seq } = header;
    this.lastFrame = { ...header, shownAt: now };
    // Only the first picture of a message counts as its answer; later ones refine it.
    if (this.#sendTimeBySeq.has(seq)) this.latencies_ms.push(Math.max(0, now - this.#sendTimeBySeq.get(seq)));
    this.latencies_ms.splice(0, this.latencies_ms.length - MAX_LATENCIES);
    deleteBefore(this.#sendTimeBySeq, seq + 1);
    this.shownCamera = this.#cameraBySeq.get(seq) ?? this.camera;
    deleteBefore(this.#cameraBySeq, seq);
    this.frameShown();
  }

  #sendRequests() {
    const isReady = !this.isConnected || (this.#isConfirmed && !this.#queuedCamera);
    // Those that were cancelled meanwhile are answered already.
    for (const message of this.#waitingRequests.splice(0).filter(({ id }) => this.#requests.has(id))) {
      if (!isReady && VIEW_REQUESTS.includes(message.type)) this.#waitingRequests.push(message);
      else if (this.#maxMessageBytes < byteLength(message)) this.#rejectRequest(message.id, 'the request is too long for the server');
      else if (!this.#connection.send(message)) this.#rejectRequest(message.id, 'there is no connection');
    }
  }

  #sendHello() {
    // A link applies to any data, the state of this page to those that it shows.
    const hello = () => ({ type: 'hello', ...this.size, scene: this.#helloPatch, name: this.info?.name });
    // The server ends a connection that sends more, again and again.
    if (this.#maxMessageBytes < byteLength(hello())) {
      this.#helloPatch = {};
      this.rejected({ text: 'The link is too long for the server: its settings are left out.' });
    }
    this.#connection.send(hello());
  }

  get #maxMessageBytes() {
    return this.info?.limits.max_message_bytes ?? MAX_HELLO_BYTES;
  }

  #scheduleFlush() {
    this.#flushRequest ||= requestAnimationFrame((now) => {
      this.#flushRequest = 0;
      const sinceFlush_ms = now - this.#flushedAt;
      // A clock that was set back must not delay the message.
      if (0 <= sinceFlush_ms && sinceFlush_ms < MIN_FLUSH_INTERVAL_MS) {
        this.#scheduleFlush();
        return;
      }
      this.#flushedAt = now;
      this.#flush();
    });
  }

  #flush() {
    if (!this.isConnected) return;
    if (this.#queuedPatch) this.#sendPatch();
    if (this.#queuedCamera) {
      this.#send({ type: 'camera', camera: this.#queuedCamera, moving: this.#isMoving });
      this.#queuedCamera = null;
      this.#lastCameraSeq = this.#seq;
    }
    this.#sendRequests();
  }

  #sendPatch() {
    const { patch, isMoving } = this.#queuedPatch;
    this.#queuedPatch = null;
    const message = { type: 'set', scene: patch, moving: isMoving, seq: this.#seq + 1 };
    if (byteLength(message) <= this.#maxMessageBytes) {
      this.#send(message);
      this.#pendingPatches.push({ seq: this.#seq, patch });
      return;
    }
    this.#applyPendingPatches();
    this.sceneChanged();
    this.rejected({ text: 'These settings are too long for the server.' });
  }

  #send(message) {
    const seq = ++this.#seq;
    this.#cameraBySeq.set(seq, this.camera);
    this.#sendTimeBySeq.set(seq, performance.now());
    this.#connection.send({ ...message, seq });
  }

  #receive(message) {
    const answer = () => this.#resolveRequest(message);
    const handlers = {
      welcome: () => this.#receiveWelcome(message),
      scene: () => this.#receiveScene(message),
      stats: () => this.statsReceived(message),
      state: () => this.progressChanged(message),
      upload: () => this.#requests.get(message.id)?.progress?.(message),
      progress: () => this.#requests.get(message.id)?.progress?.(message),
      error: () => this.#receiveError(message),
      pick: answer,
      visible: answer,
      profile: answer,
      volume: answer,
      histogram: answer,
      added: answer,
      points: answer,
      movie: answer,
      export: answer,
    };
    handlers[message.type]?.();
    this.#sendRequests();
  }

  #receiveWelcome({ scene, info }) {
    const isOtherData = this.info?.name !== info.name;
    if (isOtherData && this.info) {
      this.viewReplaced();
      this.#helloPatch = {};
    }
    const ofFiles = info.bounds;
    Object.defineProperty(info, 'bounds', { get: () => boxAround([ofFiles, ...this.addedObjects.map(({ bounds }) => bounds)]) });
    this.info = info;
    this.initialScene = scene;
    this.#confirmedScene = mergePatch(scene, this.#helloPatch);
    [this.#sceneNumber, this.lastFrame] = [null, null];
    if (isOtherData) [this.#queuedPatch, this.#queuedCamera, this.#isMoving] = [null, null, false];
    [this.#pendingPatches, this.#loadId] = [[], null];
    // Messages of an earlier connection have no effect on this one.
    this.#lastCameraSeq = 0;
    this.#applyPendingPatches();
    // The first scene message carries the position of an animated camera.
    if (isOtherData) this.camera = info.camera_moves && !this.scene.camera.lock ? null : this.scene.camera;
    this.#cameraBySeq.set(this.#seq, this.camera);
    this.isConnected = true;
    this.connectionChanged({ isConnected: true });
    // Sends the changes made while there was no connection.
    this.#scheduleFlush();
    this.infoChanged();
    this.sceneChanged();
    this.cameraChanged();
  }

  #receiveScene({ number, id, seq, scene, camera, legend }) {
    this.legend = legend;
    const { measurements } = this.#confirmedScene;
    this.#confirmedScene = scene;
    this.#sceneNumber = number;
    this.#pendingPatches = this.#pendingPatches.filter((pending) => seq < pending.seq);
    this.#applyPendingPatches();
    const isIdle = !this.#queuedCamera && !this.#isMoving && this.#lastCameraSeq <= seq;
    if (isIdle && !areEqual(camera, this.camera)) {
      this.camera = camera;
      // Pictures of this scene show this camera for all earlier messages, too.
      for (const earlier of [seq, ...this.#cameraBySeq.keys()]) this.#cameraBySeq.set(earlier, camera);
      this.cameraChanged();
    }
    if (id !== undefined) {
      // The user has chosen a scene file, and can undo it.
      if (id === this.#loadId) this.#loadId = null;
      if (!areEqual(measurements, scene.measurements)) this.measurementsLoaded(scene.measurements ?? []);
      this.changedByUser();
    }
    this.sceneChanged();
  }

  #applyPendingPatches() {
    const patches = this.#pendingPatches.map(({ patch }) => patch);
    if (this.#queuedPatch) patches.push(this.#queuedPatch.patch);
    this.scene = patches.reduce(mergePatch, this.#confirmedScene);
  }

  #receiveError({ id, seq, key, text }) {
    if (id === this.#loadId) this.#loadId = null;
    if (seq !== undefined) {
      this.#pendingPatches = this.#pendingPatches.filter((pending) => seq < pending.seq);
      this.#applyPendingPatches();
      this.sceneChanged();
    }
    if (this.#requests.has(id)) this.#rejectRequest(id, rejectionText({ key, text }));
    else if (text !== 'cancelled') this.rejected({ key, text });
  }

  #resolveRequest(message) {
    this.#requests.get(message.id)?.resolve(message);
    this.#requests.delete(message.id);
  }

  #rejectRequest(id, text) {
    this.#requests.get(id)?.reject(new Error(text));
    this.#requests.delete(id);
  }

  #handleLoss(wait_ms) {
    if (this.isConnected) this.#helloPatch = withoutAdded(viewPatch(this.initialScene, this.currentScene()), this.addedFiles);
    this.isConnected = false;
    for (const id of [...this.#requests.keys()]) this.#rejectRequest(id, 'the connection was lost');
    this.connectionChanged({ isConnected: false, wait_ms });
  }
}

function deleteBefore(bySeq, seq) {
  for (const key of bySeq.keys()) if (key < seq) bySeq.delete(key);
}

/** Size in bytes of a message as it is sent. */
function byteLength(message) {
  return new TextEncoder().encode(JSON.stringify(message)).length;
}
