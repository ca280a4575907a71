"""Families: groups inside groups.

The animals of a spawn with a ``family_size`` belong to families of neighbours, for life.  The drive `keep_family` keeps
a family together inside a larger herd, and reports have the measures of each.
"""

from __future__ import annotations

import numpy as np
from flockbrush.components import Family, Position


def make_families(world, entities, size):
    """Divide newborns into families of at most ``size`` neighbours, each numbered by its smallest id."""
    agents, ids = world.agents, np.asarray(entities, np.int64)
    rows = np.searchsorted(agents.ids, ids)
    label = families_of(agents[Position.xyz][rows], size)
    smallest = np.full(label.max(initial=-1) + 1, np.iinfo(np.int64).max)
    np.minimum.at(smallest, label, ids)
    agents[Family.number][rows] = smallest[label]


def families_of(xyz, size):
    """(n,) int: a number for each position (n, 3), the same for neighbours, each at most ``size`` times.

    Positions are halved again and again along the longer side of the box around them.
    """
    label = np.zeros(len(xyz), np.int64)
    parts = [(np.arange(len(xyz)), -(-len(xyz) // size), 0)]
    while parts:
        rows, count, first = parts.pop()
        if count <= 1:
            label[rows] = first
            continue
        axis = np.argmax(np.ptp(xyz[rows], axis=0))
        order, half = rows[np.argsort(xyz[rows, axis], kind="stable")], count // 2
        cut = round(len(rows) * half / count)
        parts += [(order[:cut], half, first), (order[cut:], count - half, first + half)]
    return label
