// The choices above the picture: layer, camera, exposure and size.

import { $, fillChoices, whenQuiet } from "./dom.js";

const FIT = "fit"; // as large as the window has room for
const SHARES = [1, 0.5, 0.25]; // of the scene's own size
const FILM = ["film.width", "film.height"];
const RESIZED = 200; // how long the window must stay as it is before a picture of its size is asked for [ms]

export class Viewing {
  constructor(session, picture) {
    this.session = session;
    this.picture = picture;
    this.size = $("#size");
    for (const name of ["layer", "camera"]) {
      $(`#${name}`).addEventListener("change", (event) => session.look({ [name]: event.target.value }));
    }
    const exposure = $("#exposure");
    exposure.addEventListener("input", () => session.look({ exposure: exposure.valueAsNumber }));
    exposure.addEventListener("dblclick", () => session.look({ exposure: 0 }));
    this.size.addEventListener("change", () => this.#resize());
    new ResizeObserver(whenQuiet(RESIZED, () => this.#resize())).observe(picture.stage);
    session.on("scene", () => this.#fill());
    session.on("values", (paths) => { if (paths.some((path) => FILM.includes(path))) this.#fill(); });
    session.on("view", () => this.#show());
  }

  #fill() {
    const { layers, cameras, film: loaded } = this.session.scene;
    const film = FILM.map((path, k) => this.session.values.get(path) ?? loaded[k]);
    fillChoices($("#layer"), layers.map(({ name, help }) => ({ value: name, title: help })));
    fillChoices($("#camera"), cameras.map((name) => ({ value: name })));
    $("#camera").closest("label").hidden = cameras.length < 2;
    const sizes = SHARES.map((share) => film.map((each) => Math.max(2, Math.round(share * each))).join(" × "));
    const chosen = [FIT, ...sizes][Math.max(this.size.selectedIndex, 0)]; // the same share of another film
    fillChoices(this.size, [{ value: FIT, text: "as the window" }, ...sizes.map((value) => ({ value }))], chosen);
    this.picture.aspect = film[0] / film[1];
    this.picture.layout();
    this.#resize();
  }

  #show() {
    const { layer, camera, exposure } = this.session.view;
    $("#layer").value = layer;
    $("#camera").value = camera;
    $("#exposure").value = exposure;
    $("#exposure-shown").textContent = (exposure > 0 ? "+" : "") + exposure.toFixed(1);
  }

  /** Asks for pictures of the chosen size. */
  #resize() {
    if (!this.session.scene) return;
    const [width, height] = this.size.value.split(" × ").map(Number);
    const wanted = this.size.value === FIT ? this.picture.room(this.picture.aspect) : { width, height };
    const { view } = this.session;
    if (view.width !== wanted.width || view.height !== wanted.height) this.session.look(wanted);
  }
}
