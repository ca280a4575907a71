"""glTF export: the 3D scene of a run."""

from __future__ import annotations

from flockbrush.output.exporter import Exporter, Option, exporter
from flockbrush.output.picture_exporter import CAMERA, LOOKS, PALETTE, camera_problems

THEME, _, AZIMUTH, ELEVATION = LOOKS


@exporter(".glb")
class GltfScene(Exporter):
    """A binary glTF 2.0 scene; `flockbrush.output.gltf` writes it."""

    contents = "scene: ground, obstacles, guides, camera, animals with gaits; y up; or a crowd buffer"
    opens_in = "three.js, Godot, Unity, Blender, every glTF viewer"
    fps = 16.0
    choices = (
        Option(
            "gltf_mode", "nodes", "nodes: one animated node per animal, at most 1,000; crowd: a buffer of records, "
            "read as in examples/.", ("nodes", "crowd"),
        ),
        THEME, PALETTE, AZIMUTH, ELEVATION, CAMERA,
    )  # fmt: skip

    @classmethod
    def problems(cls, path, options):
        return camera_problems(options)

    def open(self):
        from flockbrush.output.gltf.scene import GltfNodes

        self._scene = GltfNodes(self.temporary, self.simulation, self.fps, self.options)

    def take(self, moment):
        self._scene.take(moment)
        self.frames += 1

    def finish(self):
        self._scene.finish()

    def let_go(self):
        self._scene.close()
