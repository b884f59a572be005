// Cards of the BRDF panel, one for each model: its lobe in space, a lit sphere, a lit plane.

import { $, el } from "./dom.js";
import { clamp } from "./numbers.js";
import { drawPixels } from "./pixels.js";
import { drawSolid } from "./solid.js";

const DRAG = 0.5; // degrees for each pixel
const KEY_STEP = 5; // degrees

export class LobeCards {
  #turn = { azimuth: -65, elevation: 24 }; // of the eye around the lobes [degrees]

  /** `does.turnLight(theta, phi)` gets differences in degrees, `does.remove(of)` what is compared no more. */
  constructor(root, does) {
    this.root = root;
    this.does = does;
  }

  /** Draws the lobes of an answer; `colors` are those of its curves. */
  draw({ lobes, incident }, colors) {
    const names = lobes.map(({ of, problem }) => JSON.stringify([of, Boolean(problem)]));
    const isSame = names.join() === [...this.root.children].map((card) => card.dataset.name).join();
    if (!isSame) this.root.replaceChildren(...lobes.map((each, k) => this.#makeCard(each, names[k], k + 1)));
    lobes.forEach(({ label, title, problem, lobe, sphere, plane }, k) => {
      const card = this.root.children[k];
      $(".name", card).textContent = label;
      $(".title", card).textContent = title ?? "";
      if (problem) {
        $(".trouble", card).textContent = problem;
        return;
      }
      drawSolid($(".solid", card), lobe, { color: colors[k], incident, ...this.#turn });
      drawPixels($(".sphere", card), sphere);
      drawPixels($(".plane", card), plane);
    });
    this.redraw = () => this.draw({ lobes, incident }, colors);
  }

  #makeCard({ of, problem }, name, series) {
    const title = of.material ?? of.model;
    const remove = el("button", {
      type: "button", class: "quiet", "aria-label": `Remove ${title}`, title: "Remove", onclick: () => this.does.remove(of),
    }, "✕");
    const head = el("figcaption", {},
      el("span", { class: "swatch", "data-series": series }), el("span", { class: "name" }), el("span", { class: "title" }), remove);
    if (problem) return el("figure", { class: "card", "data-name": name }, head, el("p", { class: "trouble" }));
    const solid = el("canvas", {
      class: "solid", tabindex: "0", role: "img",
      "aria-label": `Lobe of ${title}; drag or use the arrow keys to turn the light, drag with shift to turn the view`,
    });
    this.#listen(solid);
    const views = el("div", { class: "views" }, solid,
      el("canvas", { class: "sphere", role: "img", "aria-label": `Sphere of ${title}` }),
      el("canvas", { class: "plane", role: "img", "aria-label": `Plane of ${title}` }));
    return el("figure", { class: "card", "data-name": name }, head, views);
  }

  #listen(solid) {
    solid.addEventListener("pointerdown", (event) => solid.setPointerCapture(event.pointerId));
    solid.addEventListener("contextmenu", (event) => event.preventDefault());
    solid.addEventListener("pointermove", (event) => {
      if (!solid.hasPointerCapture(event.pointerId)) return;
      const [x, y] = [event.movementX * DRAG, event.movementY * DRAG];
      if (event.shiftKey || event.buttons & 2) this.#turnView(x, y);
      else this.does.turnLight(y, x);
    });
    solid.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
      if (!step) return;
      event.preventDefault();
      this.does.turnLight(...step.map((each) => each * KEY_STEP));
    });
  }

  #turnView(x, y) {
    this.#turn = { azimuth: this.#turn.azimuth - x, elevation: clamp(this.#turn.elevation + y, -10, 90) };
    this.redraw();
  }
}
