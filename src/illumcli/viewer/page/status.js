// The line below the picture: how far the picture is, what it cost, how right it is, and the pixel under the mouse.

import { $ } from "./dom.js";
import { counted, shown } from "./numbers.js";

export class Status {
  #stamp = null; // of the input whose first picture is shown

  constructor() {
    this.root = $("#status");
  }

  /** The picture on the screen is older than the last input. */
  showWaiting() {
    this.root.dataset.stage = "waiting";
  }

  /**
   * Facts of the picture on the screen; its latency runs from an input to the first picture that follows it.
   * `isNewest` is false where another one is to follow the last input.
   */
  showPicture({ stage, width, height, seconds, rays, error, stamp }, isNewest) {
    if (isNewest) this.root.dataset.stage = stage;
    this.#put("stage", stage);
    this.#put("size", `${width} × ${height}`);
    this.#put("seconds", seconds < 1 ? `${shown(1000 * seconds, 3)} ms` : `${shown(seconds, 3)} s`);
    this.#put("rays", `${counted(rays ?? 0)} rays`);
    this.#put("error", error === null || error === undefined ? "" : `error ± ${shown(error, 2)}`);
    if (!stamp || stamp === this.#stamp) return;
    this.#stamp = stamp;
    const latency = performance.now() - stamp;
    this.root.dataset.latency = latency;
    this.#put("latency", `${Math.round(latency)} ms from input to picture`);
  }

  /** The pixel under the mouse; of its layers the shown one, the others in a list. */
  showPixel(pixel, layer) {
    const place = pixel ? [`${pixel.x}, ${pixel.y}`, pixel.object, pixel.material].filter(Boolean).join(" · ") : "";
    this.#put("place", place);
    const channels = pixel?.layers[layer] ?? {};
    this.#put("value", Object.entries(channels).map(([name, value]) => `${name} ${shown(value)}`).join("  "));
  }

  #put(name, text) {
    $(`[data-fact="${name}"]`, this.root).textContent = text;
  }
}
