"""What any model says of the next step of animals that were seen, and how likely that makes the step.

Each animal that was seen to turn is asked as in a run, by the model's own ``steer``, a few ticks on, with the others
where they were seen (teacher forcing); bodies that touch turn it aside, and it turns no faster than it can.  What is
left over is taken to be Student's t, as in `flockbrush.learning.turns`, whose `predicted` says the same of the herd
model and is the test's oracle.  Pace is left out: it is a process of its own in most models.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from flockbrush.behaviours.behaviour import Air, Behaviour, Scene, frozen
from flockbrush.engine.maths import atan2_
from flockbrush.engine.parallel import over_rows
from flockbrush.learning.turn_kernels import aside_of_
from flockbrush.learning.turns import FREEDOM, SMALLEST, Turns
from flockbrush.systems.contact import SKIN
from flockbrush.systems.visibility import Lists

CONSTANT = math.lgamma((FREEDOM + 1) / 2) - math.lgamma(FREEDOM / 2) - 0.5 * math.log(FREEDOM * math.pi)


class NextSteps:
    """Turns that were seen, ready for any model.

    The animals asked are rows of their own, before all those seen: so that an animal heads as the model turned it, and
    is seen by others as it was.
    """

    def __init__(self, turns: Turns):
        self.turns, percept, rows = turns, turns.percept, turns.rows
        self.k, self.n = len(rows), percept.animals
        first, count = percept.first, np.diff(percept.first)[rows]
        pair = np.repeat(first[rows] - np.concatenate([[0], np.cumsum(count)[:-1]]), count) + np.arange(count.sum())
        self.first = np.concatenate([[0], np.cumsum(count), np.full(self.n, count.sum())]).astype(np.int64)
        self.near = (percept.near[pair] + self.k).astype(np.int32)
        observer = np.repeat(rows, count)
        drift = turns.velocity[percept.near[pair]] - turns.velocity[observer]
        self.start = np.arctan2(percept.forward[rows, 1], percept.forward[rows, 0])
        self.own_speed = np.hypot(*turns.velocity[rows].T)
        ticks = math.ceil(float(turns.ticks.max(initial=0.0)) - 1e-9)
        self.scenes = [self._scene(percept.offset[pair] + s * turns.dt * drift, s) for s in range(ticks)]

    def _scene(self, offset, tick):
        """What is seen ``tick`` ticks on; the headings of the animals asked are put in later."""
        turns, total = self.turns, self.k + self.n
        spin, time = turns.spin, tick * turns.dt
        c, s = np.cos(spin * time), np.sin(spin * time)
        fx, fy = turns.percept.forward.T
        seen = np.column_stack([c * fx - s * fy, s * fx + c * fy, np.zeros(self.n)])
        speed = np.hypot(*turns.velocity.T)
        up, far, flat = np.tile([0.0, 0.0, 1.0], (total, 1)), np.full(total, np.inf), np.zeros((total, 3))
        nobody, plain = np.zeros(total + 1, np.int64), np.zeros((total, 2))
        forward = np.concatenate([np.zeros((self.k, 3)), seen])
        air = Air(
            self.first, self.near, np.column_stack([offset, np.zeros(len(offset))]), up, far, forward, far, up,
            np.zeros(total), np.zeros(total, np.uint8), flat, nobody, np.zeros((0, 3)),
        )  # fmt: skip
        one = np.zeros(total, np.int32)
        return Scene(
            dt=turns.dt, tick=tick, key=_no_chance, ids=np.arange(1, total + 1), xyz=flat,
            velocity=np.concatenate([np.zeros((self.k, 3)), speed[:, None] * seen]),
            forward=forward, speed=np.concatenate([self.own_speed, speed]), length=np.ones(total),
            leader=np.zeros(total, np.uint8), species=one, danger=np.zeros(total, np.uint8), first=self.first,
            near=self.near, offset=offset, obstacle_first=nobody, obstacle_offset=np.zeros((0, 2)), guidance=plain,
            slope=plain, memory=plain, known=np.zeros(total, np.uint8), order=np.arange(total, dtype=np.int32),
            air=frozen(air),
        )  # fmt: skip

    def predicted(self, model: Behaviour, params) -> np.ndarray:
        """(k,) rad that the animals turn, as the model says without chance."""
        quiet = params.model_copy(update={"wander": 0.0}) if "wander" in type(params).model_fields else params
        rows, angle, left = np.arange(self.k, dtype=np.int32), self.start.copy(), self.turns.ticks.copy()
        limit = getattr(params, "max_turn", np.inf) * self.turns.dt
        solid = self.turns.radius if model.flight is None else 0.0
        for scene in self.scenes:
            forward, velocity = scene.forward.copy(), scene.velocity.copy()
            forward[: self.k, 0], forward[: self.k, 1] = np.cos(angle), np.sin(angle)
            velocity[: self.k] = self.own_speed[:, None] * forward[: self.k]
            wish = model.steer(frozen(scene._replace(forward=forward, velocity=velocity)), rows, quiet).direction
            over_rows(
                _turn_on, self.k, wish, Lists(scene.first, scene.near, scene.offset), forward, self.turns.half, solid,
                limit, left, angle,
            )  # fmt: skip
        return angle - self.start

    def off(self, model: Behaviour, params) -> np.ndarray:
        """(k,) rad by which the animals turned otherwise."""
        off = self.turns.turn - self.predicted(model, params)
        return off - 2 * np.pi * np.round(off / (2 * np.pi))

    def loss(self, model: Behaviour, params) -> float:
        """Negative logarithm of the likelihood a turn, at the spread that is likeliest."""
        return -mean_score(self.off(model, params), self.turns.weight)[0]


def _no_chance(stream):
    raise AssertionError(f"a model asked for chance ({stream}) where it has none")


def log_density(off, spread) -> np.ndarray:
    """Logarithm of the density of differences, rad, by Student's t of that scale."""
    return CONSTANT - math.log(spread) - (FREEDOM + 1.0) / 2 * np.log1p((off / spread) ** 2 / FREEDOM)


def mean_score(off, weight, spread=None) -> tuple[float, float]:
    """(logarithm of the likelihood a turn, spread): at the given spread, or at the likeliest."""
    total = max(float(weight.sum()), 1e-12)
    if spread is None:
        spread = max(1.4826 * float(np.median(np.abs(off))), SMALLEST)
        for _ in range(8):  # by expectation and maximisation
            share = weight * (FREEDOM + 1.0) / (FREEDOM + (off / spread) ** 2)
            spread = max(float(np.sqrt((share * off * off).sum() / total)), SMALLEST)
    return float((weight * log_density(off, spread)).sum() / total), spread


@njit(cache=True, nogil=True, error_model="numpy")
def _turn_on(lo, hi, wish, lists, forward, half, radius, limit, left, angle):
    """One tick, or what is left of one: turned aside by those it touches, and no faster than it can."""
    first, near, offset = lists
    touch = 2.0 * radius
    far_enough = ((1.0 + SKIN) * touch + 2.0 * half) ** 2
    for k in range(lo, hi):
        share = min(left[k], 1.0)
        if share <= 1e-9:
            continue
        left[k] -= share
        fx, fy, hx, hy = forward[k, 0], forward[k, 1], wish[k, 0], wish[k, 1]
        if radius > 0.0:  # as in `flockbrush.systems.contact`
            for at in range(first[k], first[k + 1]):
                x, y, j = offset[at, 0], offset[at, 1], near[at]
                if x * x + y * y >= far_enough:
                    continue
                gx, gy = forward[j, 0], forward[j, 1]
                ox, oy, room = aside_of_(fx, fy, half, x, y, gx, gy, touch)
                into = hx * ox + hy * oy
                if into > 0.0:
                    hx, hy = hx - room * into * ox, hy - room * into * oy
        if hx * hx + hy * hy > 1e-24:
            change = atan2_(fx * hy - fy * hx, fx * hx + fy * hy)
            angle[k] += share * min(max(change, -limit), limit)
