"""The herd model: social forces turn, a stochastic process sets the speed.

Gong et al. 2025 [1]_, section 5.  Every animal feels cohesion, avoidance,
alignment and obstacle avoidance, each with its own Gaussian reach in distance
and in bearing (eqs. 4 and 5); their weighted sum turns its heading (eqs. 2 and
3).  Speed is not touched: direction and speed are separate.  An animal that
sees at most two others is a leader and follows the navigation field.

Headings may also drift at random (``wander``, `flockbrush.behaviours.wander`);
the paper has no such term, and none is the default.  Without it herds that
press together at the start can lock for ever, and mills of few animals give way
to marches.

Animals may also prefer a side (``turn_bias``): a constant part of the force of
eq. 3, at right angles to the heading.  The paper has none; driven reindeer turn
to the left [2]_.  With it a small mill does not become a march.

Lengths are in body lengths of the animal itself, so one brush moves mice and
cattle.  Eq. 2 is read with the unit heading, ``N(v + Δt F)`` with ``|v| = 1``:
with the velocity's magnitude a fast herd would turn less for the same force
and falls apart.  Animals of another species are given way to and otherwise
ignored.

.. [1] Gong, X., Gain, J., Rohmer, D., Lyonnet, S., Pettré, J. & Cani, M.-P. (2025). Herds from video: learning a
   microscopic herd model from macroscopic motion data. Computer Graphics Forum 44(6), e70225.
.. [2] Espmark, Y. & Kinderås, K. (2002). Behavioural lateralisation in reindeer. Rangifer 22(1), 51-58.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, Literal, NamedTuple

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
from flockbrush.engine.lane_maths import exponential, lane_function, square_of_angle
from flockbrush.engine.lanes import EIGHT, fused, load8, pointer, splat8, store, total
from flockbrush.engine.parallel import over_rows
from numba import njit
from pydantic import Field


class Params(Parameters):
    """Weights and ranges of the four forces, and who leads.

    A radial range of 1 is four body lengths, an angular range of 1 is 180°; both are the sigmas of Gaussians.
    """

    avoidance_weight: float = quantity(0.25, "1", "larger: animals keep farther apart (W_FV)", 0, 1)
    avoidance_radial: float = quantity(0.7, "4 body lengths", "reach of avoidance in distance (R_FV)", 1e-3, 1)
    avoidance_angular: float = quantity(
        1.0, "180°", "reach of avoidance in bearing, from straight ahead (Φ_FV)", 1e-3, 1
    )
    cohesion_weight: float = quantity(0.15, "1", "larger: the herd is closer together (W_FC)", 0, 1)
    cohesion_radial: float = quantity(1.0, "4 body lengths", "reach of cohesion in distance (R_FC)", 1e-3, 1)
    cohesion_angular: float = quantity(0.5, "180°", "reach of cohesion in bearing, from straight ahead (Φ_FC)", 1e-3, 1)
    alignment_weight: float = quantity(0.15, "1", "larger: animals turn faster to the neighbours' heading (W_FA)", 0, 1)
    alignment_radial: float = quantity(1.0, "4 body lengths", "reach of alignment in distance (R_FA)", 1e-3, 1)
    alignment_angular: float = quantity(
        0.5, "180°", "reach of alignment in bearing, from straight ahead (Φ_FA)", 1e-3, 1
    )
    obstacle_weight: float = quantity(0.15, "1", "larger: animals turn away from obstacles faster (W_FO)", 0, 1)
    obstacle_radial: float = quantity(1.0, "4 body lengths", "reach of obstacle avoidance in distance (R_FO)", 1e-3, 1)
    obstacle_angular: float = quantity(
        0.5, "180°", "reach of obstacle avoidance in bearing, from straight ahead (Φ_FO)", 1e-3, 1
    )
    sensitivity: float = quantity(
        10.0, "1/s", "response to the sum of all forces; larger: animals turn faster (Ω)", 0, 1000
    )
    neighbour_range: float = quantity(4.0, "body lengths", "neighbours farther away are ignored", 0.5, 20)
    leader_neighbours: int = Field(
        default=2,
        ge=-1,
        le=100,
        description="an animal that sees at most this many others is a leader; -1: there are no leaders",
        json_schema_extra={"unit": "animals"},
    )
    leader_cone: float = quantity(
        360.0,
        "degrees",
        "angle, centred ahead, in which the others are counted; with a smaller angle the front row leads",
        1,
        360,
    )
    leader_blend: float = quantity(
        0.0, "1", "how strongly a leader also responds to its neighbours; 0: not at all", 0, 1
    )
    guided: Guided = guided_parameter(
        "front", "the leaders as defined above (front), all, a share, or only appointed ones"
    )
    guided_share: float = guided_share_parameter()
    unled: Literal["return", "keep"] = Field(
        default="return",
        description="what a leader does where no guide reaches: return to the others, or keep its heading (the paper)",
        json_schema_extra={"unit": "-"},
    )
    max_turn: float = quantity(
        10.0,
        "rad/s",
        "fastest turn; prevents jerks when the brush changes (the paper has no limit)",
        0.1,
        200,
    )
    slope_aversion: float = quantity(2.0, "1/s", "larger: animals turn downhill faster on steep ground", 0, 100)
    turn_bias: float = quantity(
        0.0, "rad/s", "steady turning to the left; negative: to the right (0 in the paper); steadies mills", -10, 10
    )
    wander: float = wander_parameter(0.0, " (0 in the paper); loosens jams")
    wander_time: float = wander_time_parameter()

    sliders: ClassVar = {
        "tightness": DesignerSlider(
            "Spread out to close together",
            (moves("cohesion_weight", 0.0, 1.0), moves("cohesion_radial", 0.5, 1.0)),
        ),
        "order": DesignerSlider(
            "Random headings to common heading",
            (moves("alignment_weight", 0.0, 1.0), moves("alignment_radial", 0.5, 1.0)),
            unproved="alignment",
        ),
        "personal space": DesignerSlider(
            "Close contact to wide spacing",
            (moves("avoidance_radial", 0.1, 1.0, True), moves("avoidance_weight", 0.02, 1.0, True)),
        ),
        "nerve": DesignerSlider(
            "Slow to quick reactions",
            (moves("sensitivity", 1.0, 100.0, True), moves("max_turn", 1.0, 30.0, True)),
        ),
        "wander": DesignerSlider("Straight paths to random turns", (moves("wander", 0.0, 3.0),)),
        **SLIDERS,
    }


def explain(scene, row, p):
    """Why this animal turns: its heading and what each force adds to it (eqs. 2-5), {reason: (2,)}.

    The same formulas as `herd_kernel`, for one animal and written plainly: each is the other's test.
    """
    i, forward, (who, offset, kin, walls) = row, scene.forward[row, :2], InView.of(scene, row)
    near = np.hypot(*offset.T) <= p.neighbour_range
    who, offset, kin = who[near], offset[near], kin[near]

    def pull(name, offset, towards):
        """Sum of vectors, each by the weight of the animal or wall at its offset."""
        return _weights(p, name, offset, forward) @ towards

    turn = scene.dt * p.sensitivity
    forces = {
        "avoidance": -turn * p.avoidance_weight * pull("avoidance", offset, offset),
        "cohesion": turn * p.cohesion_weight * pull("cohesion", offset[kin], offset[kin]),
        "alignment": turn * p.alignment_weight * pull("alignment", offset[kin], scene.forward[who[kin], :2]),
        "obstacles": -turn * p.obstacle_weight * pull("obstacle", walls, walls),
        "slope": -scene.dt * p.slope_aversion * scene.slope[i],
    }
    if p.turn_bias:
        forces["turn bias"] = scene.dt * p.turn_bias * np.array([-forward[1], forward[0]])
    reasons = {"heading": forward.copy()} | forces
    if scene.leader[i]:
        reasons = _leading(scene, i, p, reasons)
    return _wandering(scene, i, p, reasons) if p.wander > 0.0 else reasons


def _weights(p, name, offset, forward):
    """Gaussian weights in distance and bearing (eqs. 4 and 5), (k,)."""
    x, y = offset.T
    bearing = np.arctan2(forward[0] * y - forward[1] * x, forward[0] * x + forward[1] * y)
    far, aside = 4.0 * getattr(p, f"{name}_radial"), np.pi * getattr(p, f"{name}_angular")
    return np.exp(-((x * x + y * y) / (2.0 * far**2) + bearing**2 / (2.0 * aside**2)))


def _leading(scene, i, p, reasons):
    """The reasons of a leader: the guide, or the way it had, or where it last saw the others."""
    guidance = scene.guidance[i]
    g = float(np.hypot(*guidance))
    if g > 1e-6:
        lead = (1.0 - p.leader_blend) * min(1.0, 4.0 * g)
        return scaled(unit(reasons), 1.0 - lead) | {"guide": lead * guidance / g}
    if p.unled != "return":
        return {"heading": reasons["heading"]}
    memory = scene.memory[i] / scene.length[i]
    m = float(np.hypot(*memory))
    if scene.known[i] and m > 1.0:
        return reasons | {"back to the herd": scene.dt * p.sensitivity * 0.3 * memory / m}
    return reasons


def _wandering(scene, i, p, reasons):
    """The reasons with what chance adds."""
    before = scaled(unit(reasons), 1.0)
    direction = np.zeros((1, 3))
    direction[0, :2] = start = sum(before.values())
    wander(scene, np.array([i], np.int32), p, direction)
    return before | {"wander": direction[0, :2] - start}


def unit(reasons):
    """Reasons whose sum is a unit vector; left alone where they cancel."""
    size = float(np.hypot(*sum(reasons.values())))
    return scaled(reasons, 1.0 / size) if size > 1e-12 else reasons


def scaled(reasons, by):
    """Reasons so many times as strong."""
    return {name: by * vector for name, vector in reasons.items()}


class HerdState(NamedTuple):
    """Who turns and who is looked at, by row."""

    forward: Any  # (n, 3) unit headings
    length: Any  # (n,) m
    species: Any  # (n,) int32, the same for animals that keep together
    leader: Any  # (n,)
    memory: Any  # (n, 2) m, from the animal to where it last saw others
    known: Any  # (n,) 1 where there is such a memory


class Land(NamedTuple):
    """What the land says to each animal, by row."""

    first: Any  # (n + 1,) obstacles of row i are walls[first[i]:first[i + 1]]
    walls: Any  # (k, 2) m, from the animal to the nearest point of an obstacle
    guidance: Any  # (n, 2)
    slope: Any  # (n, 2)


class Forces(NamedTuple):
    """The parameters of a herd in body lengths and radians."""

    weight: Any  # (4,) of avoidance, cohesion, alignment and obstacles
    radial: Any  # (4,) 1 / (2 sigma^2) in distance
    angular: Any  # (4,) likewise in bearing
    turn: float  # sensitivity, 1/s; in kernels that of a tick
    downhill: float  # slope aversion, likewise
    aside: float  # turn bias, likewise
    neighbour_range: float
    leader_blend: float
    unled_returns: bool


@behaviour("herd", Params, explain=explain, by_slot=True)
def steer(scene, rows, p):
    """Turn by social forces; leaders by the navigation field."""
    direction, pace, s = np.zeros((len(rows), 3)), np.ones(len(rows)), scene
    herd = HerdState(s.forward, s.length, s.species, s.leader, s.memory, s.known)
    land = Land(s.obstacle_first, s.obstacle_offset, s.guidance, s.slope)
    kernel, seen = herd_kernel_by_slot, s.by_slot
    if seen is None:
        kernel, seen = herd_kernel, ByRow(s.first, s.near, s.offset)
    over_rows(kernel, len(rows), rows, s.dt, herd, seen, land, forces_of(p), direction)
    wander(s, rows, p, direction)
    return Wishes(direction, pace)


def forces_of(p):
    """The parameters as the kernels want them."""
    names = "avoidance", "cohesion", "alignment", "obstacle"
    weight = np.array([getattr(p, f"{name}_weight") for name in names])
    radial = np.array([4.0 * getattr(p, f"{name}_radial") for name in names])
    angular = np.array([np.pi * getattr(p, f"{name}_angular") for name in names])
    return Forces(
        weight, 0.5 / radial**2, 0.5 / angular**2, p.sensitivity, p.slope_aversion, p.turn_bias,
        p.neighbour_range, p.leader_blend, p.unled == "return",
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def herd_kernel(lo, hi, rows, dt, herd, seen, land, forces, direction):
    """The next heading of each row asked (eqs. 2-5); neighbours by row."""
    most = np.int64(1)  # a plain 1 is a type of its own, for which numba would compile `_room` once more
    for k in range(lo, hi):
        most = max(most, seen.first[rows[k] + 1] - seen.first[rows[k]])
    heeded = np.empty((5, _room(lo, hi, rows, most, land.first)))
    _by_row(lo, hi, rows, dt, herd, seen, land, forces, direction, heeded)


@njit(cache=True, nogil=True, error_model="numpy")
def herd_kernel_by_slot(lo, hi, rows, dt, herd, seen, land, forces, direction):
    """The same, with the same bits; neighbours by slot (`flockbrush.behaviours.behaviour.BySlot`)."""
    most = np.int64(1)  # a plain 1 is a type of its own, for which numba would compile `_room` once more
    for k in range(lo, hi):
        most = max(most, seen.count[rows[k]])
    heeded = np.empty((5, _room(lo, hi, rows, most, land.first)))
    _by_slot(lo, hi, rows, dt, herd, seen, land, forces, direction, heeded)


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _room(lo, hi, rows, most, obstacle_first):
    """How many numbers a column needs that holds one animal's neighbours, or its obstacles, and no more behind them.

    Not a multiple of a power of two, at which columns would push one another out of the cache.
    """
    for k in range(lo, hi):
        most = max(most, obstacle_first[rows[k] + 1] - obstacle_first[rows[k]])
    return (most + 3 * EIGHT) // EIGHT * EIGHT | EIGHT


@lane_function
def _pointers(dt, herd, land, forces):
    """The same tuples by pointers: arrays would be counted at every call, which costs more than the work."""
    herd = HerdState(
        pointer(herd.forward), pointer(herd.length), pointer(herd.species), pointer(herd.leader), pointer(herd.memory),
        pointer(herd.known),
    )  # fmt: skip
    land = Land(pointer(land.first), pointer(land.walls), pointer(land.guidance), pointer(land.slope))
    f = forces
    return herd, land, Forces(
        pointer(f.weight), pointer(f.radial), pointer(f.angular), dt * f.turn, dt * f.downhill,
        dt * f.aside, f.neighbour_range, f.leader_blend, f.unled_returns,
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _by_row(lo, hi, rows, dt, herd, seen, land, forces, direction, heeded):
    column, step, cut = pointer(heeded), heeded.shape[1], forces.neighbour_range * forces.neighbour_range
    own, near, rule = _pointers(dt, herd, land, forces)
    for k in range(lo, hi):
        i = rows[k]
        per_length, n = 1.0 / herd.length[i], np.int64(0)
        for at in range(seen.first[i], seen.first[i + 1]):
            j, dx, dy = seen.near[at], seen.offset[at, 0] * per_length, seen.offset[at, 1] * per_length
            kin = 1.0 if herd.species[j] == herd.species[i] else 0.0
            n += _heed(n, dx, dy, herd.forward[j, 0], herd.forward[j, 1], kin, cut, column, step)
        direction[k, 0], direction[k, 1] = _heading(
            i, n, land.first[i], land.first[i + 1], own, near, rule, column, step
        )


@njit(cache=True, nogil=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
def _by_slot(lo, hi, rows, dt, herd, seen, land, forces, direction, heeded):
    column, step, cut = pointer(heeded), heeded.shape[1], forces.neighbour_range * forces.neighbour_range
    own, near, rule = _pointers(dt, herd, land, forces)
    px, py, pu, pv = pointer(seen.x), pointer(seen.y), pointer(seen.fx), pointer(seen.fy)
    pk, who = pointer(seen.species), pointer(seen.seen)
    for k in range(lo, hi):
        i = rows[k]
        n, s, per_length, kind = np.int64(0), seen.slot[i], 1.0 / herd.length[i], herd.species[i]
        if seen.count[i] > 0:
            x, y = px[s], py[s]
            for at in range(seen.begin[s], seen.begin[s] + seen.count[i]):
                j = who[at]
                dx, dy, kin = (px[j] - x) * per_length, (py[j] - y) * per_length, 1.0 if pk[j] == kind else 0.0
                n += _heed(n, dx, dy, pu[j], pv[j], kin, cut, column, step)
        direction[k, 0], direction[k, 1] = _heading(
            i, n, land.first[i], land.first[i + 1], own, near, rule, column, step
        )


@lane_function
def _heed(n, x, y, u, v, kin, cut, column, step):
    """Write down a neighbour, in body lengths, behind n others; 1 where he is near enough to stay, else 0."""
    column[n], column[step + n], column[2 * step + n], column[3 * step + n] = x, y, u, v
    column[4 * step + n] = kin
    return 1 if x * x + y * y <= cut else 0


@lane_function
def _heading(i, n, wall, last_wall, herd, land, forces, column, step):
    """The next heading of an animal who heeds n others and these obstacles (eqs. 2 and 3)."""
    forward, length, _, leader, memory, known = herd
    _, walls, guidance, slope = land
    weight, radial, angular, turn, downhill, aside, _, leader_blend, unled_returns = forces
    fx, fy, per_length = forward[3 * i], forward[3 * i + 1], 1.0 / length[i]
    sx, sy = _social_forces(n, fx, fy, weight, radial, angular, column, step)
    if last_wall > wall:
        ox, oy = _drawn_to_walls(wall, last_wall, per_length, fx, fy, radial[3], angular[3], walls, column, step)
        sx, sy = sx - weight[3] * ox, sy - weight[3] * oy
    hx = fx + turn * sx - downhill * slope[2 * i] - aside * fy
    hy = fy + turn * sy - downhill * slope[2 * i + 1] + aside * fx
    if leader[i]:
        gx, gy = guidance[2 * i], guidance[2 * i + 1]
        g = math.sqrt(gx * gx + gy * gy)
        if g > 1e-6:
            size = math.sqrt(hx * hx + hy * hy)
            if size > 0.0:
                hx, hy = hx / size, hy / size
            # where the field fades, the herd's own forces take over
            lead = (1.0 - leader_blend) * min(1.0, 4.0 * g)
            hx = lead * gx / g + (1.0 - lead) * hx
            hy = lead * gy / g + (1.0 - lead) * hy
        elif not unled_returns:
            hx, hy = fx, fy
        elif known[i]:
            # a stray turns back to where it last saw the others
            mx, my = memory[2 * i] * per_length, memory[2 * i + 1] * per_length
            m = math.sqrt(mx * mx + my * my)
            if m > 1.0:
                hx += turn * 0.3 * mx / m
                hy += turn * 0.3 * my / m
    size = math.sqrt(hx * hx + hy * hy)
    if size > 1e-12:
        return hx / size, hy / size
    return fx, fy


@lane_function
def _social_forces(n, fx, fy, weight, radial, angular, column, step):
    """The weighted sum of avoidance, cohesion and alignment (eq. 3), eight neighbours at a time.

    One gives way to other kinds, and does not join them; d u of eqs. 4 and 5 is the offset itself.
    """
    for c in range(5):  # no neighbours behind the last
        store(column, c * step + n, splat8(0.0))
    vx = vy = cx = cy = ax = ay = splat8(0.0)
    for q in range(0, n, EIGHT):
        x, y, kin = load8(column, q), load8(column, step + q), load8(column, 4 * step + q)
        d2, bearing2 = _from_here(x, y, fx, fy)
        w = _gaussian(d2, bearing2, radial[0], angular[0])
        vx, vy = fused(w, x, vx), fused(w, y, vy)
        w = kin * _gaussian(d2, bearing2, radial[1], angular[1])
        cx, cy = fused(w, x, cx), fused(w, y, cy)
        w = kin * _gaussian(d2, bearing2, radial[2], angular[2])
        ax, ay = fused(w, load8(column, 2 * step + q), ax), fused(w, load8(column, 3 * step + q), ay)
    sx = weight[1] * total(cx) - weight[0] * total(vx) + weight[2] * total(ax)
    sy = weight[1] * total(cy) - weight[0] * total(vy) + weight[2] * total(ay)
    return sx, sy


@lane_function
def _drawn_to_walls(wall, last_wall, per_length, fx, fy, radial, angular, walls, column, step):
    """The sum for obstacles, as if they drew it."""
    n = last_wall - wall
    for q in range(n):
        at = 2 * (wall + q)
        column[q], column[step + q] = walls[at] * per_length, walls[at + 1] * per_length
    store(column, n, splat8(0.0))
    store(column, step + n, splat8(0.0))
    ox = oy = splat8(0.0)
    for q in range(0, n, EIGHT):
        x, y = load8(column, q), load8(column, step + q)
        d2, bearing2 = _from_here(x, y, fx, fy)
        w = _gaussian(d2, bearing2, radial, angular)
        ox, oy = fused(w, x, ox), fused(w, y, oy)
    return total(ox), total(oy)


@lane_function
def _from_here(x, y, fx, fy):
    """Squares of distance and bearing."""
    return fused(x, x, y * y), square_of_angle(y * fx - x * fy, fused(x, splat8(fx), y * fy))


@lane_function
def _gaussian(d2, bearing2, radial, angular):
    """Weights in distance and bearing (eqs. 4 and 5)."""
    return exponential(splat8(0.0) - fused(d2, splat8(radial), bearing2 * angular))
