// The picture on the screen: decodes received pictures, draws the newest, and requests pictures of the window's size.

/** Maximum number of pixels until the server sends its own limit. */
const DEFAULT_MAX_PIXELS = 2_000_000;

export class Picture {
  #context;
  #next = null;
  #isDecoding = false;

  constructor(canvas, viewer) {
    this.canvas = canvas;
    this.viewer = viewer;
    this.#context = canvas.getContext('2d');
    viewer.pictureReceived.listen((header, files) => this.#receive(header, files));
    viewer.infoChanged.listen(() => this.resize());
    new ResizeObserver(() => this.resize()).observe(canvas);
    // The pixel ratio changes when the window moves to another screen.
    window.addEventListener('resize', () => this.resize());
    this.resize();
  }

  /** Requests as many pixels as the screen has, up to the server's limit. */
  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    const maxPixels = this.viewer.info?.limits.max_pixels ?? DEFAULT_MAX_PIXELS;
    const size = pictureSize(clientWidth, clientHeight, window.devicePixelRatio, maxPixels);
    const { canvas } = this;
    if (size.width !== canvas.width || size.height !== canvas.height) {
      const old = canvas.width && canvas.height ? copyOf(canvas) : null;
      Object.assign(canvas, size);
      if (old) this.#draw(old, { x: 0, y: 0, width: old.width, height: old.height }, old);
    }
    this.viewer.resize(size);
  }

  /** Draws a picture. While one is being decoded, only the newest of those that arrive is kept. */
  async #receive(header, files) {
    this.#next = { header, files };
    if (this.#isDecoding) return;
    this.#isDecoding = true;
    while (this.#next) {
      const { header: shown, files: parts } = this.#next;
      this.#next = null;
      try {
        const bitmaps = await Promise.all(parts.map(({ blob }) => createImageBitmap(blob)));
        const [whole] = parts;
        this.#context.clearRect(0, 0, this.canvas.width, this.canvas.height);
        parts.forEach((part, i) => this.#draw(bitmaps[i], part, whole));
        this.canvas.classList.add('is-drawn');
        for (const bitmap of bitmaps) bitmap.close();
      } catch {
        // A broken picture is skipped, and acknowledged, as the server waits for it.
      }
      this.viewer.acknowledge(shown);
    }
    this.#isDecoding = false;
  }

  /**
   * Draws an image at its place in a picture of the size of `whole`, which covers the full height, as the vertical angle
   * of view does; other aspect ratios are centred.
   */
  #draw(image, rect, whole) {
    const { width, height } = this.canvas;
    const scale = height / whole.height;
    const hasAspect = Math.abs(whole.width / whole.height - width / height) < 0.01;
    const scaleX = hasAspect ? width / whole.width : scale;
    const left = (width - scaleX * whole.width) / 2;
    // Smoothing of high quality takes longer than all else that the page does for a draft.
    this.#context.imageSmoothingQuality = this.viewer.isMoving ? 'low' : 'high';
    this.#context.drawImage(image, left + scaleX * rect.x, scale * rect.y, scaleX * rect.width, scale * rect.height);
  }
}

/** Size in device pixels of a picture that covers this many CSS pixels, scaled down to the limit. */
export function pictureSize(cssWidth, cssHeight, pixelRatio, maxPixels) {
  const wanted = cssWidth * cssHeight * pixelRatio * pixelRatio;
  const factor = pixelRatio * Math.min(1, Math.sqrt(maxPixels / Math.max(1, wanted)));
  const whole = (length) => Math.max(1, Math.floor(length * factor + 1e-6));
  return { width: whole(cssWidth), height: whole(cssHeight) };
}

function copyOf(canvas) {
  const copy = new OffscreenCanvas(canvas.width, canvas.height);
  copy.getContext('2d').drawImage(canvas, 0, 0);
  return copy;
}
