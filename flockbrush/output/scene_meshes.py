"""Static parts of a run as meshes for scene exporters: ground, obstacles, guides, goals, exits, areas."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.components import Body
from flockbrush.engine.seam import with_images, wrap_of
from flockbrush.levels.geometry import sign_of
from flockbrush.render import Painter, Scenery
from flockbrush.render.canvas import smooth
from flockbrush.render.orbit import OrbitCamera
from flockbrush.render.solid_meshes import Faces, stood_up, together
from flockbrush.render.style import SUN, mix, theme_of
from flockbrush.render.view_camera import ViewCamera
from flockbrush.systems.ground_height import heights_of_ground

TEXTURE = 2048  # pixels of the longer side of the ground's picture
CELLS = 160  # of the longer side of the ground's mesh, where it is not flat
PICTURE = (1280, 720)  # pixels that the camera is for
WALL = 1.6  # m, or body lengths if those are longer: obstacles without a told height


def jpeg_of(picture) -> bytes:
    """A picture (h, w, 3) uint8 as a file."""
    import cv2

    return cv2.imencode(".jpg", picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])[1].tobytes()


class GroundMesh(NamedTuple):
    """The ground as a grid of points."""

    points: np.ndarray  # (rows, columns, 3); metres, from the south-west corner
    box: np.ndarray  # (4,): left, lower, right and upper edge of the level in the picture, as shares of its size

    @property
    def triangles(self) -> np.ndarray:
        """(t, 3) indices into the points, row by row; their outside is above."""
        rows, columns = self.points.shape[:2]
        i = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
        return np.concatenate(
            [np.column_stack([i, i + 1, i + columns + 1]), np.column_stack([i, i + columns + 1, i + columns])]
        )

    @property
    def uv(self) -> np.ndarray:
        """(points, 2): places in the picture, from its lower left corner."""
        rows, columns = self.points.shape[:2]
        left, lower, right, upper = self.box
        u, v = np.meshgrid(np.linspace(left, right, columns), np.linspace(lower, upper, rows))
        return np.column_stack([u.ravel(), v.ravel()])


class SceneLine(NamedTuple):
    """A guide, an outline or a way."""

    name: str
    points: np.ndarray  # (k, 3) m
    closed: bool


class SceneGoal(NamedTuple):
    """A goal."""

    name: str
    at: np.ndarray  # (3,) m
    radius: float  # m; 0 of an area


class SceneMeshes:
    """The place of a simulation as it is now.

    Parameters
    ----------
    theme : str
    """

    def __init__(self, simulation, theme="light"):
        self.simulation, self.level, self.theme = simulation, simulation.level, theme_of(theme)
        self.scenery = Scenery(simulation)
        self.width, self.height = float(self.level.width), float(self.level.height)

    @property
    def hilly(self):
        """Whether the ground is not flat."""
        return self.scenery.land.relief.shape[:2] != (1, 1)

    def heights(self, xy) -> np.ndarray:
        """Height of the ground (n,) under points (n, 2), m."""
        land = self.scenery.land
        if not self.hilly:
            return np.zeros(len(xy))
        return heights_of_ground(land.heights, np.column_stack([xy, np.zeros(len(xy))]))

    def ground(self) -> GroundMesh:
        """The ground; two triangles where it is flat."""
        cells = CELLS if self.hilly else 1
        longer = max(self.width, self.height)
        columns, rows = (max(2, round(cells * side / longer) + 1) for side in (self.width, self.height))
        x, y = np.meshgrid(np.linspace(0, self.width, columns), np.linspace(0, self.height, rows))
        z = self.heights(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
        camera = self._camera_above(TEXTURE)
        box = (camera.pixels(((0, 0), (self.width, self.height))) / camera.size).ravel()
        box[1::2] = 1 - box[1::2]
        return GroundMesh(np.stack([x, y, z], axis=-1), box)

    def painter(self, side=TEXTURE) -> Painter:
        """Who draws the ground from above as the playground does; the level fills the picture."""
        camera = self._camera_above(side)
        painter = Painter(self.scenery, camera.size, self.theme, trails=None, words=False, labels=False)
        painter.look(camera)
        return painter

    def _camera_above(self, side):
        """The camera of a picture whose longer side has so many pixels."""
        scale = side / max(self.width, self.height)
        size = [int(np.clip(round(length * scale), 8, side)) for length in (self.width, self.height)]
        return ViewCamera.fit(self.width, self.height, size)

    def obstacles(self) -> tuple[Faces, np.ndarray]:
        """(faces, colours (m, 3) 0 to 255 in the sun) of what stands there."""
        return self._faces([one for one, _ in with_images(self.scenery.obstacles, wrap_of(self.level))])

    def wall(self) -> float:
        """Height of obstacles without a height, m."""
        agents = self.simulation.agents
        return max(WALL, float(np.median(agents[Body.length])) if len(agents) else 0.0)

    def faces_of_thing(self, thing, tall) -> tuple[Faces, np.ndarray]:
        """(faces, colours (m, 3) 0 to 255 in the sun) of one obstacle where it is now."""
        return self._faces([thing], tall)

    def _faces(self, things, tall=None):
        tall = self.wall() if tall is None else tall
        faces = together(self._stood(thing, tall) for thing in things)
        return faces, faces.lit(mix(self.theme.obstacle, self.theme.paper, 0.22), SUN)

    def _stood(self, thing, tall):
        """The faces of one thing, on the ground: its foot at the lowest point below it, its top above the highest."""
        faces = stood_up(thing, tall)
        under = self.heights(faces.corners[:, :, :2].reshape(-1, 2))
        z = faces.corners[:, :, 2]
        foot = z <= z.min() + 1e-9
        z[foot] += under.min()
        z[~foot] += under.max()
        return faces

    def guides(self) -> list[SceneLine]:
        """The arrows that leaders follow, curved as the picture of the ground shows them."""
        return [
            self._line(getattr(g, "name", "") or f"guide_{k}", smooth(np.asarray(g.points)[:, :2], g.loop), g.loop)
            for k, g in enumerate(self.scenery.guides)
        ]

    def outlines(self) -> list[tuple[str, list[SceneLine], tuple[int, int, int]]]:
        """[(kind, outlines, colour)] of exits, measured areas and goals that are areas, as on the plan."""
        goals = [goal for goal in self.scenery.goals if goal.polygon is not None]
        return [
            (kind, [self._line(thing.name, thing.polygon, True) for thing in things], colour)
            for kind, things, colour in (
                ("Exits", self.scenery.exits, self.theme.exit),
                ("Areas", self.level.areas, self.theme.muted),
                ("Goal areas", goals, self.theme.goal),
            )
        ]

    def goals(self) -> list[SceneGoal]:
        """The goals; those that are areas have a point in them and no radius."""
        return [
            SceneGoal(
                g.name, self._line("", sign_of(g)[None], False).points[0], float(g.radius if g.polygon is None else 0.0)
            )
            for g in self.scenery.goals
        ]

    def camera(self, azimuth=None, elevation=None) -> OrbitCamera:
        """The camera that shows the whole level; degrees, from the south and 40° up by default."""
        corners = self.ground().points[:: max(1, CELLS // 8), :: max(1, CELLS // 8)].reshape(-1, 3)
        edge = [[0, 0, 0], [self.width, 0, 0], [self.width, self.height, 0], [0, self.height, 0]]
        points = np.vstack([corners, edge])
        angles = np.radians([90.0 if azimuth is None else azimuth, 40.0 if elevation is None else elevation])
        return OrbitCamera.of(points, PICTURE, azimuth=float(angles[0]), elevation=float(angles[1]))

    def _line(self, name, points, closed):
        points = np.asarray(points, float)[:, :2]
        if self.hilly:
            points = divided(points, max(self.width, self.height) / CELLS, closed)
        return SceneLine(name, np.column_stack([points, self.heights(points)]), bool(closed))


def divided(points, longest, closed=False) -> np.ndarray:
    """A line through points (k, 2) with steps of at most so many metres."""
    ends = np.roll(points, -1, axis=0) if closed else points[1:]
    pieces = []
    for begin, end in zip(points, ends, strict=False):
        steps = max(1, int(np.ceil(np.hypot(*(end - begin)) / longest)))
        pieces.append(begin + (end - begin) * (np.arange(steps) / steps)[:, None])
    return np.vstack(pieces if closed else [*pieces, points[-1:]])
