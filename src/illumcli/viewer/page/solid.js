// The lobe in space: a shaded surface of quads, drawn from the back to the front, with the light and the horizon.

import { hexOf, linearOf } from "./color.js";
import { bytesOf, cleared } from "./pixels.js";

const SUN = [0.35, 0.45, 0.82]; // direction to the light that shades the surface, in the eye's axes
const AMBIENT = 0.25; // share of it that comes from everywhere
const GLOSS = { strength: 0.5, exponent: 12 };
const TONES = 32; // of the surface

/**
 * Draws a lobe.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {{rows: number, columns: number, points: string}} lobe  points as float32 in base64, of unit size, z upwards
 * @param {{color: string, incident: number[], azimuth: number, elevation: number}} how  angles of the eye [degrees]
 */
export function drawSolid(canvas, { rows, columns, points }, { color, incident, azimuth, elevation }) {
  const { context, width, height } = cleared(canvas);
  const style = getComputedStyle(canvas);
  const scale = Math.min(width / 2.1, height / 1.42);
  const eye = eyeAxes(azimuth, elevation);
  const project = ([x, y, z]) => eye.map((axis) => axis[0] * x + axis[1] * y + axis[2] * z);
  context.translate(width / 2, height * 0.7);
  context.scale(scale, -scale);

  // the horizon, the normal, the light
  context.lineWidth = 1 / scale;
  context.strokeStyle = style.getPropertyValue("--grid");
  context.beginPath();
  for (let k = 0; k <= 72; k++) {
    const angle = (k * Math.PI) / 36;
    context.lineTo(...project([Math.cos(angle), Math.sin(angle), 0]).slice(0, 2));
  }
  context.stroke();
  line(context, project([0, 0, 0]), project([0, 0, 1]));

  const flat = new Float32Array(bytesOf(points).buffer);
  const seen = Array.from({ length: rows * columns }, (_, k) => project(flat.subarray(3 * k, 3 * k + 3)));
  const quads = [];
  for (let r = 0; r + 1 < rows; r++) {
    for (let c = 0; c + 1 < columns; c++) {
      const [a, b, d, e] = [r * columns + c, r * columns + c + 1, (r + 1) * columns + c + 1, (r + 1) * columns + c].map((k) => seen[k]);
      quads.push({ corners: [a, b, d, e], depth: a[2] + b[2] + d[2] + e[2], shade: shadeOf(a, b, d, e) });
    }
  }
  quads.sort((first, second) => first.depth - second.depth);
  const linear = linearOf(color);
  const tones = Array.from({ length: TONES }, (_, k) => hexOf(toneOf(linear, k / (TONES - 1))));
  for (const { corners, shade } of quads) {
    context.fillStyle = context.strokeStyle = tones[Math.round(shade * (TONES - 1))];
    context.beginPath();
    for (const [x, y] of corners) context.lineTo(x, y);
    context.closePath();
    context.fill();
    context.stroke(); // closes the seams between quads
  }

  context.lineWidth = 2.5 / scale;
  context.strokeStyle = context.fillStyle = style.getPropertyValue("--light");
  const light = project(incident);
  line(context, project([0, 0, 0]), light);
  context.beginPath();
  context.arc(light[0], light[1], 5 / scale, 0, 2 * Math.PI);
  context.fill();
}

/** The colour of a quad that is lit this brightly. */
function toneOf(linear, shade) {
  const gloss = GLOSS.strength * shade ** GLOSS.exponent;
  return linear.map((each) => Math.min(1, each * (AMBIENT + (1 - AMBIENT) * shade) + gloss));
}

/** How brightly a quad with these corners is lit, from either side: 0 to 1. */
function shadeOf(a, b, d) {
  const [u, v] = [b, d].map((corner) => corner.map((each, k) => each - a[k]));
  const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const length = Math.hypot(...normal);
  if (length === 0) return 0.5;
  return Math.abs(normal.reduce((sum, each, k) => sum + each * SUN[k], 0)) / length;
}

/** Right, up and towards the eye, for an eye at these angles around z. */
function eyeAxes(azimuth, elevation) {
  const [a, e] = [azimuth, elevation].map((degrees) => (degrees * Math.PI) / 180);
  return [
    [-Math.sin(a), Math.cos(a), 0],
    [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)],
    [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)],
  ];
}

function line(context, from, to) {
  context.beginPath();
  context.moveTo(from[0], from[1]);
  context.lineTo(to[0], to[1]);
  context.stroke();
}
