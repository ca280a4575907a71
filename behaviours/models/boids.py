"""Boids: flocks, and herds and schools, in three dimensions.

Reynolds 1987 [1]_.  Each bird has urges, which ask for accelerations of at most
1 (the most it can give): keep clear of obstacles, keep clear of neighbours,
flee, match the neighbours' velocity, stay near their middle, migrate, keep its
height.  The acceleration there is, is handed out in that order until it is
used up ("prioritised acceleration allocation"); weighted averaging is the
paper's other way, with its indecision.  What the urges leave is geometric
flight (`flockbrush.systems.flight`).

Neighbours weigh by the inverse square of distance, or another exponent, and
more ahead than behind as the bird flies faster.  Obstacles are steered past
(``avoid = "steer"``: one body length beyond the silhouette edge nearest to
where the heading points) or push (``"field"``).  With ``grounded`` the same
model is a herd, held to the terrain.

The paper gives no numbers; those here are ours.  Lengths are in body lengths.

.. [1] Reynolds, C. W. (1987). Flocks, herds, and schools: a distributed behavioral model. Computer Graphics 21(4),
   25-34.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from flockbrush.behaviours.behaviour import Flight, Parameters, Wishes, air_of, behaviour, quantity
from flockbrush.behaviours.sliders import SLIDERS, DesignerSlider, moves
from flockbrush.engine.arrays import write_
from flockbrush.engine.maths import exp_, kernel_function, log_
from flockbrush.engine.parallel import over_rows
from numba import njit
from pydantic import Field

URGES = ("obstacle", "separation", "fear", "matching", "centring", "migration", "height")  # in order of priority
REASONS = dict(  # what designers read: the names that the herd's forces have
    zip(URGES, ("obstacles", "avoidance", "fear", "alignment", "cohesion", "migration", "height"), strict=True)
)
SAFETY = 5.0  # times the acceleration that would just do, asked for to pass an obstacle.  By trial: 2 grazes corners
STANDING = 0.05  # of the maximum speed: who is slower was stopped by something, and goes away from it
BESIDE = 2.0  # body lengths: nearer than this to a surface it goes off it before it heeds others, whatever is ahead
OFF = 2.0  # how firmly, right at the surface.  By trial: with 0 a third of a flock touch the pillars that they pass
NEAREST = 0.3  # body lengths: nearer neighbours weigh no more


class Params(Parameters):
    """Strengths of the urges, in order of priority, what is nearby, and what the body can do."""

    obstacle_strength: float = quantity(1.0, "1", "strength of the urge to avoid obstacles", 0, 1)
    separation_strength: float = quantity(1.0, "1", "strength of the urge to keep away from neighbours", 0, 1)
    fear_strength: float = quantity(1.0, "1", "strength of the urge to flee from predators", 0, 1)
    matching_strength: float = quantity(0.8, "1", "strength of the urge to match the neighbours' velocity", 0, 1)
    centring_strength: float = quantity(
        1.0, "1", "strength of the urge to stay near the centre of the neighbours", 0, 1
    )
    migration_strength: float = quantity(0.4, "1", "strength of the migratory urge", 0, 1)
    height_strength: float = quantity(0.3, "1", "strength of the urge to keep the height, or to fly level", 0, 1)
    arbitration: Literal["priority", "average"] = Field(
        "priority",
        description="priority: urges get acceleration in order until it is used up; average: weighted mean",
        json_schema_extra={"unit": "-"},
    )
    avoid: Literal["steer", "field"] = Field(
        "steer",
        description="steer: aim past the silhouette of an obstacle ahead; field: near obstacles push the bird away",
        json_schema_extra={"unit": "-"},
    )
    neighbour_range: float = quantity(40.0, "body lengths", "neighbours farther away are ignored", 0.5, 100)
    exponent: float = quantity(
        2.0, "1", "neighbours are weighted by distance to the power of minus this; larger: near ones count more", 0, 4
    )
    forward_weight: float = quantity(
        1.0, "1", "extra weight of neighbours ahead over neighbours behind, at full speed", 0, 4
    )
    separation: float = quantity(4.0, "body lengths", "a bird moves away from neighbours nearer than this", 0, 50)
    matching_time: float = quantity(
        0.15, "s", "time in which a bird matches its neighbours' velocity; smaller: stiffer", 0.03, 10
    )
    field_range: float = quantity(10.0, "body lengths", "reach of the force field of obstacles", 0.1, 1000)
    flight_distance: float = quantity(50.0, "body lengths", "a bird flees from a predator nearer than this", 0.5, 1000)
    panic_pace: float = quantity(1.6, "1", "speed factor when a predator is very close", 1, 20)
    height: float = quantity(0.0, "m", "height above the ground to keep; 0: any height, in level flight", 0, 1e5)
    clearance: float = quantity(5.0, "body lengths", "a bird climbs when it is nearer to the ground than this", 0, 1000)
    min_speed: float = quantity(
        10.0, "body lengths/s", "lowest speed; a bird is slower only if something stops it", 0, 1000
    )
    max_speed: float = quantity(80.0, "body lengths/s", "highest speed of a bird", 0.1, 1000)
    max_acceleration: float = quantity(
        2.0, "1/s", "largest acceleration for all urges together, divided by the maximum speed", 0.01, 100
    )
    damping: float = quantity(1.0, "1/s", "how fast the speed returns to the bird's own speed", 0, 30)
    weight: float = quantity(0.0, "1", "share of gravity that acts on the bird", 0, 1)
    buoyancy: float = quantity(0.0, "1", "share of the weight that the medium carries", 0, 1)
    lift: float = quantity(
        1.0,
        "1",
        "share of the weight that the wings carry at the bird's own speed; acts along its up axis, by speed squared",
        0,
        10,
    )
    banking: float = quantity(1.0, "1", "1: rolls into a turn like a bird; 0: stays upright; -1: leans outwards", -1, 1)
    roll_time: float = quantity(0.25, "s", "time that the bird takes to roll", 0.03, 10)
    foresight: float = quantity(2.0, "s", "how far ahead a bird looks for obstacles, as time of flight", 0, 60)
    grounded: bool = Field(
        False,
        description="true: animals stay on the ground, as a herd",
        json_schema_extra={"unit": "-", "enum": [False, True]},
    )

    sliders: ClassVar = {
        "tightness": DesignerSlider(
            "Loose to strongly attracted by neighbours", (moves("centring_strength", 0.0, 1.0),)
        ),
        "order": DesignerSlider(
            "Random headings to common heading",
            (moves("matching_strength", 0.0, 1.0), moves("matching_time", 1.5, 0.05, True)),
        ),
        "personal space": DesignerSlider("Wing to wing to wide spacing", (moves("separation", 0.5, 30.0, True),)),
        "nerve": DesignerSlider(
            "Bold to fearful",
            (moves("flight_distance", 5.0, 500.0, True), moves("panic_pace", 1.0, 4.0, True)),
        ),
        **SLIDERS,
    }


def flight(p):
    """What the air allows a boid."""
    return Flight(
        min_speed=p.min_speed,
        max_speed=p.max_speed,
        max_acceleration=p.max_acceleration * p.max_speed,
        damping=p.damping,
        weight=p.weight,
        buoyancy=p.buoyancy,
        lift=p.lift,
        banking=p.banking,
        roll_time=p.roll_time,
        foresight=p.foresight,
        grounded=p.grounded,
    )


def explain(scene, row, p):
    """Why a boid turns: its velocity, and what each urge was given of the acceleration in this tick, {reason: (3,)}."""
    asked = np.zeros((1, len(URGES), 3))
    _wishes(scene, np.array([row], np.int32), p, asked)
    ask, own = asked[0], scene.length[row]
    given = np.array(_shares(ask, [getattr(p, f"{urge}_strength") for urge in URGES], p.arbitration == "average"))
    velocity = scene.forward[row] * np.linalg.norm(scene.velocity[row])
    if not (given[:, None] * ask).any():
        velocity = scene.forward[row].copy()  # nothing is asked for: it goes on
    reasons = {REASONS[urge]: given[k] * ask[k] for k, urge in enumerate(URGES)}
    size = scene.dt * p.max_acceleration * p.max_speed * own
    return {"heading": velocity} | {name: size * wish for name, wish in reasons.items() if wish.any()}


def _shares(ask, strength, average):
    """What part each urge gets of what it asked for, (7,): by priority until 1 is handed out, or in the average."""
    size = np.sqrt((ask**2).sum(axis=1))
    if average:
        total = sum(weight for weight, one in zip(strength, size, strict=True) if one > 0)
        return [1.0 / total if total > 0 else 0.0] * len(ask)
    left = np.maximum(1.0 - np.concatenate([[0.0], np.cumsum(size)[:-1]]), 0.0)
    return np.minimum(left / np.maximum(size, 1e-300), 1.0)


@behaviour("boids", Params, flight=flight, explain=explain, has=("flee",))
def steer(scene, rows, p):
    """The acceleration that the urges agree on."""
    return _wishes(scene, rows, p, np.zeros((0, len(URGES), 3)))


def _wishes(scene, rows, p, asked):
    """The same, and into `asked` (n, 7, 3), or (0, 7, 3), what each urge asks for."""
    air, n = air_of(scene), len(rows)
    direction, pace, acceleration = np.empty((n, 3)), np.ones(n), np.empty((n, 3))
    strength = np.array([getattr(p, f"{urge}_strength") for urge in URGES])
    over_rows(
        _steer, n, rows, scene.dt, scene.velocity, scene.forward, scene.length, scene.species,
        air.first, air.near, air.offset, air.hit, air.aim, air.gap, air.normal, air.height, air.bound, air.target,
        air.danger_first, air.danger_offset, strength, p.arbitration == "average", p.avoid == "field",
        p.neighbour_range, p.exponent, p.forward_weight, p.separation, p.matching_time, p.field_range,
        p.flight_distance, p.panic_pace, p.height, p.clearance, p.foresight,
        p.max_acceleration * p.max_speed, p.max_speed, p.grounded, direction, pace, acceleration, asked,
    )  # fmt: skip
    return Wishes(direction, pace, acceleration)


@behaviour("raptor", Params, danger=True, flight=flight, explain=explain, has=("flee",))
def stoop(scene, rows, p):
    """A boid that others flee from; the script sends it."""
    return steer(scene, rows, p)


@kernel_function
def _request(ask, x, y, z, strength):
    """An urge's request, cut to 1, times its strength."""
    size = np.sqrt(x * x + y * y + z * z)
    share = strength / max(size, 1.0)
    ask[0], ask[1], ask[2] = share * x, share * y, share * z


@njit(cache=True, nogil=True, error_model="numpy")
def allocated(ask):
    """Prioritised acceleration allocation: requests in order, the last one trimmed, until 1 is handed out."""
    x = y = z = used = 0.0
    for urge in range(len(ask)):
        size = np.sqrt(ask[urge, 0] ** 2 + ask[urge, 1] ** 2 + ask[urge, 2] ** 2)
        share = 1.0
        if used + size > 1.0:
            share = (1.0 - used) / size
        x, y, z = x + share * ask[urge, 0], y + share * ask[urge, 1], z + share * ask[urge, 2]
        used += size
        if used >= 1.0:
            break
    return x, y, z


@njit(cache=True, nogil=True, error_model="numpy")
def averaged(ask, strength):
    """Weighted average of the requests of those urges that ask for anything."""
    x = y = z = total = 0.0
    for urge in range(len(ask)):
        if ask[urge, 0] != 0.0 or ask[urge, 1] != 0.0 or ask[urge, 2] != 0.0:
            x, y, z = x + ask[urge, 0], y + ask[urge, 1], z + ask[urge, 2]
            total += strength[urge]
    if total > 0.0:
        return x / total, y / total, z / total
    return 0.0, 0.0, 0.0


@kernel_function
def _weigh(a, b, i, per, fx, fy, fz, near, offset, species, cut2, apart2, exponent, ahead_counts, push, weight):
    """How much neighbours a to b push i away, into ``push``, and weigh otherwise, into ``weight``; 0 out of range.

    Without branches: who is within `separation` cannot be predicted, and a wrong guess costs more than the work.
    """
    nearest, n = 1.0 / (NEAREST * NEAREST), b - a
    share = weight[n:]
    for at in range(a, b):
        x, y, z = offset[at, 0] * per, offset[at, 1] * per, offset[at, 2] * per
        d2 = x * x + y * y + z * z
        one = 1.0 / np.sqrt(d2)
        w = one * one
        w = w if w < nearest else nearest
        there = (d2 <= cut2) & (d2 > 0.0)
        # inverse square, nothing at `separation`
        push[at - a] = (apart2 * w - 1.0) * one if there & (d2 < apart2) else 0.0
        ahead = 1.0 + ahead_counts * 0.5 * (1.0 + (fx * x + fy * y + fz * z) * one)
        share[at - a] = ahead if there & (species[near[at]] == species[i]) else 0.0
        weight[at - a] = w
    if exponent == 0.0:
        weight[:n] = 1.0
    elif exponent != 2.0:
        for k in range(n):  # a loop of its own, which LLVM does many at a time
            weight[k] = exp_(0.5 * exponent * log_(weight[k]))
    for k in range(n):
        weight[k] *= share[k]


@njit(cache=True, nogil=True, error_model="numpy")
def _steer(
    lo, hi, rows, dt, velocity, forward, length, species,
    first, near, offset, hit, aim, gap, normal, height, bound, target, danger_first, danger_offset,
    strength, average, field, neighbour_range, exponent, forward_weight, separation, matching_time, field_range,
    flight_distance, panic_pace, wanted_height, clearance, foresight, most, top, grounded,
    direction, pace, acceleration, asked,
):  # fmt: skip
    ask = np.zeros((len(strength), 3))
    cut2, apart2 = neighbour_range * neighbour_range, separation * separation
    room = 0
    for k in range(lo, hi):
        room = max(room, first[rows[k] + 1] - first[rows[k]])
    push, weight = np.empty(room), np.empty(2 * room)
    for k in range(lo, hi):
        i = rows[k]
        own = length[i]
        per = 1.0 / own
        fx, fy, fz = forward[i, 0], forward[i, 1], forward[i, 2]
        vx, vy, vz = velocity[i, 0] * per, velocity[i, 1] * per, velocity[i, 2] * per  # body lengths / s
        speed = np.sqrt(vx * vx + vy * vy + vz * vz)
        ahead_counts = forward_weight * min(speed / top, 1.0)
        a, b = first[i], first[i + 1]
        _weigh(a, b, i, per, fx, fy, fz, near, offset, species, cut2, apart2, exponent, ahead_counts, push, weight)
        sx = sy = sz = mx = my = mz = cx = cy = cz = total = 0.0
        for at in range(a, b):  # in the order of the list: another order has other last bits
            j, p, w = near[at], push[at - a], weight[at - a]
            x, y, z = offset[at, 0] * per, offset[at, 1] * per, offset[at, 2] * per
            sx, sy, sz, total = sx - p * x, sy - p * y, sz - p * z, total + w
            mx, my, mz = mx + w * velocity[j, 0], my + w * velocity[j, 1], mz + w * velocity[j, 2]
            cx, cy, cz = cx + w * x, cy + w * y, cz + w * z
        _request(ask[1], sx, sy, sz, strength[1])
        if total > 0.0:
            share, soon = per / total, 1.0 / (matching_time * most)
            _request(ask[3], (mx * share - vx) * soon, (my * share - vy) * soon, (mz * share - vz) * soon, strength[3])
            share = 1.0 / (total * neighbour_range)
            _request(ask[4], cx * share, cy * share, cz * share, strength[4])
        else:
            ask[3], ask[4] = 0.0, 0.0
        x, y, z = _clear_of_obstacles(
            field, fx, fy, fz, speed, top, most, hit[i] * per, aim[i], gap[i] * per, normal[i], field_range
        )
        # the ground: as a plane below that rises as fast as the bird sinks
        low = height[i] * per - clearance
        if low < 0.0 and not grounded:
            z += min(-low / max(clearance, 1e-9), 1.0) + max(-vz, 0.0) / most
        _request(ask[0], x, y, z, strength[0])
        worst = 0.0
        x = y = z = 0.0
        for at in range(danger_first[i], danger_first[i + 1]):
            dx, dy, dz = -danger_offset[at, 0] * per, -danger_offset[at, 1] * per, -danger_offset[at, 2] * per
            d = np.sqrt(dx * dx + dy * dy + dz * dz)
            if 0.0 < d < flight_distance:
                fear = 1.0 - d / flight_distance
                x, y, z = x + fear * dx / d, y + fear * dy / d, z + fear * dz / d
                worst = max(worst, fear)
        _request(ask[2], 2.0 * x, 2.0 * y, 2.0 * z, strength[2])
        pace[k] = 1.0 + (panic_pace - 1.0) * worst
        x, y, z = target[i, 0], target[i, 1], target[i, 2]
        size = np.sqrt(x * x + y * y + z * z)
        ask[5] = 0.0
        if bound[i] > 0 and size > 1e-9:
            # turned towards it, not hurried: where it lies behind, to the side that is nearer
            x, y, z = x / size, y / size, z / size
            along = fx * x + fy * y + fz * z
            if along < -0.999:
                x, y, z, along = x - fy, y + fx, z, 0.0
            _request(ask[5], 2.0 * (x - along * fx), 2.0 * (y - along * fy), 2.0 * (z - along * fz), strength[5])
        ask[6] = 0.0
        if not grounded:
            climb = 0.0
            if wanted_height > 0.0:
                climb = min(max((wanted_height - height[i]) * per / 10.0, -0.5), 0.5) * speed
            ask[6, 2] = strength[6] * min(max((climb - vz) * 2.0 / most, -1.0), 1.0)
        for urge in range(len(ask)):
            if grounded:
                ask[urge, 2] = 0.0
            if len(asked):
                write_(asked[k, urge], ask[urge])
        x, y, z = averaged(ask, strength) if average else allocated(ask)
        x, y, z = x * most * own, y * most * own, z * most * own
        acceleration[k, 0], acceleration[k, 1], acceleration[k, 2] = x, y, z
        x, y, z = fx * speed * own + dt * x, fy * speed * own + dt * y, fz * speed * own + dt * z
        size = np.sqrt(x * x + y * y + z * z)
        if (acceleration[k, 0] == 0.0 and acceleration[k, 1] == 0.0 and acceleration[k, 2] == 0.0) or size < 1e-9:
            direction[k, 0], direction[k, 1], direction[k, 2] = fx, fy, fz
        else:
            direction[k, 0], direction[k, 1], direction[k, 2] = x / size, y / size, z / size


@njit(cache=True, nogil=True, error_model="numpy")
def _clear_of_obstacles(field, fx, fy, fz, speed, top, most, hit, aim, gap, normal, field_range):
    """The request of obstacles; lengths in body lengths.

    Steered past, it is the acceleration across the heading that reaches the aim by the time of the impact, and some
    more, and keeps off what is within `BESIDE`: else the wishes of others press a bird that just passes an edge onto
    what lies behind it.  Pushed by a field, it falls with the square of the share of its range.
    """
    if field:
        if gap >= field_range:
            return 0.0, 0.0, 0.0
        push = (1.0 - max(gap, 0.0) / field_range) ** 2
        return push * normal[0], push * normal[1], push * normal[2]
    if speed < STANDING * top and gap < 1.0:  # in a nook both ways past are barred
        return normal[0], normal[1], normal[2]
    off = OFF * max(1.0 - gap / BESIDE, 0.0)
    bx, by, bz = off * normal[0], off * normal[1], off * normal[2]
    if not np.isfinite(hit):
        return bx, by, bz
    along = fx * aim[0] + fy * aim[1] + fz * aim[2]
    x, y, z = aim[0] - along * fx, aim[1] - along * fy, aim[2] - along * fz
    size = np.sqrt(x * x + y * y + z * z)
    if size < 1e-9:
        return bx, by, bz
    distance = max(hit, 0.5)
    aside = distance * size / max(along, 0.2)
    ask = SAFETY * 2.0 * aside * speed * speed / (distance * distance * most)
    ask = min(ask, 1.0) / size
    return ask * x + bx, ask * y + by, ask * z + bz
