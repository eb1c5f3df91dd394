// The picture on the screen: decodes what comes, draws the newest, asks for the size that the window has.

/** Until the server tells its own limit: a larger picture might be refused. */
const CAUTIOUS_PIXELS = 2_000_000;

export class Picture {
  #context;
  #next = null;
  #isDecoding = false;

  constructor(canvas, viewer) {
    this.canvas = canvas;
    this.viewer = viewer;
    this.#context = canvas.getContext('2d');
    viewer.pictureCame.listen((header, blob) => this.#receive(header, blob));
    viewer.infoChanged.listen(() => this.resize());
    new ResizeObserver(() => this.resize()).observe(canvas);
    // Another screen may have other pixels.
    window.addEventListener('resize', () => this.resize());
    this.resize();
  }

  /** Asks for as many pixels as the screen has, or as the server allows. */
  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    const most = this.viewer.info?.limits.max_pixels ?? CAUTIOUS_PIXELS;
    const size = pictureSize(clientWidth, clientHeight, window.devicePixelRatio, most);
    const { canvas } = this;
    if (size.width !== canvas.width || size.height !== canvas.height) {
      const old = canvas.width && canvas.height ? copyOf(canvas) : null;
      Object.assign(canvas, size);
      if (old) this.#draw(old);
    }
    this.viewer.resize(size);
  }

  /** A picture that comes while another is being decoded takes the place of those that wait. */
  async #receive(header, blob) {
    this.#next = { header, blob };
    if (this.#isDecoding) return;
    this.#isDecoding = true;
    while (this.#next) {
      const { header: shown, blob: file } = this.#next;
      this.#next = null;
      try {
        const bitmap = await createImageBitmap(file);
        this.#draw(bitmap);
        this.canvas.classList.add('is-drawn');
        bitmap.close();
      } catch {
        // A broken picture is passed over; the server still waits to hear that it was seen.
      }
      this.viewer.shown(shown);
    }
    this.#isDecoding = false;
  }

  /** Fills the height, as the vertical angle of view does; a picture of another shape is centred. */
  #draw(image) {
    const { width, height } = this.canvas;
    const drawnWidth = Math.abs(image.width / image.height - width / height) < 0.01
      ? width : (image.width * height) / image.height;
    this.#context.imageSmoothingQuality = 'high';
    this.#context.clearRect(0, 0, width, height);
    this.#context.drawImage(image, (width - drawnWidth) / 2, 0, drawnWidth, height);
  }
}

/** Size in device pixels of a picture that covers so many CSS pixels, scaled down to the limit. */
export function pictureSize(cssWidth, cssHeight, pixelRatio, most) {
  const wanted = cssWidth * cssHeight * pixelRatio * pixelRatio;
  const factor = pixelRatio * Math.min(1, Math.sqrt(most / Math.max(1, wanted)));
  const whole = (length) => Math.max(1, Math.floor(length * factor + 1e-6));
  return { width: whole(cssWidth), height: whole(cssHeight) };
}

function copyOf(canvas) {
  const copy = new OffscreenCanvas(canvas.width, canvas.height);
  copy.getContext('2d').drawImage(canvas, 0, 0);
  return copy;
}
