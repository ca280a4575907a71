// The data of the page: base64, packed with zlib, unpacked by the browser.
"use strict";

function parts(kind) {
  return [...document.querySelectorAll(`script[data-kind="${kind}"]`)];
}

function bytesOf(element) {
  const text = atob(element.textContent), bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  element.textContent = "";
  return bytes;
}

async function inflated(element) {
  const stream = new Blob([bytesOf(element)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function json(element) {
  return JSON.parse(new TextDecoder().decode(await inflated(element)));
}

// A chunk as output/page/frames.py writes it: columns by name, numbers [animal * frames + frame].
function chunkOf(bytes, names, first) {
  const view = new DataView(bytes.buffer, bytes.byteOffset);
  const frames = view.getUint32(0, true), animals = view.getUint32(4, true), bodies = view.getUint32(8, true);
  const box = Array.from({ length: 6 }, (_, k) => view.getFloat32(12 + 4 * k, true));
  let at = 36;
  const ids = new Uint32Array(animals), body = new Uint32Array(animals), length = new Float32Array(bodies), width = new Float32Array(bodies);
  for (const numbers of [ids, body]) {
    for (let k = 0; k < animals; k++) numbers[k] = view.getUint32(at + 4 * k, true);
    at += 4 * animals;
  }
  for (const sizes of [length, width]) {
    for (let k = 0; k < bodies; k++) sizes[k] = view.getFloat32(at + 4 * k, true);
    at += 4 * bodies;
  }
  const columns = {}, count = frames * animals;
  for (const name of names) {
    const values = new Uint16Array(count);
    for (let a = 0, k = 0; a < animals; a++) {
      let value = 0;
      for (let f = 0; f < frames; f++, k++) {
        value = (value + bytes[at + k] + (bytes[at + count + k] << 8)) & 65535;
        values[k] = value;
      }
    }
    columns[name] = values;
    at += 2 * count;
  }
  const row = new Map();
  ids.forEach((id, k) => row.set(id, k));
  return { first, frames, animals, box, ids, body, length, width, columns, row };
}

const CODES = ["clip", "species", "brush", "leader", "marked"];  // columns that are taken over as they are

// Where everybody is at any time: rows of numbers, filled anew for each picture.
class Run {
  constructor(chunks, about) {
    this.chunks = chunks;
    this.about = about;
    this.times = about.times;
    this.labels = Object.keys(about.words);
    this.everybody = new Set(chunks.flatMap((chunk) => [...chunk.ids])).size;  // who is there at any time
    this.most = Math.max(1, ...chunks.map((chunk) => chunk.animals));
    const make = (kind) => new kind(this.most);
    this.ids = make(Uint32Array);
    for (const name of ["x", "y", "z", "yaw", "pitch", "roll", "phase", "length", "width", "pace"]) this[name] = make(Float32Array);
    for (const name of CODES) this[name] = make(Uint16Array);
    this.codes = Object.fromEntries(this.labels.map((name) => [name, make(Uint16Array)]));
    this.count = 0;
  }

  get duration() {
    return this.times.length ? this.times[this.times.length - 1] - this.times[0] : 0;
  }

  frameAt(time) {
    let low = 0, high = this.times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.times[middle] <= time + 1e-9) low = middle; else high = middle - 1;
    }
    return low;
  }

  chunkAt(frame) {
    return this.chunks[Math.min(this.chunks.length - 1, this.chunks.findIndex((c) => frame < c.first + c.frames))];
  }

  place(chunk, k, out) {
    const box = chunk.box;
    out[0] = box[0] + chunk.columns.x[k] * box[3] / 65535;
    out[1] = box[1] + chunk.columns.y[k] * box[4] / 65535;
    out[2] = box[2] + chunk.columns.z[k] * box[5] / 65535;
    return out;
  }

  // The index of an animal's numbers in the columns of a frame's chunk; -1 where it is not there.
  indexIn(chunk, id, frame) {
    const row = chunk?.row.get(id), k = row === undefined ? -1 : row * chunk.frames + frame - chunk.first;
    return k >= 0 && chunk.columns.present[k] ? k : -1;
  }

  // Fill the rows with the animals at a time (s); between two frames they are between two places.
  at(time) {
    this.count = 0;
    if (!this.chunks.length) return;
    const t = time + this.times[0], frame = this.frameAt(t);
    const chunk = this.chunkAt(frame), f = frame - chunk.first;
    const beside = (number) => (number in this.times ? { chunk: this.chunkAt(number), seconds: Math.abs(this.times[number] - this.times[frame]) } : {});
    const next = beside(frame + 1), last = beside(frame - 1), after = next.chunk, before = last.chunk;
    const share = after ? Math.min(1, Math.max(0, (t - this.times[frame]) / next.seconds)) : 0;
    const here = [0, 0, 0], there = [0, 0, 0], wrap = this.about.wrap;
    // To the place in another frame, the short way over the seam of a periodic map.
    const wayTo = (other, k) => {
      this.place(other, k, there);
      for (let c = 0; c < 2 && wrap; c++) {
        if (Math.abs(there[c] - here[c]) > wrap[c] / 2) there[c] += there[c] < here[c] ? wrap[c] : -wrap[c];
      }
      return Math.hypot(there[0] - here[0], there[1] - here[1], there[2] - here[2]);
    };
    for (let row = 0; row < chunk.animals; row++) {
      const k = row * chunk.frames + f;
      if (!chunk.columns.present[k]) continue;
      const i = this.count++, columns = chunk.columns;
      this.place(chunk, k, here);
      const id = chunk.ids[row], m = this.indexIn(after, id, frame + 1), goesOn = share > 0 && m >= 0;
      const turn = (name) => {
        const a = columns[name][k];
        const change = goesOn ? (((after.columns[name][m] - a + 32768) & 65535) - 32768) * share : 0;
        return (a + change) * (2 * Math.PI / 65536);
      };
      if (m >= 0) {
        this.pace[i] = wayTo(after, m) / next.seconds;
        for (let c = 0; c < 3; c++) here[c] += (there[c] - here[c]) * share;
      } else {
        const was = this.indexIn(before, id, frame - 1);
        this.pace[i] = was < 0 ? 0 : wayTo(before, was) / last.seconds;
      }
      this.x[i] = here[0]; this.y[i] = here[1]; this.z[i] = here[2];
      this.yaw[i] = turn("yaw"); this.pitch[i] = turn("pitch"); this.roll[i] = turn("roll");
      const p = columns.phase[k], on = goesOn ? ((after.columns.phase[m] - p) & 65535) * share : 0;
      this.phase[i] = ((p + on) % 65536) / 65536;
      this.ids[i] = id;
      const body = chunk.body[row] + columns.body[k];
      this.length[i] = chunk.length[body]; this.width[i] = chunk.width[body];
      for (const name of CODES) this[name][i] = columns[name][k];
      for (const name of this.labels) this.codes[name][i] = columns[name] ? columns[name][k] : 0;
    }
  }

  // The way of one animal in the last seconds before a time, in about so many pieces: [x, y, z, ...], oldest first.
  wayOf(id, time, seconds, pieces) {
    const last = this.frameAt(time + this.times[0]), first = this.frameAt(Math.max(0, time - seconds) + this.times[0]);
    const step = Math.max(1, Math.floor((last - first) / pieces)), way = [], at = [0, 0, 0];
    let chunk = null;
    for (let frame = first + (last - first) % step; frame <= last; frame += step) {
      if (!chunk || frame >= chunk.first + chunk.frames) chunk = this.chunkAt(frame);
      const k = this.indexIn(chunk, id, frame);
      if (k < 0) continue;
      this.place(chunk, k, at);
      way.push(at[0], at[1], at[2]);
    }
    return way;
  }
}
