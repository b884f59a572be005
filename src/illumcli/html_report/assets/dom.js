// Small helpers for the document. All text goes through textContent: nothing in the data is ever read as HTML.
"use strict";

const $ = (selector, root = document) => root.querySelector(selector);
const $$ = (selector, root = document) => [...root.querySelectorAll(selector)];

// A new element: el("button", {type: "button", onclick: f, "aria-label": "x"}, "text", child, ...).
function el(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (name === "class") node.className = value;
    else if (value !== null && value !== false) node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null));
  return node;
}

// A number with as many digits as a reader needs: 0.04217, 12.5, 1,234,567.
function shown(number, digits = 4) {
  if (number === null || number === undefined) return "–";
  if (Number.isInteger(number) || Math.abs(number) >= 10 ** digits) {
    return Math.round(number).toLocaleString("en");
  }
  const size = Math.abs(number);
  return size !== 0 && size < 1e-4 ? number.toExponential(digits - 2) : String(Number(number.toPrecision(digits)));
}

function clamp(value, low, high) {
  return Math.min(Math.max(value, low), high);
}

// Calls `work` once in the next frame, however often the result is called until then.
function oncePerFrame(work) {
  let waiting = 0;
  return () => {
    if (!waiting) waiting = requestAnimationFrame(() => { waiting = 0; work(); });
  };
}

// Copies a text, from pages on disk, too, where some browsers have no clipboard interface.
async function copyText(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    const field = el("textarea", { class: "hidden" });
    field.value = text;
    (document.querySelector("dialog[open]") ?? document.body).append(field);
    field.select();
    const done = document.execCommand("copy");
    field.remove();
    return done;
  }
}
