"""Which cells a brush stroke covers, and cells put into words: arrays only, so that world and level file agree."""

from __future__ import annotations

import itertools

import numpy as np
from flockbrush.engine.noise import Noise
from flockbrush.engine.seam import images

THIN = 0.71  # cells: a stroke is never thinner than the half diagonal of a cell, so that it always paints something
_GRAIN = Noise(0)  # the same in every world, for the level file is painted without one


def stroke_cells(start, end, radius, softness, shape, cell, wraps=False):
    """The cells within a radius of a segment, which reaches over the borders of a map that ``wraps``.

    Only the cells around the segment are looked at, whatever the size of the map.

    Parameters
    ----------
    start, end : (x, y)
        Metres.
    radius : float
        Metres.
    softness : float
        0: full to the rim; 1: fading from the middle on.
    shape : (ny, nx)
        The map.
    cell : float
        Side of a cell, m.

    Returns
    -------
    iy, ix : (k,) int64
    weight : (k,)
        1 in the core, falling to 0 at the rim.
    """
    radius, (ny, nx) = max(radius, THIN * cell), shape
    ends = np.array([start, end], float)
    ways = images(ends, (nx * cell, ny * cell) if wraps else None, radius)
    return merged_cells([_stroke(*(ends + way), radius, softness, shape, cell) for way in ways], nx)


def _stroke(start, end, radius, softness, shape, cell):
    """`stroke_cells` of a segment on a map that ends at its borders."""
    (ny, nx), (ax, ay), (bx, by) = shape, start, end
    x0, x1 = _span(min(ax, bx) - radius, max(ax, bx) + radius, cell, nx)
    y0, y1 = _span(min(ay, by) - radius, max(ay, by) + radius, cell, ny)
    px, py = (np.arange(x0, x1) + 0.5) * cell - ax, ((np.arange(y0, y1) + 0.5) * cell - ay)[:, None]
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    t = np.clip((px * dx + py * dy) / square, 0.0, 1.0) if square > 0 else 0.0
    distance = np.sqrt((px - t * dx) ** 2 + (py - t * dy) ** 2)
    iy, ix = np.nonzero(distance <= radius)
    fading = (radius - distance[iy, ix]) / max(softness * radius, 1e-300) if softness > 0 else np.ones(len(iy))
    return iy + y0, ix + x0, np.minimum(fading, 1.0)


def merged_cells(parts, nx):
    """(iy, ix, weight) of cells from several such, each cell once with its greatest weight; row by row of ``nx``."""
    if len(parts) == 1:
        return parts[0]
    iy, ix, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort((-weight, ix, iy))
    _, first = np.unique((iy * nx + ix)[order], return_index=True)
    return tuple(column[order[first]] for column in (iy, ix, weight))


def _span(low, high, cell, count):
    """Cells from the first to after the last between two places, kept on the map."""
    return int(min(max(low / cell, 0), count)), int(min(max(high / cell + 1, 0), count))


def taken(iy, ix, weight):
    """(k,) bool: cells that a soft brush takes, the same ones however often it passes."""
    chance = _GRAIN.uniform("soft brush", 0, iy * (1 << 20) + ix)[:, 0]
    return chance < weight


def blended(before, cap, weight):
    """(k,) m/s: a cap painted softly over others, to two digits, so that a stroke has few different ones.

    Where there is no cap yet nothing can be half-way: the stronger half of the brush takes those cells whole.
    """
    none = np.isinf(before) | np.isinf(cap)
    mixed = np.where(none, 0.0, before) * (1.0 - weight) + (0.0 if np.isinf(cap) else cap) * weight
    values, which = np.unique(mixed, return_inverse=True)
    mixed = np.array([float(f"{value:.2g}") for value in values])[which.ravel()]
    return np.where(weight >= 1.0, cap, np.where(none, np.where(weight >= 0.5, cap, before), mixed))


# cells in words -----------------------------------------------------------------


def runs_of(iy, ix, index):
    """Cells and what each gets as ``[iy, ix, length, index]``, south row first, west to east.

    Parameters
    ----------
    iy, ix, index : (k,) int
        No cell twice.
    """
    order = np.lexsort((ix, iy))
    iy, ix, index = (np.asarray(a)[order] for a in (iy, ix, index))
    new = np.ones(len(iy), bool)
    new[1:] = (np.diff(iy) != 0) | (np.diff(ix) != 1) | (np.diff(index) != 0)
    first = np.flatnonzero(new)
    length = np.diff(np.append(first, len(iy)))
    return np.column_stack([iy[first], ix[first], length, index[first]]).astype(int).tolist()


def cells_of(runs):
    """(iy, ix, index) of `runs_of`."""
    table = np.array(runs, np.int64).reshape(-1, 4)
    length = table[:, 2]
    iy, ix, index = (np.repeat(table[:, k], length) for k in (0, 1, 3))
    return iy, ix + np.arange(len(ix)) - np.repeat(np.cumsum(length) - length, length), index


def check_runs(runs, names, shape):
    """ValueError when runs are none, leave the map, or count beyond the names."""
    for run in runs:
        if not (isinstance(run, list) and len(run) == 4 and all(type(v) is int for v in run)):
            raise ValueError("runs must be lists of four whole numbers, [row, column, length, name]")
        iy, ix, length, index = run
        if not (0 <= iy < shape[0] and ix >= 0 and length >= 1 and ix + length <= shape[1]):
            raise ValueError(f"the run {run} leaves the map, which has {shape[1]} x {shape[0]} cells")
        if not 0 <= index < len(names):
            raise ValueError(f"the run {run} has no name; there are {len(names)}")
    table = sorted((iy, ix, length) for iy, ix, length, _ in runs)
    for (iy, ix, length), (jy, jx, _) in itertools.pairwise(table):
        if iy == jy and jx < ix + length:
            raise ValueError(f"two runs meet in row {iy}, column {jx}")


def connected(values, iy, ix, wraps=False):
    """(ny, nx) bool: the cells of the same value that hang together with this one, over the borders if it ``wraps``."""
    from scipy.ndimage import label
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    parts, count = label(values == values[iy, ix])
    if not wraps:
        return parts == parts[iy, ix]
    meet = np.concatenate([parts[[0, -1]].T, parts[:, [0, -1]]])  # parts that meet at a border
    meet = meet[meet.all(axis=1)]
    pairs = coo_array((np.ones(len(meet), bool), meet.T), (count + 1, count + 1))
    whole = connected_components(pairs, directed=False)[1][parts]
    return (parts > 0) & (whole == whole[iy, ix])
