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

from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from flockbrush.behaviours.behaviour import (
    Flight,
    FlockBySlot,
    Parameters,
    Wishes,
    air_of,
    behaviour,
    flock_of,
    quantity,
)
from flockbrush.behaviours.boid_urges import (
    Around,
    Bird,
    Rule,
    away_from_danger,
    clear_of_obstacles,
    to_height,
    to_target,
    turned,
)
from flockbrush.behaviours.sliders import DesignerSlider, moves, pace
from flockbrush.engine.lane_maths import lane_function
from flockbrush.engine.lanes import EIGHT, fused, load8, load_rows, pointer, root, splat8, store, total, totals, where
from flockbrush.engine.maths import exp_, log_
from flockbrush.engine.parallel import over_rows
from numba import njit
from pydantic import Field

URGES = ("obstacle", "separation", "fear", "matching", "centring", "migration", "height")  # in order of priority
OBSTACLE, SEPARATION, FEAR, MATCHING, CENTRING, MIGRATION, HEIGHT = range(len(URGES))
REASONS = dict(  # what designers read: the names that the herd's forces have
    zip(URGES, ("obstacles", "avoidance", "fear", "alignment", "cohesion", "migration", "height"), strict=True)
)
NEAREST = 0.3  # body lengths: nearer neighbours weigh no more
SUMS = 12  # numbers that are kept of a bird and its neighbours
BLOCK = 64  # birds whose neighbours are added up before their urges are weighed


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
            unproved="alignment",
        ),
        "personal space": DesignerSlider("Wing to wing to wide spacing", (moves("separation", 0.5, 30.0, True),)),
        "nerve": DesignerSlider(
            "Bold to fearful",
            (moves("flight_distance", 5.0, 500.0, True), moves("panic_pace", 1.0, 4.0, True)),
        ),
        "pace": pace(1.0, 60.0),
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


@behaviour("boids", Params, flight=flight, explain=explain, has=("flee",), by_slot=True)
def steer(scene, rows, p):
    """The acceleration that the urges agree on."""
    return _wishes(scene, rows, p, np.zeros((0, len(URGES), 3)))


@behaviour("raptor", Params, danger=True, flight=flight, explain=explain, has=("flee",), by_slot=True)
def stoop(scene, rows, p):
    """A boid that others flee from; the script sends it."""
    return steer(scene, rows, p)


class _Birds(NamedTuple):
    """The columns of birds themselves."""

    velocity: Any
    forward: Any
    length: Any
    species: Any


class WishColumns(NamedTuple):
    """What the kernel writes, by row of those asked."""

    direction: Any
    pace: Any
    acceleration: Any
    asked: Any  # by urge
    tells: int  # 0: reasons are not recorded


class Given(NamedTuple):
    """What has been handed out of the acceleration, and how much of it; in the average, the strengths of who asked."""

    x: float
    y: float
    z: float
    used: float


def _wishes(scene, rows, p, asked):
    """What `steer` says, and into `asked` (n, 7, 3), or (0, 7, 3), what each urge asks for."""
    air, n = air_of(scene), len(rows)
    wishes = Wishes(np.empty((n, 3)), np.ones(n), np.empty((n, 3)))
    birds = _Birds(scene.velocity, scene.forward, scene.length, scene.species)
    around = Around(*(getattr(air, name) for name in Around._fields))
    wish = WishColumns(wishes.direction, wishes.pace, wishes.acceleration, asked, len(asked))
    over_rows(_steer, n, rows, flock_of(scene, air), birds, around, rule_of(p, scene.dt), wish)
    return wishes


def rule_of(p, dt):
    """The `Rule` of parameters, for ticks of dt seconds."""
    most = p.max_acceleration * p.max_speed
    return Rule(
        dt=dt,
        strength=tuple(getattr(p, f"{urge}_strength") for urge in URGES),
        average=p.arbitration == "average",
        field=p.avoid == "field",
        grounded=p.grounded,
        cut2=p.neighbour_range**2,
        per_range=1.0 / p.neighbour_range,
        exponent=p.exponent,
        lean=0.5 * p.forward_weight,
        apart2=p.separation**2,
        soon=1.0 / (p.matching_time * most),
        field_range=p.field_range,
        flight_distance=p.flight_distance,
        panic_pace=p.panic_pace,
        height=p.height,
        clearance=p.clearance,
        most=most,
        per_most=1.0 / most,
        top=p.max_speed,
        per_top=1.0 / p.max_speed,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _steer(lo, hi, rows, flock, birds, around, rule, wish):
    """What the birds of rows lo to hi wish."""
    weights, sums = np.empty(len(flock.bird) + EIGHT), np.empty((BLOCK, SUMS))
    _steer_rows(lo, hi, rows, flock, birds, around, rule, wish, weights, sums)


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _steer_rows(lo, hi, rows, flock, birds, around, rule, wish, weights, sums):
    flock = FlockBySlot(
        pointer(flock.slot), pointer(flock.begin), pointer(flock.count), pointer(flock.seen), pointer(flock.bird)
    )  # fmt: skip
    birds = _Birds(pointer(birds.velocity), pointer(birds.forward), pointer(birds.length), pointer(birds.species))
    around = Around(
        pointer(around.hit), pointer(around.aim), pointer(around.gap), pointer(around.normal), pointer(around.height),
        pointer(around.bound), pointer(around.target), pointer(around.danger_first), pointer(around.danger_offset),
    )  # fmt: skip
    wish = WishColumns(
        pointer(wish.direction), pointer(wish.pace), pointer(wish.acceleration), pointer(wish.asked), wish.tells
    )  # fmt: skip
    row, weights, sums = pointer(rows), pointer(weights), pointer(sums)
    for first in range(lo, hi, BLOCK):
        last = min(first + BLOCK, hi)
        for k in range(first, last):
            _heed(row[k], flock, birds, rule, weights, sums, SUMS * (k - first))
        for k in range(first, last):
            _decide(k, row[k], birds, around, rule, sums, SUMS * (k - first), wish)


@lane_function
def _decide(k, i, birds, around, rule, sums, at, wish):
    """Hand out the acceleration of one bird."""
    one, given = _bird_of(i, birds, sums[at + 10], sums[at + 11]), Given(0.0, 0.0, 0.0, 0.0)
    given = add_request(given, OBSTACLE, clear_of_obstacles(i, one, around, rule), rule, wish, k)
    given = add_request(given, SEPARATION, (sums[at], sums[at + 1], sums[at + 2]), rule, wish, k)
    away, wish.pace[k] = away_from_danger(i, one, around, rule)
    given = add_request(given, FEAR, away, rule, wish, k)
    if sums[at + 9] > 0.0:
        share = one.per / sums[at + 9]
        mx, my, mz = sums[at + 3] * share - one.vx, sums[at + 4] * share - one.vy, sums[at + 5] * share - one.vz
        given = add_request(given, MATCHING, (mx * rule.soon, my * rule.soon, mz * rule.soon), rule, wish, k)
        share *= rule.per_range
        middle = sums[at + 6] * share, sums[at + 7] * share, sums[at + 8] * share
        given = add_request(given, CENTRING, middle, rule, wish, k)
    given = add_request(given, MIGRATION, to_target(i, one, around), rule, wish, k)
    given = add_request(given, HEIGHT, (0.0, 0.0, to_height(around.height[i], one, rule)), rule, wish, k)
    most = rule.most * one.own
    if rule.average:
        most = most / given.used if given.used > 0.0 else 0.0
    x, y, z = given.x * most, given.y * most, given.z * most
    wish.acceleration[3 * k], wish.acceleration[3 * k + 1], wish.acceleration[3 * k + 2] = x, y, z
    x, y, z = turned(one, x, y, z, rule.dt)
    wish.direction[3 * k], wish.direction[3 * k + 1], wish.direction[3 * k + 2] = x, y, z


@lane_function
def _bird_of(i, birds, per, speed):
    return Bird(
        birds.length[i], per, birds.forward[3 * i], birds.forward[3 * i + 1], birds.forward[3 * i + 2],
        per * birds.velocity[3 * i], per * birds.velocity[3 * i + 1], per * birds.velocity[3 * i + 2], speed,
    )  # fmt: skip


@lane_function
def add_request(given, urge, wanted, rule, wish, k):
    """What has been given with what this urge gets of its request, which is cut to 1, times its strength.

    By priority: until 1 is handed out.  In the average: all of it, and the strengths of those that ask are added up.
    """
    x, y, z = wanted
    strength, size = rule.strength[urge], x * x + y * y + z * z
    if size == 0.0:
        return given
    size = np.sqrt(size)
    share = strength / max(size, 1.0)
    x, y, z, size = share * x, share * y, share * z, share * size
    if rule.grounded:
        z, size = 0.0, np.sqrt(x * x + y * y)
    if wish.tells:
        at = 3 * (len(rule.strength) * k + urge)
        wish.asked[at], wish.asked[at + 1], wish.asked[at + 2] = x, y, z
    if rule.average:
        return Given(given.x + x, given.y + y, given.z + z, given.used + (strength if size > 0.0 else 0.0))
    left = 1.0 - given.used
    if size > left:
        share = left / size
        return Given(given.x + share * x, given.y + share * y, given.z + share * z, 1.0)
    return Given(given.x + x, given.y + y, given.z + z, given.used + size)


@lane_function
def _heed(i, flock, birds, rule, weights, sums, at):
    """Sums over the neighbours of one bird for separation, matching and centring: eight at a time, without branches.

    Who is within `separation` cannot be predicted, and a wrong guess costs more than the work.  Behind the last
    neighbour stands the bird itself, which is no distance away, and counts for nobody.
    """
    bird, seen, line = flock.bird, flock.seen, max(flock.slot[i], np.int32(0))
    a, own, kind = flock.begin[line], birds.length[i], np.float64(birds.species[i])
    b = a + flock.count[i]
    own2, cut2, apart2 = own * own, rule.cut2 * (own * own), rule.apart2
    ox, oy, oz = bird[8 * line], bird[8 * line + 1], bird[8 * line + 2]
    fx, fy, fz = birds.forward[3 * i], birds.forward[3 * i + 1], birds.forward[3 * i + 2]
    vx, vy, vz = birds.velocity[3 * i], birds.velocity[3 * i + 1], birds.velocity[3 * i + 2]
    per = 1.0 / own
    speed = per * np.sqrt(vx * vx + vy * vy + vz * vz)
    lean = rule.lean * min(speed * rule.per_top, 1.0)
    if rule.exponent != 0.0 and rule.exponent != 2.0:
        _weigh(line, a, b, own2, rule.exponent, bird, seen, weights)
    none, nearest = splat8(0.0), splat8(1.0 / (NEAREST * NEAREST))
    sx = sy = sz = mx = my = mz = cx = cy = cz = all_ = none
    for q in range(a, b, EIGHT):
        x, y, z, u, v, w, kinds, _ = load_rows(bird, seen, q)
        x, y, z = x - ox, y - oy, z - oz
        d2 = x * x + y * y + z * z
        there = (d2 <= cut2) & (d2 > 0.0)
        near = splat8(1.0) / root(where(there, d2, splat8(1.0)))
        weight = near * near * own2
        weight = where(weight < nearest, weight, nearest)
        # inverse square, nothing at `separation`
        push = weight * apart2 - 1.0
        push = where(there & (push > 0.0), push * near, none)
        sx, sy, sz = sx - push * x, sy - push * y, sz - push * z
        if rule.exponent == 0.0:
            weight = splat8(1.0)
        elif rule.exponent != 2.0:
            weight = load8(weights, q - a)
        weight = ((x * fx + y * fy + z * fz) * near * lean + (1.0 + lean)) * weight
        weight = where(there, where(kinds != kind, none, weight), none)
        all_ = all_ + weight
        mx, my, mz = fused(weight, u, mx), fused(weight, v, my), fused(weight, w, mz)
        cx, cy, cz = fused(weight, x, cx), fused(weight, y, cy), fused(weight, z, cz)
    store(sums, at, totals((sx, sy, sz, mx, my, mz, cx, cy)))
    sums[at + 8], sums[at + 9], sums[at + 10], sums[at + 11] = total(cz), total(all_), per, speed


@lane_function
def _weigh(line, a, b, own2, exponent, bird, seen, weights):
    """How much neighbours weigh by distance alone, for any exponent."""
    for k in range(b - a):
        at = 8 * seen[a + k]
        x, y, z = bird[at] - bird[8 * line], bird[at + 1] - bird[8 * line + 1], bird[at + 2] - bird[8 * line + 2]
        d2 = (x * x + y * y + z * z) / own2
        weights[k] = exp_(-0.5 * exponent * log_(max(d2, NEAREST * NEAREST)))
