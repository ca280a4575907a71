// Draws the crowd buffer of a Flockbrush .glb in three.js (layout: docs/exports.md).
//
//   const gltf = await new GLTFLoader().loadAsync("run.glb");   // flockbrush export run.flock --to run.glb --gltf-mode crowd
//   const crowd = await Crowd.of(THREE, gltf);
//   scene.add(gltf.scene);
//   crowd.show(seconds);                                        // in every frame
export class Crowd {
  static async of(THREE, gltf) {
    let herd = null;
    gltf.scene.traverse((node) => { if (node.userData.crowd) herd = node; });
    if (!herd) throw new Error("no crowd buffer here: export with --gltf-mode crowd");
    const about = herd.userData.crowd, parser = gltf.parser;
    const bytes = about.bufferView === undefined ? new ArrayBuffer(0) : await parser.getDependency("bufferView", about.bufferView);
    const meshes = await Promise.all(about.poses.map((pose) => parser.getDependency("mesh", pose.mesh)));
    return new Crowd(THREE, herd, about, new DataView(bytes), meshes);
  }

  constructor(THREE, herd, about, data, meshes) {
    Object.assign(this, { THREE, about, data });
    this.at = Object.fromEntries(about.fields.map((field) => [field.name, field.offset]));
    this.poses = meshes.map((mesh) => {  // an instanced mesh for each pose; who is in that pose is drawn by it
      const many = new THREE.InstancedMesh(mesh.geometry, mesh.material, about.animals);
      many.setColorAt(0, new THREE.Color(1, 1, 1));
      many.frustumCulled = false;
      many.castShadow = true;
      herd.add(many);
      return many;
    });
    this.colours = about.brush_colours.map((rgb) => new THREE.Color(...rgb.map((part) => part * about.brightest)));
    this.one = [0, 1].map(() => ({ place: new THREE.Vector3(), turn: new THREE.Quaternion() }));
    this.matrix = new THREE.Matrix4();
    this.scale = new THREE.Vector3();
  }

  record(frame, animal) { return (frame * this.about.animals + animal) * this.about.stride; }

  code(frame, animal, field) { return this.data.getUint16(this.record(frame, animal) + this.at[field], true); }

  read(frame, animal, { place, turn }) {
    const record = this.record(frame, animal), number = (k) => this.data.getFloat32(record + this.at.place + 4 * k, true);
    const part = (k) => this.data.getInt16(record + this.at.turn + 2 * k, true) / this.about.turn_scale;
    place.set(number(0), number(1), number(2));
    turn.set(part(0), part(1), part(2), part(3)).normalize();
  }

  show(seconds) {
    const { about, one: [now, next] } = this, last = about.frames - 1;
    const exact = Math.min(Math.max(seconds * about.fps, 0), last), frame = Math.floor(exact), share = exact - frame;
    for (const pose of this.poses) pose.count = 0;
    for (let animal = 0; animal < about.animals; animal++) {
      if (!(this.code(frame, animal, "flags") & about.flags.present)) continue;
      this.read(frame, animal, now);
      const then = Math.min(frame + 1, last);
      if (this.code(then, animal, "flags") & about.flags.present) {
        this.read(then, animal, next);
        for (const [k, axis] of about.wrap ? ["x", "y"].entries() : []) {  // the short way over the seam of a periodic map
          next.place[axis] -= Math.round((next.place[axis] - now.place[axis]) / about.wrap[k]) * about.wrap[k];
        }
        now.place.lerp(next.place, share);
        now.turn.slerp(next.turn, share);
      }
      const many = this.poses[this.code(frame, animal, "pose")];
      this.scale.fromArray(about.scales[about.first_body[animal] + this.code(frame, animal, "body")]);
      many.setMatrixAt(many.count, this.matrix.compose(now.place, now.turn, this.scale));
      many.setColorAt(many.count++, this.colours[this.code(frame, animal, "brush")]);
    }
    for (const pose of this.poses) pose.instanceMatrix.needsUpdate = pose.instanceColor.needsUpdate = true;
  }
}
