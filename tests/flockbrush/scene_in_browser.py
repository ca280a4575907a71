"""A .glb shown by three.js in a headless browser: `shown` in it is {renderer, scene, camera, gltf, mixer, crowd}."""

import base64
import zlib
from pathlib import Path

from browser import Browser

import flockbrush.output.page as page

ROOT = Path(__file__).parents[2]
SHOW = """
  const packed = new Blob([bytes("three")]).stream().pipeThrough(new DecompressionStream("deflate"));
  const text = await new Response(packed).text();
  (0, eval)(text + ";globalThis.THREE = THREE");
  const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  renderer.setSize(innerWidth, innerHeight);
  document.body.append(renderer.domElement);
  const gltf = await new Promise((done, failed) => new THREE.GLTFLoader().parse(bytes("glb").buffer, "", done, failed));
  const scene = new THREE.Scene();
  scene.background = new THREE.Color("#dfe9ec");
  scene.add(gltf.scene, new THREE.HemisphereLight("#ffffff", "#8a8a70", 1.2));
  gltf.scene.updateMatrixWorld(true);
  const camera = gltf.cameras[0];
  let mixer = null, crowd = null;
  if (gltf.animations.length) {
    mixer = new THREE.AnimationMixer(gltf.scene);
    for (const clip of gltf.animations) {
      const action = mixer.clipAction(clip);
      action.loop = THREE.LoopOnce;
      action.clampWhenFinished = true;
      action.play();
    }
  } else crowd = await Crowd.of(THREE, gltf);
  const show = (seconds) => {
    if (mixer) mixer.setTime(seconds); else crowd.show(seconds);
    gltf.scene.updateMatrixWorld(true);
    renderer.render(scene, camera);
  };
  return { renderer, scene, camera, gltf, mixer, crowd, show };
"""


def page_of(glb, folder) -> Path:
    """A page that shows a .glb, written into a folder; it needs nothing else."""
    reader = (ROOT / "examples/three/crowd.js").read_text().replace("export class", "class")
    three = zlib.compress((Path(page.__file__).parent / "three.min.js").read_bytes())
    data = {"three": three, "glb": Path(glb).read_bytes()}
    parts = "".join(
        f'<script type="text/plain" id="{k}">{base64.b64encode(v).decode()}</script>' for k, v in data.items()
    )
    program = f"""
const bytes = (id) => Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
{reader}
window.shown = (async () => {{ {SHOW} }})();
"""
    path = Path(folder) / "scene.html"
    path.write_text(
        f'<!doctype html><meta charset="utf-8"><style>body{{margin:0}}</style>{parts}<script>{program}</script>'
    )
    return path


def open_scene(browser: Browser, glb, folder):
    """Open a .glb in a browser and wait until it is there."""
    browser.open(page_of(glb, folder))
    browser.evaluate(
        "new Promise((done) => { const wait = () => window.shown ? done(0) : setTimeout(wait, 50); wait(); })"
    )
    browser.evaluate("window.shown.then(() => 0)", 120)
