// Colours: scenes hold linear light, screens and colour wells sRGB with 8 bits.

import { rounded } from "./numbers.js";

export function toSrgb(linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * linear ** (1 / 2.4) - 0.055;
}

export function fromSrgb(encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : ((encoded + 0.055) / 1.055) ** 2.4;
}

/** The three numbers of a colour, which a scene may give as one for grey. */
export function asColor(value) {
  return Array.isArray(value) ? value : [value, value, value].map((each) => Number(each) || 0);
}

/** As short as a scene may write it: one number for grey. */
export function asWritten(color) {
  return color.every((each) => each === color[0]) ? color[0] : color;
}

/** What a colour well shows of a linear colour: the colour itself, or, above 1, its hue at full brightness. */
export function hexOf(color) {
  const scale = Math.max(1, ...color);
  const bytes = color.map((each) => Math.round(255 * toSrgb(Math.min(Math.max(each / scale, 0), 1))));
  return `#${bytes.map((byte) => byte.toString(16).padStart(2, "0")).join("")}`;
}

/** The linear colour of a well; `scale` is the brightness of a colour above 1. */
export function linearOf(hex, scale = 1) {
  return [1, 3, 5].map((at) => rounded(scale * fromSrgb(parseInt(hex.slice(at, at + 2), 16) / 255), 3));
}

/** The same hue with its largest channel at `strength`; black becomes grey. */
export function withStrength(color, strength) {
  const largest = Math.max(...color);
  return color.map((each) => rounded(largest > 0 ? (each / largest) * strength : strength));
}
