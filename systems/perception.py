"""Whom a brush takes into account of those in view: its ``[vision]`` says ``sight``.

exact
    Whoever is in view (`flockbrush.systems.visibility`, `flockbrush.systems.space`).
metric
    Everybody in range and field of view: bodies hide nobody.
hidden_points
    Of those, whom hidden-point removal leaves, in plan (Katz et al. 2007 [1]_).
topological
    The ``neighbours`` nearest of those in view (Ballerini et al. 2008 [2]_).
voronoi
    The first shell: those in view whose Voronoi cells touch the animal's own, in plan.

It chooses among the animal's own kind; others (dangers, prey) stay in view.  Whom a species ignores is left out for
every model.

References
----------
.. [1] Katz, S., Tal, A. and Basri, R. (2007). Direct visibility of point sets. ACM Transactions on Graphics 26(3), 24.
.. [2] Ballerini, M. et al. (2008). Interaction ruling animal collective behavior depends on topological rather than
   metric distance. PNAS 105(4), 1232-1237.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import padded_lists
from flockbrush.behaviours.brush_tables import SIGHTS
from flockbrush.components import BrushBinding, Species
from flockbrush.engine.maths import inner_kernel
from flockbrush.engine.parallel import over_rows
from flockbrush.systems.fauna import SpeciesList, kin_of
from flockbrush.systems.hidden_points import RADIUS_FACTOR, hull_corners
from flockbrush.systems.palette import Palette
from flockbrush.systems.visibility import Lists, VisibleBySlot, lists_of
from numba import njit

EXACT, METRIC, HIDDEN_POINTS, TOPOLOGICAL, VORONOI = range(len(SIGHTS))


def filters_neighbours(world):
    """Whether anybody of a world leaves out some of those in view."""
    return bool(world.resource(Palette).chooses or world.resource(SpeciesList).table.ignore.any())


def filtered_of_one_kind(lists, sight, neighbours):
    """`Lists` of those in view who are taken into account where all are of one kind and have one brush."""
    if SIGHTS.index(sight) < HIDDEN_POINTS:
        return lists
    n, keep, kin = len(lists.first) - 1, np.ones(len(lists.near), np.bool_), np.zeros((1, 1), np.bool_)
    kind = np.zeros(n, np.int32)
    sight = np.full(n, SIGHTS.index(sight))
    over_rows(_choose, n, lists, kind, kind, kin, sight, np.full(n, neighbours), keep)
    before = np.concatenate([[0], np.cumsum(keep)])
    return Lists(before[lists.first], lists.near[keep], lists.offset[keep])


def filtered_by_slot(world, found):
    """Those whom everybody's brush takes into account, of those in view; both as `Found`."""
    keep = _kept(world, lists_of(found))
    before = np.concatenate([[0], np.cumsum(keep)])
    first = np.concatenate([[0], np.cumsum(found.count)])
    return _found(found.cells, _slots(found)[keep], np.diff(before[first]))


def merge_by_row(mine, one, other):
    """`Found` with the rows of ``one`` where ``mine`` (n,) is true, else those of ``other``."""
    count = np.where(mine, one.count, other.count)
    slots, here = np.empty(count.sum(), np.int32), np.repeat(mine, count)
    slots[here] = _slots(one)[np.repeat(mine, one.count)]
    slots[~here] = _slots(other)[np.repeat(~mine, other.count)]
    return _found(one.cells, slots, count)


def _slots(found):
    """Slots of those whom each row sees, row by row."""
    first = np.concatenate([[0], np.cumsum(found.count)])[:-1]
    begin = np.where(found.count > 0, found.begin[np.maximum(found.cells.slot, 0)], 0)
    return found.seen[np.repeat(begin - first, found.count) + np.arange(found.count.sum())]


def _found(cells, slots, count):
    begin, rows = np.zeros(len(cells.x), np.int64), np.flatnonzero(cells.slot >= 0)
    seen, first = padded_lists(slots, count, cells.slot)
    begin[cells.slot[rows]] = first[rows]
    return VisibleBySlot(cells, seen, begin, count.astype(np.int64))


def _kept(world, lists):
    """(m,) bool: who stays of those in view."""
    agents, palette, table = world.agents, world.resource(Palette), world.resource(SpeciesList).table
    n, brush, species = len(agents), agents[BrushBinding.brush], agents[Species.index]
    keep = np.ones(len(lists.near), np.bool_)
    over_rows(
        _choose, n, lists, species, kin_of(table, species), table.ignore, palette.sight[brush],
        palette.neighbours[brush], keep,
    )  # fmt: skip
    return keep


@njit(cache=True, nogil=True, error_model="numpy")
def _choose(lo, hi, lists, species, kin, ignore, sight, neighbours, keep):
    first, near, offset = lists
    for i in range(lo, hi):
        count = 0
        for at in range(first[i], first[i + 1]):
            keep[at] = not ignore[species[i], species[near[at]]]
            count += keep[at] and kin[near[at]] == kin[i]
        if sight[i] < HIDDEN_POINTS or count == 0:
            continue
        own, k = np.empty(count, np.int64), 0
        for at in range(first[i], first[i + 1]):
            if keep[at] and kin[near[at]] == kin[i]:
                own[k], k = at, k + 1
                keep[at] = False
        if sight[i] == TOPOLOGICAL:
            _nearest(own, offset, neighbours[i], keep)
        else:
            _shell(own, offset, sight[i] == VORONOI, keep)


@inner_kernel
def _nearest(own, offset, most, keep):
    """Keep so many of the nearest; of equally far ones the first of the list."""
    for _ in range(min(most, len(own))):
        best, which = np.inf, -1
        for at in own:
            d2 = 0.0
            for c in range(offset.shape[1]):
                d2 += offset[at, c] * offset[at, c]
            if not keep[at] and d2 < best:
                best, which = d2, at
        keep[which] = True


@inner_kernel
def _shell(own, offset, inverted, keep):
    """Keep the corners of the hull of the points, turned inside out: by inversion, or over a sphere about all.

    Under inversion, p -> p / |p|², the corners of the hull of all and the origin are the neighbours whose Voronoi
    cells touch the origin's: the half-planes of the others are redundant.
    """
    x, y = offset[own, 0].copy(), offset[own, 1].copy()
    distance = np.sqrt(x * x + y * y)
    far = distance.max()
    for k in range(len(own)):
        d = distance[k]
        if d <= 1e-12:  # at the very same place
            keep[own[k]] = True
            continue
        stretch = far * far / (d * d) if inverted else 2.0 * RADIUS_FACTOR * far / d - 1.0
        x[k], y[k] = x[k] * stretch, y[k] * stretch
    for k in hull_corners(x, y):
        keep[own[k]] = True
