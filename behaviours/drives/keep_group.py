"""Keep group: an animal that has strayed goes back to its own kind.

It heads for the middle of those of its species that it sees; of whom it sees none, for where it last saw them. The
urgency is none within `distance` and grows with what is beyond it.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import air_of, quantity
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, towards, within_wings
from flockbrush.behaviours.trigger import SeenNeighbours
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
    if scene.bodies is None:
        return None
    return back_to(scene, rows, p, to_kin(scene, rows, scene.species, scene.known))


def back_to(scene, rows, p, middle):
    """`Urges` of those who are far from where they belong: ``middle`` (k, 3) m from each, 0 where that is not known."""
    bodies, (x, y, z) = scene.bodies, middle.T
    far = np.sqrt(x * x + y * y + z * z)
    beyond = (far / scene.length[rows] - p.distance) / p.hurry
    strays = (beyond > 0.0) & (far > 0.0)
    urgency = np.where(strays, np.minimum(beyond, 1.0), 0.0)
    way = np.where(strays, np.stack([x, y, z]) / np.where(strays, far, 1.0), 0.0).T
    if not urgency.any():
        return None
    wanted = np.maximum(scene.speed[rows], urgency * bodies.flee[rows])[:, None] * way
    flies = np.flatnonzero(bodies.aloft[rows] & (urgency > 0.0))
    if len(flies):
        wanted[flies] = within_wings(scene, rows[flies], wanted[flies])
    return Urges(towards(scene.velocity[rows], wanted, bodies.acceleration[rows]), p.strength * urgency)


def to_kin(scene, rows, kind, known):
    """(k, 3) m: from each to the middle of those of its ``kind`` (n,) that it sees, or to the place in memory.

    ``known`` (n,) is 0 where there is no such place; then it is 0.
    """
    air = air_of(scene)
    rise = np.zeros((len(scene.near), 1))
    on_ground = SeenNeighbours(scene.first, scene.near, np.hstack([scene.offset, rise]))
    in_air = SeenNeighbours(air.first, air.near, air.offset)
    return _to_kin(rows, scene.bodies.aloft, on_ground, in_air, kind, scene.memory, known)


@njit(cache=True, nogil=True, error_model="numpy")
def _to_kin(rows, aloft, on_ground, in_air, species, memory, known):
    first, near, offset = on_ground
    air_first, air_near, air_offset = in_air
    out = np.zeros((len(rows), 3))
    for k in range(len(rows)):
        i = rows[k]
        x = y = z = 0.0
        kin = 0
        lo, hi = (air_first[i], air_first[i + 1]) if aloft[i] else (first[i], first[i + 1])
        for at in range(lo, hi):
            j = air_near[at] if aloft[i] else near[at]
            if species[j] == species[i]:
                kin += 1
                away = air_offset[at] if aloft[i] else offset[at]
                x, y, z = x + away[0], y + away[1], z + away[2]
        if kin:
            x, y, z = x / kin, y / kin, z / kin
        elif known[i]:
            x, y = memory[i, 0], memory[i, 1]
        out[k, 0], out[k, 1], out[k, 2] = x, y, z if aloft[i] else 0.0
    return out
