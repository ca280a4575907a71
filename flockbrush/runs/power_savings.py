"""Power that each bird of a line formation saves by flying in the upwash of others."""

from __future__ import annotations

import numpy as np
from numba import njit

from flockbrush.behaviours.formation.hummel import REACH, g_
from flockbrush.components import Body, BrushBinding, FormationPlace, Position
from flockbrush.systems.palette import Palette

NEAR = 0.5  # wingspans of height within which birds fly in one another's wake


@njit(cache=True, nogil=True, error_model="numpy")
def savings(xyz, track, wing):
    """Σ g of every bird, (n,): from birds at its own height and not in one another's downwash.

    Parameters
    ----------
    xyz : ndarray (n, 3)
        Metres.
    track : ndarray (n, 2)
        Unit vectors: the way each bird flies.
    wing : ndarray (n,)
        Wingspans, m.  Distances between two birds count in their mean wingspan.
    """
    n = len(xyz)
    out = np.zeros(n)
    for i in range(n):
        for j in range(n):
            unit = 0.5 * (wing[i] + wing[j])
            x, y, z = xyz[j, 0] - xyz[i, 0], xyz[j, 1] - xyz[i, 1], xyz[j, 2] - xyz[i, 2]
            right, ahead = x * track[i, 1] - y * track[i, 0], x * track[i, 0] + y * track[i, 1]
            if i != j and abs(right) > (REACH + 0.02) * unit and abs(z) < NEAR * unit:
                out[i] += g_(right / unit, ahead / unit)
    return out


def wingspans_of(world):
    """m, of every bird, (n,)."""
    agents, palette = world.agents, world.resource(Palette)
    spans = np.array([getattr(brush.params, "wingspan", 1.8) for brush in palette.brushes])
    return spans[agents[BrushBinding.home]] * agents[Body.length]


def savings_of(world):
    """The share of induced power that every bird saves, (n,), 0 for those in no formation.

    Notes
    -----
    Hummel's relative power reduction, summed over the others of its flock (Klotsman & Tal, section 5).
    """
    agents, wing = world.agents, wingspans_of(world)
    xyz, track = agents[Position.xyz], agents[FormationPlace.track]
    flying = np.flatnonzero(track.any(axis=1))
    out = np.zeros(len(agents))
    out[flying] = savings(xyz[flying], track[flying], wing[flying])
    return out
