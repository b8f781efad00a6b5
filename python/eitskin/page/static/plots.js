// Place and force of each touch over the last seconds.
import { colour, fitted, idColour } from "./drawing.js";

const SHOWN_S = 10;

export class PlotsDrawing {
  constructor(canvas) {
    this.canvas = canvas;
    this.times = []; // of the frames
    this.lines = new Map(); // id -> [{t, x, y, force}]
  }

  follow(touches, time) {
    const { times, lines } = this;
    if (times.length && time < times[times.length - 1] - 1) { // not a frame of another skin
      times.length = 0;
      lines.clear();
    }
    times.push(Math.max(time, times[times.length - 1] || time));
    while (times[0] < time - SHOWN_S) times.shift();
    for (const touch of touches) {
      if (!lines.has(touch.id)) lines.set(touch.id, []);
      lines.get(touch.id).push({ t: time, x: touch.x_mm, y: touch.y_mm, force: touch.force_n, strength: touch.strength_s_per_m_mm2 });
    }
    for (const [id, line] of lines) {
      while (line.length && line[0].t < time - SHOWN_S) line.shift();
      if (!line.length) lines.delete(id);
    }
  }

  draw(box) {
    const [context, width, height] = fitted(this.canvas);
    const forces = [...this.lines.values()].some((line) => line.some((at) => at.force));
    const last = forces ? "force" : "strength";
    const most = Math.max(...[...this.lines.values()].flat().map((at) => at[last] || 0), 1e-9);
    const [x0, y0, x1, y1] = box || [0, 0, 1, 1];
    const strips = [
      { name: "x", title: ["x, mm"], low: Math.floor(x0), high: Math.ceil(x1) },
      { name: "y", title: ["y, mm"], low: Math.floor(y0), high: Math.ceil(y1) },
      { name: last, title: forces ? ["force, N"] : ["strength,", "S mm²/m"], low: 0, high: round(most) },
    ];
    const left = 56, end = this.times.length ? this.times[this.times.length - 1] : 0;
    const t = (time) => width - 4 - ((end - time) / SHOWN_S) * (width - left - 4);
    const high = (height - 16) / strips.length;
    context.font = "11px system-ui, sans-serif";
    context.lineJoin = "round";
    strips.forEach((strip, k) => {
      const top = k * high + 5, bottom = (k + 1) * high - 3;
      const y = (value) => bottom - ((value - strip.low) / (strip.high - strip.low)) * (bottom - top);
      context.strokeStyle = colour("--line");
      context.lineWidth = 1;
      context.fillStyle = colour("--soft");
      context.textAlign = "right";
      context.textBaseline = "middle";
      for (const at of [bottom, top]) {
        context.beginPath();
        context.moveTo(left, at);
        context.lineTo(width, at);
        context.stroke();
      }
      strip.title.forEach((line, n) => context.fillText(line, left - 6, (top + bottom) / 2 + 12 * (n - (strip.title.length - 1) / 2)));
      context.fillText(shown(strip.high), left - 6, top + 4);
      context.fillText(shown(strip.low), left - 6, bottom - 4);
      for (const [id, line] of this.lines) {
        context.strokeStyle = context.fillStyle = idColour(id);
        context.lineWidth = 1.8;
        context.beginPath();
        let before = -1;
        for (const at of line) {
          const value = Math.min(strip.high, Math.max(strip.low, at[strip.name] || 0));
          context[before >= 0 && at.t - before < 0.5 ? "lineTo" : "moveTo"](t(at.t), y(value));
          before = at.t;
        }
        context.stroke();
      }
    });
    context.fillStyle = colour("--soft");
    context.textBaseline = "alphabetic";
    for (const ago of [10, 5, 0]) {
      context.textAlign = ago === 10 ? "left" : ago ? "center" : "right";
      context.fillText(ago ? `${ago} s ago` : "now", t(end - ago), height - 4);
    }
    const ids = [...this.lines.keys()];
    return ids.length ? `Place and ${last} over the last ${SHOWN_S} seconds of ${ids.length === 1 ? "touch" : "touches"} ${ids.join(", ")}` : "No touch in the last seconds";
  }
}

// The next number of 1, 2 or 5 times a power of ten.
function round(value) {
  const power = Math.pow(10, Math.floor(Math.log10(value)));
  return power * ([1, 2, 5].find((one) => one * power >= value) || 10);
}

function shown(value) {
  return String(Math.round(100 * value) / 100);
}
