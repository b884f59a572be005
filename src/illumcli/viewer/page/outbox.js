// Messages of controls that move faster than pictures come: of each control one is on its way, newer ones wait and merge.

const PATIENCE = 300; // after this time a message counts as answered [ms]

const ANSWERS = { pick: "pixel", lobes: "lobes" }; // type of the answer, where it is none of pictures

const newest = (_, message) => message;

export class Outbox {
  #waiting = new Map(); // key -> {message, stamp}
  #sent = new Map(); // key -> {stamp, answer} of the message that is on its way

  constructor(live) {
    this.live = live;
    live.on("stamped", ({ type, stamp }) => this.#free(stamp, Object.values(ANSWERS).includes(type) ? type : "picture"));
    live.on("lost", () => { this.#waiting.clear(); this.#sent.clear(); });
  }

  /** Sends a message at once, or as soon as the one before it with this key is answered. */
  post(key, message, merge = newest) {
    const before = this.#waiting.get(key);
    this.#waiting.set(key, { message: before ? merge(before.message, message) : message, stamp: performance.now() });
    this.#flush(key);
  }

  #flush(key) {
    const next = this.#waiting.get(key);
    if (!next || this.#sent.has(key)) return;
    const answer = ANSWERS[next.message.type] ?? "picture";
    this.#waiting.delete(key);
    this.#sent.set(key, { stamp: next.stamp, answer });
    this.live.send(next.message, next.stamp);
    setTimeout(() => this.#free(next.stamp, answer), PATIENCE);
  }

  #free(stamp, answer) {
    for (const [key, sent] of this.#sent) {
      if (sent.stamp > stamp || sent.answer !== answer) continue;
      this.#sent.delete(key);
      this.#flush(key);
    }
  }
}
