"""Power that each bird of a line formation saves by flying in the upwash of others."""

from __future__ import annotations

import numpy as np
from numba import njit

from flockbrush.behaviours.formation.hummel import REACH, g_
from flockbrush.components import Body, BrushBinding, FormationPlace, Position
from flockbrush.systems.palette import Palette

NEAR = 0.5  # wingspans of height within which birds fly in one another's wake


@njit(cache=True, nogil=True, error_model="numpy")
def savings(x, y, z, wing):
    """Σ g of every bird, (n,): from birds at its own height and not in one another's downwash.

    Parameters
    ----------
    x, y, z : ndarray (n,)
        Metres to the right, ahead and up.
    wing : ndarray (n,)
        Wingspans, m.  Distances between two birds count in their mean wingspan.
    """
    n = len(x)
    out = np.zeros(n)
    for i in range(n):
        for j in range(n):
            unit = 0.5 * (wing[i] + wing[j])
            right = (x[j] - x[i]) / unit
            if i != j and abs(right) > REACH + 0.02 and abs(z[j] - z[i]) < NEAR * unit:
                out[i] += g_(right, (y[j] - y[i]) / unit)
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
    x = xyz[:, 0] * track[:, 1] - xyz[:, 1] * track[:, 0]
    y = xyz[:, 0] * track[:, 0] + xyz[:, 1] * track[:, 1]
    flying = np.flatnonzero(track.any(axis=1))
    out = np.zeros(len(agents))
    out[flying] = savings(x[flying], y[flying], xyz[flying, 2], wing[flying])
    return out
