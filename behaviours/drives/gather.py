"""Gather: brings a herd together and drives it to the nearest animal it follows, as a sheepdog to its shepherd.

While somebody of those it hunts is far from the middle of the others, it goes behind that one; otherwise it goes behind
the herd, seen from its shepherd (Strömbom et al. [1]_).  It knows those of them alone that it notices, and slows down
close to them.  Where it notices no shepherd it keeps the herd together.

References
----------
.. [1] Strömbom, D. et al. (2014). Solving the shepherding problem: heuristics for herding autonomous, interacting
   agents. J. R. Soc. Interface 11, 20140719.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import quantity
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, towards

HUNT, FOLLOW = 2, 3  # of the lists of noticed animals


class Params(DriveParameters):
    """How close, and how fast."""

    room: float = quantity(
        1.5,
        "m",
        "spacing of the gathered animals (r_a); one farther than r_a N^(2/3) from the herd's centre is a stray",
        0.1,
        100,
    )
    behind: float = quantity(8.0, "m", "distance kept behind a stray, and behind the edge of the herd", 0.1, 200)
    near: float = quantity(5.0, "m", "nearer than this to one of the animals it moves slowly", 0, 200)
    delivered: float = quantity(12.0, "m", "a herd whose centre is this near to the shepherd is left alone", 0, 1000)
    pace: float = quantity(0.6, "1", "share of its fleeing speed at which it moves around the herd", 0.01, 1)


@drive("gather", Params, notices=("hunt", "follow"))
def gather(scene, rows, p):
    """Behind a stray, or behind the herd."""
    noticed, bodies = scene.noticed, scene.bodies
    if noticed is None or bodies is None or not (noticed.verb == HUNT).any():
        return None
    wanted, urgency = np.zeros((len(rows), 3)), np.zeros(len(rows))
    for k, i in enumerate(rows.tolist()):
        mine = slice(noticed.first[i], noticed.first[i + 1])
        verb, offset = noticed.verb[mine], noticed.offset[mine, :2]
        herd, shepherd = offset[verb == HUNT], offset[verb == FOLLOW]
        if not len(herd):
            continue
        nearest = shepherd[np.argmin((shepherd**2).sum(axis=1))] if len(shepherd) else None
        to, slow = _place(herd, nearest, p)
        far = np.sqrt((to * to).sum())
        speed = bodies.flee[i] * p.pace * min(far / p.near if p.near else 1.0, 1.0) * (0.3 if slow else 1.0)
        wanted[k, :2] = to / max(far, 1e-9) * speed
        urgency[k] = 1.0
    return Urges(towards(scene.velocity[rows], wanted, bodies.acceleration[rows]), p.strength * urgency)


def _place(herd, shepherd, p):
    """((2,) m, offset of the place where the dog is needed; whether it is so near to the herd that it goes slowly)."""
    count, middle = len(herd), herd.mean(axis=0)
    away = np.sqrt(((herd - middle) ** 2).sum(axis=1))
    stray = int(away.argmax())
    if away[stray] > p.room * count ** (2.0 / 3.0):  # collect
        out = (herd[stray] - middle) / max(away[stray], 1e-9)
        goal, middle, radius = herd[stray] + p.behind * out, herd[stray], p.behind
    elif shepherd is None:
        return np.zeros(2), False
    else:  # drive
        out = middle - shepherd
        far = np.sqrt((out * out).sum())
        if far <= p.delivered:
            return np.zeros(2), False
        radius = p.room * np.sqrt(count)
        goal = middle + (p.behind + 0.5 * radius) * out / max(far, 1e-9)
    return _round(goal, middle, radius), bool((herd**2).sum(axis=1).min() < p.near**2)


def _round(goal, middle, radius):
    """The way to a goal (both seen from the dog), beside a herd that stands in it."""
    far = np.sqrt((goal * goal).sum())
    if far < 1e-9:
        return goal
    way = goal / far
    along, across = middle @ way, middle[1] * way[0] - middle[0] * way[1]
    if not 0.0 < along < far or abs(across) >= radius:
        return goal
    side = np.array([way[1], -way[0]]) * (1.0 if across > 0.0 else -1.0)
    return middle + 1.2 * radius * side
