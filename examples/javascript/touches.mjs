// Prints where touches come, move and go:
//
//   node touches.mjs 9000
//   eitskin stream --device sim:swipe --to udp://127.0.0.1:9000
//
// In a browser the same messages come over a WebSocket, `--to ws://127.0.0.1:9001`:
//
//   new WebSocket("ws://127.0.0.1:9001").onmessage = (event) => show(JSON.parse(event.data));
import { createSocket } from "node:dgram";

/** @type {Set<number>} ids of the touches of the last frame */
let before = new Set();

/** @param {import("../types/eitskin_message.d.ts").Message} message */
function show(message) {
  if (message.type === "notice") console.log(message.text);
  if (message.type === "summary") receiver.close();
  if (message.type !== "frame" || message.touches === null) return;
  for (const touch of message.touches) {
    const what = before.has(touch.id) ? "moves" : "comes";
    const at = `${touch.x_mm.toFixed(1)} ${touch.y_mm.toFixed(1)} mm`;
    console.log(`touch ${touch.id} ${what} ${at}${touch.confirmed ? "" : " (not confirmed)"}`);
  }
  const now = new Set(message.touches.map((touch) => touch.id));
  for (const id of before) if (!now.has(id)) console.log(`touch ${id} goes`);
  before = now;
}

const receiver = createSocket("udp4", (datagram) => show(JSON.parse(datagram.toString())));
receiver.bind(Number(process.argv[2] ?? 9000), "127.0.0.1", () => console.log("listening"));
