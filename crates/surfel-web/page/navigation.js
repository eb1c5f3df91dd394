// Moving the camera: by hand, along smooth ways, and round and round on a turntable.

import * as cameras from './camera.js';
import { addScaled, scale } from './vector.js';

const SMOOTH_MS = 350;
const SETTLE_MS = 150;
/** Half a turn for a drag over the height of the window. */
const RADIANS_PER_HEIGHT = Math.PI;
/** Share of the distance to the focal point flown in a second. */
const FLY_SPEED = 0.8;

export class Navigation {
  isTrackball = false;
  /** Whether the hand (or a turntable) is at it: the pivot is shown then. */
  isActive = false;
  turntable_secs = 0;
  #way = 0;
  #settling = 0;

  constructor(viewer) {
    this.viewer = viewer;
  }

  get camera() {
    return this.viewer.camera;
  }

  /** By so many pixels of a picture of the viewer's size. */
  orbit(across, along) {
    const { camera } = this;
    if (camera.panorama) {
      this.#lookAround(across);
      return;
    }
    const perPixel = RADIANS_PER_HEIGHT / this.viewer.size.height;
    const [turn, tilt] = [-across * perPixel, -along * perPixel];
    if (this.isTrackball) {
      this.#move(cameras.trackball(camera, camera.focal_point, turn, tilt));
    } else {
      this.#move(cameras.orbit(camera, camera.focal_point, this.up, turn, tilt));
    }
  }

  /** A panorama stays where it is: what is under the pointer goes along. Up and down it shows everything. */
  #lookAround(across) {
    const turn = (2 * Math.PI * across) / this.viewer.size.width;
    this.#move(cameras.lookAround(this.camera, turn));
  }

  pan(from, to) {
    const depth = cameras.focalDistance(this.camera);
    this.#move(cameras.pan(this.camera, this.viewer.size, from, to, depth));
  }

  /** Toward `target`, or toward what is at the pivot's depth under `place`. */
  zoom(factor, place, target) {
    const { camera, viewer } = this;
    const depth = cameras.focalDistance(camera);
    const aim = target ?? cameras.pointAtDepth(camera, viewer.size, place.x, place.y, depth);
    this.#move(cameras.zoomTo(camera, aim, factor));
  }

  zoomCenter(factor) {
    this.zoom(factor, null, this.camera.focal_point);
  }

  /** To the right, up and forward, for so many seconds. */
  fly([across, along, ahead], seconds, haste) {
    const { camera } = this;
    const { right, up, forward } = cameras.axesOf(camera);
    const way = seconds * haste * FLY_SPEED * cameras.focalDistance(camera);
    const aside = addScaled(scale(right, across * way), up, along * way);
    if (cameras.isOrthographic(camera)) {
      const nearer = cameras.zoomTo(camera, camera.focal_point, Math.exp(-ahead * seconds * haste * FLY_SPEED));
      this.#move(cameras.translate(nearer, aside));
    } else {
      this.#move(cameras.translate(camera, addScaled(aside, forward, ahead * way)));
    }
  }

  /** The picture is refined once nothing has moved for a moment. */
  settle(wait_ms = SETTLE_MS) {
    clearTimeout(this.#settling);
    this.#settling = setTimeout(() => this.rest(), wait_ms);
  }

  /** The hand lets go. */
  rest() {
    clearTimeout(this.#settling);
    this.isActive = false;
    this.viewer.look(this.camera, false);
  }

  goTo(camera) {
    this.stop();
    const from = this.camera;
    const isOfAKind = cameras.isOrthographic(from) === cameras.isOrthographic(camera) && !from.panorama;
    if (!isOfAKind || matchMedia('(prefers-reduced-motion: reduce)').matches) {
      this.viewer.look(camera, false);
      return;
    }
    const start = performance.now();
    const step = () => {
      const share = Math.min(1, (performance.now() - start) / SMOOTH_MS);
      this.viewer.look(cameras.blend(from, camera, share * share * (3 - 2 * share)), share < 1);
      this.#way = share < 1 ? requestAnimationFrame(step) : 0;
    };
    step();
  }

  lookFrom(side) {
    this.goTo(cameras.fromSide(this.camera, side, this.up));
  }

  fit() {
    this.goTo(cameras.fit(this.camera, this.viewer.size, this.viewer.info.bounds));
  }

  centerOn(point) {
    this.goTo(cameras.centeredOn(this.camera, point));
  }

  setOrthographic(isOrthographic) {
    this.stop();
    const { camera, viewer } = this;
    const other = isOrthographic
      ? cameras.toOrthographic(camera, viewer.info.bounds)
      : cameras.toPerspective(camera, viewer.opening.camera.view_angle ?? undefined);
    viewer.look(other, false);
  }

  setViewAngle(angle_deg, isMoving) {
    this.stop();
    this.viewer.look(cameras.withViewAngle(this.camera, angle_deg), isMoving);
  }

  /** Round the focal point once in so many seconds, until something else moves the camera. */
  startTurntable(seconds) {
    this.stop();
    this.turntable_secs = seconds;
    let last = performance.now();
    const step = (now) => {
      const turn = (2 * Math.PI * Math.max(0, now - last)) / (1000 * seconds);
      last = now;
      const turned = cameras.orbit(this.camera, this.camera.focal_point, this.up, turn, 0);
      this.viewer.look(turned, true);
      this.#way = requestAnimationFrame(step);
    };
    this.#way = requestAnimationFrame(step);
  }

  /** Ends a smooth way or a turntable where it is. */
  stop() {
    if (!this.#way) return;
    cancelAnimationFrame(this.#way);
    this.#way = 0;
    this.turntable_secs = 0;
    this.viewer.look(this.camera, false);
  }

  get up() {
    return this.viewer.info.up;
  }

  #move(camera) {
    this.stop();
    this.isActive = true;
    this.viewer.look(camera, true);
  }
}
