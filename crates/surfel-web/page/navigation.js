// Navigation: moves the camera by hand, in smooth transitions, and on a turntable.

import * as cameras from './camera.js';
import { stopwatch } from './stopwatch.js';
import { addScaled, distance, scale } from './vector.js';

const TRANSITION_MS = 350;
const SETTLE_MS = 150;
/** Angle for a drag over the height of the window. */
const RADIANS_PER_HEIGHT = Math.PI;
/** Fraction of the distance to the focal point flown in a second. */
const FLY_SPEED = 0.8;

export class Navigation {
  isTrackball = false;
  /** Whether the user is moving the camera; the pivot is shown meanwhile. */
  isActive = false;
  turntable_secs = 0;
  /** Whether the camera follows a path. */
  isFollowing = false;
  #previousCamera = null;
  #animationRequest = 0;
  #settleTimer = 0;

  constructor(viewer) {
    this.viewer = viewer;
    viewer.viewRequested.listen(() => this.stop());
    viewer.viewReplaced.listen(() => {
      this.stop();
      if (this.isActive) this.endInteraction();
    });
  }

  get camera() {
    return this.viewer.camera;
  }

  /** The station at which the camera stands; undefined elsewhere. */
  get station() {
    const { camera, viewer } = this;
    if (!camera || camera.panorama || cameras.isOrthographic(camera)) return undefined;
    // Links round positions.
    const isHere = ({ camera: there }) => distance(there.position, camera.position) < 1e-6 * cameras.focalDistance(there);
    return viewer.info.stations.find(isHere);
  }

  /** Orbits for a drag by this many pixels of the picture; at a station, looks around. */
  orbit(dx, dy) {
    const { camera } = this;
    if (camera.panorama) {
      this.#panPanorama(dx);
      return;
    }
    if (this.station) {
      this.#move(cameras.lookAround(camera, this.viewer.size, this.up, dx, dy));
      return;
    }
    const perPixel = RADIANS_PER_HEIGHT / this.viewer.size.height;
    const [yaw, pitch] = [-dx * perPixel, -dy * perPixel];
    if (this.isTrackball) {
      this.#move(cameras.trackball(camera, camera.focal_point, yaw, pitch));
    } else {
      this.#move(cameras.orbit(camera, camera.focal_point, this.up, yaw, pitch));
    }
  }

  /** Turns a panorama so that the surface under the pointer follows it. A panorama shows all elevations at once. */
  #panPanorama(dx) {
    const yaw = (2 * Math.PI * dx) / this.viewer.size.width;
    this.#move(cameras.turnPanorama(this.camera, yaw));
  }

  pan(from, to) {
    const depth = cameras.focalDistance(this.camera);
    this.#move(cameras.pan(this.camera, this.viewer.size, from, to, depth));
  }

  /** Zooms toward `target`, or toward the point at the pivot's depth behind `pixel`. */
  zoom(factor, pixel, target) {
    const { camera, viewer } = this;
    const depth = cameras.focalDistance(camera);
    const aim = target ?? cameras.pointAtDepth(camera, viewer.size, pixel.x, pixel.y, depth);
    this.#move(cameras.zoomWithin(viewer.info.bounds, camera, aim, factor));
  }

  zoomCenter(factor) {
    this.zoom(factor, null, this.camera.focal_point);
  }

  /** Flies to the right, up and forward for this many seconds. */
  fly([x, y, z], seconds, speed) {
    const { camera, viewer } = this;
    const { bounds } = viewer.info;
    const { right, up, forward } = cameras.axesOf(camera);
    const distance = seconds * speed * FLY_SPEED * cameras.focalDistance(camera);
    const sideways = addScaled(scale(right, x * distance), up, y * distance);
    if (cameras.isOrthographic(camera)) {
      const nearer = cameras.zoomWithin(bounds, camera, camera.focal_point, Math.exp(-z * seconds * speed * FLY_SPEED));
      this.#move(cameras.translateWithin(bounds, nearer, sideways));
    } else {
      this.#move(cameras.translateWithin(bounds, camera, addScaled(sideways, forward, z * distance)));
    }
  }

  /** Ends the interaction after a pause, so that the picture is refined. */
  settle(wait_ms = SETTLE_MS) {
    clearTimeout(this.#settleTimer);
    this.#settleTimer = setTimeout(() => this.endInteraction(), wait_ms);
  }

  /** Ends the interaction: the picture is refined. */
  endInteraction() {
    clearTimeout(this.#settleTimer);
    this.isActive = false;
    this.viewer.setCamera(this.camera, false);
  }

  /** Moves the camera in a smooth transition to one of a scene file; the server finds one that has no place or size. */
  transitionTo(target) {
    this.stop();
    const from = this.camera;
    this.#previousCamera = from;
    if (!target.position || !target.focal_point || target.orthographic === true) {
      this.endInteraction();
      this.viewer.findCamera(target);
      return;
    }
    const camera = cameras.completed(target, from);
    const isSameProjection = cameras.isOrthographic(from) === cameras.isOrthographic(camera) && !from.panorama;
    if (!isSameProjection || matchMedia('(prefers-reduced-motion: reduce)').matches) {
      this.viewer.setCamera(camera, false);
      return;
    }
    const elapsed_ms = stopwatch();
    const step = () => {
      const t = Math.min(1, elapsed_ms() / TRANSITION_MS);
      this.viewer.setCamera(cameras.blend(from, camera, t * t * (3 - 2 * t)), t < 1);
      this.#animationRequest = t < 1 ? requestAnimationFrame(step) : 0;
    };
    step();
  }

  /** Moves the camera to where it was before the last transition. */
  goBack() {
    if (this.#previousCamera) this.transitionTo(this.#previousCamera);
  }

  /** Moves the camera to where it was at the start. */
  goHome() {
    const { info, initialScene } = this.viewer;
    this.stop();
    if (info.camera_moves && !initialScene.camera.lock) this.viewer.resumeAnimation();
    else this.transitionTo(initialScene.camera);
  }

  viewFromSide(side) {
    const { bounds } = this.viewer.info;
    const seen = cameras.fromSide(this.camera, side, this.up);
    // A pivot far outside would show nothing.
    this.transitionTo(cameras.isNear(bounds, this.camera.focal_point) ? seen : cameras.fit(seen, this.viewer.size, bounds));
  }

  fit(bounds = this.viewer.info.bounds) {
    this.transitionTo(cameras.fit(this.camera, this.viewer.size, bounds));
  }

  centerOn(point) {
    this.transitionTo(cameras.centeredOn(this.camera, point));
  }

  setOrthographic(isOrthographic) {
    this.stop();
    const { camera, viewer } = this;
    const changed = isOrthographic
      ? cameras.toOrthographic(camera, viewer.info.bounds)
      : cameras.toPerspective(camera, viewer.initialScene.camera.view_angle ?? undefined);
    viewer.setCamera(changed, false);
  }

  setViewAngle(angle_deg, isMoving) {
    this.stop();
    this.viewer.setCamera(cameras.withViewAngle(this.camera, angle_deg), isMoving);
  }

  /** Turns about the focal point once in this many seconds, until the camera is moved otherwise. */
  startTurntable(seconds) {
    this.stop();
    this.turntable_secs = seconds;
    let last = performance.now();
    const step = (now) => {
      const yaw = (2 * Math.PI * Math.max(0, now - last)) / (1000 * seconds);
      last = now;
      const turned = cameras.orbit(this.camera, this.camera.focal_point, this.up, yaw, 0);
      this.viewer.setCamera(turned, true);
      this.#animationRequest = requestAnimationFrame(step);
    };
    this.#animationRequest = requestAnimationFrame(step);
  }

  /** Follows a path for this many seconds, until the camera is moved otherwise. `cameraAt(time)` has its cameras; without one the
   * path ends. */
  follow(cameraAt, seconds, showTime) {
    this.stop();
    this.isFollowing = true;
    const elapsed_ms = stopwatch();
    const step = (now) => {
      const time = Math.min(seconds, elapsed_ms(now) / 1000);
      const camera = cameraAt(time);
      if (!camera) return this.stop();
      this.viewer.setCamera(camera, true);
      showTime(time);
      if (seconds <= time) this.stop();
      else this.#animationRequest = requestAnimationFrame(step);
    };
    this.#animationRequest = requestAnimationFrame(step);
  }

  /** Stops a transition, a path or the turntable at the current camera. */
  stop() {
    if (!this.#animationRequest) return;
    cancelAnimationFrame(this.#animationRequest);
    this.#animationRequest = 0;
    this.turntable_secs = 0;
    this.isFollowing = false;
    this.viewer.setCamera(this.camera, false);
  }

  get up() {
    return this.viewer.info.up;
  }

  #move(camera) {
    this.stop();
    this.isActive = true;
    this.viewer.setCamera(camera, true);
  }
}
