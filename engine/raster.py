"""Rasters: numbers on a grid of square cells over the level.

Arrays are ``[iy, ix]`` with iy = 0 at the SOUTH edge; the centre of a cell is
``((ix + 0.5) * cell, (iy + 0.5) * cell)`` metres from the level's south-west corner.
Outside the grid the nearest cell answers, or, where the map goes on at the opposite border
(``wrap``, see `flockbrush.engine.seam`), the cell there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from flockbrush.engine.maths import kernel_function


@kernel_function
def corners_(x, cell, count, size):
    """(lower index, upper index, share of the upper) between two cell centres.

    ``size`` is that of a map that goes on at the opposite border, m, and else 0: the cells fill it exactly.
    """
    at, last, goes_on = x / cell - 0.5, count - 1, size > 0.0
    if goes_on:
        at = x * (count / size) - 0.5
        at -= count * np.floor(at / count)
    if not at > 0.0:
        at = 0.0
    at = at if goes_on else min(at, count - 1.0)
    low = min(int(at), last)
    return low, low + 1 if low < last else 0 if goes_on else last, at - low


@kernel_function
def bilinear_(values, cell, x, y, wrap):
    """The value at (x, y), linear between cell centres; ``values`` is (ny, nx)."""
    y0, y1, v = corners_(y, cell, values.shape[0], wrap[1])
    x0, x1, u = corners_(x, cell, values.shape[1], wrap[0])
    south = values[y0, x0] * (1.0 - u) + values[y0, x1] * u
    north = values[y1, x0] * (1.0 - u) + values[y1, x1] * u
    return south * (1.0 - v) + north * v


@dataclass
class Raster:
    """Numbers on the ground."""

    cell: float  # side of a cell, m
    values: np.ndarray  # (ny, nx, ...); row 0 is the southernmost

    def __post_init__(self):
        self.values = np.asarray(self.values)
        if self.values.ndim < 2 or 0 in self.values.shape[:2]:
            raise ValueError(f"a raster needs at least one cell in [iy, ix], got an array of shape {self.values.shape}")
        if not (np.isfinite(self.cell) and self.cell > 0):
            raise ValueError(f"the cell of a raster must be more than 0 m, got {self.cell!r}")

    @property
    def shape(self):
        """(ny, nx) cells."""
        return self.values.shape[:2]

    @property
    def width(self):
        """Metres from west to east."""
        return self.shape[1] * self.cell

    @property
    def height(self):
        """Metres from south to north."""
        return self.shape[0] * self.cell

    def index(self, xy):
        """(iy, ix) of the cells under points.

        Parameters
        ----------
        xy : array_like (..., 2)
            Metres.

        Returns
        -------
        tuple of ndarray of int64 (...)
            Points outside are in the nearest cell of the edge.
        """
        at = np.nan_to_num(np.asarray(xy, float) / self.cell, nan=0.0)
        ny, nx = self.shape
        return np.clip(at[..., 1], 0, ny - 1).astype(np.int64), np.clip(at[..., 0], 0, nx - 1).astype(np.int64)

    def at(self, xy):
        """The values of the cells under points (..., 2) m."""
        return self.values[self.index(xy)]

    def sample(self, xy, wrap=(0.0, 0.0)):
        """The values at points (..., 2) m, linear between cell centres."""
        xy, size, goes_on = np.asarray(xy, float), np.array(self.shape[::-1]), wrap[0] > 0.0
        at = np.mod(xy * (size / wrap) - 0.5, size) if goes_on else np.clip(xy / self.cell - 0.5, 0.0, size - 1.0)
        at = np.nan_to_num(at, nan=0.0)
        low = np.minimum(at.astype(np.int64), size - 1)
        high = (low + 1) % size if goes_on else np.minimum(low + 1, size - 1)
        (x0, y0), (x1, y1) = np.moveaxis(low, -1, 0), np.moveaxis(high, -1, 0)
        x, y = np.moveaxis(at, -1, 0)
        extra = (...,) + (None,) * (self.values.ndim - 2)
        u, v = (x - x0)[extra], (y - y0)[extra]
        south = self.values[y0, x0] * (1 - u) + self.values[y0, x1] * u
        north = self.values[y1, x0] * (1 - u) + self.values[y1, x1] * u
        return south * (1 - v) + north * v

    def centres(self):
        """(ny, nx, 2) m, the middle of every cell."""
        ny, nx = self.shape
        x, y = np.meshgrid((np.arange(nx) + 0.5) * self.cell, (np.arange(ny) + 0.5) * self.cell)
        return np.stack([x, y], axis=-1)
