// What stands still: sky, ground, obstacles, guides, goals and areas. Metres, z up.
"use strict";

const rgb = (numbers) => new THREE.Color(...numbers.map((part) => part / 255));

// Some of the faces of a place.
function part(place, first, count) {
  const some = (values, width) => values.slice(width * first, width * (first + count));
  return { faces: some(place.faces, 12), face_colours: some(place.face_colours, 3), alphas: some(place.alphas, 1) };
}

// Those faces that stand still.
function standing(place, moving) {
  const kept = { faces: [], face_colours: [], alphas: [] };
  let next = 0;
  const add = (end) => {
    const some = part(place, next, end - next);
    for (const name in kept) kept[name] = kept[name].concat(some[name]);
  };
  for (const one of moving.filter((one) => !one.faces)) {
    add(one.first);
    next = one.first + one.count;
  }
  add(place.alphas.length);
  return kept;
}

class Place {
  constructor(scene, place, about, picture, patches, sharpness) {
    this.patches = about.patches.map(([time, left, top], k) => ({ time, left, top, image: patches[k] }));
    this.picture = picture;
    this.painted = 0;
    this.sharpness = sharpness;
    this.place = place;
    const size = Math.max(place.width, place.height);
    const common = { haze: { value: rgb(about.sky[0]) }, clear: { value: 5 * size } };
    this.common = common;
    scene.add(this.sky(about), this.ground(place, about, picture, common), this.outside(place, about, common));
    this.moving = about.moving.map((one) => ({ track: one.track, mesh: this.obstacles(one.faces ? one : part(place, one.first, one.count)) }));
    for (const one of this.moving) scene.add(one.mesh);
    const still = standing(place, about.moving);
    if (still.faces.length) scene.add(this.obstacles(still));
    for (const guide of place.guides) scene.add(this.line(guide, css("--guide"), 0.55));
    for (const area of place.outlines) scene.add(this.line(area, rgb(area.colour), 0.6));
    for (const goal of place.goals) scene.add(this.goal(goal, size));
  }

  sky(about) {
    const uniforms = { horizon: { value: rgb(about.sky[0]) }, zenith: { value: rgb(about.sky[1]) }, land: { value: rgb(about.land) } };
    const material = new THREE.ShaderMaterial({ uniforms, vertexShader: SKY_VERTEX, fragmentShader: SKY_PIXEL, side: THREE.BackSide, depthWrite: false });
    const sky = new THREE.Mesh(new THREE.SphereGeometry(1, 24, 16), material);
    sky.frustumCulled = false;
    sky.renderOrder = 3;  // what is behind comes last: hidden pixels cost nothing
    return sky;
  }

  ground(place, about, picture, common) {
    this.canvas = document.createElement("canvas");
    [this.canvas.width, this.canvas.height] = [picture.width, picture.height];
    this.canvas.getContext("2d").drawImage(picture, 0, 0);
    const map = this.map = new THREE.Texture(this.patches.length ? this.canvas : picture);
    map.anisotropy = this.sharpness;
    map.needsUpdate = true;
    const { columns, rows } = place, points = [], uv = [], index = [], [left, lower, right, upper] = place.picture;
    for (let j = 0; j < rows; j++) for (let i = 0; i < columns; i++) {
      const u = i / (columns - 1), v = j / (rows - 1);
      points.push(u * place.width, v * place.height, place.heights.length ? place.heights[j * columns + i] : 0);
      uv.push(left + u * (right - left), lower + v * (upper - lower));
    }
    for (let j = 0; j + 1 < rows; j++) for (let i = 0; i + 1 < columns; i++) {
      const k = j * columns + i;
      index.push(k, k + 1, k + columns + 1, k, k + columns + 1, k + columns);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    geometry.setAttribute("uv", new THREE.Float32BufferAttribute(uv, 2));
    geometry.setIndex(index);
    const uniforms = { map: { value: map }, textured: { value: 1 }, plain: { value: rgb(about.land) }, ...common };
    const mesh = new THREE.Mesh(geometry, new THREE.ShaderMaterial({ uniforms, vertexShader: GROUND_VERTEX, fragmentShader: GROUND_PIXEL }));
    mesh.renderOrder = 1;
    return mesh;
  }

  outside(place, about, common) {
    const far = 40 * Math.max(place.width, place.height), geometry = new THREE.CircleGeometry(far, 64);
    const low = place.heights.length ? Math.min(...place.heights) : 0;
    geometry.translate(place.width / 2, place.height / 2, low - 0.02);
    const uniforms = { map: { value: null }, textured: { value: 0 }, plain: { value: rgb(about.land) }, ...common };
    const material = new THREE.ShaderMaterial({ uniforms, vertexShader: GROUND_VERTEX, fragmentShader: GROUND_PIXEL });
    material.polygonOffset = true;
    material.polygonOffsetFactor = material.polygonOffsetUnits = 4;
    const mesh = new THREE.Mesh(geometry, material);
    mesh.renderOrder = 2;
    return mesh;
  }

  obstacles(place) {
    const points = place.faces, corners = [], colours = [], count = place.alphas.length;
    for (let face = 0; face < count; face++) for (const corner of [0, 1, 2, 0, 2, 3]) {
      corners.push(...points.slice(12 * face + 3 * corner, 12 * face + 3 * corner + 3));
      colours.push(...place.face_colours.slice(3 * face, 3 * face + 3).map((part) => part / 255), place.alphas[face]);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(corners, 3));
    geometry.setAttribute("color", new THREE.Float32BufferAttribute(colours, 4));
    const clear = place.alphas.some((alpha) => alpha < 1);
    return new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ vertexColors: true, transparent: clear, side: clear ? THREE.DoubleSide : THREE.FrontSide }));
  }

  // Let the ground be painted as it was at a time (s of the run).
  paint(time) {
    let count = 0;
    while (count < this.patches.length && this.patches[count].time <= time + 1e-9) count++;
    if (count === this.painted) return;
    const brush = this.canvas.getContext("2d");
    if (count < this.painted) {
      brush.drawImage(this.picture, 0, 0);
      this.painted = 0;
    }
    for (const { left, top, image } of this.patches.slice(this.painted, count)) brush.drawImage(image, left, top);
    this.painted = count;
    this.map.needsUpdate = true;
  }

  // Put obstacles where they are at a time (s of the run).
  move(time) {
    for (const { track, mesh } of this.moving) {
      let k = 0;
      while (k + 1 < track.length && track[k + 1][0] <= time + 1e-9) k++;
      const [from, shown, ...here] = track[k], next = track[k + 1] || track[k];
      const share = next[0] > from ? Math.min(1, Math.max(0, (time - from) / (next[0] - from))) : 0;
      mesh.visible = shown === 1;
      mesh.position.set(...here.map((part, axis) => part + share * (next[2 + axis] - part)));
    }
  }

  line(line, color, opacity) {
    const points = [];
    const corners = line.closed ? [...line.points, line.points[0]] : line.points;
    for (const [x, y, z] of corners) points.push(x, y, z + 0.06);
    const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(points, 3));
    return new THREE.Line(geometry, new THREE.LineBasicMaterial({ color, transparent: true, opacity }));
  }

  goal(goal, size) {
    const group = new THREE.Group(), tall = Math.min(5, Math.max(0.02 * size, 0.6));
    const colour = new THREE.MeshBasicMaterial({ color: css("--goal"), side: THREE.DoubleSide });
    const pole = new THREE.Mesh(new THREE.CylinderGeometry(0.018 * tall, 0.018 * tall, tall, 8), new THREE.MeshBasicMaterial({ color: css("--muted") }));
    pole.rotation.x = Math.PI / 2;
    pole.position.z = tall / 2;
    const cloth = new THREE.BufferGeometry();
    cloth.setAttribute("position", new THREE.Float32BufferAttribute([0, 0, tall, 0.5 * tall, 0, 0.83 * tall, 0, 0, 0.66 * tall], 3));
    group.add(pole, new THREE.Mesh(cloth, colour));
    if (goal.radius > 0) {
      const ring = new THREE.Mesh(new THREE.RingGeometry(Math.max(goal.radius - 0.01 * size, 0.9 * goal.radius), goal.radius, 64), colour.clone());
      ring.material.transparent = true;
      ring.material.opacity = 0.5;
      ring.position.z = 0.05;
      group.add(ring);
    }
    group.position.set(...goal.at);
    return group;
  }

  height(x, y) {
    const { heights, columns, rows, width, height } = this.place;
    if (!heights.length) return 0;
    const u = Math.min(Math.max(x / width, 0), 1) * (columns - 1), v = Math.min(Math.max(y / height, 0), 1) * (rows - 1);
    const i = Math.min(Math.floor(u), columns - 2), j = Math.min(Math.floor(v), rows - 2), a = u - i, b = v - j;
    const at = (di, dj) => heights[(j + dj) * columns + i + di];
    return (at(0, 0) * (1 - a) + at(1, 0) * a) * (1 - b) + (at(0, 1) * (1 - a) + at(1, 1) * a) * b;
  }
}

function css(name) {
  return new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue(name).trim());
}
