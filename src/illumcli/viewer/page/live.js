// The picture, live: messages to and from the server.

const canvas = document.getElementById("picture");
const text = document.getElementById("text");
const address = new URL("live", location.href);
address.protocol = "ws:";
const socket = new WebSocket(address);
socket.binaryType = "arraybuffer";

const say = (message) => socket.send(JSON.stringify(message));

socket.onmessage = async ({ data }) => {
  if (typeof data === "string") {
    text.textContent = data;
    return;
  }
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  const bitmap = await createImageBitmap(new Blob([new Uint8Array(data, 4 + length)], { type: "image/jpeg" }));
  canvas.getContext("2d").drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  text.textContent = JSON.stringify(header);
};
socket.onopen = () => say({ type: "view", width: canvas.width, height: canvas.height });
canvas.onpointermove = (event) => {
  if (event.buttons === 1) {
    const orbit = [event.movementX / canvas.height, event.movementY / canvas.height];
    say({ type: "move", orbit, dragging: true });
  }
};
