// Small helpers for the document. All text goes through textContent: nothing that the server sends is read as HTML.

export const $ = (selector, root = document) => root.querySelector(selector);
export const $$ = (selector, root = document) => [...root.querySelectorAll(selector)];

/** A new element: el("button", {type: "button", onclick: f, "aria-label": "x"}, "text", child, ...). */
export function el(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

/** Fills a list of choices and keeps what is chosen where it is still there. */
export function fillChoices(select, choices, chosen = select.value) {
  select.replaceChildren(...choices.map(({ value, text, title }) => el("option", { value, title }, text ?? value)));
  select.value = chosen;
}

/** Calls `act` when no call has come for some milliseconds. */
export function whenQuiet(milliseconds, act) {
  let timer = 0;
  return () => {
    clearTimeout(timer);
    timer = setTimeout(act, milliseconds);
  };
}
