"""The place in glTF: ground with its picture, obstacles, guides, areas, goals, a camera and the sun."""

from __future__ import annotations

import numpy as np

from flockbrush.output.gltf.document import INDICES, VERTICES
from flockbrush.output.moving_solids import MovingSolids
from flockbrush.output.painted_ground import GroundPictures
from flockbrush.output.picture_exporter import chosen_theme
from flockbrush.output.scene_meshes import SceneMeshes
from flockbrush.render.style import SUN, linear_rgb

RAISED = 0.05  # m above the ground: lines
LINE_STRIP, LINE_LOOP = 3, 2  # kinds of primitives
SIDES = 12  # of a goal's cone


class PlaceNodes:
    """Everything that stands there below a node of a document.

    Parameters
    ----------
    bodies : Bodies
        Whose materials are used.
    options : dict
        ``theme``, ``azimuth``, ``elevation``.
    world : int
        The node whose axes are ours: z up.
    fps : float
    """

    def __init__(self, document, bodies, simulation, options, world, fps):
        self.document, self.bodies, self.fps = document, bodies, fps
        self.place = SceneMeshes(simulation, chosen_theme(options))
        self.node = document.node("Place", world)
        self.moving, self.painted = MovingSolids(self.place), GroundPictures(self.place, fps)
        self.grounds = []  # (frame from which it is shown, node)
        self._surface = self._ground_surface()
        self._ground(0, self.painted.first)
        for kind, lines, colour in [("Guides", self.place.guides(), self.place.theme.guide), *self.place.outlines()]:
            self._lines(kind, lines, colour)
        self._goals()
        self._light(world)

    def take(self, time):
        """Follow obstacles and paint for one more frame."""
        self.moving.take()
        new = self.painted.take(time)
        if new is not None:
            self._ground(*new)

    def finish(self):
        """Write what is known at the end: how obstacles moved, and when each picture of the ground is shown."""
        late = self.painted.late()
        if late is not None:
            self._ground(*late)
        ends = [*(frame for frame, _ in self.grounds[1:]), None]
        for (frame, node), end in zip(self.grounds, ends, strict=True):
            keys = {0: frame == 0} | {frame: True} | ({} if end is None else {end: False})
            if keys != {0: True}:
                self.document.show(node, list(keys.items()), self.fps)
        self._obstacles()

    def _ground(self, frame, picture):
        """The ground with a picture (bytes of a JPEG) that is shown from a frame on; it has no size before."""
        document = self.document
        name = "ground" if not self.grounds else f"ground {len(self.grounds)}"
        image = document.add("images", name=name, mimeType="image/jpeg", bufferView=document.bytes(picture))
        texture = document.add("textures", source=image, sampler=0)
        surface = {"baseColorTexture": {"index": texture}, "metallicFactor": 0.0, "roughnessFactor": 1.0}
        material = document.add("materials", name=name, pbrMetallicRoughness=surface)
        mesh = document.add("meshes", name=name, primitives=[{**self._surface, "material": material}])
        size = None if not self.grounds else [0.0, 0.0, 0.0]
        self.grounds.append((frame, document.node(name.capitalize(), self.node, mesh=mesh, scale=size)))

    def _ground_surface(self):
        """The primitive that all grounds share."""
        document, ground = self.document, self.place.ground()
        document.add("samplers", magFilter=9729, minFilter=9987, wrapS=33071, wrapT=33071)
        uv = ground.uv.astype(np.float32)
        uv[:, 1] = 1 - uv[:, 1]  # counted from the top
        attributes = {
            "POSITION": document.numbers(ground.points.reshape(-1, 3).astype(np.float32), VERTICES, bounds=True),
            "NORMAL": document.numbers(normals_of(ground.points), VERTICES),
            "TEXCOORD_0": document.numbers(uv, VERTICES),
        }
        indices = document.numbers(ground.triangles.astype(np.uint32).ravel(), INDICES)
        return {"attributes": attributes, "indices": indices}

    def _obstacles(self):
        """Write the obstacles as they were followed, those that are moved with keyframes."""
        solids = [solid for solid in self.moving.solids if len(solid.faces.corners)]
        if not solids:
            return
        root = self.document.node("Obstacles", self.node)
        stone = self.bodies.material("obstacle", self.place.theme.obstacle, doubleSided=True)
        for solid in solids:
            mesh = self.document.add("meshes", name=solid.name, primitives=[self._solid(solid.faces, stone)])
            node = self.document.node(solid.name, root, mesh=mesh)
            if solid.moves:
                self._track(node, solid.keys)

    def _solid(self, faces, material):
        corners = faces.corners
        triangles = np.concatenate([corners[:, (0, 1, 2)], corners[:, (0, 2, 3)]])
        normals = np.concatenate([faces.normals, faces.normals])
        real = (
            np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
            > 1e-12
        )
        attributes = {
            "POSITION": self.document.numbers(triangles[real].reshape(-1, 3).astype(np.float32), VERTICES, bounds=True),
            "NORMAL": self.document.numbers(np.repeat(normals[real], 3, axis=0).astype(np.float32), VERTICES),
        }
        return {"attributes": attributes, "material": material}

    def _track(self, node, keys):
        """Keyframes of one obstacle: it moves evenly, and comes and goes at once."""
        times = np.array([key.frame for key in keys], np.float32) / np.float32(self.fps)
        places = np.array([key.offset for key in keys], np.float32)
        self.document.animate(
            node, "translation", self.document.numbers(times, bounds=True), self.document.numbers(places)
        )
        if not all(key.shown for key in keys):
            self.document.show(node, [(key.frame, key.shown) for key in keys], self.fps)

    def _lines(self, kind, lines, colour):
        lines = [line for line in lines if len(line.points) > 1]
        if not lines:
            return
        self.document.extension("KHR_materials_unlit")
        about = {"baseColorFactor": [*np.round(linear_rgb(colour), 5).tolist(), 1.0]}
        plain = self.document.add(
            "materials", name=kind.lower(), pbrMetallicRoughness=about, extensions={"KHR_materials_unlit": {}}
        )
        root = self.document.node(kind, self.node)
        for line in lines:
            points = (line.points + (0, 0, RAISED)).astype(np.float32)
            primitive = {
                "attributes": {"POSITION": self.document.numbers(points, VERTICES, bounds=True)},
                "mode": LINE_LOOP if line.closed else LINE_STRIP,
                "material": plain,
            }
            name = line.name or kind.lower()
            self.document.node(name, root, mesh=self.document.add("meshes", name=name, primitives=[primitive]))

    def _goals(self):
        goals = self.place.goals()
        if not goals:
            return
        tall = max(2.0, 0.02 * max(self.place.width, self.place.height))
        turn = np.arange(SIDES) * (2 * np.pi / SIDES)
        points = np.vstack(
            [np.column_stack([0.2 * tall * np.cos(turn), 0.2 * tall * np.sin(turn), 0 * turn]), [0, 0, tall]]
        )
        triangles = np.array([(k, (k + 1) % SIDES, SIDES) for k in range(SIDES)])
        primitive = self.bodies.flat(points, triangles, np.full(len(points), 1.25))
        primitive["material"] = self.bodies.material("goal", self.place.theme.goal)
        cone = self.document.add("meshes", name="goal", primitives=[primitive])
        root = self.document.node("Goals", self.node)
        for goal in goals:
            about = {"radius": goal.radius}
            self.document.node(goal.name or "goal", root, mesh=cone, translation=goal.at.tolist(), extras=about)

    def _light(self, world):
        self.document.extension("KHR_lights_punctual")
        sun = {"type": "directional", "name": "sun", "color": [1.0, 0.98, 0.94], "intensity": 3.0}
        self.document.top["extensions"] = {"KHR_lights_punctual": {"lights": [sun]}}
        down = -np.asarray(SUN, float)
        turn = facing(down, (0.0, 1.0, 0.0))
        self.document.node("Sun", world, rotation=turn, extensions={"KHR_lights_punctual": {"light": 0}})


def normals_of(points) -> np.ndarray:
    """Unit normals (rows * columns, 3) of a grid of points (rows, columns, 3)."""
    down, across = np.gradient(points, axis=(0, 1))
    normals = np.cross(across, down).reshape(-1, 3)
    return (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)


def facing(ahead, up) -> list[float]:
    """Quaternion (x, y, z, w) of a camera or a light that looks along `ahead`: glTF's look along their own -z."""
    from flockbrush.output.attitude import quaternions

    back = -np.asarray(ahead, float) / np.linalg.norm(ahead)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    w, x, y, z = quaternions(np.column_stack([right, np.cross(back, right), back])[None])[0]
    return [x, y, z, w]
