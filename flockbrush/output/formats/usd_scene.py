"""USD export: the 3D scene of a run."""

from __future__ import annotations

import errno
import os
import shutil
from contextlib import contextmanager
from pathlib import Path

from flockbrush.engine.files import write_bytes
from flockbrush.output.exporter import Exporter, Option, exporter
from flockbrush.output.picture_exporter import CAMERA, LOOKS, PALETTE, camera_problems

THEME, _, AZIMUTH, ELEVATION = LOOKS

FULL = 1 << 16  # bytes: a disk with less room is full


@exporter(".usdc", ".usda")
class UsdScene(Exporter):
    """A USD scene; `flockbrush.output.usd` writes it, and is imported only when it is asked for."""

    contents = "scene: ground, obstacles, guides, camera, animals with gaits; z up; picture in NAME.ground.jpg"
    opens_in = "Blender, Houdini, Maya, Unreal, Omniverse"
    fps = 24.0
    needs = (("pxr", "usd-core"),)
    choices = (
        Option(
            "usd_mode", "instancer", "instancer: switched poses; xforms: one prim per animal, for Maya and Blender; "
            "skel: one skeleton per animal.", ("instancer", "xforms", "skel"),
        ),
        Option("prototype", None, "USD file to draw a species with.", many=True, metavar="SPECIES=FILE"),
        THEME, PALETTE, AZIMUTH, ELEVATION, CAMERA,
    )  # fmt: skip

    @classmethod
    def beside(cls, path):
        return [Path(path).with_suffix(".ground.jpg")]

    @classmethod
    def reads(cls, options):
        return [*super().reads(options), *(text.partition("=")[2] for text in options.get("prototype") or ())]

    @classmethod
    def problems(cls, path, options):
        problems = camera_problems(options)
        if options.get("prototype"):
            from flockbrush.output.usd.scene import problems_of

            problems += problems_of(options["prototype"])
        return problems

    def open(self):
        from flockbrush.levels.build import Simulation
        from flockbrush.output.painted_ground import GroundPictures
        from flockbrush.output.picture_exporter import chosen_theme
        from flockbrush.output.scene_meshes import SceneMeshes
        from flockbrush.output.usd.scene import UsdStage

        self.temporary.unlink(missing_ok=True)  # USD makes the file itself
        picture = self.beside(self.path)[0]
        self._picture, self._ground, self._later = None, None, []
        if isinstance(self.simulation, Simulation):
            self._ground = GroundPictures(SceneMeshes(self.simulation, chosen_theme(self.options)), self.fps)
            self._picture = self._ground.first
        self._scene = UsdStage(self.temporary, self.simulation, self.fps, self.options, self._picture and picture.name)

    def take(self, moment):
        with _in_words(self.temporary.parent):
            if self._ground is not None:
                self._paint(self._ground.take(moment.time))
            self._scene.take(moment)
        self.frames += 1

    def _paint(self, new):
        """Set a new picture of the ground from a frame on, if it changed."""
        if new is None:
            return
        frame, picture = new
        name = self.path.with_suffix(f".ground.{len(self._later) + 1}.jpg").name
        (self.temporary.parent / name).write_bytes(picture)
        self._scene.paint(name, frame)
        self._later.append(name)

    def finish(self):
        with _in_words(self.temporary.parent):
            if self._ground is not None:
                self._paint(self._ground.late())
            self._scene.finish(self.path.parent)
        if self._picture is not None:
            write_bytes(self.beside(self.path)[0], self._picture)
        for name in self._later:
            os.replace(self.temporary.parent / name, self.path.parent / name)

    def let_go(self):
        self._scene = None


@contextmanager
def _in_words(folder):
    """Convert errors of USD, such as a full disk, to OSError."""
    from pxr import Tf

    try:
        yield
    except Tf.ErrorException as error:
        full = "No space left" in str(error) or shutil.disk_usage(folder).free < FULL
        number = errno.ENOSPC if full else errno.EIO
        raise OSError(number, os.strerror(number)) from None
