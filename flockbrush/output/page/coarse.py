"""Bodies of few triangles for animals that are small on the page, with the points and poses of the fine ones."""

from __future__ import annotations

import numpy as np

CELL = 0.2  # of the body length: points of a part that are nearer to one another become one
LEAST = 2  # triangles of every part


def coarse_triangles(mesh) -> np.ndarray:
    """(m, 3) triangles between some of the points of a mesh: each part has a few, so that all limbs remain.

    Points of a part in one cell of a grid become the point that is nearest to their mean.
    """
    vertices = np.arange(len(mesh.points))
    cells = np.column_stack([np.floor(mesh.points / CELL).astype(int), mesh.part])
    for cell in np.unique(cells, axis=0):
        rows = np.flatnonzero((cells == cell).all(axis=1))
        away = ((mesh.points[rows] - mesh.points[rows].mean(axis=0)) ** 2).sum(axis=1)
        vertices[rows] = rows[np.argmin(away)]
    joined = vertices[mesh.triangles]
    flat = (joined == np.roll(joined, 1, axis=1)).any(axis=1)
    joined = joined[~flat]
    _, first = np.unique(np.sort(joined, axis=1), axis=0, return_index=True)
    triangles = [joined[np.sort(first)]]
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    owner, present = mesh.part[mesh.triangles[:, 0]], mesh.part[triangles[0][:, 0]]
    for part in np.unique(owner):
        if (present == part).sum() < LEAST:
            rows = np.flatnonzero(owner == part)
            triangles.append(mesh.triangles[rows[np.argsort(-areas[rows], kind="stable")[:LEAST]]])
    return np.concatenate(triangles)
