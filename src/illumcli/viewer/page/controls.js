// The panel of controls: a field for every parameter of the scene, in groups that open, filtered by words.

import { $, $$, el } from "./dom.js";
import { makeField } from "./fields.js";
import { shown } from "./numbers.js";

const TITLES = {
  materials: "Materials", lights: "Lights", ambient: "Ambient light", obscurance: "Obscurance", shading: "Shading",
  film: "Film", camera: "Camera", cameras: "Camera", objects: "Objects", depth_cue: "Depth cue",
};

export class Controls {
  #rows = new Map(); // path -> {control, row, field}
  #open = new Set(); // names of groups that are open
  #groups = new Map(); // name -> {details, rows, badge, reset}

  constructor(root, session) {
    this.session = session;
    this.list = $("#groups", root);
    this.help = $("#help", root);
    this.words = $("#filter", root);
    this.changedOnly = $("#changed-only", root);
    for (const field of [this.words, this.changedOnly]) field.addEventListener("input", () => this.#filter());
    for (const kind of ["pointerover", "focusin"]) this.list.addEventListener(kind, (event) => this.#explain(event.target));
    session.on("scene", () => this.#build());
    session.on("values", (paths) => this.#show(paths));
    session.on("view", () => this.#showLights());
  }

  /** Opens a group and brings it into view. */
  reveal(name) {
    const group = this.#groups.get(name);
    if (!group) return;
    group.details.open = true;
    group.details.scrollIntoView({ block: "nearest", behavior: "smooth" });
    for (const { details } of this.#groups.values()) details.classList.toggle("chosen", details === group.details);
  }

  /** Marks the controls that a message of the server names. */
  blame(lines) {
    for (const [path, { row }] of this.#rows) {
      row.classList.toggle("faulty", lines.some((line) => line.includes(`${path}:`) || line.includes(`${path}=`)));
    }
  }

  // --- building -----------------------------------------------------------------------------------------

  #build() {
    const focused = this.#focused();
    const { scene } = this.session;
    const isFirst = this.#groups.size === 0;
    this.#rows.clear();
    this.#groups.clear();
    const sections = new Map(); // title -> elements
    for (const [name, controls] of Map.groupBy(scene.controls, ({ group }) => group)) {
      const [family] = name.split(".");
      const title = TITLES[family] ?? family;
      if (!sections.has(title)) sections.set(title, []);
      if (isFirst && sections.get(title).length === 0 && ["materials", "ambient"].includes(family)) this.#open.add(name);
      sections.get(title).push(this.#makeGroup(name, controls));
    }
    const scrolled = this.list.scrollTop;
    this.list.replaceChildren(...[...sections].map(([title, groups]) => el("section", {}, el("h2", {}, title), ...groups)));
    this.#show([...this.#rows.keys()]);
    this.#showLights();
    this.list.scrollTop = scrolled;
    if (focused) inputs(this.#rows.get(focused.path)?.row)[focused.place]?.focus({ preventScroll: true });
  }

  /** Which input of which control has the focus. */
  #focused() {
    const row = document.activeElement?.closest("[data-path]");
    return row && { path: row.dataset.path, place: inputs(row).indexOf(document.activeElement) };
  }

  #makeGroup(name, controls) {
    const { scene } = this.session;
    const [family, ...rest] = name.split(".");
    const own = rest.join(".");
    const badge = el("span", { class: "badge", hidden: true });
    const reset = el("button", {
      type: "button", class: "quiet", onclick: () => this.session.reset(this.#changed(name)),
    }, "Reset");
    const rows = controls.map((control) => this.#makeRow(control));
    const material = family === "materials" ? scene.materials.find((each) => each.name === own) : null;
    const light = family === "lights" ? scene.lights.find((each) => each.name === own) : null;
    const details = el("details", { open: this.#open.has(name), "data-group": name },
      el("summary", {},
        el("span", { class: "title" }, own || (TITLES[family] ?? family)),
        el("span", { class: "subtitle" }, material?.model ?? light?.kind ?? ""),
        badge),
      ...rows.map(({ row }) => row),
      el("p", { class: "ends" }, material?.objects?.length ? el("span", { class: "used" }, `on ${material.objects.join(", ")}`) : null, reset));
    details.addEventListener("toggle", () => (details.open ? this.#open.add(name) : this.#open.delete(name)));
    this.#groups.set(name, { details, rows, badge, reset });
    return el("div", { class: "group" }, details, light ? this.#lightSwitch(light) : null);
  }

  #makeRow(control) {
    const field = makeField(control, (value, dragging) => this.session.set(control.path, value, dragging));
    const reset = el("button", {
      type: "button", class: "reset", title: `Back to ${written(control.original)}`, "aria-label": `Reset ${control.label}`,
      onclick: () => this.session.reset([control.path]),
    }, "↺");
    const row = el("div", { class: `control ${control.kind}`, role: "group", "aria-label": control.label, "data-path": control.path },
      el("span", { class: "label", title: control.label }, control.label),
      ...field.parts, reset);
    for (const input of inputs(row)) input.setAttribute("aria-description", control.help ?? "");
    const entry = { control, row, field };
    this.#rows.set(control.path, entry);
    return entry;
  }

  #lightSwitch({ name }) {
    const box = el("input", {
      type: "checkbox", role: "switch", "aria-label": `Light ${name}`, "data-light": name,
      onchange: () => {
        const hidden = this.session.view.hidden_lights ?? [];
        this.session.look({ hidden_lights: box.checked ? hidden.filter((each) => each !== name) : [...hidden, name] });
      },
    });
    return el("label", { class: "lamp", title: `Switch ${name} on or off` }, box);
  }

  // --- showing ------------------------------------------------------------------------------------------

  #show(paths) {
    for (const path of paths) {
      const entry = this.#rows.get(path);
      if (!entry) continue;
      const value = this.session.values.get(path);
      entry.field.show(value);
      entry.row.classList.toggle("changed", !isEqual(value, entry.control.original));
    }
    for (const [name, { badge, reset }] of this.#groups) {
      const count = this.#changed(name).length;
      badge.hidden = count === 0;
      badge.textContent = String(count);
      badge.title = `${count} changed`;
      reset.disabled = count === 0;
    }
    if (this.changedOnly.checked) this.#filter();
  }

  #showLights() {
    const hidden = this.session.view.hidden_lights ?? [];
    for (const box of $$("[data-light]", this.list)) box.checked = !hidden.includes(box.dataset.light);
  }

  #changed(name) {
    return this.#groups.get(name).rows.filter(({ row }) => row.classList.contains("changed")).map(({ control }) => control.path);
  }

  #filter() {
    const words = this.words.value.toLowerCase().split(/\s+/).filter(Boolean);
    const isFiltered = words.length > 0 || this.changedOnly.checked;
    for (const [name, { details, rows }] of this.#groups) {
      let count = 0;
      for (const { control, row } of rows) {
        const text = `${control.path} ${control.label} ${control.help}`.toLowerCase();
        const isChanged = !this.changedOnly.checked || row.classList.contains("changed");
        row.hidden = !(isChanged && words.every((word) => text.includes(word)));
        count += !row.hidden;
      }
      details.parentElement.hidden = isFiltered && count === 0;
      const open = isFiltered || this.#open.has(name);
      if (details.open !== open) toggleQuietly(details, open, this.#open, name);
    }
    for (const section of $$("section", this.list)) section.hidden = $$(":scope > .group:not([hidden])", section).length === 0;
  }

  #explain(target) {
    const row = this.#rows.get(target.closest("[data-path]")?.dataset.path);
    if (!row) return;
    const { path, help, minimum, maximum, original, unit } = row.control;
    const range = minimum === null ? "" : `slider ${shown(minimum)} to ${shown(maximum)} ${unit}`.trim();
    const facts = [range, `in the file ${written(original)}`].filter(Boolean).join("; ");
    this.help.replaceChildren(
      el("code", {}, path), " ", el("span", {}, help), el("span", { class: "facts" }, facts),
    );
  }
}

/** Opens or closes a group for a filter without forgetting what the user chose. */
function toggleQuietly(details, open, chosen, name) {
  const was = chosen.has(name);
  details.open = open;
  details.addEventListener("toggle", () => (was ? chosen.add(name) : chosen.delete(name)), { once: true });
}

function inputs(row) {
  return row ? $$("input, select", row) : [];
}

function written(value) {
  if (value === null || value === undefined) return "not set";
  if (Array.isArray(value)) return `[${value.map((each) => shown(each)).join(", ")}]`;
  return typeof value === "number" ? shown(value) : String(value);
}

function isEqual(a, b) {
  if (Array.isArray(a) !== Array.isArray(b)) return [a, b].flat().every((each) => each === [a].flat()[0]);
  return JSON.stringify(a) === JSON.stringify(b);
}
