"""Herds of models that learning was not developed on (``python benchmarks/learning.py foreign``).

References
----------
.. [1] Grégoire, G. & Chaté, H. (2004). Onset of collective and cohesive motion. Physical Review Letters 92, 025702.
.. [2] Martín-Gómez, Levis, Díaz-Guilera & Pagonabarraga (2018). Collective motion of active Brownian particles with
   polar alignment. Soft Matter 14, 2610-2618.
.. [3] Gautrais et al. (2012). Deciphering interactions in moving animal groups. PLoS Computational Biology 8, e1002678.
   Persistent turning walkers.
.. [4] Romanczuk, Couzin & Schimansky-Geier (2009). Collective motion due to individual escape and pursuit response.
   Physical Review Letters 102, 010602.
.. [5] Pearce, Miller, Rowlands & Turner (2014). Role of projection in the control of bird flocks. PNAS 111,
   10422-10426.
.. [6] Calovi et al. (2018). Disentangling and modeling interactions in fish with burst-and-coast swimming. PLoS
   Computational Biology 14, e1005933.
.. [7] Cucker, F. & Smale, S. (2007). Emergent behavior in flocks. IEEE Transactions on Automatic Control 52, 852-862.
"""

from __future__ import annotations

import math

import numpy as np

from benchmarks.foreign_herds import MODELS, ForeignHerd, units, wrapped


class VectorialNoise(ForeignHerd):
    """Vicsek's band with vectorial noise [1]_: each neighbour is mistaken, and not the sum; and a soft core."""

    speed, reach, mistaken, room, gather = 2.0, 3.0, 1.2, 1.1, 0.15

    def begin(self):
        xy, angle = super().begin()
        return xy, 0.4 * angle + 1.0

    def step(self, dt):
        offset, d = self.pairs()
        seen = d < self.reach
        lost = self.rng.uniform(-math.pi, math.pi, self.n)
        wish = units(seen @ self.forward + self.forward)
        wish = wish + self.mistaken * np.column_stack([np.cos(lost), np.sin(lost)])
        push = np.einsum("ij,ijk->ik", np.clip(1 - d / self.room, 0, None) * -2.0, offset / d[..., None])
        self.toward(wish + push + self.gather * units(self.xy.mean(0) - self.xy), 4.0, dt)
        self.breathe(dt, self.speed)
        self.go(dt)


class ActiveBrownian(ForeignHerd):
    """Active Brownian particles that align by torques [2]_, in a shallow bowl."""

    speed, torque, reach, diffusion, bowl = 1.5, 0.25, 2.5, 1.2, 0.12

    def step(self, dt):
        _, d = self.pairs()
        off = self.angle[None] - self.angle[:, None]
        middle = self.xy.mean(0) - self.xy
        down = self.forward[:, 0] * middle[:, 1] - self.forward[:, 1] * middle[:, 0]
        turn = self.torque * (np.sin(off) * (d < self.reach)).sum(1) + self.bowl * down
        kick = math.sqrt(2 * self.diffusion * dt) * self.rng.normal(size=self.n)
        self.angle = wrapped(self.angle + turn * dt + kick)
        self.breathe(dt, self.speed)
        self.go(dt)


class Turners(ForeignHerd):
    """Persistent turning walkers [3]_: the rate of turning has inertia, and drifts to that of alignment and pull."""

    speed, relax, align, pull, noise, reach = 2.2, 0.4, 2.5, 0.25, 1.3, 6.0

    def begin(self):
        self.rate = np.zeros(self.n)
        return super().begin()

    def step(self, dt):
        offset, d = self.pairs()
        seen = d < self.reach
        many = np.maximum(seen.sum(1), 1)
        off = self.angle[None] - self.angle[:, None]
        bearing = np.arctan2(offset[..., 1], offset[..., 0]) - self.angle[:, None]
        wish = self.align * (np.sin(off) * seen).sum(1) / many
        wish += self.pull * (np.where(seen, d, 0.0) * np.sin(bearing)).sum(1) / many
        self.rate += (wish - self.rate) * dt / self.relax + self.noise * math.sqrt(dt) * self.rng.normal(size=self.n)
        self.angle = wrapped(self.angle + self.rate * dt)
        self.breathe(dt, self.speed)
        self.go(dt)


class Pursuit(ForeignHerd):
    """Chains of pursuit: each runs after the nearest in a cone ahead, and home where there is nobody."""

    speed, cone, reach, noise, home = 2.5, 60.0, 5.0, 0.35, 0.5

    def step(self, dt):
        offset, d = self.pairs()
        unit = offset / d[..., None]
        ahead = np.einsum("ijk,ik->ij", unit, self.forward) > math.cos(math.radians(self.cone))
        far = np.where(ahead & (d < self.reach), d, np.inf)
        who, rows = far.argmin(1), np.arange(self.n)
        chased = np.isfinite(far[rows, who])[:, None]
        wish = np.where(chased, unit[rows, who], self.home * units(self.xy.mean(0) - self.xy))
        self.toward(wish + self.forward, 3.0, dt, most=4.0, noise=self.noise)
        self.breathe(dt, self.speed, 0.1)
        self.go(dt)


class Escape(ForeignHerd):
    """Escape and pursuit [4]_: away from who comes from behind, after who flees ahead, as forces on the velocity."""

    speed, escape, pursue, reach, friction, noise, bowl = 1.8, 3.0, 1.5, 2.5, 1.0, 0.8, 0.12

    def step(self, dt):
        offset, d = self.pairs()
        unit = offset / d[..., None]
        velocity = self.forward * self.pace[:, None]
        closing = -np.einsum("ijk,ijk->ij", velocity[None] - velocity[:, None], unit)
        before = np.einsum("ijk,ik->ij", unit, self.forward) > 0
        near = d < self.reach
        chase = np.where(near & before & (closing < 0), self.pursue * -closing, 0.0)
        flee = np.where(near & ~before & (closing > 0), -self.escape * closing, 0.0)
        many = np.maximum(near.sum(1), 1)[:, None]
        force = np.einsum("ij,ijk->ik", chase + flee, unit) / many + self.bowl * (self.xy.mean(0) - self.xy)
        velocity = velocity + dt * (force + self.friction * (self.speed * self.forward - velocity))
        velocity += self.noise * math.sqrt(dt) * self.rng.normal(size=velocity.shape)
        self.angle, self.pace = np.arctan2(velocity[:, 1], velocity[:, 0]), np.hypot(*velocity.T)
        self.go(dt)


class Projection(ForeignHerd):
    """Vision [5]_: each steers to where its view changes from bodies to sky, and with its nearest neighbours."""

    speed, edges, align, nearest, noise, size = 2.5, 0.5, 0.6, 4, 0.5, 0.35

    def begin(self):
        xy, angle = super().begin()
        return xy, 0.5 * angle

    def step(self, dt):
        offset, d = self.pairs()
        views = np.linspace(-math.pi, math.pi, 128, endpoint=False)
        off = wrapped(np.arctan2(offset[..., 1], offset[..., 0])[..., None] - views)
        dark = (np.abs(off) < np.arctan(self.size / d)[..., None]).any(1)
        border = (dark != np.roll(dark, 1, axis=1)).astype(float)
        seen = border @ np.column_stack([np.cos(views), np.sin(views)]) / np.maximum(border.sum(1), 1.0)[:, None]
        near = np.argsort(d, axis=1)[:, : self.nearest]
        self.toward(self.edges * seen + self.align * self.forward[near].mean(1), 4.0, dt, noise=self.noise)
        self.breathe(dt, self.speed)
        self.go(dt)


class Bursts(ForeignHerd):
    """Burst and coast [6]_: a kick now and then, to a heading between the others' and theirs, and slowing between."""

    speed, every, fade, align, pull, noise, reach = 3.0, 0.5, 0.9, 0.8, 0.25, 0.35, 5.0

    def begin(self):
        self.aim = None
        return super().begin()

    def step(self, dt):
        if self.aim is None:
            self.aim = self.angle.copy()
        offset, d = self.pairs()
        seen = (d < self.reach)[..., None]
        many = np.maximum(seen.sum(1), 1)
        wish = self.forward + self.align * (seen * self.forward[None]).sum(1) / many
        wish = wish + self.pull * (seen * offset).sum(1) / many
        kicks = self.rng.random(self.n) < dt / self.every
        aim = np.arctan2(wish[:, 1], wish[:, 0]) + self.noise * self.rng.normal(size=self.n)
        self.aim = np.where(kicks, aim, self.aim)
        self.pace = np.where(kicks, self.speed, self.pace * math.exp(-dt / self.fade))
        self.toward(np.column_stack([np.cos(self.aim), np.sin(self.aim)]), 8.0, dt)
        self.go(dt)


class CuckerSmale(ForeignHerd):
    """Velocities drawn to each other the less the farther [7]_, in a bowl that turns the flock round, and a core."""

    speed, strength, fall, bowl, noise, room = 2.0, 0.5, 0.6, 0.05, 0.9, 1.3

    def step(self, dt):
        offset, d = self.pairs()
        velocity = self.forward * self.pace[:, None]
        draw = self.strength / (1.0 + np.where(np.isfinite(d), d, 0.0) ** 2) ** self.fall * np.isfinite(d)
        force = np.einsum("ij,ijk->ik", draw, velocity[None] - velocity[:, None]) + self.bowl * (
            self.xy.mean(0) - self.xy
        )
        force += np.einsum("ij,ijk->ik", np.clip(1 - d / self.room, 0, None) * -6.0, offset / d[..., None])
        velocity = velocity + dt * (force + (1 - (self.pace / self.speed) ** 2)[:, None] * velocity)
        velocity += self.noise * math.sqrt(dt) * self.rng.normal(size=velocity.shape)
        self.angle, self.pace = np.arctan2(velocity[:, 1], velocity[:, 0]), np.hypot(*velocity.T)
        self.go(dt)


UNSEEN = {
    "vectorial noise": (VectorialNoise, {}),
    "active brownian": (ActiveBrownian, {}),
    "turners": (Turners, {}),
    "pursuit": (Pursuit, {}),
    "escape": (Escape, {}),
    "projection": (Projection, {}),
    "bursts": (Bursts, {}),
    "cucker-smale": (CuckerSmale, {}),
}
MODELS.update(UNSEEN)
