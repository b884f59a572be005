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
  showPicture({ stage, width, height, seconds, rays, stated, stamp }, isNewest) {
    if (isNewest) this.root.dataset.stage = stage;
    this.#put("stage", stage);
    this.#put("size", `${width} × ${height}`);
    this.#put("seconds", seconds < 1 ? `${shown(1000 * seconds, 3)} ms` : `${shown(seconds, 3)} s`);
    this.#put("rays", `${counted(rays ?? 0)} rays`);
    this.#showError(stage, stated);
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

  /** The error that was stated last, and of which picture, if it is not the one on the screen. */
  #showError(stage, stated) {
    const isOwn = stated && !stated.is_earlier && stated.stage === stage;
    const of = !stated || isOwn ? "" : stated.is_earlier ? "earlier picture: " : `${stated.stage}: `;
    this.#put("error", stated ? `${of}error ± ${shown(stated.error, 2)}` : "");
    $('[data-fact="error"]', this.root).classList.toggle("earlier", Boolean(stated?.is_earlier));
  }

  #put(name, text) {
    $(`[data-fact="${name}"]`, this.root).textContent = text;
  }
}
