// A card: the thumbnail of a variant, its label, and buttons that take it as A or B of a comparison.
"use strict";

const SIDES = ["a", "b"];
const RATIO = REPORT.ratio; // height / width of a thumbnail

// The content of a card. `caption` is false where row and column say what the variant is.
function card(index, caption = true) {
  const failed = REPORT.errors[index];
  const label = variantLabel(index);
  const identity = REPORT.pictures[index][app.picture];
  const image = identity
    ? el("img", { src: `pictures/${identity}.jpg`, alt: "", loading: "lazy", decoding: "async", draggable: "false" })
    : el("span", { class: "lacking" }, failed ? `failed: ${failed}` : "no such picture");
  const note = sortNote(index);
  const open = el("button", {
    type: "button", class: "open", "data-index": index, tabindex: index === app.active ? 0 : -1,
    "aria-label": [`${index + 1}: ${label}`, note, failed ? `failed: ${failed}` : ""].filter(Boolean).join(", "),
    title: caption ? null : label,
    onclick: () => { app.activate(index); openDetails(index); },
    onfocus: () => app.activate(index),
  }, el("span", { class: "picture" }, image), caption ? el("span", { class: "caption" }, label) : null,
  caption && note ? el("span", { class: "note" }, note) : null);
  const sides = !identity ? [] : SIDES.map((side) => el("button", {
    type: "button", class: "side", "data-side": side, tabindex: index === app.active ? 0 : -1,
    "aria-pressed": String(app.sides[side] === index), "aria-label": `Take ${index + 1} as ${side.toUpperCase()}`,
    title: `Take as ${side.toUpperCase()} (${side})`,
    onclick: () => app.take(side, index),
  }, side.toUpperCase()));
  return [open, el("span", { class: "sides" }, ...sides)];
}

function variantLabel(index) {
  return REPORT.labels[index] || `${REPORT.noun} ${index + 1}`;
}

// The value that cards are sorted by, where the label lacks it.
function sortNote(index) {
  if (!app.sort.key.startsWith("m")) return "";
  const name = app.sort.key.slice(1);
  return `${name} ${shown(columnValues(app.sort.key)[index])}`;
}

// Shows in cards that exist which variant is active, and which are A and B.
function updateCards(root) {
  for (const open of $$("button.open", root)) {
    const index = Number(open.dataset.index);
    const holder = open.parentElement;
    for (const button of $$("button", holder)) button.tabIndex = index === app.active ? 0 : -1;
    for (const side of $$("button.side", holder)) {
      side.setAttribute("aria-pressed", String(app.sides[side.dataset.side] === index));
    }
  }
}
