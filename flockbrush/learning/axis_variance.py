"""How animals lie: how varied the directions of bodies are; a picture shows axes, and not which end is the head."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from flockbrush.learning.herd_views import in_picture

NEAREST = 8  # bodies that are compared: one and those nearest to it
ENOUGH = 3  # bodies in a cell and its neighbours that are needed for an estimate
RANDOM = 3000.0  # degrees², the paper's target where animals lie at random, and ours where nothing was measured


def variance_of_axes(fields, xy, forward):
    """(ny, nx) degrees², of the axes of bodies (n, 2) in each cell and those around it; NaN where too few are.

    Angles between axes are doubled, so that axes at random have the variance of directions at random (180²/12 = 2700)
    and parallel axes none.
    """
    measured = np.full(fields.shape, np.nan)
    row, column, inside = fields.cells_of(xy)
    for r, c in {(int(r), int(c)) for r, c in zip(row[inside], column[inside], strict=True)}:
        near = (abs(row - r) <= 1) & (abs(column - c) <= 1) & inside
        if near.sum() >= ENOUGH:
            measured[r, c] = _variance(forward[near])
    return measured


def _variance(forward):
    """Of the unsigned doubled angles of axes (..., k, 2) about their mean, degrees²."""
    doubled = 2.0 * np.arctan2(forward[..., 1], forward[..., 0])
    mean = np.arctan2(np.sin(doubled).sum(-1), np.cos(doubled).sum(-1))[..., None]
    off = np.degrees(np.abs(np.arctan2(np.sin(doubled - mean), np.cos(doubled - mean))))
    return off.var(-1)


def mean_variance(xy, forward) -> float:
    """How varied the axes of bodies (n, 2) are, degrees²: the mean over all of the variance of each and those nearest.

    It does not depend on a grid: cells hold few bodies of a sparse herd, and others if the grid lies otherwise.  NaN of
    fewer than `ENOUGH` bodies.
    """
    if len(xy) < ENOUGH:
        return np.nan
    near = cKDTree(xy).query(xy, min(NEAREST, len(xy)))[1]
    return float(_variance(forward[near]).mean())


def variance_of_run(run, fields, frames) -> np.ndarray:
    """`mean_variance` of the animals of a simulated herd that are in the picture, in some of its frames."""
    inside, rows = in_picture(run, fields), [run.of(t) for t in frames]
    return np.array([mean_variance(run.xy[r][inside[r]], run.forward[r][inside[r]]) for r in rows])


def variance_told(photo) -> float:
    """How varied the axes in a photograph are, degrees²: by its bodies, else as its fields assume; `RANDOM` without."""
    seen = photo.sightings
    measured = np.nan if seen is None else mean_variance(seen.xy[seen.of(0)], seen.forward[seen.of(0)])
    if np.isfinite(measured):
        return measured
    told = photo.fields.angular_variance[0]
    return float(told[np.isfinite(told)].mean()) if np.isfinite(told).any() else RANDOM
