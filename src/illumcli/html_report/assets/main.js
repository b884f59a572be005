// The page: filters, order, views and keys.
"use strict";

const main = $("#main");
const filters = $("#filters");
const VIEWS = { gallery: Gallery, grid: Grid, table: Table };
const MOVES = ["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Home", "End", "PageUp", "PageDown"];

const app = {
  order: [], // the variants that are shown, in their order
  active: 0, // the one that keys act on
  sides: { a: null, b: null },
  picture: 0,
  size: matchMedia("(max-width: 50rem)").matches ? 150 : Number($("#size").value),
  sort: { key: "", descending: false },
  axes: firstAxes(),
  view: null,

  // Filters and sorts anew, and shows the result.
  update() {
    app.order = ordered(matching(chosenFilters(), $("#search").value), app.sort.key, app.sort.descending);
    if (!app.order.includes(app.active)) app.active = app.order[0] ?? -1;
    $("#count").textContent = `${app.order.length.toLocaleString("en")} of ${COUNT.toLocaleString("en")} ${REPORT.noun}s`;
    main.scrollTop = 0;
    app.view.show(app.order);
    main.classList.toggle("none", !app.order.length);
  },

  setView(name) {
    main.replaceChildren();
    main.dataset.view = name;
    $("#axes").hidden = name !== "grid";
    $("#sorting").hidden = name === "grid";
    $("#sizing").hidden = name === "table";
    app.view = new VIEWS[name](main);
    app.update();
    main.classList.toggle("small", app.size < 140);
    if (app.active >= 0) app.view.reveal(app.active);
  },

  sortBy(key, descending) {
    app.sort = { key, descending };
    $("#sort").value = key;
    const button = $("#direction");
    button.setAttribute("aria-pressed", String(descending));
    button.textContent = descending ? "↓" : "↑";
    app.update();
  },

  activate(index) {
    if (app.active === index) return;
    app.active = index;
    updateCards(main);
  },

  // Puts the keyboard's focus onto the active card.
  focus() {
    if (app.active < 0) return;
    app.view.reveal(app.active);
    $(`button.open[data-index="${app.active}"]`, main)?.focus({ preventScroll: true });
  },

  // Takes a variant as side A or B, or puts it back.
  take(side, index) {
    app.sides[side] = app.sides[side] === index && !$("dialog[open]") ? null : index;
    updateCards(main);
    showTray();
  },
};

function firstAxes() {
  const count = REPORT.parameters.length;
  return { x: Math.max(0, count - 1), y: count > 1 ? count - 2 : -1, held: REPORT.parameters.map(() => (isFullGrid() ? 0 : -1)) };
}

// --- filters ------------------------------------------------------------------------------------------

function chosenFilters() {
  const chosen = [];
  for (const field of $$("fieldset[data-filter]", filters)) {
    const key = field.dataset.filter;
    if (field.classList.contains("values")) {
      const values = $$("input:checked", field).map(({ value }) => (key === "state" ? value : Number(value)));
      if (values.length) chosen.push({ key, values: new Set(values) });
    } else {
      const [low, high] = $$("input", field).map((input) => input.valueAsNumber);
      if (!Number.isNaN(low) || !Number.isNaN(high)) chosen.push({ key, low, high });
    }
  }
  $("#filters-toggle").textContent = chosen.length ? `Filters (${chosen.length})` : "Filters";
  return chosen;
}

filters.addEventListener("input", oncePerFrame(app.update));
filters.addEventListener("submit", (event) => event.preventDefault());
filters.addEventListener("reset", () => { $("#search").value = ""; setTimeout(app.update); });
$("#search").addEventListener("input", oncePerFrame(app.update));
$("#filters-toggle").addEventListener("click", (event) => {
  const open = document.body.classList.toggle("filtering");
  event.currentTarget.setAttribute("aria-expanded", String(open));
});

// --- views --------------------------------------------------------------------------------------------

$("#views").addEventListener("change", (event) => app.setView(event.target.value));
$("#sort").addEventListener("change", (event) => app.sortBy(event.target.value, app.sort.descending));
$("#direction").addEventListener("click", () => app.sortBy(app.sort.key, !app.sort.descending));
$("#size").addEventListener("input", (event) => {
  app.size = Number(event.target.value);
  main.classList.toggle("small", app.size < 140);
  app.view.layout();
});
$("#picture")?.addEventListener("change", (event) => { app.picture = Number(event.target.value); app.update(); });
main.addEventListener("scroll", oncePerFrame(() => app.view.draw()), { passive: true });
new ResizeObserver(oncePerFrame(() => app.view?.layout())).observe(main);

function showAxes() {
  const { x, y, held } = app.axes;
  $("#axis-x").value = x;
  $("#axis-y").value = y;
  for (const group of $$("[data-held]")) {
    const p = Number(group.dataset.held);
    group.hidden = p === x || p === y;
    $("input", group).value = held[p];
    $("output", group).textContent = held[p] < 0 ? "any" : REPORT.parameters[p].texts[held[p]];
  }
}

$("#axes").addEventListener("input", ({ target }) => {
  const { axes } = app;
  const value = Number(target.value);
  if (target.id === "axis-x") Object.assign(axes, { x: value, y: axes.y === value ? axes.x : axes.y });
  else if (target.id === "axis-y") Object.assign(axes, { y: value, x: axes.x === value && axes.y >= 0 ? axes.y : axes.x });
  else axes.held[target.closest("[data-held]").dataset.held] = value;
  if (axes.x === axes.y) axes.y = -1;
  showAxes();
  app.update();
});

// --- comparison ---------------------------------------------------------------------------------------

function showTray() {
  const { a, b } = app.sides;
  $("#tray").hidden = a === null && b === null;
  for (const slot of $$(".slot", $("#tray"))) {
    const side = slot.dataset.slot;
    const index = app.sides[side];
    const label = index === null ? `take a ${REPORT.noun} as ${side.toUpperCase()}` : `${index + 1}: ${variantLabel(index)}`;
    slot.replaceChildren(el("b", {}, side.toUpperCase()), el("span", { class: "name", title: label }, label), index === null ? null
      : el("button", { type: "button", "aria-label": `Put ${side.toUpperCase()} back`, onclick: () => app.take(side, index) }, "✕"));
  }
  $("#compare-open").disabled = !canCompare();
}

function canCompare() {
  return SIDES.every((side) => app.sides[side] !== null && REPORT.pictures[app.sides[side]][app.picture]);
}

function compareSides() {
  if (canCompare()) openCompare(...SIDES.map((side) => shownVariant(app.sides[side])));
}

$("#compare-open").addEventListener("click", compareSides);

// --- keys ---------------------------------------------------------------------------------------------

$("#help-open").addEventListener("click", () => $("#help").showModal());
document.addEventListener("keydown", (event) => {
  if ($("dialog[open]") || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.target.closest("input, select, textarea")) {
    if (event.key === "Escape") event.target.blur();
    return;
  }
  const isCard = event.target.closest("#main") || event.target === document.body;
  if (isCard && MOVES.includes(event.key) && app.active >= 0) {
    event.preventDefault();
    app.activate(app.view.next(event.key));
    app.focus();
  } else if ((event.key === "a" || event.key === "b") && app.active >= 0 && REPORT.pictures[app.active][app.picture]) {
    app.take(event.key, app.active);
  } else if (event.key === "c") compareSides();
  else if (event.key === "/") { event.preventDefault(); $("#search").focus(); }
  else if (event.key === "?") $("#help").showModal();
});

// --- begin --------------------------------------------------------------------------------------------

{
  const total = (name) => {
    const values = REPORT.measures.find((measure) => measure.name === name)?.values ?? [];
    return values.reduce((sum, value) => sum + (value ?? 0), 0);
  };
  const failed = REPORT.errors.filter(Boolean).length;
  $("#summary").textContent = [
    `${COUNT.toLocaleString("en")} ${REPORT.noun}s`, failed ? `${failed} failed` : "", `${shown(REPORT.seconds, 3)} s`,
    `${shown(total("rays"))} rays`, `illum ${REPORT.illum}`,
  ].filter(Boolean).join(" · ");
}
showAxes();
app.setView("gallery");
