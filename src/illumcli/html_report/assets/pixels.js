// Values of pictures, from the script beside each thumbnail (html_report/picture_files.py writes it).
"use strict";

const MOST_PICTURES = 12; // held in memory
const pictureScripts = new Map(); // identity -> {resolve, reject} while its script is loading
const pictures = new Map(); // identity -> promise of a picture, the least recently used first

// Called by the script of a picture.
function illumPixels(identity, data) {
  pictureScripts.get(identity)?.resolve(data);
}

// The picture with this identity: width, height, channels, `stored` values as in its file, `linear` values.
function loadPicture(identity) {
  const known = pictures.get(identity);
  const loading = known ?? scriptOf(identity).then(unpacked);
  pictures.delete(identity);
  pictures.set(identity, loading);
  loading.catch(() => pictures.delete(identity));
  if (pictures.size > MOST_PICTURES) pictures.delete(pictures.keys().next().value);
  return loading;
}

function scriptOf(identity) {
  return new Promise((resolve, reject) => {
    const script = el("script", { src: `pictures/${identity}.js` });
    const finish = (act) => (value) => { script.remove(); pictureScripts.delete(identity); act(value); };
    pictureScripts.set(identity, { resolve: finish(resolve) });
    script.addEventListener("error", finish(() => reject(new Error("the values of this picture are missing"))));
    document.head.append(script);
  });
}

async function unpacked(data) {
  const letters = atob(data.data);
  const bytes = new Uint8Array(letters.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = letters.charCodeAt(k);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const stored = values(planes, data);
  return { ...data, data: null, stored, linear: linearValues(stored, data) };
}

// The values of all channels, channel after channel, from byte planes of differences.
function values(planes, { width, height, channels, type }) {
  for (let row = 0; row < planes.length; row += width) {
    for (let k = row + 1; k < row + width; k++) planes[k] += planes[k - 1];
  }
  const count = width * height;
  const size = { uint8: 1, float16: 2, float32: 4 }[type];
  if (size === 1) return planes;
  const joined = new Uint8Array(planes.length);
  for (let c = 0; c < channels; c++) {
    for (let b = 0; b < size; b++) {
      const from = (c * size + b) * count;
      for (let k = 0; k < count; k++) joined[(c * count + k) * size + b] = planes[from + k];
    }
  }
  const view = new DataView(joined.buffer);
  const numbers = new Float32Array(count * channels);
  for (let k = 0; k < numbers.length; k++) {
    numbers[k] = size === 2 ? halves()[view.getUint16(2 * k, true)] : view.getFloat32(4 * k, true);
  }
  return numbers;
}

// Every number of 16 bits, made when it is first needed.
const halves = (() => {
  let table = null;
  return () => (table ??= Float32Array.from({ length: 65536 }, (_, bits) => half(bits)));
})();

// The number that 16 bits stand for (IEEE 754 binary16).
function half(bits) {
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  const sign = bits & 0x8000 ? -1 : 1;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

function fromSrgb(value) {
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}

function toSrgb(value) {
  return value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055;
}

const SRGB_STEPS = Float32Array.from({ length: 256 }, (_, k) => fromSrgb(k / 255));
const SRGB_CODES = Uint8ClampedArray.from({ length: 4097 }, (_, k) => Math.round(255 * toSrgb(k / 4096)));

function srgbByte(linear) {
  // the table is exact to half a step except near black, where the curve is steep
  return linear < 0.02 ? Math.round(255 * toSrgb(Math.max(linear, 0))) : SRGB_CODES[Math.round(4096 * Math.min(linear, 1))];
}

// Linear light of the scene, without exposure. Pictures of data keep their numbers, 0 to 1 in a PNG.
function linearValues(stored, { type, display, exposure, reading }) {
  if (!display) return stored;
  const scale = reading ? 1 : 2 ** -exposure;
  const one = (value) => (reading ? value : fromSrgb(value)) * scale;
  if (type !== "uint8") return Float32Array.from(stored, one);
  const table = Float32Array.from({ length: 256 }, (_, k) => (reading ? k / 255 : SRGB_STEPS[k] * scale));
  const linear = new Float32Array(stored.length);
  for (let k = 0; k < stored.length; k++) linear[k] = table[stored[k]];
  return linear;
}

// ImageData of a picture as a screen shows it.
function displayed(picture) {
  const { stored, type, display, exposure } = picture;
  const scale = 2 ** exposure;
  if (type === "uint8") return imageData(picture, (k) => stored[k]);
  return imageData(picture, display ? (k) => 255 * stored[k] : (k) => srgbByte(stored[k] * scale));
}

// ImageData of |b - a| times a gain, as linear light; null if sizes differ.
function difference(a, b, gain) {
  if (!isComparable(a, b)) return null;
  return imageData(a, (k) => srgbByte(Math.abs(b.linear[k] - a.linear[k]) * gain));
}

function isComparable(a, b) {
  return a.width === b.width && a.height === b.height && a.channels === b.channels;
}

function imageData({ width, height, channels }, byte) {
  const image = new ImageData(width, height);
  const count = width * height;
  for (let k = 0; k < count; k++) {
    for (let c = 0; c < 3; c++) image.data[4 * k + c] = byte(channels === 3 ? c * count + k : k);
    image.data[4 * k + 3] = 255;
  }
  return image;
}

// RMSE over all values, the largest difference and its pixel.
function measuredDifference(a, b) {
  const count = a.width * a.height;
  let square = 0;
  let largest = -1;
  let place = 0;
  for (let k = 0; k < a.linear.length; k++) {
    const d = Math.abs(b.linear[k] - a.linear[k]);
    square += d * d;
    if (d > largest) { largest = d; place = k % count; }
  }
  return { rmse: Math.sqrt(square / a.linear.length), largest, x: place % a.width, y: Math.floor(place / a.width) };
}

// Values of the pixel x, y, and whether any was cut off at white in an 8-bit file of light.
function pixelValues(picture, x, y) {
  const { width, height, channels, linear, stored, type, reading } = picture;
  const count = width * height;
  const at = Array.from({ length: channels }, (_, c) => c * count + y * width + x);
  const isWhite = type === "uint8" && !reading;
  return at.map((k) => ({ value: linear[k], cut: isWhite && stored[k] === 255 }));
}
