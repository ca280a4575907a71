// Words: the legend, the card of an animal, and what is known of the run.
"use strict";

function element(tag, text, more = {}) {
  const made = Object.assign(document.createElement(tag), more);
  if (text !== undefined) made.textContent = text;
  return made;
}

function pairs(rows) {
  const list = element("dl");
  for (const [name, value, title] of rows) {
    const pair = element("div", undefined, { title: title ?? value });
    pair.append(element("dt", name), element("dd", value));
    list.append(pair);
  }
  return list;
}

class Legend {
  constructor(box, animals, changed) {
    Object.assign(this, { box, animals });
    const words = animals.about.words, names = Object.keys(words).filter((name) => name === "brush" || words[name].length > 1);
    this.choice = element("select", undefined, { title: "Colour animals by", id: "colouring" });
    for (const name of [...names, "speed"]) this.choice.append(element("option", `by ${name}`, { value: name }));
    this.choice.value = names.includes("state") ? "state" : "brush";
    this.choice.onchange = () => { animals.colouring = this.choice.value; this.told = ""; changed(); };
    animals.colouring = this.choice.value;
    this.list = element("ul");
    box.append(this.choice, this.list);
    this.told = "";
  }

  draw() {
    const { animals } = this, { run, about } = animals, name = animals.colouring;
    const counts = new Map();
    let leaders = 0;
    if (name !== "speed") for (let i = 0; i < run.count; i++) {
      const code = run.codes[name][i];
      counts.set(code, (counts.get(code) || 0) + 1);
    }
    for (let i = 0; i < run.count; i++) leaders += run.marked[i];
    const told = JSON.stringify([name, leaders, ...[...counts].sort((a, b) => a[0] - b[0])]);
    if (told === this.told) return;
    this.told = told;
    this.list.replaceChildren();
    if (name === "speed") {
      this.list.append(element("div", undefined, { className: "bar", style: `background: linear-gradient(to right, ${SCALE.join(", ")})` }));
      const ends = element("div", undefined, { className: "ends" });
      ends.append(element("span", "0"), element("span", `${+animals.top.toPrecision(2)} m/s`));
      this.list.append(ends);
    }
    for (const [code, count] of [...counts].sort((a, b) => a[0] - b[0])) {
      const danger = name === "brush" && about.predators[code];
      const ground = name === "brush" ? about.brush_grounds[code] : null;
      this.line(`#${animals.colourOf(name, code).getHexString()}`, about.words[name][code] || "none", count, danger, ground);
    }
    if (leaders) this.line(getComputedStyle(document.documentElement).getPropertyValue("--leader"), "leaders", leaders, true);
  }

  line(colour, text, count, square, ground) {
    const item = element("li");
    if (ground) item.append(element("img", undefined, { className: "ground", src: ground, alt: "", title: "Ground painted with this brush" }));
    item.append(element("span", undefined, { className: square ? "swatch square" : "swatch", style: `background: ${colour}` }), element("span", text), element("span", `${count}`, { className: "number" }));
    this.list.append(item);
  }
}

class Card {
  constructor(box, animals, closed) {
    Object.assign(this, { box, animals });
    this.heading = element("h2");
    this.body = element("div");
    this.title = element("span");
    this.heading.append(this.title, element("button", "×", { title: "Close (Esc)", onclick: closed }));
    box.append(this.heading, this.body);
  }

  draw() {
    const { animals } = this, { run, about } = animals;
    this.box.hidden = animals.selected === null;
    if (this.box.hidden) return;
    const i = animals.row();
    this.title.textContent = `animal ${animals.selected}`;
    if (i < 0) { this.body.replaceChildren(element("p", "not present at this time")); return; }
    const rows = Object.keys(about.words).map((name) => [name, about.words[name][run.codes[name][i]] || "none"]);
    const compass = (450 - run.yaw[i] * 180 / Math.PI) % 360;
    rows.push(["role", run.leader[i] ? "leader" : "follower"], ["speed", `${run.pace[i].toFixed(2)} m/s`],
      ["course", `${(Math.round(compass + 360) % 360)}°`, "clockwise from north"], ["height", `${(run.z[i] - animals.ground.height(run.x[i], run.y[i])).toFixed(2)} m`, "above the ground"],
      ["position", `${run.x[i].toFixed(1)}, ${run.y[i].toFixed(1)} m`], ["gait", about.clips[run.clip[i]]], ["length", `${run.length[i].toFixed(2)} m`, "of the body"]);
    if (Math.abs(run.roll[i]) > 0.01) {
      const roll = ((run.roll[i] + Math.PI) % (2 * Math.PI) + 2 * Math.PI) % (2 * Math.PI) - Math.PI;
      rows.push(["bank", `${Math.abs(roll * 180 / Math.PI).toFixed(0)}° ${roll > 0 ? "right" : "left"}`]);
    }
    this.body.replaceChildren(pairs(rows));
  }
}

function aboutRun(box, about, closed) {
  const heading = element("h2");
  heading.append(element("span", about.title), element("button", "×", { title: "Close", onclick: closed }));
  const rows = [["level", `${about.level}, ${about.width} × ${about.height} m, ${about.boundary}`], ["level SHA-256", about.level_sha256], ["seed", `${about.seed}`],
    ["frames", `${about.times.length} at ${about.fps} per second; the simulation has ${Math.round(1 / about.dt)} ticks per second`],
    ["state hash", `${about.state_hash} after the last frame`], ...Object.entries(about.source), ...Object.entries(about.versions)];
  const note = element("p", "Positions are stored to 1/65535 of the extent of the herd. Wheel: zoom; drag: orbit; right button: move the view; click: select an animal; space: play; arrow keys: previous and next frame.");
  box.append(heading, pairs(rows.map(([name, value]) => [name, `${value}`])), note);
}
