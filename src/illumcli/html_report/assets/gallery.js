// The gallery: cards in rows. Only those near the window exist, however many variants there are.
"use strict";

class Gallery {
  constructor(root) {
    this.root = root;
    this.list = el("ul", { class: "gallery", role: "list" }); // Safari takes a list without bullets for none
    this.items = new Map(); // place -> list item
    this.indices = [];
    root.append(this.list);
  }

  show(indices) {
    this.indices = indices;
    this.#clear();
    this.layout();
  }

  // Sizes of cells and list, then the cards that are visible.
  layout() {
    const gap = 12;
    const width = this.root.clientWidth - 2 * gap;
    this.columns = Math.max(1, Math.floor((width + gap) / (app.size + gap)));
    this.width = Math.floor((width + gap) / this.columns) - gap;
    this.height = Math.round(this.width * RATIO) + (app.sort.key.startsWith("m") ? 62 : 44);
    this.step = { x: this.width + gap, y: this.height + gap, gap };
    this.rows = Math.ceil(this.indices.length / this.columns);
    this.list.style.height = `${this.rows * this.step.y + gap}px`;
    for (const [place, item] of this.items) this.#put(item, place);
    this.draw();
  }

  draw() {
    const [first, last] = visible(this.root.scrollTop, this.root.clientHeight, this.step.y, this.rows);
    const keep = this.indices.indexOf(app.active); // its focus must not be lost
    const wanted = new Set(keep < 0 ? [] : [keep]);
    const end = Math.min(last * this.columns, this.indices.length);
    for (let place = first * this.columns; place < end; place++) wanted.add(place);
    for (const [place, item] of this.items) {
      if (!wanted.has(place)) { item.remove(); this.items.delete(place); }
    }
    for (const place of [...wanted].sort((a, b) => a - b)) if (!this.items.has(place)) this.#add(place);
  }

  reveal(index) {
    const row = Math.floor(this.indices.indexOf(index) / this.columns);
    scrollInto(this.root, "scrollTop", row * this.step.y, this.step.y + this.step.gap, this.root.clientHeight);
    this.draw();
  }

  // The variant that a key leads to from the active one.
  next(key) {
    const place = this.indices.indexOf(app.active);
    const page = this.columns * Math.max(1, Math.floor(this.root.clientHeight / this.step.y));
    const target = {
      ArrowLeft: place - 1, ArrowRight: place + 1, ArrowUp: place - this.columns, ArrowDown: place + this.columns,
      PageUp: Math.max(place - page, 0), PageDown: Math.min(place + page, this.indices.length - 1),
      Home: 0, End: this.indices.length - 1,
    }[key];
    return this.indices[target] ?? app.active;
  }

  #add(place) {
    const item = el("li", { "aria-setsize": this.indices.length, "aria-posinset": place + 1 }, ...card(this.indices[place]));
    this.#put(item, place);
    this.items.set(place, item);
    // the order of the document is that of the list, for screen readers and the Tab key
    const after = [...this.list.children].find((other) => Number(other.getAttribute("aria-posinset")) > place + 1);
    this.list.insertBefore(item, after ?? null);
  }

  #put(item, place) {
    const gap = this.step.gap;
    const x = gap + (place % this.columns) * this.step.x;
    const y = gap + Math.floor(place / this.columns) * this.step.y;
    item.style.cssText = `transform: translate(${x}px, ${y}px); width: ${this.width}px; height: ${this.height}px`;
  }

  #clear() {
    this.list.replaceChildren();
    this.items.clear();
  }
}

// The first row or column that a window shows, and the one after the last; two more on either side.
function visible(offset, extent, size, count) {
  const first = clamp(Math.floor(offset / size) - 2, 0, count);
  return [first, clamp(Math.ceil((offset + extent) / size) + 2, first, count)];
}

// Scrolls so that what is `size` long and begins at `start` is inside.
function scrollInto(root, property, start, size, extent, covered = 0) {
  if (start - covered < root[property]) root[property] = start - covered;
  else if (start + size > root[property] + extent) root[property] = start + size - extent;
}
