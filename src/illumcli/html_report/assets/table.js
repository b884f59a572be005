// The table: a row for each variant, sorted by a click on a column's head. Only rows near the window exist.
"use strict";

class Table {
  constructor(root) {
    this.root = root;
    this.columns = [
      { key: "", name: "#", text: (k) => String(k + 1) },
      ...REPORT.parameters.map((each, p) => ({
        key: `p${p}`, name: each.label, title: each.path, number: each.numeric,
        text: (k) => (each.at[k] < 0 ? "" : each.texts[each.at[k]]),
      })),
      { key: null, name: "state", text: (k) => REPORT.states[k] },
      ...REPORT.measures.map((each) => ({
        key: `m${each.name}`, name: each.name, number: true, text: (k) => shown(each.values[k]),
      })),
    ];
    this.head = el("tr", { "aria-rowindex": 1 }, el("th", { scope: "col" }, "picture"), ...this.columns.map((column) => this.#head(column)));
    this.body = el("tbody");
    this.table = el("table", { class: "table" }, el("thead", {}, this.head), this.body);
    root.append(this.table);
  }

  show(indices) {
    this.indices = indices;
    this.drawn = null;
    this.table.setAttribute("aria-rowcount", indices.length + 1);
    this.columns.forEach((column, k) => {
      const isSorted = column.key === app.sort.key;
      const sorted = app.sort.descending ? "descending" : "ascending";
      this.head.cells[k + 1].setAttribute("aria-sort", isSorted ? sorted : "none");
    });
    this.layout();
  }

  layout() {
    this.step = 56;
    this.drawn = null;
    this.draw();
  }

  draw() {
    const [first, last] = visible(this.root.scrollTop - 40, this.root.clientHeight, this.step, this.indices.length);
    const drawn = `${first},${last}`;
    if (this.drawn === drawn) return;
    this.drawn = drawn;
    const focused = this.body.contains(document.activeElement) && document.activeElement.classList.contains("open");
    const rows = range(first, last).map((place) => this.#row(place));
    this.body.replaceChildren(spacer(first * this.step), ...rows, spacer((this.indices.length - last) * this.step));
    if (focused) $(`button.open[data-index="${app.active}"]`, this.body)?.focus({ preventScroll: true });
  }

  reveal(index) {
    scrollInto(this.root, "scrollTop", 40 + this.indices.indexOf(index) * this.step, this.step, this.root.clientHeight, 40);
    this.draw();
  }

  next(key) {
    const place = this.indices.indexOf(app.active);
    const page = Math.max(1, Math.floor(this.root.clientHeight / this.step) - 2);
    const target = {
      ArrowUp: place - 1, ArrowDown: place + 1, ArrowLeft: place, ArrowRight: place, Home: 0, End: this.indices.length - 1,
      PageUp: Math.max(0, place - page), PageDown: Math.min(place + page, this.indices.length - 1),
    }[key];
    return this.indices[target] ?? app.active;
  }

  #head(column) {
    const title = column.title ?? null;
    if (column.key === null) return el("th", { scope: "col", title }, column.name);
    const sort = () => app.sortBy(column.key, app.sort.key === column.key && !app.sort.descending);
    return el("th", { scope: "col", title, class: column.number ? "number" : "" }, el("button", { type: "button", onclick: sort }, column.name));
  }

  #row(place) {
    const index = this.indices[place];
    const cells = this.columns.map((column) => el("td", { class: column.number ? "number" : "" }, column.text(index)));
    const failed = REPORT.errors[index];
    if (failed) cells[REPORT.parameters.length + 1].append(el("span", { class: "failure", title: failed }, failed));
    return el("tr", { "aria-rowindex": place + 2 }, el("td", { class: "preview" }, ...card(index, false)), ...cells);
  }
}

function spacer(height) {
  const row = el("tr", { "aria-hidden": "true", class: "spacer" }, el("td"));
  row.firstChild.style.height = `${height}px`;
  return row;
}
