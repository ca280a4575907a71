"""Follow: after the nearest of those whom the species follows and that is noticed, up to some distance."""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import quantity
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, towards

FOLLOW = 3  # of the lists of noticed animals


class Params(DriveParameters):
    """How close."""

    distance: float = quantity(4.0, "body lengths", "the drive is inactive when nearer than this", 0, 500)
    hurry: float = quantity(20.0, "body lengths", "distance beyond that at which it runs as fast as it can", 0.1, 1000)


@drive("follow", Params, notices=("follow",))
def follow(scene, rows, p):
    """Up to the one that is followed."""
    noticed, bodies = scene.noticed, scene.bodies
    if noticed is None or bodies is None or not (noticed.verb == FOLLOW).any():
        return None
    wanted, urgency = np.zeros((len(rows), 3)), np.zeros(len(rows))
    for k, i in enumerate(rows.tolist()):
        mine = slice(noticed.first[i], noticed.first[i + 1])
        offset = noticed.offset[mine][noticed.verb[mine] == FOLLOW]
        if not len(offset):
            continue
        far = np.sqrt((offset**2).sum(axis=1))
        at = int(far.argmin())
        beyond = (far[at] / scene.length[i] - p.distance) / p.hurry
        if beyond > 0.0:
            way = offset[at] * (1.0, 1.0, 1.0 if bodies.aloft[i] else 0.0)
            size = max(float(np.sqrt((way**2).sum())), 1e-9)
            who = noticed.near[mine][noticed.verb[mine] == FOLLOW][at]
            pace = float(np.sqrt((scene.velocity[who] ** 2).sum()))
            wanted[k] = way / size * min(pace + bodies.flee[i] * min(beyond, 1.0), bodies.flee[i])
            urgency[k] = min(0.5 + beyond, 1.0)
    return Urges(towards(scene.velocity[rows], wanted, bodies.acceleration[rows]), p.strength * urgency)
