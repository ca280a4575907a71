"""Convex solids in space: spheres, cylinders and convex polyhedra (boxes, prisms, half-spaces) [1]_.

`flockbrush.engine.solid_queries` has the functions that kernels call on them.

.. [1] Reynolds, C. W. (1987). Flocks, herds, and schools: a distributed behavioral model. Computer Graphics 21(4),
   25-34; "Avoiding Environmental Obstacles".
"""

from __future__ import annotations

import itertools
from functools import cache
from typing import NamedTuple

import numpy as np

SPHERE, CYLINDER, POLYHEDRON = 0, 1, 2
FLAT = 1e-9  # m; corners nearer to a plane lie in it
SHARP = -0.2  # cosine between the normals of two faces: sharper edges are cut when the solid grows


class Solid(NamedTuple):
    """One convex solid."""

    kind: int
    centre: np.ndarray  # (3,) m
    bound: float  # m, radius of a ball about the centre that holds it; inf for a half-space
    radius: float = 0.0  # m, of a sphere or cylinder
    half: float = 0.0  # m, half the length of a cylinder
    axis: np.ndarray = np.array([0.0, 0.0, 1.0])  # of a cylinder
    faces: np.ndarray = np.zeros((0, 4))  # outward unit normal and offset: inside is n · p <= d
    edges: np.ndarray = np.zeros((0, 6))  # m, both ends
    edge_faces: np.ndarray = np.zeros((0, 2), np.int32)  # the two faces at each edge
    opaque: bool = True  # blocks the view

    def moved(self, by):
        """The same solid elsewhere, by (3,) m."""
        by = np.asarray(by, float)
        faces = self.faces.copy()
        faces[:, 3] += faces[:, :3] @ by
        return self._replace(centre=self.centre + by, faces=faces, edges=self.edges + np.tile(by, 2))


def sphere(centre, radius, opaque=True):
    """A ball."""
    return Solid(SPHERE, np.asarray(centre, float), float(radius), float(radius), opaque=opaque)


def cylinder(centre, radius, half, axis=(0.0, 0.0, 1.0), opaque=True):
    """A cylinder with flat ends; ``half`` its length."""
    axis = np.asarray(axis, float) / np.sqrt(np.dot(axis, axis))
    bound = float(np.sqrt(radius * radius + half * half))
    return Solid(CYLINDER, np.asarray(centre, float), bound, float(radius), float(half), axis, opaque=opaque)


def half_space(point, normal, opaque=False):
    """Everything behind a plane through a point; the normal shows out of it."""
    point, normal = np.asarray(point, float), np.asarray(normal, float)
    normal = normal / np.sqrt(normal @ normal)
    return Solid(POLYHEDRON, point, np.inf, faces=np.array([[*normal, normal @ point]]), opaque=opaque)


def polyhedron(points, opaque=True):
    """The convex hull of some points (k, 3), not all in one plane.

    Raises
    ------
    ValueError
        When they lie in a plane.
    """
    points = np.unique(np.asarray(points, float), axis=0)
    middle = points.mean(0)
    planes = {}
    for i, j, k in itertools.combinations(range(len(points)), 3):
        normal = np.cross(points[j] - points[i], points[k] - points[i])
        size = np.sqrt(normal @ normal)
        if size <= FLAT**2:
            continue
        normal = normal / size
        away = (points - points[i]) @ normal
        if away.max() > FLAT and away.min() < -FLAT:
            continue
        if away.max() > FLAT:
            normal, away = -normal, -away
        corners = tuple(np.flatnonzero(away > -FLAT))
        planes.setdefault(corners, np.array([*normal, normal @ points[i]]))
    faces = list(planes.items())
    if len(faces) < 4 or (middle @ faces[0][1][:3] - faces[0][1][3]) > -FLAT:
        raise ValueError("the points of a polyhedron must not lie in one plane")
    edges, sides = [], []
    for (a, (corners, _)), (b, (others, _)) in itertools.combinations(enumerate(faces), 2):
        shared = sorted(set(corners) & set(others))
        if len(shared) >= 2:
            line = points[shared]
            along = (line - line[0]) @ (line[-1] - line[0])
            edges.append([*line[along.argmin()], *line[along.argmax()]])
            sides.append((a, b))
    return _solid(middle, np.array([f for _, f in faces]), np.array(edges), np.array(sides, np.int32), opaque)


def _solid(middle, faces, edges, edge_faces, opaque):
    """A polyhedron, with further faces that touch it at sharp edges and corners, for when it grows."""
    cuts = []
    for (a, b), edge in zip(edge_faces, edges, strict=True):
        if faces[a, :3] @ faces[b, :3] < SHARP:
            cuts.append(_cut(faces[[a, b]], edge[:3]))
    faces = np.vstack([faces, *cuts])
    corners = np.unique(edges.reshape(-1, 3), axis=0)
    cuts = []
    for corner in corners:
        there = faces[np.abs(faces[:, :3] @ corner - faces[:, 3]) < 1e-7 * (1 + np.abs(corner).max())]
        if np.linalg.norm(np.linalg.lstsq(there[:, :3], np.ones(len(there)), rcond=None)[0]) > 2.0:
            cuts.append(_cut(there, corner))
    bound = float(np.sqrt(((corners - middle) ** 2).sum(1).max()))
    return Solid(
        POLYHEDRON, middle, bound, faces=np.vstack([faces, *cuts]), edges=edges, edge_faces=edge_faces, opaque=opaque
    )


def _cut(faces, point):
    """A face through a point of an edge or corner, between those that meet there."""
    normal = faces[:, :3].sum(0)
    normal = normal / np.sqrt(normal @ normal)
    return np.array([*normal, normal @ point])


def prism(polygon, low, high, opaque=True):
    """A convex polygon (k, 2), counter-clockwise, stood up from ``low`` to ``high`` m."""
    polygon = np.asarray(polygon, float)
    n = len(polygon)
    along = np.roll(polygon, -1, axis=0) - polygon
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / np.sqrt((along**2).sum(1))[:, None]
    sides = np.column_stack([normal, np.zeros(n), (normal * polygon).sum(1)])
    faces = np.vstack([sides, [0.0, 0.0, -1.0, -low], [0.0, 0.0, 1.0, high]])
    bottom, top = np.column_stack([polygon, np.full(n, low)]), np.column_stack([polygon, np.full(n, high)])
    edges = np.vstack(
        [np.hstack([bottom, top]), np.hstack([bottom, np.roll(bottom, -1, 0)]), np.hstack([top, np.roll(top, -1, 0)])]
    )
    k = np.arange(n)
    edge_faces = np.vstack(
        [
            np.column_stack([(k - 1) % n, k]),
            np.column_stack([k, np.full(n, n)]),
            np.column_stack([k, np.full(n, n + 1)]),
        ]
    )
    middle = np.array([*polygon.mean(0), 0.5 * (low + high)])
    return _solid(middle, faces, edges, edge_faces.astype(np.int32), opaque)


def convex_parts(polygon):
    """Convex polygons that make up a polygon (k, 2), counter-clockwise: itself, or triangles."""
    points = [np.asarray(p, float) for p in polygon]

    def left(a, b, c):
        return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])

    n = len(points)
    if all(left(points[i - 2], points[i - 1], points[i]) >= 0 for i in range(n)):
        return [np.array(points)]
    parts = []
    while len(points) > 3:
        n = len(points)
        ears = [k for k in range(n) if _is_ear(points, k, left)] or [0]  # crossing outlines have none: as it comes
        k = max(ears, key=lambda k: left(points[k - 1], points[k], points[(k + 1) % n]))
        if left(points[k - 1], points[k], points[(k + 1) % n]) > 0:
            parts.append(np.array([points[k - 1], points[k], points[(k + 1) % n]]))
        del points[k]
    if left(*points) > 0:
        parts.append(np.array(points))
    return parts


def _is_ear(points, k, left):
    """Whether the corner k can be cut off: it turns left and no other corner lies in its triangle."""
    n = len(points)
    a, b, c = points[k - 1], points[k], points[(k + 1) % n]
    if left(a, b, c) <= 0:
        return False
    others = [p for j, p in enumerate(points) if j not in ((k - 1) % n, k, (k + 1) % n)]
    return not any(left(a, b, p) > 0 and left(b, c, p) > 0 and left(c, a, p) > 0 for p in others)


class Solids(NamedTuple):
    """Many solids as arrays, as kernels want them."""

    kind: np.ndarray  # (k,) uint8
    centre: np.ndarray  # (k, 3) m
    bound: np.ndarray  # (k,) m
    radius: np.ndarray  # (k,) m
    half: np.ndarray  # (k,) m
    axis: np.ndarray  # (k, 3)
    opaque: np.ndarray  # (k,) uint8
    face_first: np.ndarray  # (k + 1,) int32
    face: np.ndarray  # (faces, 4)
    edge_first: np.ndarray  # (k + 1,) int32
    edge: np.ndarray  # (edges, 6) m
    edge_face: np.ndarray  # (edges, 2) int32, rows of `face`


def packed(solids):
    """`Solids` of a list of `Solid`."""
    solids = list(solids)
    face_first = np.cumsum([0] + [len(s.faces) for s in solids]).astype(np.int32)
    edge_first = np.cumsum([0] + [len(s.edges) for s in solids]).astype(np.int32)
    return Solids(
        np.array([s.kind for s in solids], np.uint8),
        np.array([s.centre for s in solids], float).reshape(-1, 3),
        np.array([s.bound for s in solids], float),
        np.array([s.radius for s in solids], float),
        np.array([s.half for s in solids], float),
        np.array([s.axis for s in solids], float).reshape(-1, 3),
        np.array([s.opaque for s in solids], np.uint8),
        face_first,
        np.concatenate([np.zeros((0, 4)), *(s.faces for s in solids)]),
        edge_first,
        np.concatenate([np.zeros((0, 6)), *(s.edges for s in solids)]),
        np.concatenate(
            [np.zeros((0, 2), np.int32), *(s.edge_faces + f for s, f in zip(solids, face_first, strict=False))]
        ).astype(np.int32),
    )


@cache
def no_solids():
    """An empty sky, the same one each time."""
    return packed([])


def with_cylinders(solids, centre, radius, half):
    """The solids, and upright cylinders (centres (k, 3), m) after them: bodies of animals, say."""
    k = len(centre)
    upright = np.tile([0.0, 0.0, 1.0], (k, 1))
    more = (
        np.full(k, CYLINDER, np.uint8), centre, np.sqrt(radius * radius + half * half), radius, half, upright,
        np.ones(k, np.uint8),
    )  # fmt: skip
    return Solids(
        *(np.concatenate([old, new]) for old, new in zip(solids[:7], more, strict=True)),
        np.append(solids.face_first, np.full(k, solids.face_first[-1], np.int32)),
        solids.face,
        np.append(solids.edge_first, np.full(k, solids.edge_first[-1], np.int32)),
        solids.edge,
        solids.edge_face,
    )
