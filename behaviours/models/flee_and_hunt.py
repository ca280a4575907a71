"""Prey that flees and predators that hunt, on top of the herd model.

Gong et al. 2025 [1]_, section 7.5: reindeer move by the herd model with one
more force, away from wolves; wolves keep to the herd model, in a line, until
they see prey, then faster, and close to it they leave the pack's rules and
single out the vulnerable.  The paper gives no formulas for either; those below
are ours: fear falls off linearly with distance, spreads from neighbour to
neighbour, and the vulnerable are the near ones with few others about them.

.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple

import numpy as np
from flockbrush.behaviours.behaviour import ByRow, behaviour, kinds_in, quantity
from flockbrush.behaviours.models import herd
from flockbrush.behaviours.sliders import DesignerSlider, moves
from flockbrush.engine.parallel import over_rows
from numba import njit


class FleeParams(herd.Params):
    """The herd's parameters, and fear."""

    flight_distance: float = quantity(
        12.0, "body lengths", "an animal flees from a predator that it sees nearer than this", 0.5, 100
    )
    fear_weight: float = quantity(
        3.0, "1", "weight of fear against the herd's forces; larger: turns away from predators faster", 0, 100
    )
    panic_pace: float = quantity(3.0, "1", "speed factor when a predator is very close", 1, 20)
    contagion: float = quantity(0.7, "1", "share of the neighbours' haste that an animal adopts", 0, 0.95)

    sliders: ClassVar = {
        **herd.Params.sliders,
        "nerve": DesignerSlider(
            "Bold to fearful",
            (moves("flight_distance", 2.0, 60.0, True), moves("panic_pace", 1.0, 6.0, True)),
        ),
    }


class HuntParams(herd.Params):
    """The pack's parameters, and the chase."""

    chase_distance: float = quantity(
        30.0, "body lengths", "a hunter follows prey that it sees nearer than this", 0.5, 200
    )
    charge_distance: float = quantity(
        8.0, "body lengths", "nearer than this to the prey, a hunter ignores the pack", 0.5, 200
    )
    chase_weight: float = quantity(
        0.6, "1", "weight of the prey against the pack's forces; larger: turns to the prey faster", 0, 100
    )
    chase_pace: float = quantity(1.5, "1", "speed factor during the approach", 0.1, 20)
    charge_pace: float = quantity(2.5, "1", "speed factor during the final charge", 0.1, 20)
    crowd_penalty: float = quantity(
        1.0,
        "body lengths",
        "distance added for each animal that the prey sees; larger: hunters prefer isolated prey",
        0,
        100,
    )

    sliders: ClassVar = {
        **herd.Params.sliders,
        "nerve": DesignerSlider(
            "Attacks near prey only to chases all prey in sight",
            (moves("chase_distance", 5.0, 120.0, True), moves("charge_distance", 2.0, 60.0, True)),
        ),
    }


def explain_flight(scene, row, p):
    """Why prey turns: the herd's reasons, and fear of every predator in view."""
    i = row
    who, offset = _in_view(scene, i)
    far = np.hypot(*offset.T)
    flight = p.flight_distance * scene.length[i]
    kinds = kinds_in(scene)
    near = kinds.fears[kinds.kind[i], kinds.kind[who]] & (far > 0) & (far < flight)
    fear = (1.0 - far[near] / flight) / np.maximum(far[near], 1e-300)
    push = -scene.dt * p.sensitivity * p.fear_weight * (fear @ offset[near])
    return herd.unit(herd.explain(scene, row, p)) | {"fear": push}


def explain_hunt(scene, row, p):
    """Why a hunter turns: the pack's reasons, and its prey; close to the prey nothing else."""
    reasons = herd.unit(herd.explain(scene, row, p))
    prey = _chosen(scene, row, p)
    if prey is None:
        return reasons
    who, offset, distance = prey
    run = max(scene.speed[row] * p.charge_pace, 1e-6)
    ahead = offset + min(distance * scene.length[row] / run, 2.0) * scene.velocity[who, :2]
    way = ahead / max(float(np.hypot(*ahead)), 1e-9)
    if distance < p.charge_distance:
        return {"prey": way}
    return reasons | {"prey": scene.dt * p.sensitivity * p.chase_weight * way}


def _chosen(scene, i, p):
    """(row, offset in m, distance in body lengths) of the prey that costs least, or None."""
    who, offset = _in_view(scene, i)
    far = np.hypot(*offset.T) / scene.length[i]
    kinds = kinds_in(scene)
    fair = kinds.prey[kinds.kind[i], kinds.kind[who]] & (far < p.chase_distance) & (far > 0)
    if not fair.any():
        return None
    who, offset, far = who[fair], offset[fair], far[fair]
    ahead = offset @ scene.forward[i, :2] / (far * scene.length[i])
    others = scene.first[who + 1] - scene.first[who]
    best = np.argmin(far * (1.5 - 0.5 * ahead) + p.crowd_penalty * others)
    return who[best], offset[best], float(far[best])


def _in_view(scene, i):
    """Rows and offsets (m) of those an animal sees."""
    seen = slice(scene.first[i], scene.first[i + 1])
    return scene.near[seen], scene.offset[seen]


class Movers(NamedTuple):
    """Who flees, hunts and is met, by row."""

    length: np.ndarray  # (n,) m
    forward: np.ndarray  # (n, 3)
    velocity: np.ndarray  # (n, 3) m/s
    speed: np.ndarray  # (n,) m/s
    species: np.ndarray  # (n,)
    kind: np.ndarray  # (n,)


class Fright(NamedTuple):
    """The parameters of prey."""

    flight_distance: float
    push: float  # rad, in a tick
    panic_pace: float
    contagion: float


class Chase(NamedTuple):
    """The parameters of hunters."""

    distance: float
    charge_distance: float
    turn: float  # rad, in a tick
    pace: float
    charge_pace: float
    crowd_penalty: float


def _movers(s, kinds):
    return Movers(s.length, s.forward, s.velocity, s.speed, s.species, kinds.kind)


@behaviour("flee", FleeParams, explain=explain_flight, has=("flee",))
def flee(scene, rows, p):
    """The herd's wish, turned away from every predator in view, and hurried."""
    wishes, kinds = herd.steer(scene, rows, p), kinds_in(scene)
    fright = Fright(p.flight_distance, scene.dt * p.sensitivity * p.fear_weight, p.panic_pace, p.contagion)
    seen = ByRow(scene.first, scene.near, scene.offset)
    wish = wishes.direction, wishes.pace
    over_rows(_flee, len(rows), rows, _movers(scene, kinds), kinds.fears, seen, fright, *wish)
    return wishes


@behaviour("hunt", HuntParams, danger=True, explain=explain_hunt, has=("hunt",))
def hunt(scene, rows, p):
    """The pack's wish until prey is seen; then towards the most vulnerable one."""
    wishes, kinds = herd.steer(scene, rows, p), kinds_in(scene)
    turn = scene.dt * p.sensitivity * p.chase_weight
    chase = Chase(p.chase_distance, p.charge_distance, turn, p.chase_pace, p.charge_pace, p.crowd_penalty)
    seen = ByRow(scene.first, scene.near, scene.offset)
    wish = wishes.direction, wishes.pace
    over_rows(_hunt, len(rows), rows, _movers(scene, kinds), kinds.prey, seen, chase, *wish)
    return wishes


@njit(cache=True, nogil=True, error_model="numpy")
def _flee(lo, hi, rows, movers, fears, seen, fright, direction, pace):
    length, _, velocity, speed, species, kind = movers
    (first, near, offset), (flight_distance, push, panic_pace, contagion) = seen, fright
    for k in range(lo, hi):
        i = rows[k]
        flight = flight_distance * length[i]
        ax = ay = worst = haste = 0.0
        kin = 0
        for at in range(first[i], first[i + 1]):
            j = near[at]
            x, y = offset[at, 0], offset[at, 1]
            d = np.sqrt(x * x + y * y)
            if fears[kind[i], kind[j]]:
                if 0.0 < d < flight:
                    fear = 1.0 - d / flight
                    ax -= fear * x / d
                    ay -= fear * y / d
                    worst = max(worst, fear)
            elif species[j] == species[i] and speed[j] > 1e-9:
                vx, vy = velocity[j, 0], velocity[j, 1]
                haste += min(np.sqrt(vx * vx + vy * vy) / speed[j], panic_pace)
                kin += 1
        wanted = 1.0 + (panic_pace - 1.0) * worst
        if kin:
            wanted = max(wanted, 1.0 + contagion * (haste / kin - 1.0))
        pace[k] *= wanted
        _lean(direction, k, push * ax, push * ay)


@njit(cache=True, nogil=True, error_model="numpy")
def _hunt(lo, hi, rows, movers, prey, seen, chase, direction, pace):
    length, forward, velocity, speed, _, kind = movers
    first, near, offset = seen
    chase_distance, charge_distance, turn, chase_pace, charge_pace, crowd_penalty = chase
    for k in range(lo, hi):
        i = rows[k]
        unit = length[i]
        best, chosen, distance = np.inf, -1, 0.0
        for at in range(first[i], first[i + 1]):
            j = near[at]
            if not prey[kind[i], kind[j]]:
                continue
            x, y = offset[at, 0] / unit, offset[at, 1] / unit
            d = np.sqrt(x * x + y * y)
            if d >= chase_distance or d == 0.0:
                continue
            # ahead is nearer than behind: the chosen one stays chosen
            ahead = (forward[i, 0] * x + forward[i, 1] * y) / d
            cost = d * (1.5 - 0.5 * ahead) + crowd_penalty * (first[j + 1] - first[j])
            if cost < best:
                best, chosen, distance = cost, at, d
        if chosen < 0:
            continue
        j = near[chosen]
        x, y = offset[chosen, 0], offset[chosen, 1]
        run = max(speed[i] * charge_pace, 1e-6)
        soon = min(distance * unit / run, 2.0)  # s; where the prey will be
        x, y = x + soon * velocity[j, 0], y + soon * velocity[j, 1]
        size = max(np.sqrt(x * x + y * y), 1e-9)
        x, y = x / size, y / size
        if distance < charge_distance:
            direction[k, 0], direction[k, 1] = x, y
            pace[k] *= charge_pace
        else:
            _lean(direction, k, turn * x, turn * y)
            pace[k] *= chase_pace


@njit(inline="always")
def _lean(direction, k, x, y):
    """Turn a unit vector by a push."""
    hx, hy = direction[k, 0] + x, direction[k, 1] + y
    size = np.sqrt(hx * hx + hy * hy)
    if size > 1e-9:
        direction[k, 0], direction[k, 1] = hx / size, hy / size
