// The skins in three dimensions: surfaces with their image, touches, forces as arrows, electrodes,
// and a camera for mouse, fingers and keys. Everything is in metres of the robot's base frame.
import { channels, colour, fitted, idColour } from "./drawing.js";

const RING = 48; // corners of the circle round a touch
const SIDES = 12; // of an arrow
const VIEW = Math.PI / 5; // the camera's angle from top to bottom
const TURN = Math.PI / 24; // by an arrow key
const ELECTRODE_M = 0.007; // as wide as an electrode is drawn
const ON_SKIN = 0.004; // nearer to the eye, in depths of the view
const GLOW = 0.22; // of a skin that faces the eye, on a dark page
const STRIDE = 9; // floats of a corner: place, normal (0: not lit), colour

const SURFACE_SHADERS = [`
attribute vec3 place, normal; attribute vec2 at; uniform mat4 camera;
varying vec3 vPlace, vNormal; varying vec2 vAt;
void main() { vPlace = place; vNormal = normal; vAt = at; gl_Position = camera * vec4(place, 1.0); }`, `
precision mediump float; uniform sampler2D image; uniform vec3 eye, inside; uniform float glow;
varying vec3 vPlace, vNormal; varying vec2 vAt;
void main() {
  float facing = dot(normalize(vNormal), normalize(eye - vPlace));
  vec3 seen = facing < 0.0 ? mix(texture2D(image, vAt).rgb, inside, 0.7) : texture2D(image, vAt).rgb;
  gl_FragColor = vec4(seen * (0.62 + 0.38 * abs(facing)) + glow * abs(facing), 1.0);
}`];
const SOLID_SHADERS = [`
attribute vec3 place, normal, shade; uniform mat4 camera; uniform vec3 eye; uniform float size, lift;
varying vec3 vShade;
void main() {
  float light = dot(normal, normal) < 0.5 ? 1.0 : 0.6 + 0.4 * max(0.0, dot(normal, normalize(eye - place)));
  vShade = shade * light; gl_PointSize = size; gl_Position = camera * vec4(place, 1.0);
  gl_Position.z -= lift * gl_Position.w; // what lies on the skin is not hidden by it
}`, "precision mediump float; varying vec3 vShade; void main() { gl_FragColor = vec4(vShade, 1.0); }"];

// ---- vectors, and 4 by 4 matrices: rows in what the server sends, columns for WebGL ----

const plus = (a, b, times = 1) => [a[0] + times * b[0], a[1] + times * b[1], a[2] + times * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => {
  const length = Math.hypot(...a);
  return length > 0 ? a.map((x) => x / length) : [0, 0, 1];
};
const turned = (pose, a) => [0, 1, 2].map((k) => dot(pose[k], a));
const moved = (pose, a) => [0, 1, 2].map((k) => dot(pose[k], a) + pose[k][3]);
const product = (a, b) => Array.from({ length: 16 }, (_, k) => [0, 1, 2, 3].reduce((sum, i) => sum + a[(k % 4) + 4 * i] * b[i + 4 * (k >> 2)], 0));

// ---- one skin ----

// The triangles of a simple polygon, by cutting off ears.
function ears(corners) {
  const left = corners.map((_, k) => k), triangles = [];
  const turn = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  for (let k = 0, failed = 0; left.length > 3 && failed < left.length; ) {
    const ids = [0, 1, 2].map((i) => left[(k + i) % left.length]), [a, b, c] = ids.map((i) => corners[i]);
    const isEar = turn(a, b, c) > 0 && left.every((i) => {
      const p = corners[i];
      return ids.includes(i) || turn(a, b, p) < 0 || turn(b, c, p) < 0 || turn(c, a, p) < 0;
    });
    if (isEar) {
      triangles.push(ids);
      left.splice((k + 1) % left.length, 1);
      failed = 0;
    } else failed += 1;
    k = (k + 1) % left.length;
  }
  if (left.length >= 3) triangles.push(left.slice(0, 3));
  return triangles;
}

// Weights of the corners of a flat triangle at a place; all of them are at least 0 inside.
function weights([a, b, c], [x, y]) {
  const area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  const second = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area;
  const third = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area;
  return [1 - second - third, second, third];
}

class SkinShape {
  // ``facts`` of a skin in the session's setup; without a surface it is its flat outline
  constructor(facts, image) {
    this.source = facts.source;
    this.skin = facts.skin;
    this.image = image;
    const surface = facts.surface, flat = surface ? surface.flat_mm : this.skin.outline_mm;
    const points = surface ? surface.points_m : flat.map(([x, y]) => [x / 1e3, y / 1e3, 0]);
    this.flat = flat;
    this.pose = surface ? null : facts.pose;
    this.link = facts.link_pose;
    this.triangles = surface ? surface.triangles : ears(flat);
    this.points = points.map((p) => moved(facts.pose, p));
    this.normals = this.points.map(() => [0, 0, 0]);
    for (const [a, b, c] of this.triangles) {
      const [p, q, r] = [a, b, c].map((k) => this.points[k]), area = cross(plus(q, p, -1), plus(r, p, -1));
      for (const k of [a, b, c]) this.normals[k] = plus(this.normals[k], area);
    }
    this.normals = this.normals.map(unit);
    this.sort();
  }

  // Each cell of the plane knows the triangles that reach into it.
  sort() {
    const xs = this.flat.map((p) => p[0]), ys = this.flat.map((p) => p[1]);
    const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
    const side = Math.sqrt(((x1 - x0) * (y1 - y0)) / Math.max(1, this.triangles.length)) || 1;
    this.cellOf = (x, y) => [Math.floor((x - x0) / side), Math.floor((y - y0) / side)];
    this.cells = new Map();
    if (this.pose) return;
    this.triangles.forEach((triangle, number) => {
      const corners = triangle.map((k) => this.flat[k]);
      const [i0, j0] = this.cellOf(Math.min(...corners.map((p) => p[0])), Math.min(...corners.map((p) => p[1])));
      const [i1, j1] = this.cellOf(Math.max(...corners.map((p) => p[0])), Math.max(...corners.map((p) => p[1])));
      for (let i = i0; i <= i1; ++i) for (let j = j0; j <= j1; ++j) {
        if (!this.cells.has(`${i} ${j}`)) this.cells.set(`${i} ${j}`, []);
        this.cells.get(`${i} ${j}`).push(number);
      }
    });
  }

  // The point of a place of the drawing, and the normal there, out of the skin.
  at(x, y) {
    if (this.pose) return { point: moved(this.pose, [x / 1e3, y / 1e3, 0]), normal: turned(this.pose, [0, 0, 1]) };
    for (const number of this.cells.get(this.cellOf(x, y).join(" ")) || []) {
      const triangle = this.triangles[number], share = weights(triangle.map((k) => this.flat[k]), [x, y]);
      if (Math.min(...share) < -1e-6) continue;
      const mean = (values) => triangle.reduce((sum, k, i) => plus(sum, values[k], share[i]), [0, 0, 0]);
      return { point: mean(this.points), normal: unit(mean(this.normals)) };
    }
    let nearest = 0, least = Infinity; // beyond the rim
    this.flat.forEach((p, k) => {
      const away = Math.hypot(p[0] - x, p[1] - y);
      if (away < least) [nearest, least] = [k, away];
    });
    return { point: this.points[nearest], normal: this.normals[nearest] };
  }

  // The middle of a touch: where its message places it in the link's frame, else by the drawing.
  middleOf(touch) {
    if (!touch.position_m) return this.at(touch.x_mm, touch.y_mm);
    return { point: moved(this.link, touch.position_m), normal: turned(this.link, touch.normal) };
  }

  // A ray first meets the skin at this distance, and at this place of the drawing.
  meet(from, along) {
    let met = null;
    for (const triangle of this.triangles) {
      const [a, b, c] = triangle.map((k) => this.points[k]), ab = plus(b, a, -1), ac = plus(c, a, -1);
      const p = cross(along, ac), size = dot(ab, p);
      if (Math.abs(size) < 1e-15) continue;
      const s = plus(from, a, -1), u = dot(s, p) / size, q = cross(s, ab), v = dot(along, q) / size, away = dot(ac, q) / size;
      if (u < 0 || v < 0 || u + v > 1 || away <= 0 || (met && away >= met.away)) continue;
      const [f, g, h] = triangle.map((k) => this.flat[k]);
      met = { away, source: this.source, place: [0, 1].map((k) => f[k] + u * (g[k] - f[k]) + v * (h[k] - f[k])) };
    }
    return met;
  }
}

// ---- all skins ----

export class SurfaceDrawing {
  constructor(canvas, labels) {
    this.canvas = canvas;
    this.labels = labels; // a canvas above it, for words
    this.shapes = [];
    this.most = {}; // the greatest force and strength so far, which the longest arrow shows
    this.gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true });
    if (this.gl) this.begin();
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => {
      this.begin();
      for (const shape of this.shapes) this.load(shape);
    });
  }

  begin() {
    const { gl } = this;
    this.surface = program(gl, SURFACE_SHADERS);
    this.solid = program(gl, SOLID_SHADERS);
    this.changing = gl.createBuffer();
    gl.enable(gl.DEPTH_TEST);
  }

  // ``images`` by source
  setSkins(skins, images) {
    this.shapes = skins.filter((one) => one.skin).map((one) => new SkinShape(one, images.get(one.source)));
    this.most = { force: 0, strength: 0 };
    if (!this.gl || !this.shapes.length) return;
    for (const shape of this.shapes) this.load(shape);
    const points = this.shapes.flatMap((shape) => shape.points), ends = [0, 1, 2].map((k) => points.reduce(
      ([low, high], p) => [Math.min(low, p[k]), Math.max(high, p[k])], [Infinity, -Infinity]));
    this.middle = ends.map(([low, high]) => (low + high) / 2);
    this.size = Math.max(1e-3, Math.hypot(...ends.map(([low, high]) => high - low)) / 2);
    this.home();
  }

  // Look at the side to which the skins face, a little from above.
  home() {
    const facing = this.shapes.flatMap((shape) => shape.normals).reduce((sum, n) => plus(sum, n), [0, 0, 0]);
    const count = this.shapes.reduce((sum, shape) => sum + shape.normals.length, 0);
    const [x, y, z] = facing.map((one) => one / Math.max(1, count)), level = Math.hypot(x, y);
    this.target = [...this.middle];
    this.away = (1.04 * this.size) / Math.sin(VIEW / 2);
    this.turn = level > 0.2 ? Math.atan2(y, x) - 0.5 : -1.0;
    this.rise = Math.max(-1.2, Math.min(1.2, Math.atan2(z, level || 1) * 0.8 + 0.35));
  }

  load(shape) {
    const { gl } = this, { skin, flat, points, normals } = shape;
    const [x0, y0] = skin.origin_mm, wide = skin.nx * skin.pixel_mm, high = skin.ny * skin.pixel_mm;
    const corners = points.flatMap((p, k) => [...p, ...normals[k], (flat[k][0] - x0) / wide, (flat[k][1] - y0) / high]);
    shape.corners = filled(gl, gl.ARRAY_BUFFER, new Float32Array(corners));
    shape.indices = filled(gl, gl.ELEMENT_ARRAY_BUFFER, new Uint16Array(shape.triangles.flat()));
    shape.texture = gl.createTexture();
    shape.lines = skin.outline_mm.map(([x, y]) => this.above(shape, x, y));
    shape.marks = skin.electrode_centres_mm.map(([x, y]) => this.above(shape, x, y));
  }

  // A point a little above the skin, so that the skin does not hide what is drawn there.
  above(shape, x, y) {
    const { point, normal } = shape.at(x, y);
    return plus(point, normal, 0.004 * (this.size || 0.1));
  }

  camera(width, height) {
    const { turn, rise, away, target, size } = this;
    this.back = [Math.cos(rise) * Math.cos(turn), Math.cos(rise) * Math.sin(turn), Math.sin(rise)];
    this.right = [-Math.sin(turn), Math.cos(turn), 0];
    this.up = cross(this.back, this.right);
    this.eye = plus(target, this.back, away);
    this.wide = width / height;
    const f = 1 / Math.tan(VIEW / 2) * Math.min(1, this.wide), near = Math.max(away - 4 * size, away / 50), far = away + 4 * size;
    this.lens = [f / this.wide, f];
    const view = [0, 1, 2].flatMap((k) => [this.right[k], this.up[k], this.back[k], 0]);
    const shift = [this.right, this.up, this.back].map((axis) => -dot(axis, this.eye));
    const lens = [this.lens[0], 0, 0, 0, 0, this.lens[1], 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
    return product(lens, [...view, ...shift, 1]);
  }

  // ``frames`` by source
  draw(frames, options) {
    const { gl, canvas } = this;
    if (!gl || !this.shapes.length) return;
    const [words, width, height] = fitted(this.labels);
    if (!width || !height) return;
    if (canvas.width !== this.labels.width || canvas.height !== this.labels.height) {
      canvas.width = this.labels.width;
      canvas.height = this.labels.height;
    }
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(...shade("--panel"), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const camera = this.camera(width, height);
    this.view = { camera, width, height, words };
    for (const shape of this.shapes) this.drawSkin(shape, frames.get(shape.source), camera);
    const made = { triangles: [], lines: [], points: [] };
    words.font = "600 13px system-ui, sans-serif";
    words.textAlign = "left";
    for (const shape of this.shapes) {
      this.addRim(made, shape, options.health.get(shape.source) || {});
      if (this.shapes.length > 1) this.writeName(shape);
      for (const place of options.fingers.get(shape.source) || []) this.addRing(made, shape, place, options.finger_mm, shade("--soft"));
      const frame = frames.get(shape.source);
      if (!frame) continue;
      if (options.truth) for (const touch of frame.message.true || []) this.addRing(made, shape, [touch.x_mm, touch.y_mm], touch.radius_mm, shade("--true"));
      for (const touch of frame.message.touches || []) this.addTouch(made, shape, touch);
    }
    this.drawSolid(made.triangles, gl.TRIANGLES, camera, 0);
    this.drawSolid(made.lines, gl.LINES, camera, ON_SKIN);
    this.drawSolid(made.points, gl.POINTS, camera, ON_SKIN, this.electrodePixels(height) * (canvas.width / width));
  }

  electrodePixels(height) {
    return Math.max(3, Math.min(9, (ELECTRODE_M * height) / (2 * this.away * Math.tan(VIEW / 2))));
  }

  drawSkin(shape, frame, camera) {
    const { gl, surface } = this;
    shape.image.paint(frame ? frame.image : null);
    gl.useProgram(surface.program);
    gl.bindTexture(gl.TEXTURE_2D, shape.texture);
    gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, true); // row 0 of the image is the highest y
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, shape.image.data);
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.uniformMatrix4fv(surface.camera, false, camera);
    gl.uniform3fv(surface.eye, this.eye);
    gl.uniform3fv(surface.inside, shade("--line"));
    gl.uniform1f(surface.glow, Math.max(...shade("--panel")) < 0.5 ? GLOW : 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, shape.corners);
    attributes(gl, surface, { place: 3, normal: 3, at: 2 });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, shape.indices);
    gl.drawElements(gl.TRIANGLES, 3 * shape.triangles.length, gl.UNSIGNED_SHORT, 0);
  }

  drawSolid(corners, kind, camera, lift, size = 1) {
    const { gl, solid } = this;
    if (!corners.length) return;
    gl.useProgram(solid.program);
    gl.uniformMatrix4fv(solid.camera, false, camera);
    gl.uniform3fv(solid.eye, this.eye);
    gl.uniform1f(solid.size, size);
    gl.uniform1f(solid.lift, lift);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.changing);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(corners), gl.DYNAMIC_DRAW);
    attributes(gl, solid, { place: 3, normal: 3, shade: 3 });
    gl.drawArrays(kind, 0, corners.length / STRIDE);
  }

  // The rim, and the electrodes with their health.
  addRim(made, { lines, marks }, health) {
    const unlit = [0, 0, 0], soft = shade("--soft");
    lines.forEach((point, k) => made.lines.push(...point, ...unlit, ...soft, ...lines[(k + 1) % lines.length], ...unlit, ...soft));
    marks.forEach((point, k) => {
      const name = { noisy: "--warn", open: "--bad", bridged: "--bad" }[health[k]] || "--ink";
      made.points.push(...point, ...unlit, ...shade(name));
    });
  }

  // The circle round a place of the drawing, on the skin.
  addRing(made, shape, [x, y], radius, shown) {
    const corner = (k, part) => {
      const angle = (2 * Math.PI * k) / RING;
      return [...this.above(shape, x + part * radius * Math.cos(angle), y + part * radius * Math.sin(angle)), 0, 0, 0, ...shown];
    };
    for (let k = 0; k < RING; ++k) {
      const [a, b, c, d] = [corner(k, 0.88), corner(k, 1), corner(k + 1, 0.88), corner(k + 1, 1)];
      made.triangles.push(...a, ...b, ...c, ...b, ...d, ...c);
    }
  }

  // The circle, the arrow that presses, and the words. The arrow is as long as the force, or where
  // the model is not calibrated the strength, is great.
  addTouch(made, shape, touch) {
    const shown = channels(idColour(touch.id)).map((one) => one / 255), kind = touch.force_n ? "force" : "strength";
    const great = touch.force_n || Math.abs(touch.strength_s_per_m_mm2);
    this.addRing(made, shape, [touch.x_mm, touch.y_mm], touch.radius_mm, shown);
    this.most[kind] = Math.max(this.most[kind], great);
    const { point, normal } = shape.middleOf(touch), length = this.size * (0.1 + (0.35 * great) / (this.most[kind] || 1));
    this.addArrow(made, plus(point, normal, length), plus(point, normal, 0.01 * this.size), shown);
    const words = touch.force_n ? `${touch.id}  ${touch.force_n.toFixed(1)} N` : String(touch.id);
    this.write(words, plus(point, normal, length), "--touch", dot(normal, plus(this.eye, point, -1)) < 0);
  }

  addArrow(made, from, to, shown) {
    const along = unit(plus(to, from, -1)), side = unit(cross(along, Math.abs(along[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
    const other = cross(along, side), thick = 0.012 * this.size, head = plus(to, along, -5 * thick);
    const out = (k) => plus(side.map((x) => x * Math.cos((2 * Math.PI * k) / SIDES)), other, Math.sin((2 * Math.PI * k) / SIDES));
    const corner = (point, normal) => [...point, ...normal, ...shown];
    for (let k = 0; k < SIDES; ++k) {
      const [a, b] = [out(k), out(k + 1)];
      const [low, high] = [a, b].map((n) => [corner(plus(from, n, thick), n), corner(plus(head, n, thick), n)]);
      made.triangles.push(...low[0], ...low[1], ...high[0], ...high[0], ...low[1], ...high[1]);
      made.triangles.push(...corner(plus(head, a, 2.6 * thick), a), ...corner(to, a), ...corner(plus(head, b, 2.6 * thick), b));
      made.triangles.push(...corner(from, plus([0, 0, 0], along, -1)), ...low[0], ...high[0]);
    }
  }

  // The name of a skin, below it.
  writeName({ source, lines }) {
    const places = lines.map((point) => this.onScreen(point)), low = Math.max(...places.map((at) => at[1]));
    const xs = places.map((at) => at[0]), { words } = this.view;
    words.textAlign = "center";
    words.fillStyle = colour("--soft");
    words.fillText(source, (Math.min(...xs) + Math.max(...xs)) / 2, low + 15);
    words.textAlign = "left";
  }

  // Words beside a point; paler behind the skin.
  write(text, point, name, behind = false) {
    const { words } = this.view, at = this.onScreen(point);
    words.globalAlpha = behind ? 0.35 : 1;
    words.lineWidth = 4;
    words.lineJoin = "round";
    words.strokeStyle = colour("--panel");
    words.fillStyle = colour(name);
    words.strokeText(text, at[0] + 6, at[1] - 4);
    words.fillText(text, at[0] + 6, at[1] - 4);
    words.globalAlpha = 1;
  }

  // A point in CSS pixels of the canvas.
  onScreen(point) {
    const { camera: m, width, height } = this.view;
    const [x, y, , w] = [0, 1, 2, 3].map((k) => m[k] * point[0] + m[k + 4] * point[1] + m[k + 8] * point[2] + m[k + 12]);
    return [(width * (1 + x / w)) / 2, (height * (1 - y / w)) / 2];
  }

  // The skin and the place of its drawing under a point of the canvas; null beside all skins.
  pick(x, y) {
    if (!this.view) return null;
    const { width, height } = this.view, across = ((2 * x) / width - 1) / this.lens[0], over = (1 - (2 * y) / height) / this.lens[1];
    const along = plus(plus(this.right.map((one) => one * across), this.up, over), this.back, -1);
    const met = this.shapes.map((shape) => shape.meet(this.eye, along)).filter(Boolean);
    return met.reduce((first, one) => (!first || one.away < first.away ? one : first), null);
  }

  // ---- the camera ----

  rotate(right, down) {
    this.turn -= right;
    this.rise = Math.max(-1.5, Math.min(1.5, this.rise + down));
  }

  zoom(times) {
    this.away = Math.max(0.3 * this.size, Math.min(20 * this.size, this.away * times));
  }

  // by CSS pixels
  shift(right, down) {
    const m = (2 * this.away * Math.tan(VIEW / 2)) / Math.max(1, this.canvas.clientHeight);
    this.target = plus(plus(this.target, this.right, -right * m), this.up, down * m);
  }

  // Whether the key moved the camera.
  key(key) {
    const turn = { ArrowLeft: [-TURN, 0], ArrowRight: [TURN, 0], ArrowUp: [0, -TURN], ArrowDown: [0, TURN] }[key];
    if (turn) this.rotate(...turn);
    else if (key === "+" || key === "=") this.zoom(1 / 1.15);
    else if (key === "-") this.zoom(1.15);
    else if (key === "Home") this.home();
    else return false;
    return true;
  }
}

// ---- WebGL ----

function shade(name) {
  return channels(colour(name)).map((one) => one / 255);
}

function program(gl, [vertex, fragment]) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const part = gl.createShader(kind);
    gl.shaderSource(part, text);
    gl.compileShader(part);
    gl.attachShader(made, part);
  }
  gl.linkProgram(made);
  const uniforms = ["camera", "eye", "inside", "glow", "size", "lift"].map((name) => [name, gl.getUniformLocation(made, name)]);
  return { program: made, ...Object.fromEntries(uniforms) };
}

function filled(gl, kind, values) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(kind, buffer);
  gl.bufferData(kind, values, gl.STATIC_DRAW);
  return buffer;
}

// The attributes of a corner, one after the other, as many floats as named.
function attributes(gl, { program: made }, sizes) {
  const stride = 4 * Object.values(sizes).reduce((a, b) => a + b, 0);
  let offset = 0;
  for (let k = 0; k < 4; ++k) gl.disableVertexAttribArray(k);
  for (const [name, size] of Object.entries(sizes)) {
    const place = gl.getAttribLocation(made, name);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, gl.FLOAT, false, stride, offset);
    offset += 4 * size;
  }
}
