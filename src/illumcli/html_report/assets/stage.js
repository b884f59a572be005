// A stage shows one picture, or two in a way of comparing them, and the values of the pixel under the pointer.
// It has a cursor of its own for the keyboard.
"use strict";

class Stage {
  constructor(root) {
    this.a = this.b = this.bounds = null;
    this.mode = "single";
    this.gain = 1;
    this.zoom = 0;
    this.split = 0.5;
    this.x = this.y = 0;
    this.onsplit = () => {};
    const canvas = (name) => el("canvas", { class: name, "aria-hidden": "true" });
    this.canvases = { a: canvas("a"), b: canvas("b"), d: canvas("d") };
    this.cursors = [el("span", { class: "cursor" }), el("span", { class: "cursor" })];
    this.handle = el("span", { class: "handle" });
    this.frames = [
      el("div", { class: "frame" }, this.canvases.a, this.canvases.d, this.cursors[0]),
      el("div", { class: "frame" }, this.canvases.b, this.cursors[1]),
    ];
    this.surface = el("div", {
      class: "surface", tabindex: "0", role: "application", "aria-label": "Picture; arrow keys go from pixel to pixel",
    }, ...this.frames, this.handle);
    this.scroller = el("div", { class: "scroller" }, this.surface);
    this.message = el("p", { class: "message", role: "status" });
    this.readout = el("table", { class: "readout" });
    this.spoken = el("p", { class: "hidden", role: "status" });
    root.append(this.scroller, el("div", { class: "values-of-pixel" }, this.message, this.readout), this.spoken);
    this.surface.addEventListener("pointermove", (event) => this.#pointed(event));
    this.surface.addEventListener("pointerdown", (event) => this.#pressed(event));
    this.surface.addEventListener("keydown", (event) => this.#key(event));
    new ResizeObserver(oncePerFrame(() => this.layout())).observe(this.scroller);
  }

  // Shows a picture, or two; each has {label, picture}.
  async show(a, b = null) {
    const wanted = (this.wanted = [a, b]);
    this.message.textContent = "";
    try {
      const [first, second] = await Promise.all([a, b].map((each) => each && loadPicture(each.picture)));
      if (this.wanted !== wanted) return;
      this.a = first && { ...a, ...first };
      this.b = second && { ...b, ...second };
    } catch (error) {
      if (this.wanted !== wanted) return;
      this.a = this.b = null;
      this.message.textContent = error.message;
    }
    this.bounds = this.a && this.b && isComparable(this.a, this.b) ? measuredDifference(this.a, this.b) : null;
    for (const [name, each] of [["a", this.a], ["b", this.b]]) if (each) draw(this.canvases[name], displayed(each));
    if (this.a) {
      this.x = Math.min(this.x, this.a.width - 1);
      this.y = Math.min(this.y, this.a.height - 1);
    }
    this.setMode(this.mode);
  }

  setMode(mode) {
    this.mode = mode;
    this.surface.dataset.mode = this.b ? mode : "single";
    this.surface.dataset.front = "a";
    this.drawDifference();
    this.layout();
    this.#tell();
  }

  setGain(gain) {
    this.gain = gain;
    this.drawDifference();
  }

  setZoom(zoom) {
    this.zoom = zoom;
    this.layout();
  }

  setSplit(share) {
    this.split = clamp(share, 0, 1);
    this.surface.style.setProperty("--split", `${100 * this.split}%`);
  }

  // Flicker: the picture in front.
  get front() { return this.surface.dataset.front; }
  set front(name) { this.surface.dataset.front = name; }

  drawDifference() {
    if (this.mode !== "difference" || !this.a || !this.b) return;
    const image = difference(this.a, this.b, this.gain);
    this.message.textContent = image
      ? `RMSE ${shown(this.bounds.rmse)}, largest ${shown(this.bounds.largest)} at ${this.bounds.x}, ${this.bounds.y}; linear values`
      : "The pictures differ in size or channels, so there is no difference to show.";
    draw(this.canvases.d, image ?? new ImageData(1, 1));
  }

  // Sizes the frames: to fit, or by the zoom. B is drawn as large as A.
  layout() {
    if (!this.a) return;
    const side = this.surface.dataset.mode === "side" ? 2 : 1;
    const gap = side === 2 ? 8 : 0;
    const room = { width: (this.scroller.clientWidth - gap) / side, height: this.scroller.clientHeight };
    const fit = Math.min(room.width / this.a.width, room.height / this.a.height);
    this.scale = this.zoom ? this.zoom / devicePixelRatio : fit;
    for (const frame of this.frames) {
      frame.style.width = `${this.a.width * this.scale}px`;
      frame.style.height = `${this.a.height * this.scale}px`;
    }
    this.surface.classList.toggle("pixelated", this.scale * devicePixelRatio >= 2);
    this.setSplit(this.split);
    this.#place();
  }

  goTo(x, y) {
    this.x = clamp(x, 0, this.a.width - 1);
    this.y = clamp(y, 0, this.a.height - 1);
    this.#place();
    this.#tell();
  }

  #pointed(event) {
    if (!this.a) return;
    const second = this.surface.dataset.mode === "side" && this.frames[1].contains(event.target);
    const box = this.frames[second ? 1 : 0].getBoundingClientRect();
    if (event.buttons && this.surface.dataset.mode === "slider") {
      this.setSplit((event.clientX - box.left) / box.width);
      this.onsplit(this.split);
    }
    this.goTo(
      Math.floor(((event.clientX - box.left) / box.width) * this.a.width),
      Math.floor(((event.clientY - box.top) / box.height) * this.a.height),
    );
  }

  #pressed(event) {
    if (event.button !== 0) return;
    if (this.surface.dataset.mode === "slider") this.surface.setPointerCapture(event.pointerId);
    this.#pointed(event);
  }

  #key(event) {
    const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!step || !this.a) return;
    event.preventDefault();
    event.stopPropagation();
    const length = event.shiftKey ? 10 : 1;
    this.goTo(this.x + length * step[0], this.y + length * step[1]);
    this.cursors[0].scrollIntoView({ block: "nearest", inline: "nearest" });
    this.spoken.textContent = this.readout.innerText.replace(/\s+/g, " ");
  }

  // Puts the cursors onto the pixel.
  #place() {
    for (const cursor of this.cursors) {
      cursor.style.left = `${this.x * this.scale}px`;
      cursor.style.top = `${this.y * this.scale}px`;
      cursor.style.width = cursor.style.height = `${Math.max(this.scale, 3)}px`;
    }
  }

  // Writes the values of the pixel into the readout.
  #tell() {
    if (!this.a) { this.readout.replaceChildren(); return; }
    const { a, b } = this;
    const names = a.channels === 3 ? ["R", "G", "B"] : ["value"];
    const first = pixelValues(a, this.x, this.y);
    const rows = [row(b ? "A" : "", first)];
    if (b) {
      const x = Math.floor(((this.x + 0.5) * b.width) / a.width);
      const y = Math.floor(((this.y + 0.5) * b.height) / a.height);
      const second = pixelValues(b, x, y);
      rows.push(row("B", second));
      if (isComparable(a, b)) rows.push(row("B − A", second.map(({ value }, c) => ({ value: value - first[c].value }))));
    }
    const head = el("tr", {}, el("th", { scope: "col" }, `${this.x}, ${this.y}`), ...names.map((name) => el("th", { scope: "col" }, name)));
    this.readout.replaceChildren(el("caption", {}, this.#meaning()), head, ...rows);

    function row(name, cells) {
      const texts = cells.map(({ value, cut }) => (cut ? "≥ " : "") + shown(value, 5));
      return el("tr", {}, el("th", { scope: "row" }, name), ...texts.map((text) => el("td", {}, text)));
    }
  }

  // What the numbers are.
  #meaning() {
    const { display, reading, reduced } = this.a;
    const kind = reading || (display ? "Linear light, from 8 bits" : "Linear light");
    return kind + (reduced > 1 ? `; means of ${reduced} × ${reduced} pixels` : "");
  }
}

function draw(canvas, image) {
  canvas.width = image.width;
  canvas.height = image.height;
  canvas.getContext("2d").putImageData(image, 0, 0);
}
