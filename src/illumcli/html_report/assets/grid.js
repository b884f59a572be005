// The grid: one parameter across, one down, the others held at a value. Only cells near the window exist.
"use strict";

class Grid {
  constructor(root) {
    this.root = root;
    this.table = el("div", { class: "grid", role: "grid", "aria-label": `${REPORT.noun}s by two parameters` });
    root.append(this.table);
  }

  show(indices) {
    const { x, y, held } = app.axes;
    const cells = gridCells(indices, x, y, held);
    this.cells = cells;
    this.across = REPORT.parameters[x];
    this.down = y < 0 ? null : REPORT.parameters[y];
    // only values that some variant has now
    const used = (at) => [...new Set([...cells.keys()].map((key) => Number(key.split(",")[at])))].filter((k) => k >= 0).sort((a, b) => a - b);
    this.columns = used(0);
    this.rows = used(1);
    this.places = new Map();
    this.rows.forEach((row, r) => this.columns.forEach((column, c) => {
      const [index] = cells.get(`${column},${row}`) ?? [];
      if (index !== undefined) this.places.set(index, [r, c]);
    }));
    this.table.setAttribute("aria-rowcount", this.rows.length + 1);
    this.table.setAttribute("aria-colcount", this.columns.length + 1);
    if (!this.places.has(app.active) && this.places.size) app.activate(this.places.keys().next().value);
    this.layout();
  }

  layout() {
    this.size = { x: app.size + 6, y: Math.round(app.size * RATIO) + 6, head: 34, side: this.down ? 110 : 8 };
    const { x, y, head, side } = this.size;
    this.table.style.cssText = `width: ${side + this.columns.length * x}px; height: ${head + this.rows.length * y}px;`
      + ` --cell-x: ${x}px; --cell-y: ${y}px; --head: ${head}px; --side: ${side}px`;
    this.draw();
  }

  draw() {
    const { x, y, head, side } = this.size;
    const [top, bottom] = visible(this.root.scrollTop - head, this.root.clientHeight, y, this.rows.length);
    const [left, right] = visible(this.root.scrollLeft - side, this.root.clientWidth, x, this.columns.length);
    const drawn = [top, bottom, left, right].join();
    if (this.drawn === drawn && this.drawnCells === this.cells && this.drawnSize === x) return;
    const focused = this.root.contains(document.activeElement) && document.activeElement.classList.contains("open");
    Object.assign(this, { drawn, drawnCells: this.cells, drawnSize: x });

    const columns = range(left, right);
    const axes = `${this.down ? `${this.down.label} ↓ ` : ""}${this.across.label} →`;
    const corner = el("span", { role: "columnheader", class: "corner", "aria-colindex": 1, title: axes }, axes);
    const heads = columns.map((c) => el("span", {
      role: "columnheader", class: "head", "aria-colindex": c + 2,
    }, this.across.texts[this.columns[c]]));
    heads.forEach((node, k) => { node.style.left = `${side + columns[k] * x}px`; });
    const rows = range(top, bottom).map((r) => this.#row(r, columns));
    this.table.replaceChildren(el("div", { role: "row", class: "heads", "aria-rowindex": 1 }, corner, ...heads), ...rows);
    if (focused) $(`button.open[data-index="${app.active}"]`, this.table)?.focus({ preventScroll: true });
  }

  #row(r, columns) {
    const { x, y, head, side } = this.size;
    const name = this.down ? this.down.texts[this.rows[r]] : "";
    const cells = columns.map((c) => {
      const [index, ...more] = this.cells.get(`${this.columns[c]},${this.rows[r]}`) ?? [];
      const cell = el("span", { role: "gridcell", class: "cell", "aria-colindex": c + 2 },
        ...(index === undefined ? [] : card(index, false)),
        more.length ? el("span", { class: "more", title: `more ${REPORT.noun}s have these values` }, `+${more.length}`) : null);
      cell.style.left = `${side + c * x}px`;
      return cell;
    });
    const row = el("div", { role: "row", class: "line", "aria-rowindex": r + 2 },
      el("span", { role: "rowheader", class: "name", "aria-colindex": 1, title: name }, name), ...cells);
    row.style.top = `${head + r * y}px`;
    return row;
  }

  reveal(index) {
    const place = this.places.get(index);
    if (!place) return;
    const { x, y, head, side } = this.size;
    scrollInto(this.root, "scrollTop", head + place[0] * y, y, this.root.clientHeight, head);
    scrollInto(this.root, "scrollLeft", side + place[1] * x, x, this.root.clientWidth, side);
    this.draw();
  }

  next(key) {
    const place = this.places.get(app.active);
    if (!place) return app.active;
    const [dr, dc] = {
      ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0], Home: [0, -Infinity], End: [0, Infinity],
      PageUp: [-Infinity, 0], PageDown: [Infinity, 0],
    }[key];
    // the next cell in that direction that has a variant
    const line = [...this.places].filter(([, [r, c]]) => (dr ? c === place[1] && (r - place[0]) * dr > 0 : r === place[0] && (c - place[1]) * dc > 0));
    const far = (dr || dc) === Infinity || (dr || dc) === -Infinity;
    const distance = ([, [r, c]]) => Math.abs(r - place[0]) + Math.abs(c - place[1]);
    line.sort((a, b) => (far ? -1 : 1) * (distance(a) - distance(b)));
    return line.length ? line[0][0] : app.active;
  }
}

function range(first, last) {
  return Array.from({ length: Math.max(0, last - first) }, (_, k) => first + k);
}
