"""Invariants of every animal after every tick: limits, ground, obstacles, air."""

from __future__ import annotations

import numpy as np
from flockbrush.components import Body, BrushBinding, Heading, Position, Species, Transit, Velocity
from flockbrush.components.agent import SETTLED
from flockbrush.engine.solid_queries import surface_
from flockbrush.systems.binding import can_do
from flockbrush.systems.fauna import AIR, PLANE, WATER, SpeciesList
from flockbrush.systems.ground_height import steepness_at
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.spawning import inside_polygon

ROUNDING = 1e-6
PUSHED = 1.01  # largest factor above the top speed, when crowded bodies are pushed apart
FALLING = 4.0  # m/s at which walking animals fall that were placed above the ground
FALLS = 1e-6  # m above the ground
HOVER = 32  # ticks for which a flying animal may be slower than a quarter of its slowest flight


class InvariantWatch:
    """Checks a simulation after each tick; calls ``wrong`` with a message for each fault."""

    def __init__(self, simulation, wrong):
        self.simulation, self.wrong = simulation, wrong
        self.forget()

    def forget(self):
        """Forget the previous tick, after animals or the ground have changed."""
        self.before, self.slow, self.above = None, {}, set()  # above: ids of animals above the ground
        self.trod = set()  # ids of walking animals on ground that is not too steep

    def look(self):
        """Check this tick."""
        agents = self.simulation.agents
        xyz, velocity, forward = (agents[f] for f in (Position.xyz, Velocity.xyz, Heading.forward))
        if not (np.isfinite(xyz).all() and np.isfinite(velocity).all() and np.isfinite(forward).all()):
            self.wrong("not finite")
            return
        if len(xyz) and np.abs(np.linalg.norm(forward, axis=1) - 1.0).max() > ROUNDING:
            self.wrong("a heading is not a unit vector")
        world = self.simulation.world
        palette, fauna, land = world.resource(Palette), world.resource(SpeciesList), world.resource(Landscape)
        table, species, brush = fauna.table, agents[Species.index], agents[BrushBinding.brush]
        flies = palette.flies_free[brush]
        swims = table.media[species, WATER] & ~table.media[species, PLANE]
        medium = np.where(flies, AIR, np.where(swims, WATER, PLANE))
        self._abilities(palette, table, species, brush)
        self._speeds(velocity, table.speed[species, medium], species, fauna, flies, agents.ids)
        self._turns(agents.ids, forward, table.turn[species, medium], species, fauna, flies)
        ground = np.array([land.ground(xy) for xy in xyz[:, :2]])
        self.above = set(agents.ids[xyz[:, 2] - ground > FALLS].tolist())
        self._ground(agents, xyz[:, 2] - ground, flies)
        self._slopes(agents, land, table.steepest[species], species, flies)
        self._obstacles(agents, land, xyz, ground, flies)
        self._air(agents, velocity, xyz[:, 2] - ground, table.slowest[species], flies)
        self.before = agents.ids.copy(), forward.copy(), flies.copy()

    def _abilities(self, palette, table, species, brush):
        for b, s in zip(brush, species, strict=True):
            if not can_do(palette, table)[b, s]:
                name = self.simulation.world.resource(SpeciesList).names[s]
                self.wrong(f"a {name} uses the brush {palette.names[b]}, which it cannot do")
                return

    def _speeds(self, velocity, top, species, fauna, flies, ids):
        speed = np.linalg.norm(np.where(flies[:, None], velocity, velocity * (1, 1, 0)), axis=1)
        whole = np.linalg.norm(velocity, axis=1)
        falls = ~flies & (velocity[:, 2] < 0.0) & np.isin(ids, list(self.above))
        speed = np.where(falls, speed, whole)
        over = speed - top * np.where(flies, 1.0, PUSHED)
        if len(over) and over.max() > ROUNDING:
            at = int(np.argmax(over))
            where = "in the air" if flies[at] else "on the ground"
            self.wrong(f"a {fauna.names[species[at]]} {where} is faster than its species", speed[at] / top[at])

    def _turns(self, ids, forward, most, species, fauna, flies):
        if self.before is None:
            return
        old, was, flew = self.before
        both, here, there = np.intersect1d(ids, old, return_indices=True)
        same = flies[here] == flew[there]
        here, there = here[same], there[same]
        cosine = np.clip((forward[here] * was[there]).sum(1), -1.0, 1.0)
        sine = np.linalg.norm(np.cross(forward[here], was[there]), axis=1)
        angle = np.arctan2(sine, cosine)
        over = angle - most[here] / 32
        if len(over) and over.max() > 1e-5:
            i = int(np.argmax(over))
            at = here[i]
            where = "in the air" if flies[at] else "on the ground"
            self.wrong(f"a {fauna.names[species[at]]} {where} turns faster than its species", angle[i] * 32 / most[at])

    def _ground(self, agents, height, flies):
        if len(height) and height.min() < -1e-5:
            self.wrong("an animal is under the ground")
        if self.before is None:
            return
        length, radius = agents[Body.length], agents[Body.radius]
        if (~flies & (height > radius + 0.3 * length + ROUNDING)).any():
            self.wrong("a walking animal is above the ground")

    def _slopes(self, agents, land, steepest, species, flies):
        hills = land.hills_for(steepest)
        steep = np.array([steepness_at(hills, x, y) for x, y in agents[Position.xyz][:, :2]]) > steepest
        for at in np.flatnonzero(steep & ~flies & np.isin(agents.ids, list(self.trod)))[:1]:
            names = self.simulation.world.resource(SpeciesList).names
            self.wrong(f"a {names[species[at]]} walks onto ground that is too steep for its species")
        self.trod = set(agents.ids[~steep & ~flies].tolist())

    def _obstacles(self, agents, land, xyz, ground, flies):
        for barrier in land.barriers:
            if barrier.solid and (inside_polygon(xyz[~flies, :2], barrier.polygon)).any():
                self.wrong("a walking animal is in an obstacle")
        gaps = [surface_(land.sky, k, *at)[0] for k in range(len(land.sky.kind)) for at in xyz[flies]]
        if min(gaps, default=0.0) < -ROUNDING:
            self.wrong("a flying animal is in an obstacle")

    def _air(self, agents, velocity, height, slowest, flies):
        hovers = flies & (np.linalg.norm(velocity, axis=1) < 0.25 * slowest) & (agents[Transit.kind] == SETTLED)
        hovers &= height > 2.0 * agents[Body.length]
        slow = {}
        for entity in agents.ids[hovers].tolist():
            slow[entity] = self.slow.get(entity, 0) + 1
            if slow[entity] > HOVER:
                self.wrong("a flying animal hovers")
        self.slow = slow
