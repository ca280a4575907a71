"""A brush from other starts than the clip's: from which of them does a herd become what the clip shows?

A herd can have two ways to move at one set of parameters, as a mill that never forms out of a scatter.
"""

from __future__ import annotations

import math

import numpy as np

from flockbrush.behaviours.brush import Brush
from flockbrush.components import Heading, Position
from flockbrush.learning.rollout import HerdStart
from flockbrush.levels.build import DT, herds_apart
from flockbrush.systems.measures import compute_milling, compute_nnd, compute_polarization

STARTS = {"scatter": "a scatter with random headings", "mill": "a turning disc", "ring": "a turning ring"}
HERDS = 3  # side by side, of each start
SECONDS, SETTLING = 20.0, 10.0  # s of a run, and what of it is not measured
MOST = 300  # animals of a herd
REGULAR = 0.5  # animals in the square of the distance to the nearest, between at random (.25) and a lattice (1)
FILLED = 0.35  # of the ground that bodies may cover where they are put


def with_other_starts(brush: Brush, start: HerdStart, seed=0, herds=HERDS, seconds=SECONDS) -> list[dict]:
    """What herds do that begin otherwise than the clip's, on an endless plane, as dense as that one.

    Parameters
    ----------
    start : HerdStart
        The clip's herd, BL.
    herds : int
        Side by side from each start.

    Returns
    -------
    list of dict
        ``start``, ``words``, ``animals``, and by herd ``polarization`` and ``milling``, means of the end.
    """
    animals = min(len(start), MOST)
    if animals < 2:
        return []
    density = _density(brush, start)
    brushes = [brush.model_copy(update={"name": f"herd-{k}"}) for k in range(herds)]
    reach = 2.0 * (brush.speed.mean * seconds + math.sqrt(animals / density)) + brush.vision.range
    settling, rows = min(SETTLING, seconds / 2), []
    for name, words in STARTS.items():
        simulation = herds_apart(brushes, animals, density, name, seed, apart=reach * brush.body.length)
        simulation.run(round(settling / DT))
        found = []
        for _ in range(max(1, round(seconds - settling))):
            simulation.run(round(1 / DT))
            found.append([_order(simulation, slice(k * animals, (k + 1) * animals)) for k in range(herds)])
        simulation.close()
        polarization, milling = np.mean(found, axis=0).T.tolist()
        rows.append(
            {"start": name, "words": words, "animals": animals, "polarization": polarization, "milling": milling}
        )
    return rows


def _order(simulation, rows):
    """(polarization, milling) of one of the herds."""
    xy, forward = simulation.agents[Position.xyz][rows, :2], simulation.agents[Heading.forward][rows]
    return compute_polarization(forward), compute_milling(xy, forward)


def _density(brush, start):
    """Local animals per BL² of the clip, from distances to the nearest neighbour; at most close packing of bodies."""
    radius = min(brush.body.radius / brush.body.length, 0.5)
    body = 2 * radius * (1 - 2 * radius) + math.pi * radius**2
    gap = float(np.median(compute_nnd(start.xy)))
    return min(REGULAR / max(gap, 1e-3) ** 2, FILLED / body)
