// What the page says beside the picture: a fault with its place, a lost connection, a short word about what was done.

import { $, el } from "./dom.js";

const SAID = 4000; // how long a short word stays [ms]

const SOURCES = {
  file: "The file has a mistake. The picture is the last good one; it follows when the file is mended.",
  edit: "This edit cannot be rendered. The picture is the last good one.",
};

export class Notices {
  #timer = 0;

  constructor() {
    this.problem = $("#problem");
    this.lost = $("#lost");
    this.said = $("#said");
  }

  showProblem({ lines, from }) {
    this.problem.replaceChildren(
      el("p", {}, SOURCES[from] ?? "This did not work."),
      el("pre", { tabindex: "0", "aria-label": "Message" }, lines.join("\n")),
    );
    this.problem.hidden = false;
  }

  solve() {
    this.problem.hidden = true;
  }

  showLost(isLost) {
    this.lost.hidden = !isLost;
  }

  say(text) {
    this.said.textContent = text;
    this.said.classList.add("visible");
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.said.classList.remove("visible"), SAID);
  }
}
