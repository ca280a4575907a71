"""A USD stage of a run: the place, and the herd in one of three ways (`herd`, `skeletons`).

The stage has our own axes: x east, y north, z up, metres; time codes are frames.  A body looks along +X, is one metre
long, and scales make it as long as the animal.  Samples are handed to the file as the run goes on.
"""

from __future__ import annotations

import os
import warnings
from pathlib import Path

from pxr import Sdf, Usd, UsdGeom, Vt

from flockbrush.engine.locks import Advice
from flockbrush.output.picture_exporter import camera_of, chosen_theme
from flockbrush.output.trajectory_table import as_attribute, metadata_of
from flockbrush.output.usd.bodies import UsdBodies, bounds_of
from flockbrush.output.usd.herd_prims import Instancer, Xforms
from flockbrush.output.usd.skeletons import Skeletons
from flockbrush.output.usd.surroundings import CAMERA, sample_ground, set_camera, write_place
from flockbrush.render.gaits import Gaits
from flockbrush.runs.snapshots import Moment, words_of

PENDING = 64 << 20  # bytes of samples in memory before they are handed to the file
ROOT = "/World"
MODES = {"instancer": Instancer, "xforms": Xforms, "skel": Skeletons}


class UsdStage:
    """A USD scene of a run.

    Parameters
    ----------
    path : path
        A new file.
    fps : float
    options : dict
        ``usd_mode``; ``prototype``: "species=file.usd" texts; ``theme``, ``azimuth``, ``elevation``, ``camera``.
    texture : str, optional
        Name of the ground's picture, beside the file, if there is one.
    """

    def __init__(self, path, simulation, fps, options, texture=None):
        self.simulation, self.fps, self.frames = simulation, fps, 0
        self._layer = Sdf.Layer.CreateNew(str(path))
        self._stage = stage = Usd.Stage.Open(self._layer)
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        stage.SetTimeCodesPerSecond(fps)
        stage.SetFramesPerSecond(fps)
        world = UsdGeom.Xform.Define(stage, ROOT)
        stage.SetDefaultPrim(world.GetPrim())
        Usd.ModelAPI(world).SetKind("assembly")
        about = {key: as_attribute(value) for key, value in metadata_of(simulation, fps).items()}
        self._layer.customLayerData = {"flockbrush": about}
        self._gaits, self._pending = Gaits(simulation), 0
        given = dict(text.split("=", 1) for text in options.get("prototype") or ())
        files = {name: Path(file) for name, file in given.items()}
        self._bodies = bodies = UsdBodies(stage, simulation, files, chosen_theme(options))
        self._herd = MODES[options.get("usd_mode") or "instancer"](stage, bodies, simulation)
        self._obstacles = write_place(stage, simulation, options, texture)
        self._camera = camera_of(options)

    def take(self, moment: Moment):
        """Add one moment."""
        self._pending += self._herd.write(self.frames, moment, *self._gaits.of(moment))
        if self._obstacles is not None:
            self._pending += self._obstacles.take()
        if self._camera is not None and self._stage.GetPrimAtPath(CAMERA):
            set_camera(self._stage, self._camera.at(moment.time), self.frames)
        self.frames += 1
        if self._pending > PENDING:
            self._layer.Save()
            self._pending = 0

    def paint(self, texture, frame):
        """Set a new picture of the ground from a frame on."""
        sample_ground(self._stage, texture, frame)

    def finish(self, folder):
        """Complete the file, which will lie in a folder: references to other files lead from there."""
        self._stage.SetStartTimeCode(0)
        self._stage.SetEndTimeCode(max(0, self.frames - 1))
        self._herd.finish()
        species = self._bodies.names()[0]
        for name in self._bodies.given:
            if name not in species:
                told = f"--prototype {name}=...: there is no such species here; there are {', '.join(species)}"
                warnings.warn(Advice(told), stacklevel=2)
        herd = self._stage.GetPrimAtPath(f"{ROOT}/Herd")
        for name, words in words_of(self.simulation).items():
            herd.SetCustomDataByKey(f"{name}_names", Vt.StringArray(list(words)))
        layer, files = self._layer, self._bodies.given.values()
        self._bodies = self._herd = self._obstacles = self._stage = self._layer = None
        for file in files:
            layer.UpdateCompositionAssetDependency(os.path.abspath(file), _way(folder, file))
        layer.Save()


def _way(folder, file):
    """The way from a folder to a file, as USD writes it; on another drive the whole path."""
    try:
        way = Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:  # Windows
        return Path(os.path.abspath(file)).as_posix()
    return way if way.startswith("../") else f"./{way}"


def problems_of(prototypes) -> list[str]:
    """What is wrong with ``--prototype`` texts."""
    problems, names = [], [text.partition("=")[0] for text in prototypes or ()]
    for k, text in enumerate(prototypes or ()):
        name, _, file = text.partition("=")
        if name in names[:k]:
            problems.append(f"--prototype {text}: there are several files for {name!r}")
        elif not name or not file:
            problems.append(f"--prototype must be SPECIES=FILE.usd, got {text!r}")
        elif not Path(file).is_file():
            problems.append(f"--prototype {text}: there is no file {file!r}")
        else:
            try:
                stage = Usd.Stage.Open(file)
            except Exception:  # noqa: BLE001  whatever USD says of a file it cannot read
                stage = None
            if stage is None or not stage.GetDefaultPrim():
                problems.append(f"--prototype {text}: this is not a USD file with a default prim")
            elif bounds_of(stage.GetDefaultPrim()).IsEmpty():
                problems.append(f"--prototype {text}: its default prim has no geometry")
    return problems
