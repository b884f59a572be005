// The widgets of one control: a slider and a number, a colour well, a vector, a choice, a switch, a text.

import { asColor, asWritten, hexOf, linearOf, withStrength } from "./color.js";
import { el } from "./dom.js";
import { rounded, shown, SliderScale, STEPS } from "./numbers.js";

const SCRUB = 0.005; // of a number, or of 1, for each pixel that its name is dragged
const AXES = ["x", "y", "z", "w"];

/**
 * The field of a control.
 *
 * @param {object} control  as the server describes it
 * @param {(value: any, dragging: boolean) => void} change
 * @returns {{parts: HTMLElement[], show: (value: any) => void}}
 */
export function makeField(control, change) {
  return FIELDS[control.kind](control, change);
}

const FIELDS = { number: numeric, integer: numeric, color, vector, choice, switch: toggle, text };

function numeric(control, change) {
  const isWhole = control.kind === "integer";
  const slider = makeSlider(control, control.label, (value, dragging) => change(isWhole ? Math.round(value) : value, dragging));
  const number = makeNumber(control.label, control, (value, dragging) => change(value, dragging));
  return {
    parts: [slider.input, number.input],
    show(value) {
      slider.show(value ?? control.minimum ?? 0);
      number.show(value);
    },
  };
}

function color(control, change) {
  let value = asColor(control.value);
  const take = (next, dragging) => change(asWritten(next), dragging);
  const well = el("input", {
    type: "color", "aria-label": `${control.label}, sRGB`,
    oninput: () => pick(true),
    onchange: () => pick(false),
  });
  // a well that was opened and closed has not changed a colour that its 8 bits cannot hold
  const pick = (dragging) => take(well.value === hexOf(value) ? value : linearOf(well.value, Math.max(1, ...value)), dragging);
  const channels = ["red", "green", "blue"].map((name, k) => makeNumber(
    `${control.label}, ${name}, linear`, control,
    (each, dragging) => (each === null ? change(null, false) : take(value.with(k, each), dragging)),
  ));
  const strength = makeSlider(
    { ...control, minimum: control.minimum ?? 0 }, `${control.label}, brightness`,
    (largest, dragging) => take(withStrength(value, largest), dragging),
  );
  return {
    parts: [strength.input, well, el("span", { class: "numbers" }, ...channels.map(({ input }) => input))],
    show(next) {
      value = asColor(next);
      const isAbsent = next === null || next === undefined;
      well.value = hexOf(value);
      well.classList.toggle("absent", isAbsent);
      well.title = isAbsent ? "not set" : `linear ${value.map((each) => shown(each)).join(" ")}, sRGB ${well.value}`;
      channels.forEach((channel, k) => channel.show(isAbsent ? null : value[k]));
      strength.show(Math.max(...value));
    },
  };
}

function vector(control, change) {
  let value = control.value ?? [];
  const numbers = (control.value ?? control.default ?? [0, 0, 0]).map((_, k) => {
    const number = makeNumber(`${control.label}, ${AXES[k]}`, control, (each, dragging) => change(value.with(k, each), dragging));
    return { ...number, name: makeScrub(AXES[k], () => value[k], (each, dragging) => change(value.with(k, each), dragging)) };
  });
  return {
    parts: [el("span", { class: "numbers" }, ...numbers.map(({ name, input }) => el("span", { class: "axis" }, name, input)))],
    show(next) {
      value = next ?? [];
      numbers.forEach((number, k) => number.show(value[k]));
    },
  };
}

function choice(control, change) {
  const none = control.optional ? [el("option", { value: "" }, "–")] : [];
  const select = el("select", {
    "aria-label": control.label,
    onchange: () => change(control.choices.find((each) => String(each) === select.value) ?? null, false),
  }, ...none, ...control.choices.map((each) => el("option", { value: String(each) }, String(each))));
  return { parts: [select], show: (value) => { select.value = value ?? ""; } };
}

function toggle(control, change) {
  const box = el("input", { type: "checkbox", role: "switch", "aria-label": control.label, onchange: () => change(box.checked, false) });
  return { parts: [box], show: (value) => { box.checked = Boolean(value); } };
}

function text(control, change) {
  const field = el("input", {
    type: "text", spellcheck: "false", "aria-label": control.label,
    onchange: () => change(field.value === "" && control.optional ? null : field.value, false),
  });
  return { parts: [field], show: (value) => { if (document.activeElement !== field) field.value = value ?? ""; } };
}

// --- parts ----------------------------------------------------------------------------------------------

function makeSlider(control, label, change) {
  const scale = new SliderScale(control);
  const give = (dragging) => change(scale.value(input.valueAsNumber), dragging);
  const input = el("input", {
    type: "range", min: 0, max: STEPS, "aria-label": `${label}, slider`, oninput: () => give(true), onchange: () => give(false),
  });
  return {
    input,
    show(value) {
      if (scale.value(input.valueAsNumber) !== value) input.value = scale.place(value);
      input.setAttribute("aria-valuetext", shown(value));
    },
  };
}

/** A number field. While it is written in, only complete numbers within the limits count. */
function makeNumber(label, control, change) {
  const input = el("input", {
    type: "number", step: control.kind === "integer" ? 1 : "any", "aria-label": label,
    placeholder: control.optional ? "–" : null,
    onkeydown: (event) => {
      const step = { ArrowUp: 1, ArrowDown: -1 }[event.key];
      if (!step || input.value === "") return;
      event.preventDefault();
      give(stepped(input.valueAsNumber, step * (event.shiftKey ? 10 : 1), control.kind === "integer"), false);
    },
    oninput: () => { if (Number.isFinite(input.valueAsNumber) && isWithin(input.valueAsNumber)) change(input.valueAsNumber, true); },
    onchange: () => {
      if (Number.isFinite(input.valueAsNumber)) change(input.valueAsNumber, false);
      else if (control.optional) change(null, false);
      else show(last);
    },
  });
  let last = null;
  const isWithin = (value) => value >= (control.minimum ?? -Infinity) && value <= (control.maximum ?? Infinity);
  const give = (value, dragging) => { input.value = value; change(value, dragging); };
  const show = (value) => {
    last = value;
    if (document.activeElement === input && input.valueAsNumber === value) return;
    input.value = value === null || value === undefined ? "" : rounded(value, 6);
  };
  return { input, show };
}

/** The number one step of its last digits further. */
function stepped(value, count, isWhole) {
  if (isWhole) return value + count;
  const step = 10 ** Math.floor(Math.log10(Math.max(Math.abs(value), 0.1)) - 1);
  return rounded(Math.round(value / step + count) * step, 6);
}

/** The name of a number, which is changed by dragging it sideways. */
function makeScrub(name, current, change) {
  let start = null; // {x, value}
  const scrub = el("span", {
    class: "scrub", title: `Drag to change ${name}`, "aria-hidden": "true",
    onpointerdown: (event) => {
      scrub.setPointerCapture(event.pointerId);
      start = { x: event.clientX, value: current() ?? 0 };
      event.preventDefault();
    },
    onpointermove: (event) => { if (start) change(at(event), true); },
    onpointerup: (event) => {
      if (start && at(event) !== start.value) change(at(event), false);
      start = null;
    },
    onpointercancel: () => { start = null; },
  }, name);
  const at = ({ clientX }) => rounded(start.value + (clientX - start.x) * SCRUB * Math.max(1, Math.abs(start.value)), 4);
  return scrub;
}
