"""What stands on the ground, as flat faces: prisms, cylinders, balls, roofs."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from flockbrush.engine.solids import convex_parts

ENDLESS = 999.0  # m; what is as high as this has been told no height
AROUND, UP = 24, 12  # faces of a ball
FOOT = 0.12  # of the usual height: how high is what hides nobody, if it was told no height
FLAT = 1e-9  # m; corners nearer to a plane lie in it
CLEAR = 0.32  # opacity of planes that one looks through: ceilings


class Faces(NamedTuple):
    """Flat faces in space."""

    # (m, 4, 3); metres, to the left round the outside; of a triangle the last corner is there twice
    corners: np.ndarray
    normals: np.ndarray  # (m, 3); unit vectors to the outside
    alphas: np.ndarray  # (m,); opacity; what is clear is seen from both sides

    def lit(self, colour, sun) -> np.ndarray:
        """Colours (m, 3) of the faces in the sun, a unit vector."""
        facing = self.normals @ sun
        shine = 0.66 + 0.10 * self.normals[:, 2] + np.where(facing > 0, 0.36, 0.12) * facing
        return np.minimum(shine[:, None] * np.asarray(colour, float), 255.0)

    def seen(self, camera) -> np.ndarray:
        """Rows of the faces that show the camera their outside, from far to near."""
        eye, middle = camera.eye, self.corners.mean(axis=1)
        shown = (((eye - middle) * self.normals).sum(axis=1) > 0) | (self.alphas < 1)
        rows = np.flatnonzero(shown)
        far = ((middle[rows] - eye) ** 2).sum(axis=1)
        return rows[np.lexsort([-far, self.alphas[rows] < 1])]  # what is clear goes over the rest


def faces_of(corners, alpha=1.0) -> Faces:
    """Faces from their corners (m, 4, 3) m."""
    corners = np.asarray(corners, float).reshape(-1, 4, 3)
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(size > 1e-12, normals, flat)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return Faces(corners, normals, np.full(len(corners), float(alpha)))


def together(parts) -> Faces:
    """All faces of several things."""
    parts = list(parts) or [faces_of(np.zeros((0, 4, 3)))]
    return Faces(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def block(polygon, low, high) -> Faces:
    """An outline (k, 2) m, counter-clockwise, stood up from `low` to `high` m."""
    polygon = np.asarray(polygon, float)
    after = np.roll(polygon, -1, axis=0)

    def at(points, z):
        return np.column_stack([points, np.full(len(points), z)])

    sides = np.stack([at(polygon, low), at(after, low), at(after, high), at(polygon, high)], axis=1)
    return together([faces_of(sides), lid(polygon, high), lid(polygon, low, down=True)])


def lid(polygon, z, down=False, alpha=1.0) -> Faces:
    """An outline (k, 2) m lying flat at a height, its outside above, or below."""
    triangles = []
    for part in convex_parts(np.asarray(polygon, float)):
        corners = np.column_stack([part, np.full(len(part), z)])
        corners = corners[::-1] if down else corners
        for k in range(1, len(corners) - 1, 2):
            last = min(k + 2, len(corners) - 1)
            triangles.append([corners[0], corners[k], corners[k + 1], corners[last]])
    return faces_of(triangles, alpha)


def ball(centre, radius) -> Faces:
    """A ball about a point (3,) m."""
    turn = np.linspace(0, 2 * np.pi, AROUND + 1)
    rise = np.linspace(-np.pi / 2, np.pi / 2, UP + 1)
    flat = np.cos(rise)[:, None]
    grid = np.stack(
        [flat * np.cos(turn), flat * np.sin(turn), np.repeat(np.sin(rise)[:, None], AROUND + 1, axis=1)], axis=-1
    )
    grid = np.asarray(centre, float) + radius * grid
    corners = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=2)
    return faces_of(corners.reshape(-1, 4, 3))


def hull(points) -> Faces:
    """The faces of the convex hull of a few points (k, 3) m."""
    points = np.unique(np.asarray(points, float), axis=0)
    by_plane: dict[tuple, np.ndarray] = {}
    for i, j, k in itertools.combinations(range(len(points)), 3):
        normal = np.cross(points[j] - points[i], points[k] - points[i])
        size = np.linalg.norm(normal)
        if size < 1e-12:
            continue
        away = (points - points[i]) @ (normal / size)
        if away.max() > FLAT and away.min() < -FLAT:
            continue  # it cuts through the middle
        outside = normal / size if away.max() <= FLAT else -normal / size
        by_plane.setdefault(tuple(np.flatnonzero(np.abs(away) <= FLAT)), outside)
    faces = []
    for rows, outside in by_plane.items():
        corners = points[list(rows)]
        along = corners[0] - corners.mean(axis=0)
        away = corners - corners.mean(axis=0)
        turn = np.arctan2(away @ np.cross(outside, along), away @ along)
        corners = corners[np.argsort(turn)]
        faces += [[corners[0], corners[k], corners[k + 1], corners[k + 1]] for k in range(1, len(corners) - 1)]
    return faces_of(faces)


def stood_up(obstacle, tall: float) -> Faces:
    """The faces of an obstacle of a level; one without a told height is `tall` m high.

    Parameters
    ----------
    obstacle : Obstacle
        Or anything with a `polygon` (k, 2) m; `z_min`, `z_max` (m) and `shape` as an `Obstacle` has them.
    """
    polygon = np.asarray(obstacle.polygon, float)
    x, y = polygon.T
    if (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() < 0:
        polygon = polygon[::-1]
    low, high = float(getattr(obstacle, "z_min", 0.0)), float(getattr(obstacle, "z_max", ENDLESS))
    if high >= ENDLESS:  # who can see across it sees across it here, too: a pond, a ditch, a low wall
        high = max(tall if getattr(obstacle, "blocks_view", True) else FOOT * tall, low + FOOT * tall)
    shape, middle = getattr(obstacle, "shape", "box"), polygon.mean(axis=0)
    if shape == "plane":
        return lid(polygon, low if low > 0 else high, alpha=CLEAR)
    corners = getattr(obstacle, "corners", None)
    if corners is not None:
        return hull(np.asarray(corners, float) + (*middle, low))
    if shape == "sphere":
        radius = float(np.sqrt(((polygon - middle) ** 2).sum(axis=1).max()))
        return ball((*middle, 0.5 * (low + high)), radius)
    return block(polygon, low, high)
