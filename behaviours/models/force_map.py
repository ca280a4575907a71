"""Force map: how an animal turns to others by their distance, as it is measured from tracks.

Studies of tracks of animals ask how the turning of one depends on where its neighbours are, and tabulate the answer:
force maps of fish (Katz et al. 2011 [1]_, Herbert-Read et al. 2011 [2]_), or one function for attraction and one for
alignment (Calovi et al. 2018 [3]_).  Here these two are functions of distance, given at 1/2, 1, 2, 4 and 8 body lengths
and linear between; nearer than the first and farther than the last they are constant.  Both are the rate of turning
(rad/s) when the direction asked for is at right angles to the heading, and fall with the sine of the angle.  A negative
attraction repels.

Of several others that are about equally far the mean counts, as in those maps, so that a brush holds for any number of
animals: each neighbour belongs to the two distances of the table that it is between.  With ``front_attraction`` and
``front_alignment`` those ahead count more, or less, than those behind.

Nearest points of obstacles and animals of other species repel with a rate that halves every half body length.  For
leaders, the guide is one more direction to turn to.

Lengths are in body lengths of the animal itself.

.. [1] Katz, Y., Tunstrøm, K., Ioannou, C. C., Huepe, C. & Couzin, I. D. (2011). Inferring the structure and dynamics of
   interactions in schooling fish. PNAS 108, 18720-18725.
.. [2] Herbert-Read, J. E. et al. (2011). Inferring the rules of interaction of shoaling fish. PNAS 108, 18726-18731.
.. [3] Calovi, D. S. et al. (2018). Disentangling and modeling interactions in fish with burst-and-coast swimming reveal
   distinct alignment and attraction behaviors. PLoS Computational Biology 14, e1005933.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, NamedTuple

import numpy as np
from flockbrush.behaviours.behaviour import (
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
from flockbrush.engine.maths import exp_, kernel_function, sincos_
from flockbrush.engine.parallel import over_rows
from numba import njit

KNOTS = {"half": 0.5, "1": 1.0, "2": 2.0, "4": 4.0, "8": 8.0}  # BL, as parameters name them
MANY = len(KNOTS)
REACH = 0.5 / math.log(2.0)  # BL: repulsion by strangers halves every half body length


def _attraction(default, where):
    return quantity(default, "rad/s", f"turning to animals at {where}; negative: away from them", -100, 100)


def _alignment(default, where):
    return quantity(default, "rad/s", f"turning to the heading of animals at {where}", -100, 100)


class Params(Parameters):
    """Attraction and alignment by distance, and what lies ahead."""

    attraction_half: float = _attraction(-6.0, "1/2 body length and less")
    attraction_1: float = _attraction(-1.0, "1 body length")
    attraction_2: float = _attraction(0.5, "2 body lengths")
    attraction_4: float = _attraction(1.0, "4 body lengths")
    attraction_8: float = _attraction(1.0, "8 body lengths and more")
    alignment_half: float = _alignment(0.5, "1/2 body length and less")
    alignment_1: float = _alignment(1.0, "1 body length")
    alignment_2: float = _alignment(1.0, "2 body lengths")
    alignment_4: float = _alignment(0.5, "4 body lengths")
    alignment_8: float = _alignment(0.0, "8 body lengths and more")
    front_attraction: float = quantity(0.0, "1", "1: only those ahead attract and repel, -1: only those behind", -1, 1)
    front_alignment: float = quantity(0.0, "1", "1: only those ahead align, -1: only those behind", -1, 1)
    obstacle_repulsion: float = quantity(
        12.0, "rad/s", "turning away from obstacles and animals of other species at distance 0", 0, 200
    )
    max_turn: float = quantity(10.0, "rad/s", "fastest turn, random turns included", 0.01, 200)
    wander: float = wander_parameter(0.3)
    wander_time: float = wander_time_parameter()
    guidance_weight: float = quantity(3.0, "rad/s", "turning of an animal that follows a guide", 0, 200)
    guided: Guided = guided_parameter("share", "all, a share, or only appointed ones; front: none in this model")
    guided_share: float = guided_share_parameter()

    sliders: ClassVar = {
        "tightness": DesignerSlider(
            "Loose to close together", (moves("attraction_4", 0.0, 6.0), moves("attraction_8", 0.0, 6.0))
        ),
        "order": DesignerSlider(
            "Random headings to common heading",
            (moves("alignment_2", 0.0, 6.0), moves("alignment_1", 0.0, 6.0), moves("alignment_4", 0.0, 3.0)),
            unproved="alignment",
        ),
        "personal space": DesignerSlider(
            "Close contact to wide spacing", (moves("attraction_1", 2.0, -12.0), moves("attraction_2", 2.0, -4.0))
        ),
        "nerve": DesignerSlider("Slow to quick turns", (moves("max_turn", 0.3, 12.0, True),)),
        "wander": DesignerSlider("Straight paths to random turns", (moves("wander", 0.0, 2.0),)),
        **SLIDERS,
    }


def explain(scene, row, p):
    """Why this animal turns: by how much each force does, and the heading that is left, {reason: (2,)}.

    Written plainly, for one animal; a test compares it with `steer`.
    """
    forward, (who, offset, kin, walls) = scene.forward[row, :2], InView.of(scene, row)
    attraction, alignment = _tables(p)
    to_them = _shared(offset[kin], forward, offset[kin], p.front_attraction, True)
    like_them = _shared(offset[kin], forward, scene.forward[who[kin], :2], p.front_alignment)
    forces = {
        "cohesion": np.maximum(attraction, 0.0) @ to_them,
        "avoidance": np.minimum(attraction, 0.0) @ to_them - p.obstacle_repulsion * decaying_sum(offset[~kin], REACH),
        "alignment": alignment @ like_them,
        "obstacles": -p.obstacle_repulsion * decaying_sum(walls, REACH),
    } | guide_force(scene, row, p.guidance_weight)
    reasons = turn_contributions(forward, forces, scene.dt, p.max_turn * scene.dt)
    direction = np.zeros((1, 3))
    _steer(scene, np.array([row], np.int32), p, direction)
    chance = direction[0, :2] - sum(reasons.values())
    return reasons | ({"wander": chance} if p.wander > 0.0 else {})


def _tables(p):
    """Attraction and alignment by distance, (MANY,) each."""
    return tuple(np.array([getattr(p, f"{of}_{knot}") for knot in KNOTS]) for of in ("attraction", "alignment"))


def _shared(offset, forward, vectors, front, to_unit=False):
    """Mean of vectors (n, 2) by distance of the table, (MANY, 2), those ahead weighed by ``front``."""
    far = np.hypot(*offset.T)
    there = far > 0
    share = np.array([np.interp(far[there], list(KNOTS.values()), one) for one in np.eye(MANY)])
    bearing = offset[there] @ forward / far[there]
    vectors = vectors[there] / (far[there, None] if to_unit else 1.0) * (1.0 + front * bearing)[:, None]
    return share @ vectors / np.maximum(share.sum(1), 1.0)[:, None]


def summary(scene, rows):
    """What each of these rows has about it, by distance, whatever the parameters and its own heading are.

    Returns
    -------
    near : (k, MANY, 12) ndarray
        Of each distance of the table how many animals there are; the sums of the directions u to them (2), of the
        products uu (xx, xy, yy), of their headings g (2), and of the products gu (xx, xy, yx, yy).
    push : (k, 2) ndarray
        Away from obstacles and animals of other species, 1 at distance 0.
    """
    animals = _Animals(scene.forward, scene.length, scene.species)
    others = ByRow(scene.first, scene.near, scene.offset)
    walls = ByRow(scene.obstacle_first, scene.near[:0], scene.obstacle_offset)
    near, push = np.zeros((len(rows), MANY, 12)), np.zeros((len(rows), 2))
    over_rows(_sum_up, len(rows), rows, animals, others, walls, near, push)
    return near, push


@behaviour("force_map", Params, explain=explain, summary=summary)
def steer(scene, rows, p, summed=None):
    """Turn as the map says."""
    direction = np.zeros((len(rows), 3))
    _steer(scene, rows, p, direction, summed)
    return Wishes(direction, np.ones(len(rows)))


class _Animals(NamedTuple):
    """The columns by which animals are summed up."""

    forward: Any
    length: Any
    species: Any


class _Map(NamedTuple):
    """The parameters as the kernel wants them."""

    attraction: Any  # (MANY,) rad/s
    alignment: Any
    front_attraction: float
    front_alignment: float
    repulsion: float
    guidance_weight: float
    turn: float  # rad, at most
    dt: float


def _steer(s, rows, p, direction, summed=None):
    """Write the next headings, chance and all."""
    table = _Map(
        *_tables(p), p.front_attraction, p.front_alignment, p.obstacle_repulsion, p.guidance_weight, p.max_turn * s.dt,
        s.dt,
    )  # fmt: skip
    near, push = summary(s, rows) if summed is None else summed
    over_rows(_turn, len(rows), rows, s.forward, s.leader, s.guidance, near, push, table, direction)
    wander(s, rows, p, direction)


@njit(cache=True, nogil=True, error_model="numpy")
def _sum_up(lo, hi, rows, animals, others, walls, near, push):
    for k in range(lo, hi):
        i = rows[k]
        per, rx, ry = 1.0 / animals.length[i], 0.0, 0.0
        for at in range(others.first[i], others.first[i + 1]):
            j, x, y = others.near[at], per * others.offset[at, 0], per * others.offset[at, 1]
            d = np.sqrt(x * x + y * y)
            if d == 0.0:
                continue
            x, y = x / d, y / d
            if animals.species[j] == animals.species[i]:
                _add(near[k], d, x, y, animals.forward[j, 0], animals.forward[j, 1])
            else:
                away = exp_(-d / REACH)
                rx, ry = rx - away * x, ry - away * y
        for at in range(walls.first[i], walls.first[i + 1]):
            x, y = per * walls.offset[at, 0], per * walls.offset[at, 1]
            d = np.sqrt(x * x + y * y)
            if d > 0.0:
                away = exp_(-d / REACH) / d
                rx, ry = rx - away * x, ry - away * y
        push[k, 0], push[k, 1] = rx, ry


@kernel_function
def _add(near, d, x, y, gx, gy):
    """Add an animal d away in the direction (x, y), headed to (gx, gy), to the two distances that it is between."""
    knot, share = 0, 0.0
    if d >= 8.0:
        knot, share = MANY - 2, 1.0
    elif d >= 4.0:
        knot, share = 3, 0.25 * d - 1.0
    elif d >= 2.0:
        knot, share = 2, 0.5 * d - 1.0
    elif d >= 1.0:
        knot, share = 1, d - 1.0
    elif d > 0.5:
        share = 2.0 * d - 1.0
    for q in range(2):
        part, own = share if q else 1.0 - share, near[knot + q]
        px, py, hx, hy = part * x, part * y, part * gx, part * gy
        own[0] += part
        own[1] += px
        own[2] += py
        own[3] += px * x
        own[4] += px * y
        own[5] += py * y
        own[6] += hx
        own[7] += hy
        own[8] += hx * x
        own[9] += hx * y
        own[10] += hy * x
        own[11] += hy * y


@njit(cache=True, nogil=True, error_model="numpy")
def _turn(lo, hi, rows, forward, leader, guidance, near, push, table, direction):
    front_to, front_with = table.front_attraction, table.front_alignment
    for k in range(lo, hi):
        i = rows[k]
        fx, fy = forward[i, 0], forward[i, 1]
        x, y = table.repulsion * push[k, 0], table.repulsion * push[k, 1]
        for q in range(MANY):
            own = near[k, q]
            per_animal = 1.0 / max(own[0], 1.0)
            to, with_ = per_animal * table.attraction[q], per_animal * table.alignment[q]
            x += to * (own[1] + front_to * (own[3] * fx + own[4] * fy))
            y += to * (own[2] + front_to * (own[4] * fx + own[5] * fy))
            x += with_ * (own[6] + front_with * (own[8] * fx + own[9] * fy))
            y += with_ * (own[7] + front_with * (own[10] * fx + own[11] * fy))
        gx, gy = guidance[i, 0], guidance[i, 1]
        size = np.sqrt(gx * gx + gy * gy)
        if leader[i] and size > 1e-6:
            x, y = x + table.guidance_weight * gx / size, y + table.guidance_weight * gy / size
        turn = (fx * y - fy * x) * table.dt
        sine, cosine = sincos_(min(max(turn, -table.turn), table.turn))
        direction[k, 0], direction[k, 1] = cosine * fx - sine * fy, sine * fx + cosine * fy
