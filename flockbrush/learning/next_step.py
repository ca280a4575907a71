"""The next step of observed animals as any model predicts it, and the likelihood of the observed step.

The model's own ``steer`` is called for each animal with an observed turn, for a few ticks, while the others move as
observed (teacher forcing). Bodies in contact deflect the animal, and its rate of turning is limited. The residuals are
assumed to follow Student's t distribution, as in `flockbrush.learning.turns`, whose `predicted` gives the same values
for the herd model and is the oracle of the test. Speed is left out: in most models it is a process of its own.
"""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numba import njit

from flockbrush.behaviours.behaviour import Air, Behaviour, flock_of, frozen
from flockbrush.engine.maths import atan2_
from flockbrush.engine.parallel import over_rows
from flockbrush.learning.plane_scene import plane_scene
from flockbrush.learning.turn_kernels import aside_of_
from flockbrush.learning.turns import FREEDOM, SMALLEST, Turns
from flockbrush.systems.contact import SKIN
from flockbrush.systems.visibility import Lists

CONSTANT = math.lgamma((FREEDOM + 1) / 2) - math.lgamma(FREEDOM / 2) - 0.5 * math.log(FREEDOM * math.pi)


class NextSteps:
    """Observed turns, prepared for any model.

    The k animals asked have rows of their own before the n observed animals, so that the model can turn an animal
    while the others still perceive it as it was observed.

    Parameters
    ----------
    turns : Turns
        Observed turns, in body lengths (BL) and seconds.
    """

    def __init__(self, turns: Turns):
        self.turns, percept, rows = turns, turns.percept, turns.rows
        self.k, self.n = len(rows), percept.animals
        self.first = np.concatenate([[0], np.cumsum(np.diff(percept.first)[rows])]).astype(np.int64)
        ticks = math.ceil(float(turns.ticks.max(initial=0.0)) - 1e-9)
        self.near = np.empty(self.first[-1], np.int32)
        offsets = np.zeros((ticks, len(self.near), 3))
        _look(rows, percept.first, percept.near, percept.offset, turns.velocity, turns.dt, self.near, offsets)
        self.near += self.k
        self.first = np.concatenate([self.first, np.full(self.n, self.first[-1])])
        self.walls_first, walls, past = _walls(percept, rows, turns.velocity)
        self.walls_first = np.concatenate([self.walls_first, np.full(self.n, self.walls_first[-1])])
        self.start = np.arctan2(percept.forward[rows, 1], percept.forward[rows, 0])
        self.own_speed, self.effort = np.hypot(*turns.velocity[rows].T), np.ones(self.k + self.n)
        self.scenes = [self._scene(offset, walls - s * turns.dt * past, s) for s, offset in enumerate(offsets)]
        reach = (1.0 + SKIN) * 2.0 * turns.radius + 2.0 * turns.half
        self.touching = [_within(reach, self.first[: self.k + 1], self.near, offset) for offset in offsets]
        self.summaries: dict[str, list] = {}  # of models that have any, by tick

    def _scene(self, offset, walls, tick):
        """The `Scene` of a tick with neighbours at `offset` (m, 3) BL and walls at `walls` (j, 2) BL.

        Headings of the k animals come later.
        """
        turns, total = self.turns, self.k + self.n
        spin, time = turns.spin, tick * turns.dt
        c, s = np.cos(spin * time), np.sin(spin * time)
        fx, fy = turns.percept.forward.T
        seen = np.column_stack([c * fx - s * fy, s * fx + c * fy, np.zeros(self.n)])
        speed = np.hypot(*turns.velocity.T)
        up, far, flat = np.tile([0.0, 0.0, 1.0], (total, 1)), np.full(total, np.inf), np.zeros((total, 3))
        nobody = np.zeros(total + 1, np.int64)
        forward = np.concatenate([np.zeros((self.k, 3)), seen])
        air = Air(
            self.first, self.near, offset, up, far, forward, far, up,
            np.zeros(total), np.zeros(total, np.uint8), flat, nobody, np.zeros((0, 3)),
        )  # fmt: skip
        return plane_scene(
            dt=turns.dt, tick=tick, key=_no_chance, ids=np.arange(1, total + 1), forward=forward,
            velocity=np.concatenate([np.zeros((self.k, 3)), speed[:, None] * seen]),
            speed=np.concatenate([self.own_speed, speed]), effort=self.effort,
            seen=Lists(self.first, self.near, offset[:, :2].copy()), walls=(self.walls_first, walls), air=frozen(air),
        )  # fmt: skip

    def predicted(self, model: Behaviour, params) -> np.ndarray:
        """The turns that a model predicts, without noise.

        Parameters
        ----------
        model : Behaviour
        params : Parameters

        Returns
        -------
        (k,) ndarray
            Radians over the observed time of each turn.
        """
        rows, quiet = np.arange(self.k, dtype=np.int32), _quiet(params)
        limit = getattr(params, "max_turn", np.inf) * self.turns.dt
        solid, scenes = self.turns.radius if model.flight is None else 0.0, self.scenes
        if model.by_slot:
            scenes = self._scenes_by_slot
        known = () if model.summary is None else (self._summed_up(model, rows),)

        def wish(scene):
            with model.blaming():
                return model.steer(frozen(scene), rows, quiet, *(of[scene.tick] for of in known)).direction

        return self._turned(scenes, wish, limit, solid)

    def _summed_up(self, model, rows):
        """What a model makes of each scene whatever its parameters are."""
        if model.name not in self.summaries:
            with model.blaming():
                self.summaries[model.name] = [model.summary(frozen(scene), rows) for scene in self.scenes]
        return self.summaries[model.name]

    def paces(self, model: Behaviour, params) -> np.ndarray:
        """The factors (k,) to which a model brings the speeds of the animals, if they stay as at the start of a turn.

        A model may ask for a part of the way from the present factor: the one that it would leave as it is, is told.
        """
        rows, scene, effort = np.arange(self.k, dtype=np.int32), self._headed(self.scenes[0], self.start), self.effort
        with model.blaming():
            at_rest, at_one = (
                model.steer(frozen(scene._replace(effort=now * effort)), rows, _quiet(params)).pace
                for now in (0.0, 1.0)
            )
        return at_rest / np.maximum(1.0 + at_rest - at_one, 1e-6)

    def alone(self, model: Behaviour, params) -> np.ndarray:
        """The turns (k,), rad, that a model predicts for animals that see no others but touch them."""
        rows, quiet, nobody = np.arange(self.k, dtype=np.int32), _quiet(params), np.zeros_like(self.first)
        limit = getattr(params, "max_turn", np.inf) * self.turns.dt

        def wish(scene):
            air = scene.air._replace(first=nobody, near=scene.near[:0], offset=scene.air.offset[:0])
            seen = scene._replace(first=nobody, near=scene.near[:0], offset=scene.offset[:0], air=frozen(air))
            with model.blaming():
                return model.steer(frozen(seen), rows, quiet).direction

        return self._turned(self.scenes, wish, limit, self.turns.radius if model.flight is None else 0.0)

    def by_contact(self) -> np.ndarray:
        """The turns (k,), rad, of animals that go straight on except where they touch others."""
        return self._turned(self.scenes, lambda scene: scene.forward[: self.k], np.inf, self.turns.radius)

    @cached_property
    def _scenes_by_slot(self):
        """The scenes with the neighbours by slot; these are observed animals, which no prediction moves."""
        return [scene._replace(air=scene.air._replace(by_slot=flock_of(scene, scene.air))) for scene in self.scenes]

    def _turned(self, scenes, wish, limit, solid):
        """(k,) rad by which animals turn to what they wish in each `Scene`, at most ``limit`` rad to a tick."""
        angle, left = self.start.copy(), self.turns.ticks.copy()
        for scene, touching in zip(scenes, self.touching, strict=True):
            scene = self._headed(scene, angle)
            over_rows(
                _turn_on, self.k, wish(scene), touching, scene.forward, self.turns.half, solid, limit, left, angle
            )
        return angle - self.start

    def _headed(self, scene, angle):
        """The scene with the animals asked headed at these angles (k,), rad, at their speeds."""
        forward, velocity = scene.forward.copy(), scene.velocity.copy()
        forward[: self.k, 0], forward[: self.k, 1] = np.cos(angle), np.sin(angle)
        velocity[: self.k] = self.own_speed[:, None] * forward[: self.k]
        return scene._replace(forward=forward, velocity=velocity)

    def off(self, model: Behaviour, params) -> np.ndarray:
        """Observed minus predicted turns (k,), rad, in -π to π."""
        return wrapped(self.turns.turn - self.predicted(model, params))

    def loss(self, model: Behaviour, params) -> float:
        """Negative log likelihood per turn (nats), at the most likely spread of the residuals."""
        return -mean_score(self.off(model, params), self.turns.weight)[0]


def _quiet(params):
    """The parameters without chance: those that are declared so are 0."""
    fields = type(params).model_fields.items()
    return params.model_copy(
        update={name: 0.0 for name, field in fields if (field.json_schema_extra or {}).get("chance")}
    )


def wrapped(angle) -> np.ndarray:
    """Angles from -π to π, rad."""
    return angle - 2 * np.pi * np.round(angle / (2 * np.pi))


def _no_chance(stream, tick=0):
    return np.uint64(0)  # for models that draw numbers and multiply them by 0


def log_density(off, spread) -> np.ndarray:
    """Log density of residuals (n,), rad, under Student's t with `FREEDOM` degrees of freedom and this scale (rad)."""
    return CONSTANT - math.log(spread) - (FREEDOM + 1.0) / 2 * np.log1p((off / spread) ** 2 / FREEDOM)


def mean_score(off, weight) -> tuple[float, float]:
    """Mean log likelihood of residuals under Student's t, and its most likely scale, at least `SMALLEST`.

    Parameters
    ----------
    off : (n,) ndarray
        Residuals, rad.
    weight : (n,) ndarray

    Returns
    -------
    (float, float)
        Nats per turn, and the scale, rad.
    """
    total = max(float(weight.sum()), 1e-12)
    spread = max(1.4826 * float(np.median(np.abs(off))), SMALLEST)
    for _ in range(8):  # by expectation and maximisation
        share = weight * (FREEDOM + 1.0) / (FREEDOM + (off / spread) ** 2)
        spread = max(float(np.sqrt((share * off * off).sum() / total)), SMALLEST)
    return float((weight * log_density(off, spread)).sum() / total), spread


def _walls(percept, rows, velocity):
    """The walls that some rows (k,) see: first (k + 1,), offset (j, 2) BL, and how fast it gets less, BL/s (j, 2)."""
    count = np.diff(percept.walls_first)[rows]
    first = np.concatenate([[0], np.cumsum(count)])
    chosen = np.repeat(percept.walls_first[rows] - first[:-1], count) + np.arange(first[-1])
    return first, percept.walls_offset[chosen], velocity[np.repeat(rows, count)]


def _within(reach, first, near, offset):
    """The neighbours (m,) of k rows that are nearer than this: `Lists` with offsets (j, 3)."""
    close = (offset[:, 0] ** 2 + offset[:, 1] ** 2) < reach * reach
    return Lists(np.concatenate([[0], np.cumsum(close)])[first], near[close], offset[close])


@njit(cache=True, nogil=True, error_model="numpy")
def _look(rows, first, near, offset, velocity, dt, found, offsets):
    """Write the neighbours of some rows (m,), and where they are in each tick (ticks, m, 3) if all go on as they do."""
    m = 0
    for i in rows:
        for at in range(first[i], first[i + 1]):
            j = near[at]
            found[m] = j
            x, y = velocity[j, 0] - velocity[i, 0], velocity[j, 1] - velocity[i, 1]
            for s in range(len(offsets)):
                offsets[s, m, 0], offsets[s, m, 1] = offset[at, 0] + s * dt * x, offset[at, 1] + s * dt * y
            m += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _turn_on(lo, hi, wish, lists, forward, half, radius, limit, left, angle):
    """Turn rows `lo` to `hi` by one tick, or by the rest of one: deflect by touching bodies, then limit the turn.

    Reads and writes `left` (k,), ticks, and `angle` (k,), rad; `limit` is in rad per tick, `half` and `radius` in BL,
    and `lists` hold whoever may touch.
    """
    first, near, offset = lists
    touch = 2.0 * radius
    for k in range(lo, hi):
        share = min(left[k], 1.0)
        if share <= 1e-9:
            continue
        left[k] -= share
        fx, fy, hx, hy = forward[k, 0], forward[k, 1], wish[k, 0], wish[k, 1]
        if radius > 0.0:  # as in `flockbrush.systems.contact`
            for at in range(first[k], first[k + 1]):
                x, y, j = offset[at, 0], offset[at, 1], near[at]
                gx, gy = forward[j, 0], forward[j, 1]
                ox, oy, room = aside_of_(fx, fy, half, x, y, gx, gy, touch)
                into = hx * ox + hy * oy
                if into > 0.0:
                    hx, hy = hx - room * into * ox, hy - room * into * oy
        if hx * hx + hy * hy > 1e-24:
            change = atan2_(fx * hy - fy * hx, fx * hx + fy * hy)
            angle[k] += share * min(max(change, -limit), limit)
