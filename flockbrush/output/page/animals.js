// Animals: an instanced mesh and its shadow for each look, coloured by brush, state, species or speed.
"use strict";

const SUN = [-0.42, -0.38, 0.824];  // as in the playground
const SMALLEST = 7;  // pixels: no animal is drawn shorter
const COARSE = 16;   // pixels: shorter animals have fewer triangles
const TRAIL = 2.5;   // s
const SCALE = ["#00224e", "#35456c", "#666970", "#948e77", "#c8b866", "#fee838"];  // cividis

class Look {
  constructor(scene, mesh, most, about, place) {
    this.first = mesh.first;
    this.poses = mesh.count;
    this.geometry = new THREE.InstancedBufferGeometry();
    const count = mesh.vertices, rows = mesh.points.length / 3 / count, texels = new Float32Array(4 * count * rows);
    for (let k = 0; k < count * rows; k++) texels.set(mesh.points.slice(3 * k, 3 * k + 3), 4 * k);
    const poses = new THREE.DataTexture(texels, count, rows, THREE.RGBAFormat, THREE.FloatType);
    poses.needsUpdate = true;
    const attribute = (values, size) => new THREE.BufferAttribute(new Float32Array(values), size);
    this.geometry.setAttribute("position", attribute(mesh.points.slice(0, 3 * count), 3));
    this.geometry.setAttribute("vertex", attribute([...Array(count).keys()], 1));
    this.geometry.setAttribute("shade", attribute(mesh.shade, 1));
    this.geometry.setIndex(mesh.triangles);
    for (const name of ["place", "turn", "pose", "paint"]) {
      this[name] = new THREE.InstancedBufferAttribute(new Float32Array(4 * most), 4);
      this[name].setUsage(THREE.DynamicDrawUsage);
      this.geometry.setAttribute(name, this[name]);
    }
    const [r, g, b, alpha] = about.shadow;
    this.uniforms = {
      poses: { value: poses }, pixel: { value: 0.001 }, smallest: { value: SMALLEST }, sun: { value: new THREE.Vector3(...SUN) },
      shadow: { value: new THREE.Vector4(r / 255, g / 255, b / 255, alpha) }, leaderColour: { value: rgb(about.leader) }, ...place.common,
    };
    const body = new THREE.ShaderMaterial({ uniforms: this.uniforms, vertexShader: ANIMAL_VERTEX, fragmentShader: ANIMAL_PIXEL, side: THREE.DoubleSide });
    const dark = new THREE.ShaderMaterial({
      uniforms: this.uniforms, vertexShader: SHADOW_VERTEX, fragmentShader: SHADOW_PIXEL, transparent: true, depthWrite: false,
      side: THREE.DoubleSide, stencilWrite: true, stencilRef: 1, stencilFunc: THREE.NotEqualStencilFunc, stencilZPass: THREE.ReplaceStencilOp,
    });
    this.meshes = [new THREE.Mesh(this.geometry, body), new THREE.Mesh(this.geometry, dark)];
    this.meshes[1].renderOrder = -1;
    for (const mesh of this.meshes) {
      mesh.frustumCulled = false;
      scene.add(mesh);
    }
  }
}

class Animals {
  constructor(scene, run, about, place) {
    this.run = run;
    this.about = about;
    this.ground = place;
    this.looks = {};
    for (const [name, mesh] of Object.entries(about.meshes)) {
      this.looks[name] = new Look(scene, mesh, run.most, about, place);
      this.looks[`${name} coarse`] = new Look(scene, { ...mesh, triangles: mesh.coarse }, run.most, about, place);
    }
    this.colouring = "brush";
    this.selected = null;
    this.top = Math.max(0.1, ...about.measures.find((m) => m.name === "speed").values.map((value) => 2 * (value ?? 0)));
    this.trail = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false }));
    this.trail.frustumCulled = false;
    this.ring = new THREE.Mesh(new THREE.RingGeometry(0.93, 1, 48), new THREE.MeshBasicMaterial({ color: css("--ink"), transparent: true, opacity: 0.8, depthTest: false }));
    this.ring.renderOrder = 5;
    scene.add(this.trail, this.ring);
    this.scale = SCALE.map((colour) => new THREE.Color(colour));
    this.colours = new Map();
  }

  colourOf(name, code) {
    if (!this.colours.has(name)) this.colours.set(name, []);
    const known = this.colours.get(name), others = this.about.other_colours;
    if (!known[code]) known[code] = name === "brush" ? new THREE.Color(this.about.brush_colours[code] || others[code % others.length]) : new THREE.Color(others[code % others.length]);
    return known[code];
  }

  colour(i) {
    if (this.colouring !== "speed") return this.colourOf(this.colouring, this.run.codes[this.colouring][i]);
    const at = Math.min(0.999, this.run.pace[i] / this.top) * (this.scale.length - 1), k = Math.floor(at);
    return this.scale[k].clone().lerp(this.scale[k + 1], at - k);
  }

  draw(time, camera, height, trails) {
    const run = this.run, counts = {}, eye = camera.position, pixel = 2 * Math.tan(camera.fov * Math.PI / 360) / height;
    run.at(time);
    for (const name in this.looks) counts[name] = 0;
    for (let i = 0; i < run.count; i++) {
      const away = Math.hypot(run.x[i] - eye.x, run.y[i] - eye.y, run.z[i] - eye.z);
      const name = (this.about.looks[run.species[i]] ?? "beast") + (run.length[i] < COARSE * pixel * away ? " coarse" : "");
      const look = this.looks[name], k = 4 * counts[name]++;
      const colour = this.colour(i), clip = run.clip[i], poses = look.poses[clip], at = run.phase[i] * poses, row = Math.floor(at) % poses;
      look.place.array.set([run.x[i], run.y[i], run.z[i], run.length[i]], k);
      look.turn.array.set([run.yaw[i], run.pitch[i], run.roll[i], run.width[i] / 0.4], k);
      look.pose.array.set([look.first[clip] + row, look.first[clip] + (row + 1) % poses, at - Math.floor(at), this.ground.height(run.x[i], run.y[i])], k);
      look.paint.array.set([colour.r, colour.g, colour.b, run.marked[i]], k);
    }
    for (const name in this.looks) {
      const look = this.looks[name];
      look.geometry.instanceCount = counts[name];
      look.uniforms.pixel.value = pixel;
      for (const attribute of [look.place, look.turn, look.pose, look.paint]) attribute.needsUpdate = true;
      for (const mesh of look.meshes) mesh.visible = counts[name] > 0;
    }
    this.drawTrails(time, trails);
  }

  // Fading lines behind everybody (few of them), and the longer way of who is selected.
  drawTrails(time, trails) {
    const lines = { points: [], colours: [] };
    const few = trails && this.run.count <= 400;
    for (let i = 0; few && i < this.run.count; i++) this.layTrail(lines, this.run.ids[i], this.colour(i), time, TRAIL, 0.04, 10);
    const row = this.row();
    if (row >= 0) this.layTrail(lines, this.selected, css("--ink"), time, 12, 0.08, 96);
    this.ring.visible = row >= 0;
    if (row >= 0) {
      this.ring.position.set(this.run.x[row], this.run.y[row], this.run.z[row] + 0.07);
      this.ring.scale.setScalar(Math.max(0.75 * this.run.length[row], 0.2));
    }
    this.trail.geometry.dispose();
    this.trail.geometry = new THREE.BufferGeometry();
    this.trail.geometry.setAttribute("position", new THREE.Float32BufferAttribute(lines.points, 3));
    this.trail.geometry.setAttribute("color", new THREE.Float32BufferAttribute(lines.colours, 4));
    this.trail.visible = lines.points.length > 0;
  }

  layTrail(lines, id, colour, time, seconds, lift, pieces) {
    const way = this.run.wayOf(id, time, seconds, pieces), count = way.length / 3, wrap = this.about.wrap;
    for (let k = 0; k + 1 < count; k++) {
      const a = 3 * k, b = a + 3;
      if (wrap && Math.hypot(way[a] - way[b], way[a + 1] - way[b + 1]) > Math.min(...wrap) / 2) continue;
      lines.points.push(way[a], way[a + 1], way[a + 2] + lift, way[b], way[b + 1], way[b + 2] + lift);
      lines.colours.push(colour.r, colour.g, colour.b, 0.75 * (k + 1) / count, colour.r, colour.g, colour.b, 0.75 * (k + 2) / count);
    }
  }

  row() {
    return this.selected === null ? -1 : this.run.ids.subarray(0, this.run.count).indexOf(this.selected);
  }

  middle() {
    const run = this.run, n = Math.max(1, run.count), sum = [0, 0, 0];
    for (let i = 0; i < run.count; i++) { sum[0] += run.x[i]; sum[1] += run.y[i]; sum[2] += run.z[i]; }
    return new THREE.Vector3(...sum.map((part) => part / n));
  }

  // The animal nearest to a pixel, null where none is near.
  pick(x, y, camera, width, height) {
    const point = new THREE.Vector3();
    let best = 22, found = null;
    for (let i = 0; i < this.run.count; i++) {
      point.set(this.run.x[i], this.run.y[i], this.run.z[i] + 0.4 * this.run.length[i]).project(camera);
      if (point.z > 1) continue;
      const far = Math.hypot((point.x + 1) * width / 2 - x, (1 - point.y) * height / 2 - y);
      if (far < best) { best = far; found = this.run.ids[i]; }
    }
    return found;
  }
}
