"use strict";
// The picture: radiances in half precision, drawn at an exposure; zoom, pan, and a picture beside it.

/** Values of all 65536 half-precision numbers. */
const HALVES = (() => {
  const values = new Float32Array(65536);
  for (let bits = 0; bits < 65536; bits++) {
    const exponent = (bits >> 10) & 31, mantissa = bits & 1023;
    let x = exponent ? (1 + mantissa / 1024) * 2 ** (exponent - 15) : mantissa * 2 ** -24;
    if (exponent === 31) x = mantissa ? NaN : Infinity;
    values[bits] = bits >> 15 ? -x : x;
  }
  return values;
})();

const toScreen = (x) => {
  if (!(x > 0)) return 0;
  if (x >= 1) return 255;
  return Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
};
const toLinear = (x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);

/** A picture, and the same as screen colours at the present exposure. */
class Picture {
  constructor(width, height, numbers, step, valueOf) {
    Object.assign(this, { width, height, numbers, step, valueOf });
    this.canvas = new OffscreenCanvas(width, height);
    this.context = this.canvas.getContext("2d");
    this.pixels = this.context.createImageData(width, height);
    this.pixels.data.fill(255);
  }

  /** Of an answer of the server. */
  static async ofAnswer(answer) {
    const number = (name) => Number(answer.headers.get(name));
    const scale = 2 ** number("X-Exponent");
    const numbers = new Uint16Array(await answer.arrayBuffer());
    const valueOf = (bits) => HALVES[bits] * scale;
    const picture = new Picture(number("X-Width"), number("X-Height"), numbers, 3, valueOf);
    picture.passes = number("X-Passes");
    return picture;
  }

  /** Of a PNG file: 8 bits, clipped at one. */
  static async ofFile(file) {
    const bitmap = await createImageBitmap(file, { colorSpaceConversion: "none" });
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext("2d");
    context.drawImage(bitmap, 0, 0);
    const numbers = context.getImageData(0, 0, bitmap.width, bitmap.height).data;
    return new Picture(bitmap.width, bitmap.height, numbers, 4, (byte) => toLinear(byte / 255));
  }

  expose(stops) {
    const { numbers, step, pixels } = this, data = pixels.data, factor = 2 ** stops;
    const table = new Uint8Array(step === 3 ? 65536 : 256);
    for (let i = 0; i < table.length; i++) table[i] = toScreen(this.valueOf(i) * factor);
    for (let from = 0, to = 0; to < data.length; from += step, to += 4) {
      data[to] = table[numbers[from]];
      data[to + 1] = table[numbers[from + 1]];
      data[to + 2] = table[numbers[from + 2]];
    }
    this.context.putImageData(pixels, 0, 0);
  }

  /** The three radiances of a pixel. */
  at(column, row) {
    const first = (row * this.width + column) * this.step;
    return [0, 1, 2].map((i) => this.valueOf(this.numbers[first + i]));
  }
}

// From one on whole numbers, so that all pixels are of one size.
const ZOOMS = [1 / 16, 1 / 8, 1 / 4, 1 / 2, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64];

/** Draws pictures on the stage; lengths are in pixels of the screen. */
class View {
  constructor(stage, canvas) {
    Object.assign(this, { stage, canvas, context: canvas.getContext("2d") });
    Object.assign(this, { now: null, earlier: null, mode: "off", divider: 0.5, stops: 0 });
    Object.assign(this, { zoom: 1, x: 0, y: 0, isFitted: true, pointed: null, isDue: false });
    this.onchange = () => {};
    new ResizeObserver(() => this.resize()).observe(stage);
  }

  get hasPanes() { return this.mode === "panes" && this.earlier !== null; }
  get hasDivider() { return this.mode === "slider" && this.earlier !== null; }
  get paneWidth() { return this.hasPanes ? this.canvas.width / 2 : this.canvas.width; }

  resize() {
    const density = window.devicePixelRatio || 1;
    this.canvas.width = Math.max(Math.round(this.stage.clientWidth * density), 1);
    this.canvas.height = Math.max(Math.round(this.stage.clientHeight * density), 1);
    if (this.isFitted) this.fit(); else this.draw();
  }

  show(picture) {
    const isFirst = this.now === null;
    this.now = picture;
    picture.expose(this.stops);
    if (isFirst) {
      this.stage.style.setProperty("--shape", `${picture.width} / ${picture.height}`);
      this.resize();
    } else this.draw();
  }

  showBeside(picture, mode) {
    this.earlier = picture;
    picture.expose(this.stops);
    this.setMode(mode);
  }

  setMode(mode) {
    this.mode = mode;
    if (this.isFitted) this.fit(); else this.draw();
  }

  expose(stops) {
    this.stops = stops;
    this.now?.expose(stops);
    this.earlier?.expose(stops);
    this.draw();
  }

  fit() {
    const { now, canvas } = this;
    if (!now) return;
    this.zoom = Math.min(this.paneWidth / now.width, canvas.height / now.height);
    if (this.zoom > 1) this.zoom = Math.max(Math.floor(this.zoom), 1);
    this.x = (this.paneWidth - now.width * this.zoom) / 2;
    this.y = (canvas.height - now.height * this.zoom) / 2;
    this.isFitted = true;
    this.draw();
  }

  /** Zoom about a place of the stage. */
  zoomTo(zoom, at = [this.paneWidth / 2, this.canvas.height / 2]) {
    if (!this.now) return;
    this.x = at[0] - ((at[0] - this.x) * zoom) / this.zoom;
    this.y = at[1] - ((at[1] - this.y) * zoom) / this.zoom;
    this.zoom = zoom;
    this.isFitted = false;
    this.draw();
  }

  zoomBy(direction, at) {
    const larger = ZOOMS.find((zoom) => zoom > this.zoom * 1.01) ?? ZOOMS[ZOOMS.length - 1];
    const smaller = ZOOMS.findLast((zoom) => zoom < this.zoom * 0.99) ?? ZOOMS[0];
    this.zoomTo(direction > 0 ? larger : smaller, at);
  }

  panBy(dx, dy) {
    this.x += dx;
    this.y += dy;
    this.isFitted = false;
    this.draw();
  }

  /** The pixel at a place of the stage, or null. */
  pixelAt([x, y]) {
    if (!this.now) return null;
    if (this.hasPanes && x >= this.paneWidth) x -= this.paneWidth;
    const column = Math.floor((x - Math.round(this.x)) / this.zoom);
    const row = Math.floor((y - Math.round(this.y)) / this.zoom);
    const isInside = column >= 0 && row >= 0 && column < this.now.width && row < this.now.height;
    return isInside ? { column, row } : null;
  }

  point(pixel) {
    this.pointed = pixel;
    if (pixel) this.stage.setAttribute("aria-label", `The growing picture, at column ${pixel.column}, row ${pixel.row}`);
    this.draw();
  }

  draw() {
    if (this.isDue) return;
    this.isDue = true;
    requestAnimationFrame(() => { this.isDue = false; this.paint(); });
  }

  paint() {
    const { context, canvas, now, earlier } = this;
    context.clearRect(0, 0, canvas.width, canvas.height);
    if (!now) return;
    const half = this.paneWidth, cut = Math.round(this.divider * canvas.width);
    if (this.hasPanes) {
      this.paintOne(earlier, 0, 0, half);
      this.paintOne(now, half, half, canvas.width);
      this.line(half);
    } else if (this.hasDivider) {
      this.paintOne(earlier, 0, 0, cut);
      this.paintOne(now, 0, cut, canvas.width);
      this.line(cut);
    } else this.paintOne(now, 0, 0, canvas.width);
    this.onchange();
  }

  paintOne(picture, shift, from, to) {
    const { context, canvas, zoom } = this, x = Math.round(this.x + shift), y = Math.round(this.y);
    context.save();
    context.beginPath();
    context.rect(from, 0, to - from, canvas.height);
    context.clip();
    context.imageSmoothingEnabled = zoom < 1;
    context.imageSmoothingQuality = "high";
    context.drawImage(picture.canvas, x, y, picture.width * zoom, picture.height * zoom);
    if (this.pointed) {
      const left = x + this.pointed.column * zoom, top = y + this.pointed.row * zoom;
      const side = Math.max(zoom, 5), off = (side - zoom) / 2;
      context.lineWidth = 3;
      context.strokeStyle = "rgb(0 0 0 / 80%)";
      context.strokeRect(left - off - 1, top - off - 1, side + 2, side + 2);
      context.lineWidth = 1;
      context.strokeStyle = "#fff";
      context.strokeRect(left - off - 1, top - off - 1, side + 2, side + 2);
    }
    context.restore();
  }

  line(x) {
    this.context.fillStyle = "rgb(0 0 0 / 60%)";
    this.context.fillRect(x - 2, 0, 4, this.canvas.height);
    this.context.fillStyle = "#fff";
    this.context.fillRect(x - 1, 0, 2, this.canvas.height);
  }
}

const view = new View($("stage"), $("canvas"));
