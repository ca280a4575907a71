"""V rules: birds that join the nearest, seek a clear view and stop where the upwash is best.

Nathan & Barbosa 2008 [1]_.  Three rules, and V-like formations come of themselves: J, W, echelons and V.  A bird flies
with the flock's velocity and shifts its place in the flock by small steps, to the side or forward, without turning;
which step, `flockbrush.behaviours.v_rules.rules` says, and the experiments with thousands of flocks call the same
function.

Beyond the paper: the flock's way follows guides, goals and the migratory urge, and birds follow those ahead into a
turn and to their height; with ``turn`` a bird must turn to get sideways; with ``layer`` height counts; with
``perturbation`` nothing ever settles.

.. [1] Nathan, A. & Barbosa, V. C. (2008). V-like formations in flocks of artificial birds. Artificial Life 14(2),
   179-188.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from flockbrush.behaviours.behaviour import Flight, Wishes, air_of, behaviour, quantity
from flockbrush.behaviours.sliders import DesignerSlider, moves, pace
from flockbrush.behaviours.v_rules.flights import STREAM, InFrame, shift
from flockbrush.behaviours.v_rules.rules import VRuleSettings, kernel, law_of, sort_by
from flockbrush.engine.arrays import write_
from flockbrush.engine.maths import atan2_, inner_kernel, sincos_

LEVELS, STEEPEST = 2.0, 0.12  # s in which a bird comes to another height, and at most what share of its speed


class Params(VRuleSettings):
    """The rules in wingspans, and how they become metres and seconds."""

    wingspan: float = quantity(1.8, "body lengths", "distance between the wingtips (w)", 0.1, 10)
    time_step: float = quantity(1 / 32, "s", "duration of one time step of the paper", 1 / 1024, 60)
    foresight: float = quantity(2.0, "s", "how far ahead a bird looks for obstacles, as time of flight", 0, 60)
    follow: float = quantity(
        0.5, "rad/s", "fastest turn of the flock to a guide, or of a bird to the heading of the birds ahead", 0, 10
    )

    sliders: ClassVar = {
        "tightness": DesignerSlider("Wings apart to wings overlapping", (moves("lateral_room", 1.0, -0.3),)),
        "regularity": DesignerSlider("Several lines to one V", (moves("angle", 40.0, 180.0),)),
        "personal space": DesignerSlider(
            "Close behind one another to wide spacing", (moves("margin", 0.05, 2.0, True),)
        ),
        "nerve": DesignerSlider(
            "Slow to quick changes of place",
            (moves("lateral_step", 0.01, 0.4, True), moves("forward_step", 0.01, 0.4, True)),
        ),
        "wander": DesignerSlider("Still to turbulent air", (moves("perturbation", 0.0, 0.5),)),
        "pace": pace(1.0, 60.0),
    }


def explain(scene, row, p):
    """Why a bird flies as it does: its velocity, the flock's way and its step by the rules, {reason: (3,)} in m/s."""
    rows = np.flatnonzero(scene.species == scene.species[row]).astype(np.int32)
    wishes, at = steer(scene, rows, p), int(np.searchsorted(rows, row))
    wish, now = wishes.velocity[at], scene.velocity[row].copy()
    flock = scene.speed[row] * wishes.direction[at] if p.turn == 0.0 else wish
    reasons = {"flock": flock - now, "rules": wish - flock}
    return {"heading": now} | {name: vector for name, vector in reasons.items() if np.abs(vector).max() > 1e-12}


def flight_of(p):
    """Its velocity is its own."""
    return Flight(exact=True, foresight=p.foresight)


@behaviour("v_rules", Params, flight=flight_of, explain=explain, needs=("avoid_obstacles",))
def steer(scene, rows, p):
    """Fly on with the flock, one step nearer to one's place in it.

    Everybody of the kinds asked for is expected to keep to the rules, whoever moves it: birds act in the order of their
    ids, and each sees what those before it have done in this tick.
    """
    air = air_of(scene)
    members = np.flatnonzero(np.isin(scene.species, scene.species[rows]))
    way, velocity = np.zeros((len(scene.ids), 3)), np.zeros((len(scene.ids), 3))
    if len(members):
        steps = scene.dt / p.time_step
        law = law_of(p, p.wingspan * float(scene.length[members].mean()), steps)
        law = law._replace(cruise=float(scene.speed[members].mean()) * scene.dt)
        birds = scene.animals
        _ways(members, air, birds, law.cotangent, p.follow * scene.dt, law.turn > 0.0, way)
        _shifts(law, members, air, birds, scene.key(STREAM), way, scene.dt, velocity)
        if p.layer == 0.0:
            _rises(members, air, birds, way, law.cotangent, velocity)
    direction = way[rows] if p.turn == 0.0 else _facing(velocity[rows], scene.forward[rows])
    return Wishes(direction, np.ones(len(rows)), velocity=velocity[rows])


def _facing(velocity, forward):
    """Birds that turn face the way they go; those who stand still, the way they faced."""
    level = velocity * (1.0, 1.0, 0.0)
    size = np.linalg.norm(level, axis=1, keepdims=True)
    return np.where(size > 1e-9, level / np.maximum(size, 1e-9), forward)


@kernel
def _ways(members, air, birds, cotangent, limit, turning, way):
    """The flock's way as each bird sees it, a level unit vector: a lead's from its guide, others' from those ahead."""
    forward, guidance, bound, target = birds.forward, birds.guidance, air.bound, air.target
    sine_limit, cosine_limit = sincos_(limit)
    for i in members:
        fx, fy = _level(forward[i, 0], forward[i, 1], 1.0, 0.0)
        gx, gy = 0.0, 0.0
        if turning:
            ax, ay = _of_the_foremost(i, air, birds, fx, fy)
        else:
            ax, ay = _of_those_ahead(i, air, birds, fx, fy, cotangent)
        if ax != 0.0 or ay != 0.0:
            gx, gy = _level(ax, ay, fx, fy)
            if turning:  # its own body does not face the flock's way
                way[i, 0], way[i, 1] = gx, gy
                continue
        elif bound[i] > 0:
            gx, gy = _level(target[i, 0], target[i, 1], fx, fy)
        elif abs(guidance[i, 0]) > 1e-6 or abs(guidance[i, 1]) > 1e-6:
            gx, gy = _level(guidance[i, 0], guidance[i, 1], fx, fy)
        else:
            gx, gy = fx, fy
        if fx * gx + fy * gy < cosine_limit:
            sine = sine_limit if fx * gy - fy * gx >= 0.0 else -sine_limit
            gx, gy = _level(fx * cosine_limit - fy * sine, fx * sine + fy * cosine_limit, fx, fy)
        way[i, 0], way[i, 1] = gx, gy


@kernel
def _rises(members, air, birds, way, cotangent, velocity):
    """In a plane all come to one height: a lead to its target's, others to the mean of those ahead."""
    first, near, offset, bound, target = air.first, air.near, air.offset, air.bound, air.target
    species, speed = birds.species, birds.speed
    for i in members:
        rise, count = 0.0, 0
        for at in range(first[i], first[i + 1]):
            x, y = offset[at, 0], offset[at, 1]
            along, aside = x * way[i, 0] + y * way[i, 1], abs(x * way[i, 1] - y * way[i, 0])
            if species[near[at]] == species[i] and along > 0.0 and along >= aside * cotangent:
                rise, count = rise + offset[at, 2], count + 1
        if count > 0:
            rise /= count
        elif bound[i] == 2:
            rise = target[i, 2]
        most = STEEPEST * speed[i]
        velocity[i, 2] += min(max(rise / LEVELS, -most), most)


@inner_kernel
def _of_those_ahead(i, air, birds, fx, fy, cotangent):
    """Sum of the headings of birds of the same species within the angle; (0, 0) for a leader."""
    first, near, offset, species, forward = air.first, air.near, air.offset, birds.species, birds.forward
    ax = ay = 0.0
    for at in range(first[i], first[i + 1]):
        j = near[at]
        x, y = offset[at, 0], offset[at, 1]
        along, aside = x * fx + y * fy, abs(x * fy - y * fx)
        if species[j] == species[i] and along > 0.0 and along >= aside * cotangent:
            hx, hy = _level(forward[j, 0], forward[j, 1], fx, fy)
            ax, ay = ax + hx, ay + hy
    return ax, ay


@inner_kernel
def _of_the_foremost(i, air, birds, fx, fy):
    """The heading of the foremost of one's kind, who has no reason to turn; (0, 0): one is it oneself."""
    first, near, offset, species, forward = air.first, air.near, air.offset, birds.species, birds.forward
    mx, my = fx, fy
    for at in range(first[i], first[i + 1]):
        j = near[at]
        if species[j] == species[i]:
            hx, hy = _level(forward[j, 0], forward[j, 1], fx, fy)
            mx, my = mx + hx, my + hy
    mx, my = _level(mx, my, fx, fy)
    farthest, ax, ay = 0.0, 0.0, 0.0
    for at in range(first[i], first[i + 1]):
        j = near[at]
        along = offset[at, 0] * mx + offset[at, 1] * my
        if species[j] == species[i] and along > farthest:
            farthest = along
            ax, ay = _level(forward[j, 0], forward[j, 1], fx, fy)
    return ax, ay


@inner_kernel
def _level(x, y, instead_x, instead_y):
    size = np.sqrt(x * x + y * y)
    if size > 1e-12:
        return x / size, y / size
    return instead_x, instead_y


@kernel
def _shifts(law, members, air, birds, key, way, dt, velocity):
    """The velocity of each member: the flock's, and the step the rules ask for."""
    first, near, offset = air.first, air.near, air.offset
    ids, species, forward, speed = birds.ids, birds.species, birds.forward, birds.speed
    moved = np.zeros((len(ids), 3))
    most = 1
    for i in members:
        most = max(most, first[i + 1] - first[i] + 1)
    x, y, z = np.empty(most), np.empty(most), np.empty(most)  # where others are now, from the bird's own eye
    sx, sy, sz = np.empty(most), np.empty(most), np.empty(most)  # and as it sees them
    flock, seen, by_x = InFrame(x, y, z), InFrame(sx, sy, sz), np.empty(most, np.int64)
    me = np.int64(0)  # a plain 0 or 1 is a type of its own, for which numba would compile the rules once more
    for i in members:
        fx, fy = way[i, 0], way[i, 1]
        x[0] = y[0] = z[0] = sx[0] = sy[0] = sz[0] = 0.0
        kin = last = np.int64(1)
        for kind in range(2):  # one's own kind first: one keeps the rules with these, and clear of all
            for at in range(first[i], first[i + 1]):
                j = near[at]
                if (species[j] == species[i]) == (kind == 0):
                    east, north = offset[at, 0], offset[at, 1]
                    sx[last], sy[last] = east * fy - north * fx, east * fx + north * fy
                    east, north = east + moved[j, 0], north + moved[j, 1]
                    x[last], y[last] = east * fy - north * fx, east * fx + north * fy
                    sz[last] = offset[at, 2] if law.layer > 0.0 else 0.0
                    z[last] = sz[last] + (moved[j, 2] if law.layer > 0.0 else 0.0)
                    last += 1
            if kind == 0:
                kin = last
        if law.in_turn:
            write_(sx[:kin], x)
            write_(sy[:kin], y)
            write_(sz[:kin], z)
        for k in range(kin):
            by_x[k] = k
        sort_by(sx, by_x, kin)
        hx, hy = _level(forward[i, 0], forward[i, 1], fx, fy)
        angle = atan2_(hx * fy - hy * fx, hx * fx + hy * fy)
        busy, angle, mx, my, mz = shift(law, me, kin, last, seen, flock, by_x, key, ids[i], angle)
        moved[i, 0], moved[i, 1], moved[i, 2] = mx * fy + my * fx, -mx * fx + my * fy, mz
        velocity[i, 0] = speed[i] * fx + moved[i, 0] / dt
        velocity[i, 1] = speed[i] * fy + moved[i, 1] / dt
        velocity[i, 2] = mz / dt
