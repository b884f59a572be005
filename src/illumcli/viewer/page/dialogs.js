// The dialogs: saving the edits, the command of the picture, mouse and keys.

import { $, $$ } from "./dom.js";

export class Dialogs {
  constructor(session, notices) {
    this.session = session;
    for (const button of $$("dialog [data-close]")) button.addEventListener("click", () => button.closest("dialog").close());
    this.#listenToSave(notices);
    session.live.on("command", ({ text }) => this.#showCommand(text));
  }

  openKeys() {
    $("#keys-dialog").showModal();
  }

  // --- save ---------------------------------------------------------------------------------------------

  openSave() {
    if (!this.session.scene) return;
    const { file } = this.session.scene;
    $("#save-file").value ||= file.replace(/(\.\w+)?$/, "-edited.yaml");
    $("#save-problem").hidden = true;
    $("#save-dialog").showModal();
  }

  #listenToSave(notices) {
    const dialog = $("#save-dialog");
    $("form", dialog).addEventListener("submit", (event) => {
      event.preventDefault();
      this.session.live.send({ type: "save", file: $("#save-file").value, replace: $("#save-replace").checked });
    });
    this.session.live.on("saved", ({ file }) => {
      dialog.close();
      $("#save-replace").checked = false;
      notices.say(`Saved ${file}`);
    });
    this.session.live.on("problem", ({ from, lines }) => {
      if (from !== "save") return;
      $("#save-problem").textContent = lines.join("\n");
      $("#save-problem").hidden = false;
    });
  }

  // --- command ------------------------------------------------------------------------------------------

  askCommand() {
    this.session.live.send({ type: "command" });
  }

  async #showCommand(text) {
    $("#command-text").textContent = text;
    $("#command-dialog").showModal();
    const isCopied = await navigator.clipboard.writeText(text).then(() => true, () => false);
    $("#command-copied").textContent = isCopied ? "Copied to the clipboard." : "Select the text to copy it.";
    if (!isCopied) getSelection().selectAllChildren($("#command-text"));
  }
}
