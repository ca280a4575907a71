"""How animals lie: how varied the directions of bodies are; a picture shows axes, and not which end is the head."""

from __future__ import annotations

import numpy as np

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
    """Of the unsigned doubled angles of axes about their mean, degrees²."""
    doubled = 2.0 * np.arctan2(forward[:, 1], forward[:, 0])
    mean = np.arctan2(np.sin(doubled).sum(), np.cos(doubled).sum())
    off = np.degrees(np.abs(np.arctan2(np.sin(doubled - mean), np.cos(doubled - mean))))
    return float(off.var())


def mean_variance(fields, xy, forward) -> float:
    """The mean of `variance_of_axes` over the cells where it is known, degrees²; NaN if there are none."""
    cells = variance_of_axes(fields, xy, forward)
    return float(np.nanmean(cells)) if np.isfinite(cells).any() else np.nan


def variance_told(fields) -> float:
    """The mean variance of directions in a photograph where it was measured, degrees²; `RANDOM` where nowhere was."""
    told = fields.angular_variance[0]
    measured = told[np.isfinite(told) & (told != RANDOM)]
    return float(measured.mean()) if len(measured) else RANDOM
