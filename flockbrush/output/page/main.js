// Puts the page together and runs it.
"use strict";

const SMOOTH = 1 / 60;  // s between two pictures
const $ = (id) => document.getElementById(id);

// Whether there is no graphics card: then smooth edges cost too much.
function drawnByCpu() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) throw new Error("this browser has no WebGL 2");
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  const name = names ? gl.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

class Player {
  constructor(about, run, place, picture, ...patches) {
    Object.assign(this, { about, run, time: 0, playing: false, pace: 1, dirty: true, frames: 0 });
    THREE.ColorManagement.enabled = false;
    this.renderer = new THREE.WebGLRenderer({ canvas: $("view"), antialias: !drawnByCpu(), stencil: true });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.ratio = Math.min(2, window.devicePixelRatio || 1);
    this.renderer.setPixelRatio(this.ratio);
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(38, 1, 0.1, 1e5);
    this.camera.up.set(0, 0, 1);
    this.place = new Place(this.scene, place, about, picture, patches, this.renderer.getContextAttributes().antialias ? 8 : 1);
    this.animals = new Animals(this.scene, run, about, this.place);
    this.orbit = new THREE.OrbitControls(this.camera, $("view"));
    this.orbit.mouseButtons.MIDDLE = THREE.MOUSE.ROTATE;  // as in the playground
    Object.assign(this.orbit, { maxPolarAngle: 1.54, enableDamping: true, dampingFactor: 0.12, zoomToCursor: true });
    this.orbit.addEventListener("change", () => { this.dirty = true; });
    this.charts = new Charts($("charts"), about, run.duration);
    this.legend = new Legend($("legend"), this.animals, () => { this.dirty = true; });
    this.card = new Card($("card"), this.animals, () => this.select(null));
    $("title").textContent = about.title;
    $("summary").textContent = `${run.everybody.toLocaleString("en")} animals, ${+run.duration.toFixed(2)} s, seed ${about.seed}`;
    aboutRun($("about"), about, () => this.toggleAbout());
    this.listen();
    this.resize();
    run.at(0);
    this.view("orbit");
  }

  view(name) {
    this.mode = name;
    $("orbit").classList.toggle("on", name === "orbit");
    $("plan").classList.toggle("on", name === "plan");
    const { width, height } = this.place.place, run = this.run;
    this.camera.far = 60 * Math.max(width, height);
    this.camera.near = Math.max(0.05, 0.001 * Math.max(width, height));
    this.camera.updateProjectionMatrix();
    const tall = Math.max(0, ...run.z.subarray(0, run.count));
    const low = new THREE.Vector2(0, 0), high = new THREE.Vector2(width, height);
    const target = new THREE.Vector3((low.x + high.x) / 2, (low.y + high.y) / 2, tall > 3 && name !== "plan" ? 0.5 * tall : 0);
    const plan = { minPolarAngle: 0, maxPolarAngle: 0, enableRotate: false }, orbit = { minPolarAngle: 0, maxPolarAngle: 1.54, enableRotate: true };
    Object.assign(this.orbit, name === "plan" ? plan : orbit);
    const from = name === "plan" ? [0, -0.001, 1] : [-0.1, -0.8, 0.6], widest = Math.max(high.x - low.x, high.y - low.y);
    const corners = [0, tall].flatMap((z) => [[low.x, low.y, z], [high.x, low.y, z], [low.x, high.y, z], [high.x, high.y, z]]);
    let far = widest / 4;
    do {
      this.camera.position.set(target.x + from[0] * far, target.y + from[1] * far, target.z + from[2] * far);
      far *= 1.03;
    } while (!this.shows(corners, target) && far < 50 * widest);
    this.orbit.target.copy(target);
    this.orbit.update();
    this.dirty = true;
  }

  // Whether points are in the picture, above the charts.
  shows(points, target) {
    this.camera.lookAt(target);
    this.camera.updateMatrixWorld();
    const bottom = 1.02 - 2 * this.free() / window.innerHeight;
    return points.every(([x, y, z]) => {
      const at = new THREE.Vector3(x, y, z).project(this.camera);
      return at.z < 1 && Math.abs(at.x) < 0.98 && at.y > bottom && at.y < 0.98;
    });
  }

  // Height of the picture above the charts, in pixels.
  free() {
    return $("charts").getBoundingClientRect().top - $("view").getBoundingClientRect().top;
  }

  listen() {
    $("play").onclick = () => this.play(!this.playing);
    $("back").onclick = () => this.step(-1);
    $("forth").onclick = () => this.step(1);
    $("scrub").oninput = () => { this.play(false); this.seek($("scrub").value * this.run.duration); };
    $("speed").onchange = () => { this.pace = +$("speed").value; };
    $("orbit").onclick = () => this.view("orbit");
    $("plan").onclick = () => this.view("plan");
    $("more").onclick = () => this.toggleAbout();
    $("trails").onchange = $("follow").onchange = () => { this.dirty = true; this.last = null; };
    $("charts").onpointerdown = $("charts").onpointermove = (event) => {
      if (event.type === "pointermove" && !(event.buttons & 1)) return;
      this.play(false);
      this.seek(this.charts.timeAt(event.offsetX));
    };
    let down = null;
    $("view").addEventListener("pointerdown", (event) => { down = [event.clientX, event.clientY]; });
    $("view").addEventListener("pointerup", (event) => {
      if (down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < 5) this.click(event.clientX, event.clientY);
      down = null;
    });
    window.addEventListener("keydown", (event) => this.key(event));
    window.addEventListener("resize", () => this.resize());
  }

  key(event) {
    if (event.target.tagName === "SELECT" || event.ctrlKey || event.metaKey || event.altKey) return;
    const does = { " ": () => this.play(!this.playing), ArrowLeft: () => this.step(-1), ArrowRight: () => this.step(1), o: () => this.view("orbit"),
      p: () => this.view("plan"), i: () => this.toggleAbout(), Escape: () => ($("about").hidden ? this.select(null) : this.toggleAbout()), Home: () => this.seek(0) }[event.key];
    if (!does || (event.target.tagName === "BUTTON" && event.key === " ")) return;
    event.preventDefault();
    does();
  }

  toggleAbout() {
    $("about").hidden = !$("about").hidden;
    $("more").setAttribute("aria-expanded", `${!$("about").hidden}`);
  }

  click(x, y) {
    const box = $("view").getBoundingClientRect();
    this.select(this.animals.pick(x - box.left, y - box.top, this.camera, box.width, box.height));
  }

  select(id) {
    this.animals.selected = id;
    this.last = null;
    this.dirty = true;
  }

  play(on) {
    if (on && this.time >= this.run.duration) this.time = 0;
    this.playing = on && this.run.duration > 0;
    $("play").textContent = this.playing ? "❚❚" : "▶";
    $("play").setAttribute("aria-label", this.playing ? "Pause" : "Play");
    this.dirty = true;
  }

  seek(time) {
    this.time = Math.min(this.run.duration, Math.max(0, time));
    this.dirty = true;
  }

  step(by) {
    this.play(false);
    const frame = this.run.frameAt(this.time + this.run.times[0]) + by;
    this.seek(this.run.times[Math.min(this.run.times.length - 1, Math.max(0, frame))] - this.run.times[0]);
  }

  resize() {
    const width = window.innerWidth, height = window.innerHeight;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.setViewOffset(width, height, 0, (height - this.free()) / 2, width, height);  // its middle lies above the charts
    document.documentElement.style.setProperty("--free", `${this.free()}px`);
    this.charts.resize();
    this.dirty = true;
  }

  followed() {
    const row = this.animals.row(), run = this.run;
    return row >= 0 ? new THREE.Vector3(run.x[row], run.y[row], run.z[row]) : this.animals.middle();
  }

  // Fewer pixels where pictures come slowly, more again where they come fast.
  adapt(passed) {
    this.slow = 0.9 * (this.slow ?? SMOOTH) + 0.1 * passed;
    const wanted = this.slow > 2.5 * SMOOTH ? this.ratio * 0.8 : this.slow < 1.2 * SMOOTH ? this.ratio * 1.25 : this.ratio;
    const ratio = Math.min(Math.min(2, window.devicePixelRatio || 1), Math.max(0.4, wanted));
    if (ratio === this.ratio || (this.waits = (this.waits ?? 0) + 1) < 15) return;
    this.waits = 0;
    this.ratio = ratio;
    this.renderer.setPixelRatio(ratio);
    this.resize();
  }

  tick(now) {
    const passed = Math.min(0.25, (now - (this.before ?? now)) / 1000);
    this.before = now;
    if (this.playing) this.adapt(passed);
    if (this.playing) {
      this.time += passed * this.pace;
      if (this.time >= this.run.duration) { this.time = this.run.duration; this.play(false); }
      this.dirty = true;
    }
    this.orbit.update();
    if (!this.dirty) return;
    this.dirty = false;
    this.place.move(this.time + (this.run.times[0] || 0));
    this.place.paint(this.time + (this.run.times[0] || 0));
    this.animals.draw(this.time, this.camera, window.innerHeight, $("trails").checked);
    if ($("follow").checked && this.run.count) {
      const at = this.followed();
      if (this.last) {
        const moved = at.clone().sub(this.last);
        this.camera.position.add(moved);
        this.orbit.target.add(moved);
      }
      this.last = at;
      this.orbit.update();
    }
    this.renderer.render(this.scene, this.camera);
    this.frames++;
    this.charts.draw(this.time);
    this.legend.draw();
    this.card.draw();
    $("scrub").value = this.run.duration ? this.time / this.run.duration : 0;
    $("clock").textContent = `${this.time.toFixed(1)} / ${this.run.duration.toFixed(1)} s`;
  }
}

async function pictureOf(part) {
  const picture = new Image();
  picture.src = URL.createObjectURL(new Blob([bytesOf(part)], { type: "image/jpeg" }));
  await picture.decode();
  return picture;
}

async function begin() {
  if (typeof DecompressionStream === "undefined") throw new Error("this browser is too old: it has no DecompressionStream");
  const three = element("script", new TextDecoder().decode(await inflated(parts("three")[0])));
  document.head.append(three);
  const about = await json(parts("about")[0]), place = await json(parts("place")[0]);
  const labels = await Promise.all(parts("labels").map(json)), chunks = [];
  let first = 0;
  for (const [k, part] of parts("frames").entries()) {
    const chunk = chunkOf(await inflated(part), [...about.columns, ...labels[k]], first);
    first += chunk.frames;
    chunks.push(chunk);
  }
  const pictures = await Promise.all([...parts("ground"), ...parts("patch")].map(pictureOf));
  const player = new Player(about, new Run(chunks, about), place, ...pictures);
  const loop = (now) => { player.tick(now); requestAnimationFrame(loop); };
  requestAnimationFrame(loop);
  $("message").hidden = true;
  return player;
}

// For whoever embeds the page: a promise of the player (seek, play, select, view, run).
window.flockbrush = begin();
window.flockbrush.catch((error) => { $("message").textContent = `This page cannot be shown: ${error.message}`; });
