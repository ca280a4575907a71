"""A glTF scene of a run: the place, the herd as animated nodes or as a crowd buffer, a camera.

glTF's axes are y up; the node "World" turns ours (x east, y north, z up) into them, so everything below it has the
numbers of the simulation, in metres.
"""

from __future__ import annotations

import math

import numpy as np

import flockbrush
from flockbrush.levels.build import Simulation
from flockbrush.output.gltf.animated_nodes import Herd, check_number, hemisphere
from flockbrush.output.gltf.bodies import GltfBodies
from flockbrush.output.gltf.crowd_buffer import write_crowd
from flockbrush.output.gltf.document import GltfDocument
from flockbrush.output.gltf.records import Records
from flockbrush.output.gltf.surroundings import PlaceNodes, facing
from flockbrush.output.picture_exporter import camera_of, chosen_theme
from flockbrush.output.trajectory_table import metadata_of
from flockbrush.render.gaits import Gaits

UPRIGHT = [-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]  # z up becomes y up


class GltfNodes:
    """A glTF scene of a run.

    Parameters
    ----------
    path : Path
        A new file, in a folder where temporary files may be written.
    fps : float
    options : dict
        ``gltf_mode``, ``theme``, ``azimuth``, ``elevation``, ``camera``.
    """

    def __init__(self, path, simulation, fps, options):
        self.path, self.simulation, self.fps, self.options = path, simulation, fps, options
        self.document = GltfDocument(path.parent)
        self.world = self.document.node("World", rotation=UPRIGHT)
        self.document.add("scenes", name="Scene", nodes=[self.world])
        self.document.top["scene"] = 0
        self.bodies, self.gaits = GltfBodies(self.document, simulation, chosen_theme(options)), Gaits(simulation)
        self.records = Records(path.parent, simulation)
        self.place, self.times, self._crowd = None, [], options.get("gltf_mode") == "crowd"
        if isinstance(simulation, Simulation):
            self.place = PlaceNodes(self.document, self.bodies, simulation, options, self.world, fps)

    def take(self, moment):
        """Add one moment."""
        clip, phase = self.gaits.of(moment)
        self.times.append(moment.time)
        if self.place is not None:
            self.place.take(moment.time)
        self.records.take(moment, self.bodies.shown(moment, clip, phase), phase)
        if not self._crowd:
            check_number(len(self.records.slots))

    def finish(self):
        """Complete the file."""
        if self.place is not None:
            self.place.finish()
            self._camera()
        if self._crowd:
            write_crowd(self.document, self.bodies, self.records, self.world, self.fps)
        else:
            Herd(self.document, self.bodies, self.records, self.world, self.fps)
        about = metadata_of(self.simulation, self.fps)
        self.document.lists["scenes"][0]["extras"] = {"flockbrush": about}
        self.document.write(self.path, f"Flockbrush {flockbrush.__version__}")
        self.close()

    def close(self):
        """Close temporary files."""
        self.records.close()
        self.document.close()

    def _camera(self):
        """The camera with keyframes, else one that shows the whole level from the given direction."""
        place, path = self.place.place, camera_of(self.options)
        fixed = place.camera(self.options.get("azimuth"), self.options.get("elevation"))
        views = [fixed] if path is None else [path.at(time) for time in self.times or [0.0]]
        far = 50 * max(fixed.distance, *(view.distance for view in views))
        lens = {"yfov": float(views[0].fov), "znear": 0.1, "zfar": float(far)}
        lens["aspectRatio"] = fixed.size[0] / fixed.size[1]
        camera = self.document.add("cameras", type="perspective", perspective=lens)
        eyes = np.array([view.eye for view in views], np.float32)
        turns = np.array([facing(view.axes[2], view.axes[1]) for view in views])
        turns = hemisphere(turns[:, None])[:, 0].astype(np.float32)
        node = self.document.node(
            "Camera", self.world, camera=camera, translation=eyes[0].tolist(), rotation=turns[0].tolist()
        )
        if len(views) > 1:
            times = self.document.numbers(np.arange(len(views), dtype=np.float32) / np.float32(self.fps), bounds=True)
            self.document.animate(node, "translation", times, self.document.numbers(eyes))
            self.document.animate(node, "rotation", times, self.document.numbers(turns))
