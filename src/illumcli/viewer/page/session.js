// What this window shows: the scene as the server described it, its edits, its view; and the verbs that change them.

import { Outbox } from "./outbox.js";

const KEPT = `illum view ${location.pathname}`; // in the storage of this tab, so that a reload keeps the edits

export class Session {
  scene = null; // the server's last description
  edits = {}; // path -> value, as the server has them
  view = { exposure: 0, hidden_lights: [] }; // and camera, layer, width, height
  values = new Map(); // path -> what the control shows
  asked = 0; // when a picture was asked for last [ms]
  #past = [];
  #future = [];
  #held = null; // what is being dragged
  #listeners = new Map();

  constructor(live) {
    this.live = live;
    this.outbox = new Outbox(live);
    let isFirst = false; // description after a connection
    live.on("connected", () => { isFirst = true; });
    live.on("scene", (scene) => {
      const kept = isFirst && JSON.parse(sessionStorage.getItem(KEPT) ?? "null");
      isFirst = false;
      this.#take(scene);
      if (kept) this.#restore(kept);
    });
    live.on("values", ({ values, edits }) => this.#update(values, edits));
  }

  /** Calls `handle` when the scene, the `values` of controls, the `edits` or the `view` have changed, or a picture is `asked` for. */
  on(what, handle) {
    this.#listeners.set(what, [...(this.#listeners.get(what) ?? []), handle]);
  }

  // --- verbs --------------------------------------------------------------------------------------------

  set(path, value, dragging) {
    this.#remember(path, dragging);
    this.#update({ [path]: value }, this.edits);
    this.outbox.post(path, { type: "set", path, value, dragging });
  }

  reset(paths) {
    this.#remember(null, false);
    for (const path of paths) this.live.send({ type: "reset", path });
  }

  resetAll() {
    this.#remember(null, false);
    this.live.send({ type: "reset" });
  }

  /** Moves the camera: {orbit: [x, y]}, {pan: [x, y]} or {dolly: d}; a drag ends with `dragging` false. */
  move(motion, dragging) {
    this.#remember("camera", dragging);
    this.outbox.post(`move ${Object.keys(motion)}`, { type: "move", ...motion, dragging }, addMotions);
  }

  look(part) {
    this.view = { ...this.view, ...part };
    this.#keep();
    this.#tell("view");
    this.#ask();
    this.outbox.post(`view ${Object.keys(part)}`, { type: "view", ...part });
  }

  get canUndo() { return this.#past.length > 0; }
  get canRedo() { return this.#future.length > 0; }

  undo() { this.#travel(this.#past, this.#future); }
  redo() { this.#travel(this.#future, this.#past); }

  // --- state --------------------------------------------------------------------------------------------

  #take(scene) {
    Object.assign(this, { scene, edits: scene.edits, view: { ...this.view, ...scene.view } });
    this.values = new Map(scene.controls.map(({ path, value }) => [path, value]));
    this.#keep();
    for (const what of ["scene", "view", "edits"]) this.#tell(what);
  }

  #update(values, edits) {
    for (const [path, value] of Object.entries(values)) this.values.set(path, value);
    this.edits = edits;
    this.#keep();
    this.#tell("values", Object.keys(values));
    this.#tell("edits");
  }

  /** Keeps the edits as they are before a change; of a drag only those before its beginning. */
  #remember(what, dragging) {
    this.#ask();
    if (this.#held === null || this.#held !== what) {
      this.#past.push(this.edits);
      this.#future = [];
    }
    this.#held = dragging ? what : null;
  }

  #travel(from, to) {
    while (from.length && JSON.stringify(from.at(-1)) === JSON.stringify(this.edits)) from.pop(); // what was refused
    if (!from.length) {
      this.#tell("edits");
      return;
    }
    to.push(this.edits);
    this.#restore({ edits: from.pop() });
  }

  #restore({ edits, view = this.view }) {
    this.view = view;
    this.#tell("view");
    this.#ask();
    this.live.send({ type: "restore", edits, view });
  }

  #ask() {
    this.asked = performance.now();
    this.#tell("asked");
  }

  #keep() {
    sessionStorage.setItem(KEPT, JSON.stringify({ edits: this.edits, view: this.view }));
  }

  #tell(what, detail) {
    for (const handle of this.#listeners.get(what) ?? []) handle(detail);
  }
}

/** One motion for two that were not sent in time. */
function addMotions(first, second) {
  const sum = { ...second };
  for (const kind of ["orbit", "pan"]) {
    if (kind in second) sum[kind] = second[kind].map((each, k) => each + first[kind][k]);
  }
  if ("dolly" in second) sum.dolly = first.dolly + second.dolly;
  return sum;
}
