// The picture: decodes what arrives, draws the newest, fits it into its stage; a frozen one beside it.

import { $ } from "./dom.js";
import { clamp } from "./numbers.js";

export class Picture {
  header = null; // of the picture that is drawn
  onpaint = () => {}; // called when a picture is on the screen
  #next = null; // the newest picture while another is decoded
  #isDecoding = false;
  #split = 0.5;

  constructor(stage) {
    this.stage = stage;
    this.frame = $("#frame", stage);
    this.canvas = $("#now", stage);
    this.frozen = $("#frozen", stage);
    this.handle = $("#split", stage);
    new ResizeObserver(() => this.layout()).observe(stage);
    this.#listen();
  }

  show(picture) {
    this.#next = picture;
    if (!this.#isDecoding) this.#decode();
  }

  /** Keeps the picture of now to compare with, or lets it go. */
  freeze(isFrozen) {
    if (isFrozen) draw(this.frozen, this.canvas);
    this.frame.classList.toggle("split", isFrozen);
    this.setSplit(0.5);
  }

  get isFrozen() {
    return this.frame.classList.contains("split");
  }

  setSplit(share) {
    this.#split = clamp(share, 0, 1);
    this.frame.style.setProperty("--split", `${100 * this.#split}%`);
    this.handle.setAttribute("aria-valuenow", Math.round(100 * this.#split));
  }

  /** The size of the largest picture of this aspect that the stage has room for, in whole pixels. */
  room(aspect) {
    const { width, height } = this.stage.getBoundingClientRect();
    const wide = Math.max(2, Math.floor(Math.min(width, height * aspect)));
    return { width: wide, height: Math.max(2, Math.round(wide / aspect)) };
  }

  layout() {
    if (!this.header) return;
    const aspect = this.header.width / this.header.height;
    const room = this.room(this.aspect ?? aspect);
    this.frame.style.width = `${room.width}px`;
    this.frame.style.height = `${room.height}px`;
  }

  async #decode() {
    this.#isDecoding = true;
    while (this.#next) {
      const { image, ...header } = this.#next;
      this.#next = null;
      const bitmap = await createImageBitmap(image).catch(() => null); // null: not a picture
      if (!bitmap) continue;
      const isResized = this.header?.width !== header.width || this.header?.height !== header.height;
      this.header = header;
      draw(this.canvas, bitmap);
      bitmap.close();
      if (isResized) this.layout();
      afterPaint(() => this.onpaint(header));
    }
    this.#isDecoding = false;
  }

  #listen() {
    const { handle } = this;
    handle.addEventListener("pointerdown", (event) => {
      event.stopPropagation();
      handle.setPointerCapture(event.pointerId);
    });
    handle.addEventListener("pointermove", (event) => {
      const box = this.frame.getBoundingClientRect();
      if (handle.hasPointerCapture(event.pointerId)) this.setSplit((event.clientX - box.left) / box.width);
    });
    handle.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      this.setSplit(this.#split + (step * (event.shiftKey ? 10 : 1)) / 100);
    });
  }
}

function draw(canvas, source) {
  if (canvas.width !== source.width) canvas.width = source.width;
  if (canvas.height !== source.height) canvas.height = source.height;
  canvas.getContext("2d").drawImage(source, 0, 0);
}

/** Calls `act` when the browser has painted what is drawn now. */
function afterPaint(act) {
  requestAnimationFrame(() => {
    const channel = new MessageChannel();
    channel.port1.onmessage = act;
    channel.port2.postMessage(null);
  });
}
