"""Avoid obstacles: foresight on the ground and in the air.

On the ground an animal looks as far ahead as it goes in its foresight, and, where something solid stands there, to
both sides for the nearest way that is free (Reynolds 1987, steer-to-avoid; the rays are ours).  In the air it steers
past the silhouette of what lies ahead (`systems.foresight`); ahead is where its model wishes to go, if that says a
velocity, so that no bird turns back to its place through what it passes.
"""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import air_of, quantity
from flockbrush.behaviours.drive import DriveParameters, Urges, drive, towards
from flockbrush.engine.maths import inner_kernel, sincos_
from flockbrush.engine.solid_queries import BodyFrame, ahead_, past_
from numba import njit

ROOM = 0.5  # body lengths beside the body that count as in the way of a bird
RAYS = 9  # to each side
WIDEST = 2.4  # rad


class Params(DriveParameters):
    """How far ahead."""

    foresight: float = quantity(2.0, "s", "how far ahead the animal looks, as time of travel", 0, 60)
    room: float = quantity(0.5, "body lengths", "free space kept beside the body", 0, 20)


@drive("avoid_obstacles", Params, safety=True)
def avoid_obstacles(scene, rows, p):
    """The nearest free way."""
    bodies = scene.bodies
    if bodies is None:
        return None
    n, air = len(rows), air_of(scene)
    way, urgency, speed = np.zeros((n, 3)), np.zeros(n), np.sqrt((scene.velocity[rows] ** 2).sum(axis=1))
    goes = np.maximum(speed, scene.speed[rows])
    if len(bodies.walls):
        _free_way(rows, bodies.aloft, scene.animals, p.foresight * goes, bodies.walls, p.room, way, urgency)
    hit, aim = air.hit[rows], air.aim[rows]
    if len(bodies.solids.kind):
        past_solids(rows, bodies, scene.animals, air.up, hit, aim)
    flies = bodies.aloft[rows] & np.isfinite(hit)
    reach = np.maximum(bodies.foresight[rows] * goes, 1e-6)
    soon = np.clip(1.0 - hit / reach, 0.0, 1.0)
    way[flies], urgency[flies] = aim[flies], np.where(hit < reach, 0.3 + 0.7 * soon, 0.0)[flies]
    if not urgency.any():
        return None
    return Urges(towards(scene.velocity[rows], goes[:, None] * way, bodies.acceleration[rows]), p.strength * urgency)


@njit(cache=True, nogil=True, error_model="numpy")
def _free_way(rows, aloft, animals, ahead, walls, room, way, urgency):
    """The nearest way that is free for as many metres as each looks ``ahead`` (k,), and how urgent it is."""
    xyz, forward, length = animals.xyz, animals.forward, animals.length
    for k in range(len(rows)):
        i = rows[k]
        if aloft[i]:
            continue
        reach = ahead[k] + 2.0 * length[i]
        beside = room * length[i] + 0.5 * length[i]
        x, y, fx, fy = xyz[i, 0], xyz[i, 1], forward[i, 0], forward[i, 1]
        straight = _room(walls, x, y, fx, fy, reach, beside, animals.wrap)
        if straight >= reach:
            continue
        best, bx, by = straight, fx, fy
        for step in range(1, RAYS + 1):
            found = False
            for side in (1.0, -1.0):
                sine, cosine = sincos_(side * step * WIDEST / RAYS)
                gx, gy = cosine * fx - sine * fy, sine * fx + cosine * fy
                free = _room(walls, x, y, gx, gy, reach, beside, animals.wrap)
                if free > best + 1e-9:
                    best, bx, by = free, gx, gy
                found |= free >= reach
            if found:
                break
        way[k, 0], way[k, 1] = bx, by
        urgency[k] = min(0.3 + 0.7 * (1.0 - straight / reach), 1.0)


@inner_kernel
def _room(walls, x, y, fx, fy, reach, beside, wrap):
    """Metres along a unit vector until an edge comes nearer than ``beside`` in front; ``reach`` when none does.

    Near the border of a map that goes on at the opposite one, the edges there count.
    """
    free, far = reach, reach + beside
    over_x = wrap[0] if x < far else -wrap[0] if x > wrap[0] - far else 0.0
    over_y = wrap[1] if y < far else -wrap[1] if y > wrap[1] - far else 0.0
    for image in range(4 if wrap[0] > 0.0 else 1):
        if (image & 1 and over_x == 0.0) or (image & 2 and over_y == 0.0):
            continue
        px, py = x + over_x if image & 1 else x, y + over_y if image & 2 else y
        for e in range(len(walls)):
            ax, ay, bx, by = walls[e, 0] - px, walls[e, 1] - py, walls[e, 2] - px, walls[e, 3] - py
            # along and across the way
            au, av, bu, bv = ax * fx + ay * fy, ay * fx - ax * fy, bx * fx + by * fy, by * fx - bx * fy
            if max(au, bu) <= 0.0 or min(au, bu) >= free or min(av, bv) >= beside or max(av, bv) <= -beside:
                continue
            lo, hi = 0.0, 1.0  # the part of the edge within the strip
            if av != bv:
                t0, t1 = (-beside - av) / (bv - av), (beside - av) / (bv - av)
                lo, hi = max(lo, min(t0, t1)), min(hi, max(t0, t1))
            u0, u1 = au + lo * (bu - au), au + hi * (bu - au)
            if max(u0, u1) > 0.0:
                free = min(free, max(min(u0, u1), 0.0))
    return free


@njit(cache=True, nogil=True, error_model="numpy")
def past_solids(rows, bodies, animals, up, hit, aim):
    """Metres to what each would meet on the way that its model wishes, and where to steer instead, into hit and aim.

    It passes on the side that is nearest to its heading: wishes may change sides from tick to tick.
    """
    ids, xyz, forward, length = animals.ids, animals.xyz, animals.forward, animals.length
    aloft, wished, radius, height = bodies.aloft, bodies.wished, bodies.radius, bodies.height
    solids, foresight = bodies.solids, bodies.foresight
    for k in range(len(rows)):
        i = rows[k]
        x, y, z, fx, fy, fz = xyz[i, 0], xyz[i, 1], xyz[i, 2], wished[i, 0], wished[i, 1], wished[i, 2]
        speed = np.sqrt(fx * fx + fy * fy + fz * fz)
        if not aloft[i] or foresight[i] <= 0.0 or speed < 1e-9:
            continue
        fx, fy, fz = fx / speed, fy / speed, fz / speed
        reach = foresight[i] * speed + 2.0 * length[i]
        who, hit[k] = ahead_(solids, x, y, z, fx, fy, fz, reach, radius[i] + ROOM * length[i])
        if who >= 0:
            beyond = radius[i] + (ROOM + 0.5) * length[i]
            gx, gy, gz = forward[i, 0], forward[i, 1], forward[i, 2]
            pose = BodyFrame((x, y, z), (gx, gy, gz), (up[i, 0], up[i, 1], up[i, 2]))
            aim[k, 0], aim[k, 1], aim[k, 2] = past_(solids, who, pose, beyond, height[i], ids[i] & 1)
