// The drawings: the skin with its image, touches and electrodes, and the raw voltages.

const AHEAD_S = 0.05;
const TRAIL_S = 1.5;
const PLACE_90 = 4.605; // chi-squared of two numbers that 90 % lie below

const ID_COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b8860b", "#56b4e9", "#7b4fa3"];

// A touch has this colour in the table, on the skin and in the plots. Colour-blind eyes can tell them apart.
export function idColour(id) {
  return ID_COLOURS[(id - 1) % ID_COLOURS.length] || ID_COLOURS[0];
}

export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

export function channels(hex) {
  const number = parseInt(hex.slice(1), 16);
  return [number >> 16, (number >> 8) & 255, number & 255];
}

// A canvas as large as it is shown, in device pixels; its context counts in CSS pixels.
export function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  const wide = Math.max(1, Math.round(width * ratio)), high = Math.max(1, Math.round(height * ratio));
  if (canvas.width !== wide || canvas.height !== high) {
    canvas.width = wide;
    canvas.height = high;
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return [context, width, height];
}

// The image of a skin as pixels; row 0 is the highest y.
export class SkinImage {
  constructor(skin) {
    this.skin = skin;
    this.peak = 0;
    this.data = new ImageData(skin.nx, skin.ny);
    this.words = new Uint32Array(this.data.data.buffer);
    this.cells = Int32Array.from(skin.cells, (cell) => {
      const row = Math.floor(cell / skin.nx);
      return (skin.ny - 1 - row) * skin.nx + (cell - row * skin.nx);
    });
    this.takeColours();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.takeColours());
  }

  takeColours() {
    const [low, middle, high] = ["low", "middle", "high"].map((name) => channels(colour(`--${name}`)));
    this.ramp = new Uint32Array(511); // from -255 to 255
    for (let k = -255; k <= 255; ++k) {
      const end = k < 0 ? low : high, part = Math.pow(Math.abs(k) / 255, 0.8);
      const [r, g, b] = middle.map((from, i) => Math.round(from + (end[i] - from) * part));
      this.ramp[k + 255] = (255 << 24) | (b << 16) | (g << 8) | r;
    }
    this.painted = undefined;
  }

  // null: no image
  paint(image) {
    if (image === this.painted) return;
    this.painted = image;
    this.words.fill(this.ramp[255]);
    if (!image) return;
    let peak = 0;
    for (const value of image) peak = Math.max(peak, Math.abs(value));
    // the colours' range follows the largest change at once, and shrinks slowly
    this.peak = Math.max(peak, 0.98 * this.peak, 0.02 * this.skin.conductivity_s_per_m);
    const factor = 255 / this.peak;
    for (let k = 0; k < this.cells.length; ++k) this.words[this.cells[k]] = this.ramp[255 + Math.round(image[k] * factor)];
  }
}

export class SkinDrawing {
  constructor(canvas) {
    this.canvas = canvas;
    this.pixels = document.createElement("canvas");
    this.trails = new Map(); // id -> [{x, y, t}]
    this.skin = null;
    this.takeColours();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.takeColours());
  }

  takeColours() {
    this.colours = Object.fromEntries(
      ["ink", "soft", "line", "panel", "accent", "touch", "true", "good", "warn", "bad", "middle", "high", "low"].map(
        (name) => [name, colour(`--${name}`)]));
  }

  // ``image``: its SkinImage
  setSkin(skin, image) {
    this.skin = skin;
    this.image = image;
    this.trails.clear();
    if (!skin) return;
    this.pixels.width = skin.nx;
    this.pixels.height = skin.ny;
    const xs = skin.outline_mm.map((p) => p[0]), ys = skin.outline_mm.map((p) => p[1]);
    this.box = [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
  }

  follow(touches, time) {
    for (const touch of touches) {
      const trail = this.trails.get(touch.id) || [];
      if (trail.length && time < trail[trail.length - 1].t) trail.length = 0;
      trail.push({ x: touch.x_mm, y: touch.y_mm, t: time });
      this.trails.set(touch.id, trail);
    }
    for (const [id, trail] of this.trails) {
      while (trail.length && (time - trail[0].t > TRAIL_S || trail[0].t > time)) trail.shift();
      if (!trail.length) this.trails.delete(id);
    }
  }

  place(width, height) {
    const [x0, y0, x1, y1] = this.box, rim = 26;
    const scale = Math.max(0.01, Math.min((width - 2 * rim) / (x1 - x0), (height - 2 * rim) / (y1 - y0)));
    this.scale = scale;
    this.x = (mm) => width / 2 + (mm - (x0 + x1) / 2) * scale;
    this.y = (mm) => height / 2 - (mm - (y0 + y1) / 2) * scale;
  }

  draw(frame, options) {
    const [context, width, height] = fitted(this.canvas);
    if (!this.skin) {
      context.fillStyle = this.colours.soft;
      context.font = "15px system-ui, sans-serif";
      context.textAlign = "center";
      context.fillText("waiting for the board,", width / 2, height / 2 - 10);
      context.fillText("or its model is not known here", width / 2, height / 2 + 10);
      return;
    }
    this.place(width, height);
    const outline = new Path2D();
    this.skin.outline_mm.forEach(([x, y], k) => outline[k ? "lineTo" : "moveTo"](this.x(x), this.y(y)));
    outline.closePath();
    context.fillStyle = this.colours.middle;
    context.fill(outline);
    if (frame && frame.image) this.drawImage(context, outline, frame.image);
    context.strokeStyle = this.colours.soft;
    context.lineWidth = 1.5;
    context.stroke(outline);
    this.drawZones(context, options.zones, options.pressed);
    this.drawElectrodes(context, options.health);
    if (options.teach) this.drawPlaces(context, options.teach);
    for (const place of options.fingers) this.drawFinger(context, place, options.finger_mm);
    if (!frame) return;
    if (options.trails) this.drawTrails(context, frame.message.time_s);
    if (options.truth) for (const touch of frame.message.true || []) this.drawTrue(context, touch);
    for (const touch of frame.message.touches || []) this.drawTouch(context, touch);
    for (const touch of (options.report || {}).touches || []) this.drawMoving(context, touch);
  }

  // The place in mm at a point of the canvas, in CSS pixels.
  placeAt(x, y) {
    if (!this.skin || !this.scale) return null;
    const [x0, y0, x1, y1] = this.box, { clientWidth: width, clientHeight: height } = this.canvas;
    return [(x0 + x1) / 2 + (x - width / 2) / this.scale, (y0 + y1) / 2 - (y - height / 2) / this.scale];
  }

  // a finger that this page presses
  drawFinger(context, [x, y], radius_mm) {
    context.fillStyle = this.colours.ink;
    context.globalAlpha = 0.18;
    context.beginPath();
    context.arc(this.x(x), this.y(y), radius_mm * this.scale, 0, 2 * Math.PI);
    context.fill();
    context.globalAlpha = 1;
  }

  // where a touch after a drive will be in AHEAD_S
  drawMoving(context, touch) {
    const x = this.x(touch.x_mm), y = this.y(touch.y_mm);
    context.strokeStyle = context.fillStyle = this.colours.accent;
    context.lineWidth = 3;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(this.x(touch.x_mm + AHEAD_S * touch.vx_mm_per_s), this.y(touch.y_mm + AHEAD_S * touch.vy_mm_per_s));
    context.stroke();
    context.beginPath();
    context.arc(x, y, 5, 0, 2 * Math.PI);
    if (touch.confirmed) context.fill();
    else context.stroke();
  }

  drawImage(context, outline, image) {
    const { skin } = this;
    this.image.paint(image);
    this.pixels.getContext("2d").putImageData(this.image.data, 0, 0);
    const [x0, y0] = skin.origin_mm, wide = skin.nx * skin.pixel_mm, high = skin.ny * skin.pixel_mm;
    context.save();
    context.clip(outline);
    context.imageSmoothingEnabled = true;
    context.drawImage(this.pixels, this.x(x0), this.y(y0 + high), wide * this.scale, high * this.scale);
    context.restore();
  }

  // The places to press: done ones are filled, the next one is a ring with its number.
  drawPlaces(context, { places_mm, done, number, step }) {
    places_mm.forEach(([x, y], k) => {
      const now = k === number && step !== "done", there = done.includes(k);
      context.beginPath();
      context.arc(this.x(x), this.y(y), now ? 13 : there ? 5 : 3, 0, 2 * Math.PI);
      context.fillStyle = context.strokeStyle = now ? this.colours.accent : there ? this.colours.good : this.colours.soft;
      context.lineWidth = 3;
      context[now ? "stroke" : "fill"]();
    });
    if (step === "done") return;
    context.font = "600 13px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillStyle = this.colours.accent;
    context.fillText(String(number + 1), this.x(places_mm[number][0]), this.y(places_mm[number][1]));
  }

  drawZones(context, zones, pressed) {
    context.font = "600 12px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    for (const zone of zones) {
      const border = new Path2D();
      zone.corners_mm.forEach(([x, y], k) => border[k ? "lineTo" : "moveTo"](this.x(x), this.y(y)));
      if (zone.corners_mm.length) border.closePath();
      for (const radius of zone.corners_mm.length ? [] : [zone.outer_mm, zone.inner_mm]) {
        if (!radius) continue;
        border.moveTo(this.x(zone.x_mm) + radius * this.scale, this.y(zone.y_mm));
        border.arc(this.x(zone.x_mm), this.y(zone.y_mm), radius * this.scale, 0, 2 * Math.PI);
      }
      context.fillStyle = context.strokeStyle = this.colours.accent;
      context.lineWidth = 1.5;
      context.globalAlpha = pressed.has(zone.name) ? 0.3 : 0.06;
      context.fill(border, "evenodd");
      context.globalAlpha = 0.8;
      context.stroke(border);
      const xs = zone.corners_mm.map((p) => p[0]), ys = zone.corners_mm.map((p) => p[1]);
      const mean = (values) => values.reduce((a, b) => a + b, 0) / values.length;
      const at = xs.length ? [mean(xs), mean(ys)] : [zone.x_mm, zone.y_mm + (zone.inner_mm ? (zone.inner_mm + zone.outer_mm) / 2 : 0.7 * zone.outer_mm)];
      context.fillText(zone.name, this.x(at[0]), this.y(at[1]));
      context.globalAlpha = 1;
    }
  }

  drawElectrodes(context, health) {
    const middle = [(this.box[0] + this.box[2]) / 2, (this.box[1] + this.box[3]) / 2];
    context.lineCap = "butt";
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.font = "600 11px system-ui, sans-serif";
    this.skin.electrode_spans_mm.forEach((span, k) => {
      const state = health[k] || "good";
      const shown = state === "good" ? this.colours.ink : state === "noisy" ? this.colours.warn : this.colours.bad;
      context.strokeStyle = context.fillStyle = shown;
      context.lineWidth = state === "good" ? 5 : 8;
      context.beginPath();
      span.forEach(([x, y], i) => context[i ? "lineTo" : "moveTo"](this.x(x), this.y(y)));
      context.stroke();
      const [x, y] = this.skin.electrode_centres_mm[k];
      const away = [x - middle[0], y - middle[1]], length = Math.hypot(...away) || 1;
      const at = [this.x(x) + (14 * away[0]) / length, this.y(y) - (14 * away[1]) / length];
      context.fillText(state === "good" ? String(k) : `${k}!`, ...at);
    });
  }

  drawTrails(context, time) {
    context.lineCap = "round";
    for (const [id, trail] of this.trails) {
      context.strokeStyle = idColour(id);
      for (let k = 1; k < trail.length; ++k) {
        const fresh = 1 - (time - trail[k].t) / TRAIL_S;
        context.globalAlpha = Math.max(0, 0.7 * fresh);
        context.lineWidth = 1 + 3 * Math.max(0, fresh);
        context.beginPath();
        context.moveTo(this.x(trail[k - 1].x), this.y(trail[k - 1].y));
        context.lineTo(this.x(trail[k].x), this.y(trail[k].y));
        context.stroke();
      }
    }
    context.globalAlpha = 1;
  }

  drawTrue(context, touch) {
    context.strokeStyle = this.colours.true;
    context.lineWidth = 2;
    context.beginPath();
    context.arc(this.x(touch.x_mm), this.y(touch.y_mm), touch.radius_mm * this.scale, 0, 2 * Math.PI);
    context.stroke();
  }

  drawTouch(context, touch) {
    const x = this.x(touch.x_mm), y = this.y(touch.y_mm);
    context.strokeStyle = context.fillStyle = this.colours.touch;
    context.lineWidth = 2;
    context.setLineDash([6, 4]);
    context.beginPath();
    context.arc(x, y, Math.max(4, touch.radius_mm * this.scale), 0, 2 * Math.PI);
    context.stroke();
    context.setLineDash([]);
    if (touch.x_variance_mm2) this.drawEllipse(context, touch, x, y);
    context.fillStyle = idColour(touch.id);
    context.beginPath();
    context.arc(x, y, 4, 0, 2 * Math.PI);
    context.fill();
    context.fillStyle = this.colours.touch;
    const words = touch.force_n ? `${touch.id}  ${touch.force_n.toFixed(1)} N` : String(touch.id);
    context.font = "700 14px system-ui, sans-serif";
    context.textAlign = "left";
    context.textBaseline = "bottom";
    context.lineWidth = 4;
    context.lineJoin = "round";
    context.strokeStyle = this.colours.panel;
    const away = Math.max(5, 0.75 * touch.radius_mm * this.scale);
    context.strokeText(words, x + away, y - away);
    context.fillText(words, x + away, y - away);
  }

  // where the true centre lies with 90 %
  drawEllipse(context, touch, x, y) {
    const a = touch.x_variance_mm2, b = touch.xy_covariance_mm2, c = touch.y_variance_mm2;
    const mean = (a + c) / 2, apart = Math.hypot((a - c) / 2, b);
    const radii = [mean + apart, Math.max(0, mean - apart)].map((v) => Math.max(1, Math.sqrt(PLACE_90 * v) * this.scale));
    context.lineWidth = 1.5;
    context.beginPath();
    context.ellipse(x, y, ...radii, -0.5 * Math.atan2(2 * b, a - c), 0, 2 * Math.PI);
    context.stroke();
  }
}

// Three digits or more, and no power of ten.
function inMillivolts(volts) {
  return `${Number((1e3 * volts).toPrecision(3))} mV`;
}

export class VoltsDrawing {
  constructor(canvas) {
    this.canvas = canvas;
  }

  draw(volts, reference) {
    const [context, width, height] = fitted(this.canvas);
    const ink = colour("--soft");
    context.font = "12px system-ui, sans-serif";
    context.fillStyle = ink;
    if (!volts) {
      context.textAlign = "center";
      context.fillText("no raw voltages are streamed", width / 2, height / 2);
      return "No raw voltages are streamed";
    }
    const known = reference && reference.length === volts.length;
    let top = 1e-9, apart = 0, usable = 0;
    for (let k = 0; k < volts.length; ++k) {
      if (!Number.isFinite(volts[k])) continue;
      ++usable;
      top = Math.max(top, Math.abs(volts[k]), known ? Math.abs(reference[k]) : 0);
      if (known) apart = Math.max(apart, Math.abs(volts[k] - reference[k]));
    }
    const left = 66, bottom = height - 18, middle = bottom / 2;
    // noise stays a thin line: 60 dB times 100 is a tenth of the largest voltage
    const enlarged = apart > 0 ? Math.min(100, (0.9 * top) / apart) : 1;
    const x = (k) => left + ((k + 0.5) / volts.length) * (width - left - 4);
    const y = (v) => middle - (v / top) * (middle - 6);
    context.strokeStyle = colour("--line");
    context.lineWidth = 1;
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const v of [top, 0, -top]) {
      context.beginPath();
      context.moveTo(left, y(v));
      context.lineTo(width, y(v));
      context.stroke();
      context.fillText(v ? inMillivolts(v) : "0", left - 6, Math.max(8, y(v)));
    }
    context.textAlign = "left";
    context.textBaseline = "alphabetic";
    const times = known && apart > 0 ? `; difference up to ${inMillivolts(apart)}, × ${Number(enlarged.toPrecision(2))}` : "";
    context.fillText(`${volts.length} rows${times}`, 4, height - 4);
    const line = (value, name, wide) => {
      context.strokeStyle = colour(name);
      context.lineWidth = wide;
      context.lineJoin = "round";
      context.beginPath();
      let down = false;
      for (let k = 0; k < volts.length; ++k) {
        const v = value(k);
        if (!Number.isFinite(v)) { down = false; continue; }
        context[down ? "lineTo" : "moveTo"](x(k), y(v));
        down = true;
      }
      context.stroke();
    };
    if (known) line((k) => reference[k], "--soft", 2.5);
    line((k) => volts[k], "--accent", 1.2);
    if (known && apart > 0) line((k) => (volts[k] - reference[k]) * enlarged, "--high", 1.2);
    const lost = volts.length - usable;
    return `${volts.length} raw voltages up to ${(1e3 * top).toPrecision(3)} millivolts` +
      (lost ? `, ${lost} not usable` : "") +
      (known ? `; largest difference from the reference ${(1e3 * apart).toPrecision(3)} millivolts` : "");
  }
}
