// Mouse, touch and keys on the picture: orbit, pan, dolly, and the point under the pointer.

import { whenQuiet } from "./dom.js";

const CLICK = 4; // a press that moves less is a click [CSS pixels]
const KEY_STEP = 0.04; // of the picture's height, for each key press
const WHEEL_STEP = 0.0015; // for each pixel that the wheel scrolls
const SILENCE = 250; // after which turning the wheel or holding a key has ended [ms]
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const ZOOMS = { "+": 1, "=": 1, PageUp: 1, "-": -1, PageDown: -1 };

/**
 * Listens to the picture's frame.
 *
 * @param {HTMLElement} frame
 * @param {{move: Function, hover: Function, click: Function}} does  `move(motion, dragging)`; `hover(point)` with null
 *   outside; `click(point)`. Points are fractions of the picture from its top left.
 */
export function listenToGestures(frame, does) {
  let pressed = null; // {x, y, kind, isMoved}

  frame.addEventListener("pointerdown", (event) => {
    frame.setPointerCapture(event.pointerId);
    const kind = event.shiftKey || event.button !== 0 ? "pan" : "orbit";
    pressed = { x: event.clientX, y: event.clientY, kind, isMoved: false };
  });
  frame.addEventListener("pointermove", (event) => {
    if (!pressed) {
      does.hover(pointOf(event));
      return;
    }
    const [x, y] = [event.clientX - pressed.x, event.clientY - pressed.y];
    if (!pressed.isMoved && Math.hypot(x, y) < CLICK) return;
    Object.assign(pressed, { x: event.clientX, y: event.clientY, isMoved: true });
    does.move({ [pressed.kind]: [x / frame.clientHeight, y / frame.clientHeight] }, true);
  });
  const release = (event) => {
    if (pressed?.isMoved) does.move({ [pressed.kind]: [0, 0] }, false);
    else if (pressed && event.type === "pointerup" && event.button === 0) does.click(pointOf(event));
    pressed = null;
  };
  frame.addEventListener("pointerup", release);
  frame.addEventListener("pointercancel", release);
  frame.addEventListener("pointerleave", () => does.hover(null));
  frame.addEventListener("contextmenu", (event) => event.preventDefault());

  const endOf = {
    dolly: whenQuiet(SILENCE, () => does.move({ dolly: 0 }, false)),
    orbit: whenQuiet(SILENCE, () => does.move({ orbit: [0, 0] }, false)),
    pan: whenQuiet(SILENCE, () => does.move({ pan: [0, 0] }, false)),
  };
  const step = (kind, amount) => {
    does.move({ [kind]: amount }, true);
    endOf[kind]();
  };
  frame.addEventListener("wheel", (event) => {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 33 : 1);
    step("dolly", -pixels * WHEEL_STEP);
  }, { passive: false });
  frame.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const arrow = ARROWS[event.key];
    const zoom = ZOOMS[event.key];
    if (arrow) step(event.shiftKey ? "pan" : "orbit", arrow.map((each) => each * KEY_STEP));
    else if (zoom) step("dolly", zoom * KEY_STEP);
    else if (event.key === "Enter") does.click({ x: 0.5, y: 0.5 });
    else return;
    event.preventDefault();
  });

  function pointOf(event) {
    const box = frame.getBoundingClientRect();
    const point = { x: (event.clientX - box.left) / box.width, y: (event.clientY - box.top) / box.height };
    return point.x >= 0 && point.x < 1 && point.y >= 0 && point.y < 1 ? point : null;
  }
}
