// The page of `illum view`: connects its parts.

import { Controls } from "./controls.js";
import { Dialogs } from "./dialogs.js";
import { $ } from "./dom.js";
import { listenToGestures } from "./gestures.js";
import { Live } from "./live.js";
import { Lobes } from "./lobes.js";
import { Notices } from "./notices.js";
import { Picture } from "./picture.js";
import { Session } from "./session.js";
import { Status } from "./status.js";
import { Viewing } from "./viewing.js";

const live = new Live(new URL("live", location.href.replace(/^http/, "ws")));
const session = new Session(live);
const picture = new Picture($("#stage"));
const controls = new Controls($("#panel"), session);
const lobes = new Lobes($("#lobes"), session);
const notices = new Notices();
const status = new Status();
const dialogs = new Dialogs(session, notices);
new Viewing(session, picture);

// --- what the server says -------------------------------------------------------------------------------

live.on("connected", () => notices.showLost(false));
live.on("lost", () => notices.showLost(true));
live.on("picture", (message) => picture.show(message));
picture.onpaint = (header) => {
  status.showPicture(header, (header.stamp ?? 0) >= session.asked);
  if (header.stage !== "coarse") point(pointed);
};
live.on("same", ({ stamp }) => {
  if (picture.header && stamp >= session.asked) status.showPicture(picture.header, true);
});
live.on("problem", (problem) => {
  if (problem.from === "save") return;
  notices.showProblem(problem);
  controls.blame(problem.lines);
});
live.on("solved", () => {
  notices.solve();
  controls.blame([]);
});
live.on("pixel", (pixel) => {
  status.showPixel(pointed && pixel, session.view.layer);
  if (!isChoosing || !pixel.material) return;
  isChoosing = false;
  controls.reveal(`materials.${pixel.material}`);
  lobes.choose(pixel.material);
});
session.on("scene", () => {
  const { name, file } = session.scene;
  document.title = `${name} – illum view`;
  $("#name").textContent = name;
  $("#name").title = file ?? name;
});
session.on("asked", () => status.showWaiting());
session.on("edits", () => {
  $("#undo").disabled = !session.canUndo;
  $("#redo").disabled = !session.canRedo;
  $("#reset").disabled = Object.keys(session.edits).length === 0;
});

// --- what the user does on the picture ------------------------------------------------------------------

let pointed = null; // where the mouse is, in fractions of the picture
let isChoosing = false; // whether the material of the next pixel is to be chosen

function point(at) {
  pointed = at;
  if (at) session.outbox.post("pick", { type: "pick", ...at });
  else status.showPixel(null);
}

listenToGestures(picture.frame, {
  move: (motion, dragging) => session.move(motion, dragging),
  hover: point,
  click(at) {
    isChoosing = true;
    point(at);
  },
});

// --- actions --------------------------------------------------------------------------------------------

const actions = {
  freeze() {
    picture.freeze(!picture.isFrozen);
    $("#freeze").setAttribute("aria-pressed", picture.isFrozen);
  },
  brdf() {
    lobes.open(!lobes.isOpen);
    $("#brdf").setAttribute("aria-pressed", lobes.isOpen);
  },
  undo: () => session.undo(),
  redo: () => session.redo(),
  reset: () => session.resetAll(),
  command: () => dialogs.askCommand(),
  save: () => dialogs.openSave(),
  keys: () => dialogs.openKeys(),
};
for (const [name, act] of Object.entries(actions)) $(`#${name}`).addEventListener("click", act);

document.addEventListener("keydown", (event) => {
  if (document.querySelector("dialog[open]")) return;
  const isWriting = event.target.matches("input:not([type=range], [type=checkbox]), textarea, select");
  if (event.ctrlKey || event.metaKey) {
    const key = event.key.toLowerCase();
    const act = key === "s" ? actions.save : key === "z" && !isWriting ? (event.shiftKey ? actions.redo : actions.undo) : null;
    if (act) { event.preventDefault(); act(); }
  } else if (!isWriting && !event.altKey) {
    const act = { f: actions.freeze, b: actions.brdf, "?": actions.keys, "/": () => $("#filter").focus() }[event.key];
    if (act) { event.preventDefault(); act(); }
  }
});

live.connect();
