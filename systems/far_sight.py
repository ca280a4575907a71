"""Who is seen far away: a few named animals or places, beyond the range in which neighbours are listed.

As animals notice those whom their species names (`flockbrush.systems.noticing`): within a reach, in the field of view
of the eyes, or anywhere around when alarmed, with no obstacle, no ground that blocks the view and no hill between.
Bodies hide nobody.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.seam import short_way_
from flockbrush.engine.solid_queries import blocks_
from flockbrush.engine.solids import Solids
from flockbrush.systems.ground_height import Heights
from flockbrush.systems.noticing import behind_a_hill, crosses_an_edge
from numba import njit


class Eyes(NamedTuple):
    """What the lines of sight of n animals need."""

    xyz: np.ndarray  # (n, 3) m
    forward: np.ndarray  # (n, 3)
    cosine: np.ndarray  # (n,) of half the field of view; -1 sees all round
    up: np.ndarray  # (n,) m, how high the eyes are above the feet; 0 in the air
    radius: np.ndarray  # (n,) m, of bodies; 0 in the air
    aloft: np.ndarray  # (n,) bool
    edges: np.ndarray  # (e, 4) m, opaque on the ground
    solids: Solids  # opaque in space
    heights: Heights


def count_far(eyes, rows, targets, reach):
    """(k,) how many of the targets, rows (t,), the animals in rows (k,) see within their reach (n,), m."""
    count = np.zeros(len(rows), np.int64)
    if len(targets):
        x = eyes.xyz[targets, 0]
        order = np.argsort(x, kind="stable")
        over_rows(_count, len(rows), eyes, rows, targets[order], x[order], reach, count)
    return count


def sees_place(eyes, rows, place, reach):
    """(k,) bool, who sees a place (3,) within a reach (k,), m."""
    out = np.zeros(len(rows), np.bool_)
    over_rows(_place, len(rows), eyes, rows, *map(float, place), reach, out)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _count(lo, hi, eyes, rows, targets, x, reach, count):
    width = eyes.heights.wrap[0]
    wraps = 1 if width > 0.0 else 0
    for k in range(lo, hi):
        i = rows[k]
        end = 0
        for image in range(-wraps, wraps + 1):  # those in reach by x alone, each once
            middle = eyes.xyz[i, 0] + image * width
            begin = max(end, np.searchsorted(x, middle - reach[i]))
            end = max(end, np.searchsorted(x, middle + reach[i], side="right"))
            for t in range(begin, end):
                j = targets[t]
                place = eyes.xyz[j, 0], eyes.xyz[j, 1], eyes.xyz[j, 2]
                count[k] += j != i and _sees(eyes, i, place, eyes.radius[j], eyes.aloft[j], reach[i])


@njit(cache=True, nogil=True, error_model="numpy")
def _place(lo, hi, eyes, rows, x, y, z, reach, out):
    for k in range(lo, hi):
        out[k] = _sees(eyes, rows[k], (x, y, z), 0.0, eyes.aloft[rows[k]], reach[k])


@njit(cache=True, nogil=True, error_model="numpy")
def _sees(eyes, i, place, radius, aloft, reach):
    """Whether animal i sees a place, above which something is ``radius`` high."""
    heights = eyes.heights
    x, y = short_way_(place[0] - eyes.xyz[i, 0], place[1] - eyes.xyz[i, 1], heights.wrap)
    z = place[2] - eyes.xyz[i, 2]
    d2 = x * x + y * y + z * z
    if d2 > reach * reach:
        return False
    if eyes.cosine[i] > -1.0:
        ahead = x * eyes.forward[i, 0] + y * eyes.forward[i, 1] + z * eyes.forward[i, 2]
        if ahead < eyes.cosine[i] * np.sqrt(d2):
            return False
    px, py, pz = eyes.xyz[i, 0], eyes.xyz[i, 1], eyes.xyz[i, 2] + eyes.up[i]
    rise = z - eyes.up[i] + radius
    if not (eyes.aloft[i] or aloft) and crosses_an_edge(eyes.edges, px, py, x, y, heights.wrap):
        return False
    if len(eyes.solids.kind) and blocks_(eyes.solids, px, py, pz, x, y, rise):
        return False
    hills = heights.relief.shape[0] * heights.relief.shape[1] > 1
    return not (hills and behind_a_hill(heights, px, py, pz, x, y, rise))
