// The BRDF panel: what is compared, from where the light comes, and on which scale; it asks the server for the data.

import { $, $$, fillChoices } from "./dom.js";
import { LobeCards } from "./lobe_cards.js";
import { clamp } from "./numbers.js";
import { Slices } from "./slices.js";

const MOST = 5; // models side by side: so many colours tell them apart

export class Lobes {
  #of = []; // what is compared: {material} or {model}
  #answer = null;

  constructor(root, session) {
    this.root = root;
    this.session = session;
    this.add = $("#lobe-add", root);
    this.theta = $("#theta", root);
    this.phi = $("#phi", root);
    this.slices = new Slices($("#slices", root), (theta) => this.#aim(theta, this.phi.valueAsNumber));
    this.cards = new LobeCards($("#cards", root), {
      turnLight: (theta, phi) => this.#aim(this.theta.valueAsNumber + theta, this.phi.valueAsNumber + phi),
      remove: (one) => this.#compare(this.#of.filter((each) => !isSame(each, one))),
    });
    for (const input of $$("input", root)) input.addEventListener("input", () => this.#ask());
    this.add.addEventListener("change", () => this.#addChosen());
    session.on("scene", () => this.#fill());
    session.on("values", () => this.#ask());
    session.live.on("lobes", (answer) => this.#show(answer));
    new ResizeObserver(() => this.#draw()).observe(root);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#draw());
  }

  get isOpen() { return !this.root.hidden; }

  open(isOpen) {
    this.root.hidden = !isOpen;
    if (this.#of.length) this.#ask();
    else this.choose(this.session.scene?.materials[0]?.name);
  }

  /** Shows a material in place of the first one. */
  choose(material) {
    if (material) this.#compare([{ material }, ...this.#of.slice(1).filter((each) => !isSame(each, { material }))]);
  }

  #addChosen() {
    const [kind, name] = this.add.value.split(":");
    this.add.value = "";
    const one = { [kind]: name };
    if (name) this.#compare([...this.#of.filter((each) => !isSame(each, one)), one].slice(-MOST));
  }

  #compare(of) {
    this.#of = of;
    if (of.length) this.#ask();
    else if (this.#answer) this.#show({ ...this.#answer, lobes: [] });
  }

  /** Turns the light to these angles [degrees]. */
  #aim(theta, phi) {
    this.theta.value = clamp(theta, 0, Number(this.theta.max));
    this.phi.value = ((phi % 360) + 360) % 360;
    this.#ask();
  }

  #ask() {
    for (const input of [this.theta, this.phi]) $(`output[for=${input.id}]`, this.root).textContent = `${input.value}°`;
    if (!this.isOpen || !this.#of.length) return;
    const [theta, phi] = [this.theta, this.phi].map(({ valueAsNumber }) => valueAsNumber);
    const [log, cosine] = ["#log", "#cosine"].map((name) => $(name, this.root).checked);
    this.session.outbox.post("lobes", { type: "lobes", of: this.#of, theta, phi, log, cosine });
  }

  #fill() {
    const { materials, models } = this.session.scene;
    this.#of = this.#of.filter(({ material }) => !material || materials.some(({ name }) => name === material));
    fillChoices(this.add, [
      { value: "", text: "Compare with…" },
      ...materials.map(({ name, model }) => ({ value: `material:${name}`, text: `${name} (${model})` })),
      ...models.map(({ name, title }) => ({ value: `model:${name}`, text: `${name} as it comes`, title })),
    ], "");
    this.#ask();
  }

  #show(answer) {
    this.#answer = answer;
    this.#draw();
  }

  #draw() {
    if (!this.isOpen || !this.#answer) return;
    const style = getComputedStyle(this.root);
    const colors = Array.from({ length: MOST }, (_, k) => style.getPropertyValue(`--series-${k + 1}`));
    this.slices.draw(this.#answer, colors);
    this.cards.draw(this.#answer, colors);
  }
}

function isSame(one, other) {
  return one.material === other.material && one.model === other.model;
}
