"""Edges of the ground: around cells of a raster, and across the seams of a periodic map."""

from __future__ import annotations

import numpy as np
from flockbrush.engine.seam import with_images


def outline_edges(mask):
    """Straight edges around the true cells of a mask, long runs in one piece.

    Parameters
    ----------
    mask : ndarray (ny, nx) bool

    Returns
    -------
    ndarray (k, 4)
        ``x0, y0, x1, y1`` in cells.
    """
    padded = np.pad(mask, 1)
    row, west, east = _runs(padded[1:, 1:-1] != padded[:-1, 1:-1])  # a horizontal edge below row iy
    column, south, north = _runs((padded[1:-1, 1:] != padded[1:-1, :-1]).T)
    across, along = np.stack([west, row, east, row], 1), np.stack([column, south, column, north], 1)
    return np.concatenate([across, along]).astype(float)


def _runs(lines):
    """(line, first, after last) of every run of true, three arrays: line by line."""
    line, place = np.nonzero(np.diff(np.pad(lines.astype(np.int8), ((0, 0), (1, 1)))))
    return line[::2], place[::2], place[1::2]


def solid_images(obstacles, wrap):
    """Those that are solid, with their copies on the other sides of a periodic map (width, height) that reach into it.

    None is a map without a seam.
    """
    return [image for image, _ in with_images([one for one in obstacles if one.solid], wrap, reach="margin")]


def across_seam(edges, owner, wrap, reach):
    """Edges and their copies just across the seams of a periodic map."""
    out, owners = [], []
    for dx in (-wrap[0], 0.0, wrap[0]):
        for dy in (-wrap[1], 0.0, wrap[1]):
            moved = edges + (dx, dy, dx, dy)
            low, high = np.minimum(moved[:, :2], moved[:, 2:]), np.maximum(moved[:, :2], moved[:, 2:])
            near = ((high > -reach) & (low < np.array(wrap) + reach)).all(1)
            out.append(moved[near])
            owners.append(owner[near])
    return np.concatenate(out), np.concatenate(owners)
