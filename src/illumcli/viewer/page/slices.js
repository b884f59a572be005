// Polar slices of several models in the plane of incidence: the normal upwards, the light on the left.

import { shown } from "./numbers.js";
import { cleared } from "./pixels.js";

const MARGIN = { side: 26, top: 22, bottom: 20 };
const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3], [14, 4]]; // curves differ without colour, too

export class Slices {
  /** `aim` is called with the angle of the light [degrees] that a drag means. */
  constructor(canvas, aim) {
    this.canvas = canvas;
    const turn = (event) => {
      if (!event.buttons) return;
      const box = canvas.getBoundingClientRect();
      const { x, y } = this.centre;
      const [across, up] = [event.clientX - box.left - x, y - (event.clientY - box.top)];
      aim(Math.round(Math.abs((Math.atan2(across, Math.max(up, 1)) * 180) / Math.PI)));
    };
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); turn(event); });
    canvas.addEventListener("pointermove", turn);
  }

  draw({ lobes, theta, top, log, decades, quantity }, colors) {
    const { context, width, height } = cleared(this.canvas);
    const style = getComputedStyle(this.canvas);
    const radius = Math.max(10, Math.min(width / 2 - MARGIN.side, height - MARGIN.top - MARGIN.bottom));
    this.centre = { x: width / 2, y: MARGIN.top + radius };
    context.translate(this.centre.x, this.centre.y);
    context.font = `11px ${style.fontFamily}`;
    this.#drawGrid(context, radius, { style, top, log, decades });

    // the light and its mirror direction
    context.strokeStyle = context.fillStyle = style.getPropertyValue("--light");
    context.lineWidth = 2;
    ray(context, -theta, 0, radius);
    context.beginPath();
    context.arc(...at(-theta, radius), 5, 0, 2 * Math.PI);
    context.fill();
    context.setLineDash([3, 4]);
    context.lineWidth = 1;
    ray(context, theta, 0, radius);

    lobes.forEach(({ slice, problem }, k) => {
      if (problem) return;
      context.strokeStyle = colors[k];
      context.lineWidth = 2;
      context.setLineDash(DASHES[k]);
      context.beginPath();
      slice.angles.forEach((angle, i) => context.lineTo(...at(angle, radius * Math.min(slice.radius[i], 1))));
      context.stroke();
    });
    context.setLineDash([]);
    context.fillStyle = style.color;
    context.textAlign = "left";
    context.fillText(quantity, -this.centre.x, 12 - this.centre.y);
  }

  #drawGrid(context, radius, { style, top, log, decades }) {
    context.strokeStyle = style.getPropertyValue("--grid");
    context.fillStyle = style.getPropertyValue("--quiet");
    context.lineWidth = 1;
    const rings = log ? Array.from({ length: decades }, (_, k) => (k + 1) / decades) : [0.25, 0.5, 0.75, 1];
    for (const ring of rings) {
      context.beginPath();
      context.arc(0, 0, radius * ring, Math.PI, 0);
      context.stroke();
    }
    for (const angle of [-90, -60, -30, 0, 30, 60, 90]) {
      ray(context, angle, 0, radius);
      const [x, y] = at(angle, radius + 12);
      context.textAlign = angle < 0 ? "right" : angle > 0 ? "left" : "center";
      if (Math.abs(angle) < 90) context.fillText(`${Math.abs(angle)}°`, x + 4 * Math.sign(angle), y + 4);
    }
    context.textAlign = "center";
    for (const ring of log ? rings : [0.5, 1]) {
      const value = log ? top * 10 ** ((ring - 1) * decades) : top * ring;
      context.fillText(log ? value.toExponential(0).replace("e+", "e") : shown(value, 3), radius * ring, MARGIN.bottom - 5);
    }
  }
}

/** The place at an angle from the normal [degrees], to the right where positive. */
function at(angle, radius) {
  const radians = (angle * Math.PI) / 180;
  return [radius * Math.sin(radians), -radius * Math.cos(radians)];
}

function ray(context, angle, from, to) {
  context.beginPath();
  context.moveTo(...at(angle, from));
  context.lineTo(...at(angle, to));
  context.stroke();
}
