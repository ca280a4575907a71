"""Zones: repulsion from the near, else alignment with the middle distance and attraction to the far.

Couzin et al. 2002 [1]_, eqs. 1 to 3.  An animal with others in its zone of
repulsion turns away from them and heeds nobody else.  Else it takes the mean of
the way those in the zone of orientation face and of the way to those in the
zone of attraction; in both it is blind to whom a cone behind it holds.  It
turns towards that at a limited rate.

Chance turns the heading after that and grows with the square root of time
(``wander``), so that it does not depend on the tick; the paper turns the wished
direction by a normal angle of .05 rad in each step of .1 s, which a limited
turn mostly cuts.  Nearest points of obstacles repel as animals do.  Who leads
adds the way of the guide to the wished direction, as the informed of Couzin et
al. 2005 [2]_ do.  Other species are kept out of the zone of repulsion and
otherwise ignored.

Lengths are in body lengths of the animal itself.

.. [1] Couzin, I. D., Krause, J., James, R., Ruxton, G. D. & Franks, N. R. (2002). Collective memory and spatial
   sorting in animal groups. Journal of Theoretical Biology 218(1), 1-11.
.. [2] Couzin, I. D., Krause, J., Franks, N. R. & Levin, S. A. (2005). Effective leadership and decision-making in
   animal groups on the move. Nature 433, 513-516.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

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
from flockbrush.behaviours.turning import InView
from flockbrush.behaviours.wander import wander, wander_parameter, wander_time_parameter
from flockbrush.engine.maths import atan2_, kernel_function, sincos_
from flockbrush.engine.parallel import over_rows
from numba import njit

NOWHERE = 1e-12  # shorter sums of directions point nowhere


class Params(Parameters):
    """Widths of the three zones, what lies behind, and how fast an animal turns."""

    repulsion: float = quantity(1.0, "body lengths", "an animal turns away from others nearer than this (r_r)", 0, 20)
    orientation: float = quantity(
        3.0, "body lengths", "width of the zone of orientation, beyond the zone of repulsion (Δr_o)", 0, 50
    )
    attraction: float = quantity(
        8.0, "body lengths", "width of the zone of attraction, beyond the zone of orientation (Δr_a)", 0, 100
    )
    blind_angle: float = quantity(
        90.0, "degrees", "angle behind in which others neither orient nor attract it (360° - α)", 0, 360
    )
    max_turn: float = quantity(0.7, "rad/s", "fastest turn, random turns included (θ)", 0.01, 200)
    wander: float = wander_parameter(0.16, " (σ)")
    wander_time: float = wander_time_parameter()
    guidance_weight: float = quantity(0.5, "1", "weight of a guide against the other animals (ω)", 0, 100)
    guided: Guided = guided_parameter("share", "all, a share, or only appointed ones; front: none in this model")
    guided_share: float = guided_share_parameter()

    sliders: ClassVar = {
        "tightness": DesignerSlider(
            "Attracted by near to attracted by distant animals", (moves("attraction", 1.0, 30.0, True),)
        ),
        "order": DesignerSlider(
            "Random headings to common heading", (moves("orientation", 0.1, 20.0, True),), unproved="alignment"
        ),
        "personal space": DesignerSlider("Close contact to wide spacing", (moves("repulsion", 0.3, 6.0, True),)),
        "nerve": DesignerSlider("Slow to quick turns", (moves("max_turn", 0.1, 10.0, True),)),
        "wander": DesignerSlider("Straight paths to random turns", (moves("wander", 0.0, 2.0),)),
        **SLIDERS,
    }


def explain(scene, row, p):
    """Why this animal turns: the directions of eqs. 1 to 3 that its wish is made of, {reason: (2,)}.

    Written plainly, for one animal, with the rate of turning and the chance as what is left: each is the other's test.
    """
    reasons = _reasons(scene, row, p)
    direction = np.zeros((1, 3))
    _zones_of(scene, np.array([row], np.int32), p, direction)
    wish = sum(reasons.values(), np.zeros(2))
    size, forward = float(np.hypot(*wish)), scene.forward[row, :2]
    if size <= NOWHERE:
        return {"heading": direction[0, :2].copy()}
    # as much of the wish as may be turned in a tick, the heading for the rest
    side = forward[0] * wish[1] - forward[1] * wish[0]
    angle = float(np.arctan2(side, forward @ wish))
    most = p.max_turn * scene.dt
    if abs(angle) <= most:
        shares = {name: vector / size for name, vector in reasons.items()}
    else:  # sin(angle - most) of the heading and sin(most) of the wish add up to it
        part = np.sin(most) / max(np.sin(abs(angle)), NOWHERE)
        heading = np.array([np.cos(np.sign(angle) * most), np.sin(np.sign(angle) * most)])
        turned = np.array([
            heading[0] * forward[0] - heading[1] * forward[1], heading[0] * forward[1] + heading[1] * forward[0]
        ])  # fmt: skip
        shares = {name: part * vector / size for name, vector in reasons.items()}
        shares = {"heading": turned - sum(shares.values())} | shares
    chance = direction[0, :2] - sum(shares.values())
    return shares | ({"wander": chance} if p.wander > 0.0 else {})


def _reasons(scene, i, p):
    """{reason: (2,)}: what the wished direction is the sum of."""
    forward, (who, offset, kin, walls) = scene.forward[i, :2], InView.of(scene, i)
    far = np.hypot(*offset.T)
    wall_far = np.hypot(*walls.T)
    too_near, wall_near = (far > 0) & (far < p.repulsion), (wall_far > 0) & (wall_far < p.repulsion)
    away = -(offset[too_near] / far[too_near, None]).sum(0)
    off_walls = -(walls[wall_near] / wall_far[wall_near, None]).sum(0)
    if too_near.any() or wall_near.any():
        return _leading(scene, i, p, {"avoidance": away, "obstacles": off_walls})
    bearing = np.abs(np.arctan2(forward[0] * offset[:, 1] - forward[1] * offset[:, 0], offset @ forward))
    counts = kin & (far > 0) & (bearing <= np.pi - 0.5 * np.radians(p.blind_angle))
    aligned = counts & (far < p.repulsion + p.orientation)
    drawn = counts & ~aligned & (far < p.repulsion + p.orientation + p.attraction)
    sums = {
        "alignment": scene.forward[who[aligned], :2].sum(0), "cohesion": (offset[drawn] / far[drawn, None]).sum(0)
    }  # fmt: skip
    sized = {name: v / np.hypot(*v) for name, v in sums.items() if np.hypot(*v) > NOWHERE}
    return _leading(scene, i, p, sized)


def _leading(scene, i, p, reasons):
    """With the guide of a leader."""
    guidance = scene.guidance[i]
    if not scene.leader[i] or float(np.hypot(*guidance)) <= 1e-6 or p.guidance_weight <= 0.0:
        return reasons
    total = sum(reasons.values(), np.zeros(2))
    size = float(np.hypot(*total))
    scaled = {name: vector / size for name, vector in reasons.items()} if size > NOWHERE else {}
    return scaled | {"guide": p.guidance_weight * guidance / np.hypot(*guidance)}


@behaviour("zones", Params, explain=explain)
def steer(scene, rows, p):
    """Turn away from the near, else with the middle and towards the far."""
    direction = np.zeros((len(rows), 3))
    _zones_of(scene, rows, p, direction)
    return Wishes(direction, np.ones(len(rows)))


class _Animals(NamedTuple):
    """The columns that the kernel reads."""

    forward: np.ndarray
    length: np.ndarray
    species: np.ndarray
    leader: np.ndarray
    guidance: np.ndarray


class _Zones(NamedTuple):
    """The parameters as the kernel wants them."""

    repulsion: float  # outer edges
    orientation: float
    attraction: float
    seen_from: float  # cosine
    turn: float  # rad, at most
    guidance_weight: float


def _zones_of(s, rows, p, direction):
    """Write the next headings, chance and all."""
    edges = np.cumsum([p.repulsion, p.orientation, p.attraction])
    seen_from = sincos_(np.pi - 0.5 * np.radians(p.blind_angle))[1]
    zones = _Zones(*map(float, edges), seen_from, p.max_turn * s.dt, p.guidance_weight)
    animals = _Animals(s.forward, s.length, s.species, s.leader, s.guidance)
    others, walls = ByRow(s.first, s.near, s.offset), ByRow(s.obstacle_first, s.near[:0], s.obstacle_offset)
    over_rows(_turn, len(rows), rows, animals, others, walls, zones, direction)
    wander(s, rows, p, direction)


@njit(cache=True, nogil=True, error_model="numpy")
def _turn(lo, hi, rows, animals, others, walls, zones, direction):
    for k in range(lo, hi):
        i = rows[k]
        fx, fy = animals.forward[i, 0], animals.forward[i, 1]
        x, y = _wished(i, animals, others, walls, zones)
        gx, gy = animals.guidance[i, 0], animals.guidance[i, 1]
        if animals.leader[i] and _size(gx, gy) > 1e-6:
            gx, gy = _unit(gx, gy)
            x, y = _unit(x, y)
            x, y = x + zones.guidance_weight * gx, y + zones.guidance_weight * gy
        direction[k, 0], direction[k, 1] = fx, fy
        if _size(x, y) > NOWHERE:
            angle = atan2_(fx * y - fy * x, fx * x + fy * y)
            sine, cosine = sincos_(min(max(angle, -zones.turn), zones.turn))
            direction[k, 0], direction[k, 1] = cosine * fx - sine * fy, sine * fx + cosine * fy


@kernel_function
def _wished(i, animals, others, walls, zones):
    """The direction that the zones of row i ask for."""
    per, fx, fy = 1.0 / animals.length[i], animals.forward[i, 0], animals.forward[i, 1]
    rx = ry = ox = oy = ax = ay = 0.0
    repelled = False
    for at in range(others.first[i], others.first[i + 1]):
        x, y = per * others.offset[at, 0], per * others.offset[at, 1]
        d = np.sqrt(x * x + y * y)
        if d == 0.0 or d >= zones.attraction:
            continue
        x, y = x / d, y / d
        if d < zones.repulsion:  # eq. 1
            rx, ry, repelled = rx - x, ry - y, True
            continue
        j = others.near[at]
        if animals.species[j] != animals.species[i] or x * fx + y * fy < zones.seen_from:
            continue
        if d < zones.orientation:  # eq. 2
            ox, oy = ox + animals.forward[j, 0], oy + animals.forward[j, 1]
        else:  # eq. 3
            ax, ay = ax + x, ay + y
    for at in range(walls.first[i], walls.first[i + 1]):
        x, y = per * walls.offset[at, 0], per * walls.offset[at, 1]
        d = np.sqrt(x * x + y * y)
        if 0.0 < d < zones.repulsion:
            rx, ry, repelled = rx - x / d, ry - y / d, True
    if repelled:
        return rx, ry
    ox, oy = _unit(ox, oy)
    ax, ay = _unit(ax, ay)
    return ox + ax, oy + ay


@kernel_function
def _size(x, y):
    return np.sqrt(x * x + y * y)


@kernel_function
def _unit(x, y):
    """(x, y) with length 1; nothing where it points nowhere."""
    size = np.sqrt(x * x + y * y)
    if size <= NOWHERE:
        return 0.0, 0.0
    return x / size, y / size
