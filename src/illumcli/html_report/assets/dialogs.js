// The dialogs: one variant with all its facts, and the comparison of two.
"use strict";

const details = $("#details");
const compare = $("#compare");
const calm = matchMedia("(prefers-reduced-motion: reduce)");
let detailsStage = null;
let compareStage = null;
let detailsOf = 0; // the variant that the dialog shows

// --- one variant --------------------------------------------------------------------------------------

function openDetails(index) {
  detailsStage ??= new Stage($(".stage", details));
  detailsOf = index;
  $("#details-title").textContent = `${index + 1}: ${variantLabel(index)}`;
  $(".facts", details).replaceChildren(...facts(index));
  const identity = REPORT.pictures[index][app.picture];
  $(".stage", details).hidden = !identity;
  if (!details.open) details.showModal();
  if (identity) detailsStage.show({ picture: identity });
}

function facts(index) {
  const list = el("dl");
  const fact = (name, ...value) => list.append(el("dt", {}, name), el("dd", {}, ...value));
  for (const { path, values, at } of REPORT.parameters) if (at[index] >= 0) fact(path, values[at[index]]);
  fact("state", REPORT.states[index]);
  if (REPORT.errors[index]) fact("message", el("span", { class: "failure" }, REPORT.errors[index]));
  for (const { name, values } of REPORT.measures) if (values[index] !== null) fact(name, shown(values[index], 6));
  REPORT.files[index].forEach((address, k) => {
    if (address) fact(REPORT.files[index].length > 1 ? `file, ${REPORT.pictureNames[k]}` : "file", el("a", { href: address }, decodeURIComponent(address)));
  });
  const command = REPORT.commands[index];
  const copied = el("output");
  const copy = el("button", {
    type: "button", onclick: async () => { copied.textContent = (await copyText(command)) ? "copied" : "select the text to copy it"; },
  }, "Copy the command");
  const take = SIDES.map((side) => el("button", { type: "button", onclick: () => app.take(side, index) }, `Take as ${side.toUpperCase()}`));
  const reference = REPORT.references[index];
  const against = reference && REPORT.pictures[index][0] && el("button", {
    type: "button",
    onclick: () => { details.close(); app.picture = 0; openCompare({ label: "reference", picture: reference }, shownVariant(index)); },
  }, "Compare with the reference");
  return [
    list,
    el("p", { class: "row" }, ...(REPORT.pictures[index].some(Boolean) ? take : []), against || null),
    el("h3", {}, "Command"),
    el("pre", { tabindex: "0" }, command),
    el("p", { class: "row" }, copy, copied),
  ];
}

details.addEventListener("click", (event) => {
  const step = Number(event.target.dataset?.step ?? 0);
  if (step) stepDetails(step);
});
details.addEventListener("keydown", (event) => {
  if (event.target.closest("pre")) return;
  if (event.key === "ArrowLeft") stepDetails(-1);
  if (event.key === "ArrowRight") stepDetails(1);
});
details.addEventListener("close", () => {
  app.activate(detailsOf); // the browser has put the focus back onto the card that it came from
  app.focus();
});

function stepDetails(step) {
  const index = app.order[app.order.indexOf(detailsOf) + step];
  if (index !== undefined) openDetails(index);
}

// --- two variants -------------------------------------------------------------------------------------

// What a side of the comparison shows: {label, picture, index}.
function shownVariant(index) {
  return { label: `${index + 1}: ${variantLabel(index)}`, picture: REPORT.pictures[index][app.picture], index };
}

const compared = { a: null, b: null };

function openCompare(a, b) {
  compareStage ??= new Stage($(".stage", compare));
  compareStage.onsplit = (share) => { $("#split").value = 100 * share; };
  Object.assign(compared, { a, b });
  if (!compare.open) compare.showModal();
  for (const slot of $$(".slot", compare)) {
    const { label, index } = compared[slot.dataset.slot];
    const step = (by, name, sign) => el("button", {
      type: "button", "aria-label": `${name} ${REPORT.noun} as ${slot.dataset.slot.toUpperCase()}`, disabled: index === undefined,
      onclick: () => stepCompared(slot.dataset.slot, by),
    }, sign);
    slot.replaceChildren(el("b", {}, slot.dataset.slot.toUpperCase()), step(-1, "Previous", "←"),
      el("span", { class: "name", title: label }, label), step(1, "Next", "→"));
  }
  compareStage.show(a, b).then(() => {
    if (!gainIsChosen) $("#gain").value = suitableGain();
    setMode();
  });
}

// Goes to the next variant in the order of the view that has a picture.
function stepCompared(side, by) {
  const { order, picture } = app;
  let place = order.indexOf(compared[side].index) + by;
  while (order[place] !== undefined && !REPORT.pictures[order[place]][picture]) place += by;
  if (order[place] === undefined) return;
  app.take(side, order[place]);
  openCompare(...SIDES.map((each) => (each === side ? shownVariant(order[place]) : compared[each])));
  $(`.slot[data-slot="${side}"] button:${by < 0 ? "first" : "last"}-of-type`, compare).focus();
}

function swap() {
  openCompare(compared.b, compared.a);
}

const mode = () => $("input[name=mode]:checked").value;

function setMode() {
  for (const group of $$("[data-mode]", $(".controls", compare))) group.hidden = group.dataset.mode !== mode();
  compareStage.setMode(mode());
  setGain();
  runFlicker(mode() === "flicker" && !calm.matches);
}

// The exponent of a gain that brings the largest difference near to white, until the user chooses one.
let gainIsChosen = false;

function suitableGain() {
  const largest = compareStage.bounds?.largest || 1;
  return clamp(Math.floor(-Math.log2(largest)), 0, 10);
}

function setGain() {
  const gain = 2 ** Number($("#gain").value);
  $("output[for=gain]").textContent = `${gain} ×`;
  compareStage.setGain(gain);
}

// Flicker changes twice a second: one flash a second, below what may harm.
let flickerTimer = 0;

function runFlicker(run) {
  clearInterval(flickerTimer);
  flickerTimer = run ? setInterval(flick, 500) : 0;
  $("#flicker-run").setAttribute("aria-pressed", String(run));
  $("#flicker-shown").textContent = compareStage.front.toUpperCase();
}

function flick() {
  compareStage.front = compareStage.front === "a" ? "b" : "a";
  $("#flicker-shown").textContent = compareStage.front.toUpperCase();
}

$("#modes").addEventListener("change", setMode);
$("#split").addEventListener("input", (event) => compareStage.setSplit(event.target.value / 100));
$("#gain").addEventListener("input", () => { gainIsChosen = true; setGain(); });
$("#zoom").addEventListener("change", (event) => compareStage.setZoom(Number(event.target.value)));
$("#swap").addEventListener("click", swap);
$("#largest").addEventListener("click", () => {
  const { bounds } = compareStage;
  if (bounds) compareStage.goTo(bounds.x, bounds.y);
});
$("#flicker-run").addEventListener("click", () => runFlicker(!flickerTimer));
$("#flicker-swap").addEventListener("click", () => { runFlicker(false); flick(); });
compare.addEventListener("close", () => { runFlicker(false); app.focus(); });
compare.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const number = ["1", "2", "3", "4"].indexOf(event.key);
  if (number >= 0) { $$("input[name=mode]")[number].checked = true; setMode(); }
  if (event.key === "x") swap();
  if (event.key === " " && mode() === "flicker" && !event.target.closest("button, input, select")) {
    event.preventDefault();
    runFlicker(false);
    flick();
  }
});

for (const dialog of $$("dialog")) {
  $(".close", dialog).addEventListener("click", () => dialog.close());
  dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });
}
