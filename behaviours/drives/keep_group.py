"""Keep group: an animal that has strayed goes back to its own kind.

It heads for the middle of those of its species that it sees; of whom it sees none, for where it last saw them. The
urgency is none within `distance` and grows with what is beyond it.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import air_of, quantity
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, towards, within_wings
from numba import njit


class Params(DriveParameters):
    """What is far."""

    distance: float = quantity(6.0, "body lengths", "farther than this from its kind it returns", 0, 500)
    hurry: float = quantity(
        20.0, "body lengths", "distance beyond that at which it returns with full control", 0.1, 1000
    )


@drive("keep_group", Params)
def keep_group(scene, rows, p):
    """Towards the middle of those of its kind that it sees."""
    bodies = scene.bodies
    if bodies is None:
        return None
    air = air_of(scene)
    way, urgency = np.zeros((len(rows), 3)), np.zeros(len(rows))
    rise = np.zeros((len(scene.near), 1))
    _back(
        rows, bodies.aloft, scene.first, scene.near, np.hstack([scene.offset, rise]), air.first, air.near, air.offset,
        scene.species, scene.memory, scene.known, scene.length, p.distance, p.hurry, way, urgency,
    )  # fmt: skip
    if not urgency.any():
        return None
    wanted = np.maximum(scene.speed[rows], urgency * bodies.flee[rows])[:, None] * way
    flies = np.flatnonzero(bodies.aloft[rows] & (urgency > 0.0))
    if len(flies):
        wanted[flies] = within_wings(scene, rows[flies], wanted[flies])
    return Urges(towards(scene.velocity[rows], wanted, bodies.acceleration[rows]), p.strength * urgency)


@njit(cache=True, nogil=True, error_model="numpy")
def _back(
    rows, aloft, first, near, offset, air_first, air_near, air_offset, species, memory, known, length, distance, hurry,
    way, urgency,
):  # fmt: skip
    for k in range(len(rows)):
        i = rows[k]
        x = y = z = 0.0
        kin = 0
        lo, hi = (air_first[i], air_first[i + 1]) if aloft[i] else (first[i], first[i + 1])
        for at in range(lo, hi):
            j = air_near[at] if aloft[i] else near[at]
            if species[j] == species[i]:
                kin += 1
                for_x = air_offset[at] if aloft[i] else offset[at]
                x, y, z = x + for_x[0], y + for_x[1], z + for_x[2]
        if kin:
            x, y, z = x / kin, y / kin, z / kin
        elif known[i]:
            x, y = memory[i, 0], memory[i, 1]
        if not aloft[i]:
            z = 0.0
        far = np.sqrt(x * x + y * y + z * z)
        beyond = (far / length[i] - distance) / hurry
        if beyond > 0.0 and far > 0.0:
            way[k, 0], way[k, 1], way[k, 2] = x / far, y / far, z / far
            urgency[k] = min(beyond, 1.0)
