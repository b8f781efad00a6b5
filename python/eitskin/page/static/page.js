// The live page: takes what the server sends, draws the newest frame, and says what the user wants.
import { SkinDrawing, SkinImage, VoltsDrawing, idColour } from "./drawing.js";
import { PlotsDrawing } from "./plots.js";
import { SurfaceDrawing } from "./surface.js";

const $ = (id) => document.getElementById(id);
const MAGIC = 0x31465645; // "EVF1"
const WORDS_MS = 2500; // between two texts for screen readers
const SHOWN_LOG = 60;
const FINGERS = ["down", "move", "up"]; // the touches themselves show these
const STEP_MM = 5; // the step of a finger that the arrow keys move
const MAX_FINGERS = 5; // the most fingers that may press at once
const GESTURE_MS = 4000; // how long a gesture stays on the page

const skin = new SkinDrawing($("skin"));
const space = new SurfaceDrawing($("surface"), $("labels"));
const plots = new PlotsDrawing($("plots"));
const volts = new VoltsDrawing($("volts"));
const page = {
  socket: null, setup: null, surfaces: new Map(), newSurface: false, frames: new Map(), shown: null, images: new Map(), asked: false, times: [], health: {}, dropped: 0, skipped: 0,
  wordsAt: 0, words: "", gestures: [], pressed: new Set(), state: "", teach: null,
  fingers: new Map(), turning: new Map(), pressing: false, pressAgain: false, seeking: false,
};
const token = new URLSearchParams(location.hash.slice(1)).get("token");

// ---- the line ----

function connect() {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    page.pressing = false;
    page.surfaces.clear();
    socket.send(JSON.stringify({ type: "hello", token }));
  };
  socket.onmessage = ({ data }) => (typeof data === "string" ? take(JSON.parse(data)) : takeFrame(data));
  socket.onclose = ({ code, reason }) => {
    if (code === 4401) return setState("failed", `${reason}: open the address that eitskin view printed`);
    setState("away", "the server is gone; trying again");
    setTimeout(connect, 1000);
  };
  page.socket = socket;
}

function send(facts) {
  if (page.socket && page.socket.readyState === WebSocket.OPEN) page.socket.send(JSON.stringify(facts));
}

function ask(what, value) {
  answer({ ok: true, text: "…" });
  send({ type: "do", do: what, value });
}

function takeFrame(buffer) {
  const head = new DataView(buffer);
  if (head.getUint32(0, true) !== MAGIC) return;
  const [number, pixels, rows] = [4, 8, 12].map((at) => head.getUint32(at, true));
  const text = new TextDecoder().decode(new Uint8Array(buffer, 16 + 4 * (pixels + rows)));
  const message = JSON.parse(text), source = sourceOf(message);
  const frame = {
    number,
    image: pixels ? new Float32Array(buffer, 16, pixels) : null,
    volts: rows ? new Float32Array(buffer, 16 + 4 * pixels, rows) : null,
    message,
  };
  page.frames.set(source, frame);
  page.newest = number;
  follow(message, source);
  for (const event of message.events || []) {
    if (event.zone && event.kind === "press") page.pressed.add(event.zone);
    if (event.zone && event.kind === "release") page.pressed.delete(event.zone);
    if (!FINGERS.includes(event.kind) && event.phase !== "change") page.gestures.unshift({ ...event, at: performance.now() });
  }
  page.gestures = page.gestures.filter((event) => performance.now() - event.at < GESTURE_MS).slice(0, 4);
  soon();
}

// The name of a message's skin. Before the first setup there is none.
function sourceOf(message) {
  const skins = page.setup ? page.setup.skins : [];
  return skins.some((one) => one.source === message.source) ? message.source : page.shown;
}

function shownFrame() {
  return page.frames.get(page.shown);
}

function follow(message, source) {
  plots.follow(message.touches || [], message.time_s);
  if (source !== page.shown) return;
  const { times } = page, last = times[times.length - 1];
  if (last && (message.time_s < last.time_s || message.frame < last.frame)) times.length = 0;
  times.push({ at: performance.now(), frame: message.frame, time_s: message.time_s });
  while (times.length > 2 && times[0].at < performance.now() - 2000) times.shift();
  skin.follow(message.touches || [], message.time_s);
}

// touches after a drive, newer than the newest frame
function takeReport(message) {
  page.report = message;
  soon();
}

function soon() {
  if (page.asked) return;
  page.asked = true;
  requestAnimationFrame(() => {
    page.asked = false;
    draw();
    if (page.newest) send({ type: "drawn", number: page.newest });
  });
}

function take(message) {
  if (message.type === "setup") return takeSetup(message);
  if (message.type === "surface") return takeSurface(message);
  if (message.type === "state") return setState(message.state, message.text);
  if (message.type === "answer") return answer(message);
  if (message.type === "notice") return note(message);
  if (message.type === "report") return takeReport(message);
  if (message.type === "teach") return showTeach(message);
  if (message.type === "page") {
    page.dropped = message.dropped + message.skipped;
    $("n-latency").textContent = message.latency_ms === null ? "–" : `${message.latency_ms.toFixed(0)} ms`;
    $("n-dropped").textContent = String(page.dropped);
  }
}

// ---- what is shown ----

function setState(state, text) {
  page.state = state;
  $("state").dataset.state = state;
  $("state").textContent = { live: "live", ended: "over", starting: "starting" }[state] || text || state;
  $("state").title = text || "";
  if (text && state !== "live" && state !== "starting") note({ kind: "session", text });
  showPlay();
}

// A skin's surface comes before the setup that needs it, and not again with the next ones.
function takeSurface({ source, surface }) {
  page.surfaces.set(source, surface);
  page.newSurface = true;
}

function takeSetup(setup) {
  const before = page.setup;
  page.setup = setup;
  page.report = null;
  $("device").textContent = `${setup.name && setup.name + " · "}${setup.url} · ${setup.board}, ${setup.electrodes} electrodes`;
  document.title = `${setup.url} · eitskin`;
  const what = ({ model_crc, url, skins }) => JSON.stringify([model_crc, url, skins.map((one) => [one.source, one.pose, Boolean(one.skin)])]);
  for (const one of setup.skins) one.surface = page.surfaces.get(one.source) || null;
  if (!before || page.newSurface || what(before) !== what(setup)) takeSkins(setup.skins);
  page.newSurface = false;
  const may = setup.may_command, board = may && !setup.replays;
  $("undo").hidden = !setup.can_undo_tare;
  for (const id of ["tare", "undo", "record", "preset", "sign", "iterations", "model"]) $(id).disabled = !board;
  for (const box of $("mode").querySelectorAll("input")) {
    box.disabled = !board;
    box.checked = setup.mode.includes(box.value);
  }
  for (const id of ["play", "step", "speed", "at"]) $(id).disabled = !may;
  showView();
  $("timeline").hidden = !setup.length_s;
  if (setup.length_s) $("at").max = setup.length_s;
  if (setup.replays) $("download").hidden = !may;
  $("step").hidden = $("speed").parentElement.hidden = !setup.timed;
  const speed = setup.speed === 0 ? "max" : String(setup.speed);
  if (![...$("speed").options].some((one) => one.value === speed)) $("speed").add(new Option(`${speed} ×`, speed));
  $("speed").value = speed;
  $("preset").value = setup.preset;
  if (setup.sign) $("sign").value = setup.sign;
  if (setup.iterations && document.activeElement !== $("iterations")) $("iterations").value = setup.iterations;
  $("record").setAttribute("aria-pressed", String(Boolean(setup.recording)));
  $("record-text").textContent = setup.recording ? "Stop recording" : "Record";
  $("truth-label").hidden = !setup.has_truth;
  if (!may) answer({ ok: true, text: "Looking on: buttons need the address that eitskin view printed." });
  showElectrodes({}, setup.electrodes);
  showPlay();
  showTeachButtons();
  soon();
}

function takeSkins(skins) {
  const known = skins.filter((one) => one.skin);
  page.images = new Map(known.map((one) => [one.source, new SkinImage(one.skin)]));
  page.frames.clear();
  space.setSkins(skins, page.images);
  $("which").replaceChildren(...skins.map((one) => new Option(one.source)));
  $("which-label").hidden = skins.length < 2;
  showSkin(skins.some((one) => one.source === page.shown) ? page.shown : skins[0].source);
}

// The skin whose numbers, voltages and flat drawing are shown.
function showSkin(source) {
  page.shown = source;
  page.times.length = 0;
  $("which").value = source;
  skin.setSkin(shownSkin().skin, page.images.get(source));
  soon();
}

function shownSkin() {
  return page.setup.skins.find((one) => one.source === page.shown);
}

// In three dimensions are drawn several skins, and one that covers a surface.
function showView() {
  const { skins, may_command } = page.setup;
  const deep = space.gl && space.shapes.length > 0 && (skins.length > 1 || Boolean(skins[0].surface));
  page.deep = deep && !$("flat").checked;
  page.may_press = may_command && skins.some((one) => one.finger_mm && one.skin);
  $("flat-label").hidden = !deep;
  $("skin").hidden = page.deep;
  $("space").hidden = !page.deep;
  $("trails-label").hidden = page.deep;
  $("skin").classList.toggle("pressable", page.may_press);
  const press = "Press the skin with mouse or finger, or with Enter and the arrow keys.";
  const turn = `Drag ${page.may_press ? "on a skin to press it, beside it to turn the view" : "to turn the view"}; wheel or two fingers zoom.`;
  $("hint").textContent = page.deep ? turn : page.may_press ? press : "";
  if (!page.may_press) page.fingers.clear();
}

function showPlay() {
  const over = page.state === "ended" || page.state === "failed", setup = page.setup;
  $("play").textContent = over ? "Start again" : setup && setup.paused ? "Play" : "Pause";
  $("play").hidden = !over && Boolean(setup) && !setup.timed;
  if (over) $("play").disabled = Boolean(setup) && !setup.may_command;
}

function answer({ ok, text, do: what }) {
  if (what === "press") return pressAnswered(ok, text);
  if (what === "record" && ok && text.startsWith("recorded")) $("download").hidden = false;
  $("answer").textContent = text;
  $("answer").dataset.ok = String(ok);
}

function note({ kind, text, time_s }) {
  const item = document.createElement("li"), what = document.createElement("b");
  what.textContent = time_s === null || time_s === undefined ? `${kind}: ` : `${time_s.toFixed(1)} s ${kind}: `;
  item.append(what, text);
  $("log").prepend(item);
  $("log-none").hidden = true;
  while ($("log").children.length > SHOWN_LOG) $("log").lastChild.remove();
}

function showTeach(teach) {
  page.teach = teach;
  const count = teach.places_mm.length, at = teach.places_mm[teach.number];
  $("teach").hidden = false;
  $("teach").dataset.step = teach.step;
  $("teach-text").textContent = teach.text;
  $("teach-count").textContent = `${teach.done.length} of ${count} presses` +
    (at ? `; now place ${teach.number + 1} at ${at[0].toFixed(1)}, ${at[1].toFixed(1)} mm` : "");
  showTeachButtons();
  soon();
}

function showTeachButtons() {
  const { teach, setup } = page, may = Boolean(teach && setup && setup.may_command);
  $("teach-back").disabled = !may || !teach.done.length;
  $("teach-skip").disabled = !may || teach.step === "done";
  $("teach-fit").disabled = !may || teach.done.length < 5;
}

function cell(text) {
  const one = document.createElement("td");
  one.textContent = text;
  return one;
}

function showTouches(touches) {
  const several = page.setup.skins.length > 1;
  $("of-skin").hidden = !several;
  const rows = touches.map((touch) => {
    const row = document.createElement("tr");
    row.dataset.id = touch.id;
    row.style.setProperty("--id", idColour(touch.id));
    const sure = touch.confidence === null ? "–" : `${Math.round(100 * touch.confidence)} %`;
    row.append(cell(touch.id), ...(several ? [cell(touch.source)] : []), cell(touch.x_mm.toFixed(1)), cell(touch.y_mm.toFixed(1)), cell(touch.radius_mm.toFixed(1)),
      cell(touch.force_n ? touch.force_n.toFixed(2) : "–"), cell(sure));
    return row;
  });
  $("touches").replaceChildren(...rows);
  $("none").hidden = touches.length > 0;
}

function chips(holder, texts, fine) {
  const shown = texts.length ? texts : fine ? [fine] : [];
  holder.replaceChildren(...shown.map((text) => {
    const chip = document.createElement("span");
    chip.textContent = text;
    if (!texts.length) chip.className = "fine";
    return chip;
  }));
}

function showElectrodes(health, count) {
  const same = $("electrodes").children.length === count && JSON.stringify(health) === JSON.stringify(page.health);
  if (same) return;
  page.health = health;
  const items = Array.from({ length: count }, (_, k) => {
    const item = document.createElement("li");
    item.dataset.health = health[k] || "good";
    item.textContent = String(k);
    item.title = item.ariaLabel = `electrode ${k}: ${health[k] || "good"}`;
    return item;
  });
  $("electrodes").replaceChildren(...items);
  const bad = Object.entries(health).map(([k, state]) => `${k} is ${state}`);
  $("health").textContent = bad.length ? bad.join(", ") : "None is found open, bridged or noisy.";
}

function gestureText({ kind, phase, zone, direction_deg }) {
  const way = direction_deg === null || direction_deg === undefined ? "" : ` ${["right", "up", "left", "down"][Math.round(direction_deg / 90 + 4) % 4]}`;
  return [kind, phase === "end" ? phase : "", zone || ""].filter(Boolean).join(" ") + way;
}

function healthOf(info) {
  const health = {};
  if (!info) return health;
  for (const state of ["noisy", "bridged", "open"]) for (const k of info[`${state}_electrodes`] || []) health[k] = state;
  return health;
}

// Frames per second of the board's clock, and drawn here per second.
function rates() {
  const { times } = page, first = times[0], last = times[times.length - 1];
  if (times.length < 2 || last.time_s <= first.time_s || last.at <= first.at) return [];
  return [(last.frame - first.frame) / (last.time_s - first.time_s), ((times.length - 1) * 1000) / (last.at - first.at)];
}

function draw() {
  const { setup } = page, frame = shownFrame();
  if (page.deep) space.draw(page.frames, { truth: $("truth").checked, fingers: fingersBySkin(), finger_mm: fingerRadius(),
    health: new Map([...page.frames].map(([source, one]) => [source, healthOf(one.message.info)])) });
  else skin.draw(frame, { report: page.report, health: page.health, trails: $("trails").checked, truth: $("truth").checked,
    zones: setup ? setup.zones : [], pressed: page.pressed, teach: page.teach,
    fingers: setup ? fingersBySkin().get(page.shown) || [] : [], finger_mm: fingerRadius() });
  if (!frame || !setup) return;
  const { message } = frame, { info } = message;
  const touches = [...page.frames].flatMap(([source, one]) => (one.message.touches || []).map((touch) => ({ ...touch, source })));
  $("plots").ariaLabel = plots.draw(skin.box);
  $("volts").ariaLabel = volts.draw(frame.volts, page.shown === setup.skins[0].source ? setup.reference_v : null);
  showElectrodes(healthOf(info), setup.electrodes);
  showTouches(touches);
  chips($("found"), message.refused ? [`refused: ${message.refused}`, ...message.found] : message.found, "nothing found wrong");
  chips($("gestures"), page.gestures.map(gestureText));
  $("gestures").hidden = !page.gestures.length;
  $("n-frame").textContent = String(message.frame);
  $("n-time").textContent = `${message.time_s.toFixed(2)} s`;
  [$("n-rate").textContent, $("n-shown").textContent] = [0, 1].map((k) => rates()[k] ? `${rates()[k].toFixed(1)} Hz` : "–");
  showTime(message.time_s, setup.length_s, setup.frame_us / 1e6);
  const solve_us = info ? info.solve_us + info.touch_us : 0;
  $("n-solve").textContent = solve_us ? `${(solve_us / 1e3).toFixed(1)} ms` : "–";
  const { peak } = page.images.get(page.shown) || { peak: 0 };
  $("scale-low").textContent = `−${peak.toPrecision(2)}`;
  $("scale-high").textContent = `+${peak.toPrecision(2)}`;
  sayTouches(touches);
}

// A recording that is looped goes on counting; ``frame_s`` lies between its end and its beginning.
function showTime(time_s, length_s, frame_s) {
  if (!length_s) return;
  const at = page.seeking ? Number($("at").value) : time_s > length_s ? time_s % (length_s + frame_s) : time_s;
  if (!page.seeking) $("at").value = at;
  $("at-text").textContent = `${at.toFixed(1)} of ${length_s.toFixed(1)} s`;
}

// Touches in words, seldom enough to be listened to.
function sayTouches(touches) {
  const words = touches.length
    ? `${touches.length} ${touches.length === 1 ? "touch" : "touches"}: ` +
      touches.map((t) => `number ${t.id} at ${t.x_mm.toFixed(0)}, ${t.y_mm.toFixed(0)} millimetres`).join("; ")
    : "No touch";
  $("skin").ariaLabel = `The skin from above. ${words}`;
  $("surface").ariaLabel = `The skins in three dimensions. ${words}`;
  const now = performance.now();
  if (words === page.words || now - page.wordsAt < WORDS_MS) return;
  page.words = words;
  page.wordsAt = now;
  $("words").textContent = words;
}

// ---- a finger on a simulated skin ----

// The newest places only, and one message at a time.
function press() {
  soon();
  page.pressAgain = page.pressing;
  if (page.pressing) return;
  page.pressing = true;
  send({ type: "do", do: "press", value: Object.fromEntries(fingersBySkin()) });
}

// The places that this page's fingers press, by the names of the skins.
function fingersBySkin() {
  const places = new Map();
  for (const { source, place } of page.fingers.values()) places.set(source, [...(places.get(source) || []), place].slice(0, MAX_FINGERS));
  return places;
}

function fingerRadius() {
  return page.setup ? shownSkin().finger_mm || 8 : 0;
}

function pressAnswered(ok, text) {
  page.pressing = false;
  if (!ok) answer({ ok, text });
  if (page.pressAgain) press();
}

// ``at``: a skin's name and a place of its drawing
function moveFinger(id, at) {
  if (!at || !page.may_press || !page.setup.skins.find((one) => one.source === at.source).finger_mm) return false;
  page.fingers.set(id, at);
  press();
  return true;
}

function liftFinger(id) {
  if (page.fingers.delete(id)) press();
}

function flatAt(x, y) {
  const place = skin.placeAt(x, y);
  return place && { source: page.shown, place };
}

for (const [name, at] of [["skin", flatAt], ["surface", (x, y) => space.pick(x, y)]]) {
  $(name).addEventListener("pointerdown", (event) => {
    if (event.button === 0 && !event.shiftKey && moveFinger(event.pointerId, at(event.offsetX, event.offsetY))) return;
    if (name !== "surface") return;
    page.turning.set(event.pointerId, [event.offsetX, event.offsetY]);
    $(name).setPointerCapture(event.pointerId);
  });
  $(name).addEventListener("pointermove", (event) => {
    if (page.fingers.has(event.pointerId)) moveFinger(event.pointerId, at(event.offsetX, event.offsetY)) || liftFinger(event.pointerId);
    else if (page.turning.has(event.pointerId)) turnView(event);
  });
  for (const end of ["pointerup", "pointercancel", "pointerleave"]) $(name).addEventListener(end, (event) => {
    liftFinger(event.pointerId);
    page.turning.delete(event.pointerId);
  });
}

// One pointer turns or shifts the view, two change its size.
function turnView(event) {
  const { turning } = page, before = turning.get(event.pointerId), now = [event.offsetX, event.offsetY];
  const [right, down] = [now[0] - before[0], now[1] - before[1]];
  const apart = () => Math.hypot(...[0, 1].map((k) => [...turning.values()][0][k] - [...turning.values()][1][k]));
  const from = turning.size > 1 ? apart() : 0;
  turning.set(event.pointerId, now);
  if (turning.size > 1) space.zoom(from / Math.max(1, apart()));
  else if (event.shiftKey || event.buttons === 2) space.shift(right, down);
  else space.rotate(right / 150, down / 150);
  soon();
}

$("surface").addEventListener("wheel", (event) => {
  event.preventDefault();
  space.zoom(Math.exp(event.deltaY / 600));
  soon();
}, { passive: false });
$("surface").addEventListener("contextmenu", (event) => event.preventDefault());
$("surface").addEventListener("keydown", (event) => {
  if (!space.key(event.key)) return;
  event.preventDefault();
  soon();
});
addEventListener("blur", () => {
  if (!page.fingers.size) return;
  page.fingers.clear();
  press();
});
$("skin").addEventListener("keydown", (event) => {
  const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
  const { place } = page.fingers.get("keys") || {}, size = $("skin");
  if (event.key === "Escape" || (event.key === "Enter" && place)) liftFinger("keys");
  else if (event.key === "Enter") moveFinger("keys", flatAt(size.clientWidth / 2, size.clientHeight / 2));
  else if (step && place) moveFinger("keys", { source: page.shown, place: place.map((at, k) => at + STEP_MM * step[k]) });
  else return;
  event.preventDefault();
});

// ---- what is wanted ----

function playOrPause() {
  const over = page.state === "ended" || page.state === "failed";
  ask(over || (page.setup && page.setup.paused) ? "play" : "pause");
}

$("tare").addEventListener("click", () => ask("tare"));
$("undo").addEventListener("click", () => ask("undo-tare"));
$("record").addEventListener("click", () => ask("record", $("record").getAttribute("aria-pressed") !== "true"));
$("play").addEventListener("click", playOrPause);
$("step").addEventListener("click", () => ask("step"));
for (const what of ["back", "skip", "fit"]) $(`teach-${what}`).addEventListener("click", () => ask("teach", what));
$("speed").addEventListener("change", () => ask("speed", $("speed").value));
$("preset").addEventListener("change", () => ask("preset", $("preset").value));
$("sign").addEventListener("change", () => ask("sign", $("sign").value));
$("iterations").addEventListener("change", () => ask("iterations", Number($("iterations").value)));
$("mode").addEventListener("change", () => ask("mode", [...$("mode").querySelectorAll("input:checked")].map((box) => box.value)));
$("model").addEventListener("change", async () => {
  const [file] = $("model").files;
  if (!file) return;
  answer({ ok: true, text: `uploading ${file.name}` });
  try {
    const reply = await fetch("/model", { method: "POST", headers: { "X-Eitskin-Token": token || "" }, body: file });
    const said = await reply.json();
    answer({ ok: reply.ok, text: said.text || said.error });
  } catch (error) {
    answer({ ok: false, text: `the upload did not arrive: ${error.message}` });
  }
  $("model").value = "";
});
$("at").addEventListener("input", () => {
  page.seeking = true;
  soon();
});
$("at").addEventListener("change", () => {
  page.seeking = false;
  ask("seek", Number($("at").value));
});
$("download").addEventListener("click", async () => {
  answer({ ok: true, text: "fetching the recording" });
  try {
    const reply = await fetch("/recording", { headers: { "X-Eitskin-Token": token || "" } });
    if (!reply.ok) throw new Error((await reply.json()).error);
    const link = document.createElement("a");
    link.download = /filename="([^"]+)"/.exec(reply.headers.get("content-disposition") || "")?.[1] || "recording.eits";
    link.href = URL.createObjectURL(await reply.blob());
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    answer({ ok: true, text: `saved ${link.download}` });
  } catch (error) {
    answer({ ok: false, text: `the recording did not come: ${error.message}` });
  }
});
$("flat").addEventListener("change", () => {
  showView();
  soon();
});
$("which").addEventListener("change", () => showSkin($("which").value));
for (const id of ["truth", "trails"]) $(id).addEventListener("change", soon);
addEventListener("resize", soon);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", soon);
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || /^(INPUT|SELECT|BUTTON)$/.test(event.target.tagName)) return;
  const button = { t: "tare", z: "undo", r: "record", " ": "play", ".": "step", b: "teach-back", s: "teach-skip", f: "teach-fit" }[event.key.toLowerCase()];
  if (!button || $(button).disabled || $(button).hidden) return;
  event.preventDefault();
  $(button).click();
});

connect();
