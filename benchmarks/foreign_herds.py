"""Herds that are not ours, by models of the literature: what learning is tried on, with the truth beside it.

`herd` runs a model (or ours, "own:BRUSH") and gives a `Truth`: places and headings in body lengths (BL).  The models
turn and press as their authors say; their lengths are stretched to animals of 1 x .4 BL that do not lie on each other,
and headings take a moment to follow where a paper lets them jump.

References
----------
.. [1] Grégoire, G. & Chaté, H. (2004). Onset of collective and cohesive motion. Physical Review Letters 92, 025702.
.. [2] D'Orsogna, Chuang, Bertozzi & Chayes (2006). Self-propelled particles with soft-core interactions: patterns,
   stability, and collapse. Physical Review Letters 96, 104302.
.. [3] Couzin, Krause, James, Ruxton & Franks (2002). Collective memory and spatial sorting in animal groups. Journal of
   Theoretical Biology 218, 1-11.
.. [4] Berg, H. C. (1993). Random Walks in Biology.  Run and tumble.
.. [5] Ginelli et al. (2015). Intermittent collective dynamics emerge from conflicting imperatives in sheep herds. PNAS
   112, 12729-12734.  Standing, walking.
.. [6] Ballerini et al. (2008). Interaction ruling animal collective behavior depends on topological rather than metric
   distance. PNAS 105, 1232-1237.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

HALF, RADIUS = 0.3, 0.2  # BL: a body is a capsule, its axis from -HALF to HALF, its half width RADIUS


@dataclass
class Truth:
    """Where everybody is, in body lengths, x right and y up."""

    name: str
    fps: float
    xy: np.ndarray  # (T, n, 2) BL
    forward: np.ndarray  # (T, n, 2) unit, where the head is
    speed: np.ndarray  # (T, n) BL/s

    @property
    def turn(self):
        """(T, n) rad/s, central differences of the heading over one frame to each side."""
        angle = np.unwrap(np.arctan2(self.forward[..., 1], self.forward[..., 0]), axis=0)
        return np.gradient(angle, 1 / self.fps, axis=0)


# models -------------------------------------------------------------------------------------------------------------


class ForeignHerd:
    """A herd in the hands of a foreign model; `step` is one dt of it."""

    start = "disc"
    spacing = 1.2  # BL, about
    warmup = 4.0  # s, after which it is what it is called

    def __init__(self, count, rng, **changes):
        for name, value in changes.items():
            if not hasattr(self, name):
                raise TypeError(f"{type(self).__name__} has no {name!r}")
            setattr(self, name, value)
        self.rng, self.n = rng, count
        self.xy, self.angle = self.begin()
        self.pace = np.full(count, getattr(self, "speed", 1.0))

    def begin(self):
        """Places on a jittered disc, everybody its own way."""
        k = np.arange(self.n)
        r, a = self.spacing * 0.6 * np.sqrt(k + 0.5), k * 2.39996
        xy = np.column_stack([r * np.cos(a), r * np.sin(a)]) + self.rng.normal(0, 0.1, (self.n, 2))
        return xy, self.rng.uniform(-math.pi, math.pi, self.n)

    @property
    def forward(self):
        return np.column_stack([np.cos(self.angle), np.sin(self.angle)])

    def pairs(self):
        """Offsets from i to j (n, n, 2), and distances (n, n) with inf on the diagonal."""
        offset = self.xy[None] - self.xy[:, None]
        distance = np.hypot(offset[..., 0], offset[..., 1])
        np.fill_diagonal(distance, np.inf)
        return offset, distance

    def toward(self, wish, rate, dt, most=math.inf, noise=0.0):
        """Turn to the directions wished, (n, 2), as fast as rate (1/s) says, with noise in rad/√s."""
        known = np.hypot(*wish.T) > 1e-9
        off = wrapped(np.arctan2(wish[:, 1], wish[:, 0]) - self.angle)
        turn = np.where(known, np.clip(off * min(1.0, rate * dt), -most * dt, most * dt), 0.0)
        self.angle = wrapped(self.angle + turn + noise * math.sqrt(dt) * self.rng.normal(size=self.n))

    def breathe(self, dt, mean, spread=0.08, rate=1.0):
        """Speeds that come and go about their mean (BL/s), spread as a share of it."""
        kick = mean * spread * math.sqrt(2 * rate * dt) * self.rng.normal(size=self.n)
        self.pace = np.maximum(self.pace + rate * (mean - self.pace) * dt + kick, 0.0)

    def go(self, dt):
        """Walk, and lie on nobody."""
        self.xy = apart(self.xy + self.forward * self.pace[:, None] * dt, self.forward)


class Band(ForeignHerd):
    """A marching band: Grégoire and Chaté's cohesive Vicsek model [1]_, all in one direction after some seconds."""

    speed, align, press, near, rest, far, reach, noise = 3.0, 1.0, 0.4, 0.8, 1.3, 2.6, 3.0, 0.3

    def begin(self):
        xy, angle = super().begin()
        return xy, 0.6 * angle  # half agreed already

    def step(self, dt):
        offset, d = self.pairs()
        seen = d < self.reach
        pull = np.clip(0.25 * (d - self.rest) / (self.far - self.rest), -2.0, 1.0)
        pull = np.where(d < self.near, -4.0, np.where(d > self.far, 1.0, pull))
        unit = offset / np.maximum(d, 1e-9)[..., None]
        press = np.einsum("ij,ijk->ik", np.where(seen, pull, 0.0), unit)
        wish = self.align * (seen @ self.forward + self.forward) + self.press * press
        self.toward(wish, 3.0, dt, noise=self.noise)
        self.breathe(dt, self.speed)
        self.go(dt)


class Mill(ForeignHerd):
    """A mill: D'Orsogna et al.'s self-propelled particles in a Morse potential [2]_, begun as a turning ring."""

    speed, relax, attract, attract_reach, repel, repel_reach = 3.0, 0.5, 0.4, 10.0, 2.0, 1.6
    noise, drift = 0.5, (0.0, 0.0)

    def begin(self):
        inner = 3.0
        k = np.arange(self.n) + 0.5
        r, a = np.sqrt(inner**2 + k * self.spacing**2 / math.pi * 1.3), k * 2.39996
        self.centre = np.zeros(2)
        return np.column_stack([r * np.cos(a), r * np.sin(a)]), wrapped(a + math.pi / 2)

    def step(self, dt):
        offset, d = self.pairs()
        unit = offset / np.maximum(d, 1e-9)[..., None]
        share = 30 / self.n  # the pull of all together does not depend on how many they are
        pull = share * self.attract * np.exp(-d / self.attract_reach) - self.repel * np.exp(-d / self.repel_reach)
        force = np.einsum("ij,ijk->ik", pull, unit)
        if np.any(self.drift):  # what they circle moves along
            self.centre = self.centre + np.asarray(self.drift) * dt
            force += 0.3 * (self.centre - self.xy.mean(0)) + np.asarray(self.drift) * self.relax
        velocity = self.forward * self.pace[:, None]
        velocity = velocity + dt * (force + self.relax * (1 - (self.pace / self.speed) ** 2)[:, None] * velocity)
        velocity += self.noise * math.sqrt(dt) * self.rng.normal(size=velocity.shape)
        self.angle, self.pace = np.arctan2(velocity[:, 1], velocity[:, 0]), np.hypot(*velocity.T)
        self.go(dt)


class Swarm(ForeignHerd):
    """A swarm without common direction: run and tumble [4]_, with room for each and a weak pull to the others."""

    speed, tumbles, room, pull, reach, noise = 1.5, 0.35, 2.0, 0.25, 8.0, 0.3

    def begin(self):
        self.tumbling = np.zeros(self.n)
        xy, angle = super().begin()
        self.aim = angle.copy()
        return xy, angle

    def step(self, dt):
        begins = self.rng.random(self.n) < self.tumbles * dt
        self.aim = np.where(begins, self.rng.uniform(-math.pi, math.pi, self.n), self.aim)
        self.tumbling = np.where(begins, 0.5, np.maximum(self.tumbling - dt, 0.0))
        offset, d = self.pairs()
        unit = offset / np.maximum(d, 1e-9)[..., None]
        push = np.einsum("ij,ijk->ik", np.clip(1 - d / self.room, 0, None) * -3.0, unit)
        seen = (d < self.reach)[..., None]
        pull = self.pull * (offset * seen).sum(1) / np.maximum(seen.sum(1), 1) / 2.0
        own = np.where(
            (self.tumbling > 0)[:, None], np.column_stack([np.cos(self.aim), np.sin(self.aim)]), self.forward
        )
        self.toward(own + push + pull, 6.0, dt, most=6.0, noise=self.noise)
        self.breathe(dt, self.speed, 0.15)
        self.go(dt)


class School(ForeignHerd):
    """A school: Couzin et al.'s zones of repulsion, orientation and attraction [3]_; with little orientation a mill."""

    speed, repel, orient, attract, blind, turning, noise = 3.0, 0.9, 4.0, 12.0, 90.0, 1.75, 0.15

    def step(self, dt):
        offset, d = self.pairs()
        unit = offset / np.maximum(d, 1e-9)[..., None]
        ahead = np.einsum("ijk,ik->ij", unit, self.forward) > -math.cos(math.radians(self.blind / 2))
        close = d < self.repel
        beside = ~close & ahead & (d < self.orient)
        afar = ~close & ~beside & ahead & (d < self.attract)
        away = -np.einsum("ij,ijk->ik", close.astype(float), unit)
        social = units(beside @ self.forward) + units(np.einsum("ij,ijk->ik", afar.astype(float), unit))
        self.toward(np.where(close.any(1)[:, None], away, social), 8.0, dt, most=self.turning, noise=self.noise)
        self.breathe(dt, self.speed, 0.05)
        self.go(dt)


class Graze(ForeignHerd):
    """A grazing herd: they stand, walk some steps, and stand again, as one of their neighbours does [5]_."""

    speed, starts, stops, room, noise = 0.6, 0.4, 0.25, 2.0, 0.3
    spacing = 2.2

    def begin(self):
        self.walks = np.zeros(self.n, bool)
        return super().begin()

    def step(self, dt):
        offset, d = self.pairs()
        nearest = np.argsort(d, axis=1)[:, :7]
        busy = self.walks[nearest].mean(1)
        start = self.rng.random(self.n) < self.starts * (0.3 + 2 * busy) * dt
        stop = self.rng.random(self.n) < self.stops * (1.5 - busy) * dt
        self.walks = np.where(self.walks, ~stop, start)
        unit = offset / np.maximum(d, 1e-9)[..., None]
        push = np.einsum("ij,ijk->ik", np.clip(1 - d / self.room, 0, None) * -2.0, unit)
        pull = 0.02 * (self.xy.mean(0) - self.xy)
        self.toward(np.where(self.walks[:, None], self.forward + push + pull, 0.0), 2.0, dt, noise=0.0)
        self.angle = wrapped(self.angle + self.noise * math.sqrt(dt) * self.rng.normal(size=self.n) * self.walks)
        self.breathe(dt, np.where(self.walks, self.speed, 0.0), 0.1, 3.0)
        self.go(dt)


class Topological(ForeignHerd):
    """A flock of so many nearest neighbours, however far [6]_: align and gather, with a soft core."""

    speed, neighbours, noise, room = 2.5, 7, 0.4, 1.1

    def begin(self):
        xy, angle = super().begin()
        return xy, 0.5 * angle

    def step(self, dt):
        offset, d = self.pairs()
        near = np.argsort(d, axis=1)[:, : self.neighbours]
        rows = np.arange(self.n)[:, None]
        unit = offset[rows, near] / d[rows, near][..., None]
        pull = np.clip(d[rows, near] - self.room, -1.5, 1.0)[..., None] * unit
        wish = self.forward[near].mean(1) + 0.8 * pull.mean(1)
        self.toward(wish, 2.5, dt, most=3.0, noise=self.noise)
        self.breathe(dt, self.speed, 0.1)
        self.go(dt)


MODELS = {
    "band": (Band, {}),
    "mill": (Mill, {}),
    "drifting mill": (Mill, {"drift": (0.5, 0.2)}),
    "swarm": (Swarm, {}),
    "school": (School, {}),
    "torus": (School, {"orient": 2.0, "turning": 1.2, "speed": 2.5, "attract": 15.0, "warmup": 16.0}),
    "graze": (Graze, {}),
    "topological": (Topological, {}),
}


ALIGNED = ("march", "column", "front", "lanes", "stampede")  # brushes of ours that begin with one direction


def herd(name, count=80, seconds=4.0, fps=25.0, seed=0, warmup=None, other=None, **changes) -> Truth:
    """Run a model: one of MODELS, or "own:BRUSH" for a shipped brush (or a `Brush`) of this program's own.

    Parameters
    ----------
    warmup : float
        s that pass before the film begins; as many as the model needs unless given.
    other : (int, int), optional
        Of one of MODELS: a frame, and the seed of the random numbers from then on.
    **changes
        Numbers of the model to change, such as ``speed=2.0`` BL/s.
    """
    if not isinstance(name, str) or name.startswith("own:"):
        return _own(name, count, seconds, fps, seed, 4.0 if warmup is None else warmup)
    model, preset = MODELS[name]
    animals = model(count, np.random.default_rng([seed, count]), **{**preset, **changes})
    sub = max(1, math.ceil(50 / fps))
    dt = 1 / (fps * sub)
    for _ in range(round((animals.warmup if warmup is None else warmup) / dt)):
        animals.step(dt)
    places, headings = [], []
    for frame in range(round(seconds * fps)):
        if other is not None and frame == other[0]:
            animals.rng = np.random.default_rng([*other, count])
        places.append(animals.xy.copy())
        headings.append(animals.forward)
        for _ in range(sub):
            animals.step(dt)
    return _truth(name, fps, np.array(places), np.array(headings))


def _own(name, count, seconds, fps, seed, warmup):
    """Our own model, a frame to the nearest tick (1/32 s: fps 32, 16 or 8 are exact)."""
    from flockbrush.behaviours.brush import Brush, shipped
    from flockbrush.components import Heading, Position
    from flockbrush.levels.build import plane

    brush = name if isinstance(name, Brush) else shipped().get(name.removeprefix("own:"))
    start = "ring" if "hollow" in brush.name else "scatter"
    simulation = plane(brush, count, seed=seed, start=start, heading=0.4 if brush.name in ALIGNED else None)
    places, headings, done = [], [], 0
    for frame in range(round(seconds * fps)):
        tick = round((warmup + frame / fps) * 32)
        simulation.run(tick - done)
        done = tick
        length = brush.body.length
        places.append(simulation.agents[Position.xyz][:, :2] / length)
        headings.append(simulation.agents[Heading.forward][:, :2].copy())
    xy = np.array(places)
    return _truth(f"own:{brush.name}", fps, xy - xy[0].mean(0), np.array(headings))


def _truth(name, fps, xy, forward):
    velocity = np.gradient(xy, 1 / fps, axis=0)
    return Truth(name, float(fps), xy, forward, np.hypot(velocity[..., 0], velocity[..., 1]))


def wrapped(angle):
    return (angle + math.pi) % (2 * math.pi) - math.pi


def units(v):
    size = np.hypot(v[:, 0], v[:, 1])[:, None]
    return np.divide(v, size, out=np.zeros_like(v), where=size > 1e-12)


def apart(xy, forward, rounds=3):
    """Places at which hardly any bodies overlap: each body is three discs, and discs push each other, (n, 2)."""
    at, share = np.array([-HALF, 0.0, HALF]), 1.0
    for _ in range(rounds):
        discs = (xy[:, None] + at[None, :, None] * forward[:, None]).reshape(-1, 2)
        pairs = cKDTree(discs).query_pairs(2 * RADIUS, output_type="ndarray")
        pairs = pairs[pairs[:, 0] // 3 != pairs[:, 1] // 3]
        if not len(pairs):
            return xy
        off = discs[pairs[:, 1]] - discs[pairs[:, 0]]
        d = np.maximum(np.hypot(*off.T), 1e-6)
        push = (share * 0.5 * (2 * RADIUS - d) / d)[:, None] * off
        xy, met = xy.copy(), np.ones(len(xy))
        np.add.at(met, pairs.ravel() // 3, 1)
        np.add.at(xy, pairs[:, 0] // 3, -push / (met[pairs[:, 0] // 3] ** 0.5)[:, None])
        np.add.at(xy, pairs[:, 1] // 3, push / (met[pairs[:, 1] // 3] ** 0.5)[:, None])
    return xy
