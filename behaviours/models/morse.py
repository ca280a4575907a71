"""Self-propelled particles in a Morse potential: attraction to far and repulsion from near animals (D'Orsogna et al.).

Each animal keeps to its own speed, and others exert forces on it that decay exponentially with distance: an attraction
and a stronger, shorter repulsion [1]_, eqs. 1 to 3.  The part of the force across the heading turns the animal, slow
ones more than fast ones; the part along the heading speeds it up or slows it down.  Such herds mill.

The attraction is the mean over the animals it sees instead of their sum, so that a brush holds for any number of them
(as potentials divided by N do).  Speed is a process of its own (`flockbrush.systems.pace`), whose mean takes the place
of the paper's square root of α/β.  The force multiplies it by a factor that comes to what balances propulsion and
friction as fast as in the paper's equation near its rest, with the rate 2α, but no faster than any animal takes up an
effort.  Noise turns the heading.  Nearest points of obstacles and animals of other species repel as those of the same
species do, and do not attract.  For leaders, the guide is one more force.

Lengths are in body lengths of the animal itself.

.. [1] D'Orsogna, M. R., Chuang, Y. L., Bertozzi, A. L. & Chayes, L. S. (2006). Self-propelled particles with soft-core
   interactions: patterns, stability, and collapse. Physical Review Letters 96, 104302.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

import numpy as np
from flockbrush.behaviours.behaviour import (
    TAKES_UP,
    ByRow,
    Guided,
    Parameters,
    Wishes,
    behaviour,
    guided_parameter,
    guided_share_parameter,
    quantity,
)
from flockbrush.behaviours.sliders import SLIDERS, DesignerSlider, moves
from flockbrush.behaviours.turning import InView, decaying_sum, guide_force, turn_contributions
from flockbrush.behaviours.wander import wander, wander_parameter, wander_time_parameter
from flockbrush.engine.lane_maths import exponential, lane_function
from flockbrush.engine.lanes import EIGHT, fused, load8, pointer, root, splat8, total, where
from flockbrush.engine.maths import sincos_
from flockbrush.engine.parallel import over_rows
from numba import njit

CRAWL = 0.1  # BL/s: slower animals turn as if they had this speed
LEAST_PACE, MOST_PACE = 0.2, 2.0  # times the animal's own speed


class Params(Parameters):
    """Strengths and reaches of the two forces, and what they do to speed and heading."""

    attraction: float = quantity(
        12.0, "body lengths/s²", "mean attraction by visible animals at distance 0 (C_a/l_a)", 0, 1000
    )
    attraction_reach: float = quantity(
        10.0, "body lengths", "distance at which attraction has decayed to 37 % (l_a)", 0.05, 200
    )
    repulsion: float = quantity(2.0, "body lengths/s²", "repulsion by one animal at distance 0 (C_r/l_r)", 0, 1000)
    repulsion_reach: float = quantity(
        1.6, "body lengths", "distance at which repulsion has decayed to 37 % (l_r)", 0.05, 200
    )
    propulsion: float = quantity(
        0.5, "1/s", "how firmly an animal keeps to its own speed (α); 0: forces only turn it", 0, 100
    )
    max_turn: float = quantity(10.0, "rad/s", "fastest turn, random turns included", 0.01, 200)
    wander: float = wander_parameter(0.15)
    wander_time: float = wander_time_parameter()
    guidance_weight: float = quantity(6.0, "body lengths/s²", "force of a guide on animals that follow it", 0, 1000)
    guided: Guided = guided_parameter("share", "all, a share, or only appointed ones; front: none in this model")
    guided_share: float = guided_share_parameter()

    sliders: ClassVar = {
        "tightness": DesignerSlider("Loose to tightly packed", (moves("attraction", 1.0, 100.0, True),)),
        "personal space": DesignerSlider("Close contact to wide spacing", (moves("repulsion_reach", 0.3, 5.0, True),)),
        "nerve": DesignerSlider("Slow to quick turns", (moves("max_turn", 0.3, 12.0, True),)),
        "wander": DesignerSlider("Straight paths to random turns", (moves("wander", 0.0, 2.0),)),
        **SLIDERS,
    }


def explain(scene, row, p):
    """Why this animal turns: by how much each force does, and the heading that is left, {reason: (2,)}.

    Written plainly, for one animal; a test compares it with `steer`.
    """
    forward, (_, offset, kin, walls) = scene.forward[row, :2], InView.of(scene, row)
    forces = {
        "cohesion": p.attraction * decaying_sum(offset[kin], p.attraction_reach) / max(kin.sum(), 1),
        "avoidance": -p.repulsion * decaying_sum(offset, p.repulsion_reach),
        "obstacles": -p.repulsion * decaying_sum(walls, p.repulsion_reach),
    } | guide_force(scene, row, p.guidance_weight)
    speed = max(np.hypot(*scene.velocity[row, :2]) / scene.length[row], CRAWL)
    reasons = turn_contributions(forward, forces, scene.dt / speed, p.max_turn * scene.dt)
    direction, pace = np.zeros((1, 3)), np.ones(1)
    _steer(scene, np.array([row], np.int32), p, direction, pace)
    chance = direction[0, :2] - sum(reasons.values())
    return reasons | ({"wander": chance} if p.wander > 0.0 else {})


@behaviour("morse", Params, explain=explain)
def steer(scene, rows, p):
    """Turn, speed up or slow down as the forces say."""
    direction, pace = np.zeros((len(rows), 3)), np.ones(len(rows))
    _steer(scene, rows, p, direction, pace)
    return Wishes(direction, pace)


class _Animals(NamedTuple):
    """The columns that the kernel reads."""

    forward: Any
    length: Any
    species: Any
    velocity: Any
    effort: Any
    leader: Any
    guidance: Any


class _Forces(NamedTuple):
    """The parameters as the kernel wants them."""

    attraction: float
    per_attraction: float  # reach
    repulsion: float
    per_repulsion: float
    per_propulsion: float  # 0: speeds stay alone
    swiftness: float  # part of the way to a new factor of speed that an animal asks for
    guidance_weight: float
    turn: float  # rad, at most
    dt: float


def _steer(s, rows, p, direction, pace):
    """Write the next headings, chance and all, and factors of speed."""
    forces = _Forces(
        p.attraction, 1.0 / p.attraction_reach, p.repulsion, 1.0 / p.repulsion_reach,
        1.0 / p.propulsion if p.propulsion > 0.0 else 0.0, min(2.0 * p.propulsion * TAKES_UP, 1.0),
        p.guidance_weight, p.max_turn * s.dt, s.dt,
    )  # fmt: skip
    animals = _Animals(s.forward, s.length, s.species, s.velocity, s.effort, s.leader, s.guidance)
    others, walls = ByRow(s.first, s.near, s.offset), ByRow(s.obstacle_first, s.near[:0], s.obstacle_offset)
    over_rows(_turn, len(rows), rows, animals, others, walls, forces, direction, pace)
    wander(s, rows, p, direction)


@njit(cache=True, nogil=True, error_model="numpy")
def _turn(lo, hi, rows, animals, others, walls, forces, direction, pace):
    most = np.int64(1)
    for k in range(lo, hi):
        i = rows[k]
        most = max(most, others.first[i + 1] - others.first[i], walls.first[i + 1] - walls.first[i])
    near = np.empty((3, (most + EIGHT) // EIGHT * EIGHT))
    for k in range(lo, hi):
        i = rows[k]
        fx, fy = animals.forward[i, 0], animals.forward[i, 1]
        x, y = _force(i, animals, others, walls, forces, near)
        vx, vy = animals.velocity[i, 0], animals.velocity[i, 1]
        speed = max(np.sqrt(vx * vx + vy * vy) / animals.length[i], CRAWL)
        turn = (fx * y - fy * x) / speed * forces.dt
        sine, cosine = sincos_(min(max(turn, -forces.turn), forces.turn))
        direction[k, 0], direction[k, 1] = cosine * fx - sine * fy, sine * fx + cosine * fy
        along = (fx * x + fy * y) * forces.per_propulsion / speed
        rest = np.sqrt(min(max(1.0 + along, LEAST_PACE * LEAST_PACE), MOST_PACE * MOST_PACE))
        now = animals.effort[i] if forces.per_propulsion > 0.0 else rest
        pace[k] = now + (rest - now) * forces.swiftness


@njit(inline="always")
def _force(i, animals, others, walls, forces, near):
    """The force on row i, BL/s² (eqs. 2 and 3); ``near`` is room for its neighbours."""
    per, kin, first, last = 1.0 / animals.length[i], 0, others.first[i], others.first[i + 1]
    for at in range(first, last):
        same = animals.species[others.near[at]] == animals.species[i]
        kin += same
        near[0, at - first], near[1, at - first] = per * others.offset[at, 0], per * others.offset[at, 1]
        near[2, at - first] = 1.0 if same else 0.0
    near[:, last - first : last - first + EIGHT] = 0.0  # no neighbours behind the last
    rx, ry, ax, ay = _decayed_sums(
        pointer(near), near.shape[1], last - first, forces.per_repulsion, forces.per_attraction
    )
    first, last = walls.first[i], walls.first[i + 1]
    for at in range(first, last):
        near[0, at - first], near[1, at - first] = per * walls.offset[at, 0], per * walls.offset[at, 1]
    near[:, last - first : last - first + EIGHT] = 0.0
    wx, wy, _, _ = _decayed_sums(pointer(near), near.shape[1], last - first, forces.per_repulsion, 0.0)
    push, pull = forces.repulsion, forces.attraction / max(kin, 1)
    gx, gy = animals.guidance[i, 0], animals.guidance[i, 1]
    size = np.sqrt(gx * gx + gy * gy)
    lead = forces.guidance_weight / size if animals.leader[i] and size > 1e-6 else 0.0
    return pull * ax - push * (rx + wx) + lead * gx, pull * ay - push * (ry + wy) + lead * gy


@lane_function
def _decayed_sums(near, step, n, per_repulsion, per_attraction):
    """Sums of unit vectors to all near ones, and to those whose third column is 1, decayed with distance."""
    rx = ry = ax = ay = splat8(0.0)
    for q in range(0, n, EIGHT):
        x, y = load8(near, q), load8(near, step + q)
        far = root(fused(x, x, y * y))
        per_far = where(far > 0.0, splat8(1.0) / where(far > 0.0, far, splat8(1.0)), splat8(0.0))
        push = exponential(splat8(0.0) - far * per_repulsion) * per_far
        pull = exponential(splat8(0.0) - far * per_attraction) * per_far * load8(near, 2 * step + q)
        rx, ry, ax, ay = fused(push, x, rx), fused(push, y, ry), fused(pull, x, ax), fused(pull, y, ay)
    return total(rx), total(ry), total(ax), total(ay)
