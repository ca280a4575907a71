// The measures over time, under one another's time line; a click goes there.
"use strict";

const FONT = "12px system-ui, 'DejaVu Sans', sans-serif";
const NARROWEST = 135;  // px of a chart, with its name and value beside each other

class Charts {
  constructor(canvas, about, duration) {
    Object.assign(this, { canvas, about, duration });
    this.context = canvas.getContext("2d");
    this.known = about.measures.filter((m) => m.values.some((value) => value !== null));
    this.shown = this.known;
    this.still = null;
    canvas.title = this.known.map((m) => `${m.name}: ${m.meaning}`).join("\n");
  }

  resize() {
    const ratio = window.devicePixelRatio || 1, box = this.canvas.getBoundingClientRect();
    this.width = box.width;
    this.height = box.height;
    this.shown = this.known.slice(0, Math.max(1, Math.floor(this.width / NARROWEST)));
    this.canvas.width = Math.round(box.width * ratio);
    this.canvas.height = Math.round(box.height * ratio);
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.still = null;
  }

  range(measure) {
    if (measure.range) return measure.range;
    const values = measure.values.filter((value) => value !== null), whole = measure.unit === "1";
    const low = whole ? 0 : Math.min(0, ...values), high = whole ? 1 : Math.max(...values) * 1.08 || 1;
    measure.range = [low, high];
    return measure.range;
  }

  // Lines and names, which stay; drawn once for each size.
  background() {
    const still = document.createElement("canvas"), context = still.getContext("2d"), ratio = this.canvas.width / this.width;
    still.width = this.canvas.width;
    still.height = this.canvas.height;
    context.scale(ratio, ratio);
    this.shown.forEach((measure, k) => {
      const left = this.left(k), times = this.about.times;
      context.strokeStyle = this.colour("--muted");
      context.globalAlpha = 0.35;
      context.strokeRect(left + 0.5, 18.5, this.across, this.tall);
      context.globalAlpha = 1;
      context.strokeStyle = this.colour("--exit");
      context.lineWidth = 1.6;
      context.beginPath();
      let down = false;
      const step = Math.max(1, Math.floor(times.length / (2 * this.across)));
      for (let f = 0; f < times.length; f += step) {
        const value = measure.values[f];
        if (value !== null) {
          const x = left + this.across * (this.duration ? (times[f] - times[0]) / this.duration : 0), y = this.y(measure, value);
          if (down) context.lineTo(x, y); else context.moveTo(x, y);
        }
        down = value !== null;
      }
      context.stroke();
      context.fillStyle = this.colour("--ink");
      context.font = FONT;
      context.fillText(measure.name, left, 12);
    });
    return still;
  }

  colour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name);
  }

  left(k) {
    return k * this.width / this.shown.length;
  }

  get across() {
    return this.width / this.shown.length - 14;
  }

  get tall() {
    return this.height - 20;
  }

  y(measure, value) {
    const [low, high] = this.range(measure);
    return 18 + this.tall * (1 - (value - low) / (high - low || 1));
  }

  draw(time) {
    const context = this.context;
    this.still ??= this.background();
    context.clearRect(0, 0, this.width, this.height);
    context.drawImage(this.still, 0, 0, this.width, this.height);
    const count = this.about.times.length, share = this.duration ? time / this.duration : 0;
    const ink = this.colour("--ink"), mark = this.colour("--goal");
    context.font = FONT;
    context.textAlign = "right";
    this.shown.forEach((measure, k) => {
      const now = measure.values[Math.min(count - 1, Math.round(share * (count - 1)))], x = this.left(k) + this.across * share;
      const unit = measure.unit && measure.unit !== "1" ? ` ${measure.unit}` : "";
      context.fillStyle = ink;
      context.fillText(now === null || now === undefined ? "–" : `${+now.toPrecision(3)}${unit}`, this.left(k) + this.across, 12);
      context.fillStyle = mark;
      context.fillRect(x - 0.5, 18, 1, this.tall);
      if (now === null || now === undefined) return;
      context.beginPath();
      context.arc(x, this.y(measure, now), 3, 0, 7);
      context.fill();
    });
  }

  timeAt(x) {
    const wide = this.width / this.shown.length, at = (x % wide) / (wide - 14);
    return Math.min(1, Math.max(0, at)) * this.duration;
  }
}
