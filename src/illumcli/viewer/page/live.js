// The socket to the server: JSON messages both ways, pictures as binary frames. It connects again when it breaks.

const DELAYS = [300, 1000, 2000, 4000]; // before attempts to connect again [ms]

export class Live {
  #handlers = new Map(); // type of message -> functions
  #attempts = 0;
  #socket = null;

  constructor(url) {
    this.url = url;
    addEventListener("pagehide", () => this.#socket?.close());
    addEventListener("pageshow", ({ persisted }) => { if (persisted) this.connect(); });
  }

  /** Calls `handle` for messages of a type; `connected` and `lost` are types, too. */
  on(type, handle) {
    this.#handlers.set(type, [...(this.#handlers.get(type) ?? []), handle]);
  }

  connect() {
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.#attempts = 0;
      this.#tell({ type: "connected" });
    };
    socket.onmessage = ({ data }) => this.#tell(typeof data === "string" ? JSON.parse(data) : readFrame(data));
    socket.onclose = () => this.#again();
    this.#socket = socket;
  }

  get isOpen() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  /** Sends a message with the time of the event that caused it; lost messages are made good by `restore`. */
  send(message, stamp = performance.now()) {
    if (this.isOpen) this.#socket.send(JSON.stringify({ ...message, stamp }));
  }

  #again() {
    this.#tell({ type: "lost" });
    setTimeout(() => this.connect(), DELAYS[Math.min(this.#attempts++, DELAYS.length - 1)]);
  }

  #tell(message) {
    for (const handle of this.#handlers.get(message.type) ?? []) handle(message);
    if (message.stamp) for (const handle of this.#handlers.get("stamped") ?? []) handle(message);
  }
}

/** The header of a picture, with its JPEG as `image`. */
function readFrame(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  return { ...header, image: new Blob([new Uint8Array(buffer, 4 + length)], { type: "image/jpeg" }) };
}
