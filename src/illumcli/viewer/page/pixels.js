// Pictures and arrays that come inside JSON, as base64.

export function bytesOf(base64) {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
}

/** Draws {width, height, pixels}: RGBA bytes, sRGB, not premultiplied. */
export function drawPixels(canvas, { width, height, pixels }) {
  Object.assign(canvas, { width, height });
  canvas.getContext("2d").putImageData(new ImageData(new Uint8ClampedArray(bytesOf(pixels)), width, height), 0, 0);
}

/** A canvas made as sharp as the screen, cleared, with CSS pixels as its unit. */
export function cleared(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas;
  canvas.width = Math.round(width * devicePixelRatio);
  canvas.height = Math.round(height * devicePixelRatio);
  const context = canvas.getContext("2d");
  context.scale(devicePixelRatio, devicePixelRatio);
  return { context, width, height };
}
