"""What programs may ask about the animals: `flockbrush.behaviours.trigger.Senses`, answered by a world."""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import read_only
from flockbrush.behaviours.trigger import ANYONE, Happening, SeenNeighbours
from flockbrush.components import (
    Alarm,
    Body,
    Destination,
    Ground,
    Heading,
    Position,
    ProgramState,
    Species,
    Velocity,
    Vision,
)
from flockbrush.engine.clock import Clock
from flockbrush.engine.maths import sincos_
from flockbrush.engine.noise import Noise, key_, uniform_
from flockbrush.systems.far_sight import Eyes, count_far, sees_place
from flockbrush.systems.fauna import SOLITARY, SpeciesList
from flockbrush.systems.ground_height import heights_of_ground
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.named_regions import away_from_region, in_goal, in_region
from flockbrush.systems.senses import Near, Sight, SightInSpace
from numba import njit


class WorldSenses:
    """The columns and answers of one tick; what costs something is worked out when first asked for."""

    def __init__(self, world, programs, events):
        agents, clock = world.agents, world.resource(Clock)
        self._world, self._agents, self._programs = world, agents, programs
        self._land = world.resource(Landscape)
        self._noise, self._cache = world.resource(Noise), {}
        self.dt, self.tick = clock.dt, clock.tick
        self.ids, self.xyz, self.velocity = agents.ids, agents[Position.xyz], agents[Velocity.xyz]
        self.length = agents[Body.length]
        self.species, self.slope = agents[Species.index], agents[Ground.slope]
        self.kin = self._kin_labels()[self.species]
        self.since, self.state = agents[ProgramState.since].copy(), agents[ProgramState.state].copy()
        self.wrap = self._land.wrap or (0.0, 0.0)
        lists = (world.resource(Sight).lists, world.resource(SightInSpace).lists)
        self.seen = tuple(SeenNeighbours(*seen) for seen in lists if seen is not None and len(seen.near))
        self.events = events
        self._births, self._deaths = _changes(agents, programs.known, self._species_names)

    @property
    def before(self):
        """(n, 3) m/s, the velocity one tick ago."""
        return self._kept("before", self._agents[ProgramState.before])

    @property
    def births(self):
        """(n,) uint8, who was not there in the last tick."""
        return self._kept("births", self._births)

    @property
    def deaths(self):
        """Of the last tick."""
        return self._kept("deaths", self._deaths)

    def _kept(self, name, value):
        if name not in self._programs.needs:
            raise AttributeError(f'a condition that asks for senses.{name} must say so: needs = ("{name}",)')
        return value

    @property
    def _species_names(self):
        return self._world.resource(SpeciesList).names

    def _kin_labels(self):
        """(species,) the same number for species that keep together, another for each other species."""
        kin = self._world.resource(SpeciesList).table.kin.copy()
        alone = np.flatnonzero(kin == SOLITARY)
        kin[alone] = len(kin) + alone
        return kin

    def program(self, compiled):
        """Answer for the animals of this program from now on."""
        self._slots, self._program = compiled.slots, compiled.program.name

    def _once(self, key, make):
        if key not in self._cache:
            self._cache[key] = make()
        return self._cache[key]

    # chance

    def stream(self, name):
        """Noise stream of a name, for `flockbrush.engine.noise.key_`."""
        return self._noise.stream(name)

    def key(self, name):
        """Noise key of a stream in this tick."""
        return self._noise.key(name, self.tick)

    def uniform(self, name, rows):
        """(k,) numbers in [0, 1)."""
        return self._noise.uniform(name, self.tick, self.ids[rows])[:, 0]

    def drawn(self, name, amount, rows, ticks=None):
        """(k,) an amount, drawn where it is a range: the same number for the same tick."""
        if amount.low == amount.high:
            return np.full(len(rows), amount.low)
        ticks = np.full(len(rows), self.tick) if ticks is None else ticks
        out = np.empty(len(rows))
        _draw(self.stream(name), self.ids, rows, np.ascontiguousarray(ticks), amount.low, amount.high, out)
        return out

    # who

    def flags(self, names):
        """(n,) uint8, who is of one of these species."""
        return self._once(("flags", names), lambda: self._flags(names))

    def _flags(self, names):
        if ANYONE in names:
            return np.ones(len(self.ids), np.uint8)
        indices = [k for k, name in enumerate(self._species_names) if name in names]
        flags = np.zeros(len(self.ids), np.uint8)
        for k in indices:
            flags |= self.species == k
        return flags

    def is_kin(self, name):
        """(n,) bool, whose own kind a species is."""
        names = self._species_names
        label = self._kin_labels()[names.index(name)] if name in names else -1
        return self.kin == label

    def in_state(self, name):
        """(n,) uint8, who is in the state of this name of the program asked for; PROGRAM/STATE is that of another."""
        program, _, state = name.rpartition("/")
        key = program or self._program, state
        return self._once(("state", *key), lambda: self._in_state(*key))

    def _in_state(self, program, state):
        if program not in self._programs.names:
            return np.zeros(len(self.ids), np.uint8)
        k = self._programs.named(program)
        number = self._programs.compiled[k].number.get(state, -1)
        return ((self._agents[ProgramState.program] == k) & (self.state == number)).astype(np.uint8)

    # where

    def inside(self, region):
        """(n,) bool, who is in the region of this name."""
        return self._once(("region", region), lambda: in_region(region, self.xyz, self._land))

    def at_goal(self, goal):
        """(n,) bool, who stands in this goal; "" is each one's own."""
        return self._once(("goal", goal), lambda: self._at_goal(goal))

    def _at_goal(self, name):
        arrived = np.zeros(len(self.ids), bool)
        bound = self._agents[Destination.goal]
        for k, goal in enumerate(self._land.goals):
            if goal.name == name or not name:
                arrived |= in_goal(goal, self.xyz, self._land.wrap) & ((bound == k) | bool(name))
        return arrived

    def away(self, place):
        """(n,) m in plan to the middle of the nearest goal or region of this name; infinite where there is none."""
        return self._once(("away", place), lambda: away_from_region(place, self.xyz, self._land))

    def height(self):
        """(n,) m above the ground."""
        return self._once("height", lambda: self.xyz[:, 2] - heights_of_ground(self._land.heights, self.xyz))

    # memory and sight

    def ground(self, name):
        """(n,) a property of the ground under each animal."""
        return self._once(("ground", name), lambda: read_only(self._land.ground_at(name, self.xyz)))

    def last(self, memory, rows):
        """(k,) tick in which what the condition remembers last held, before this one."""
        return self._agents[ProgramState.memory][rows, self._slots[memory.memory()]]

    def count_far(self, rows, flags, reach):
        """(k,) how many of the animals with a flag are seen within a reach (n,), by the eyes of the species."""
        targets = np.flatnonzero(flags).astype(np.int32)
        return count_far(self._eyes(), rows, targets, reach)

    def _eyes(self):
        return self._once("eyes", self._make_eyes)

    def _make_eyes(self):
        agents, land, table = self._agents, self._land, self._world.resource(SpeciesList).table
        aloft = self._world.resource(Near).aloft
        aloft = np.zeros(len(self.ids), np.bool_) if aloft is None else aloft
        cosine = np.array([-1.0 if v >= np.pi else sincos_(v)[1] for v in table.view / 2.0])[self.species]
        return Eyes(
            self.xyz, agents[Heading.forward], np.where(agents[Alarm.level] > 0.0, -1.0, cosine),
            np.where(aloft, 0.0, table.eyes[self.species] * self.length), np.where(aloft, 0.0, agents[Body.radius]),
            aloft, land.opaque.ends, land.opaque_solids, land.heights,
        )  # fmt: skip

    def perceives(self, rows, happening, within):
        """(k,) bool, who has this place within a distance (m), in view and not behind a wall."""
        reach = np.minimum(within, np.inf) + np.zeros(len(rows))
        reach = np.where(np.isinf(reach), self._agents[Vision.range][rows], reach)
        return sees_place(self._eyes(), rows, happening.xyz, reach)


def _changes(agents, known, species_names):
    """(births, deaths): (n,) uint8, and [Happening], since the last tick."""
    births, deaths = np.zeros(len(agents), np.uint8), []
    if known is None:
        return births, deaths
    ids, xyz, species = known
    births[:] = ~np.isin(agents.ids, ids)
    for row in np.flatnonzero(~np.isin(ids, agents.ids)).tolist():
        deaths.append(Happening(species_names[species[row]], tuple(xyz[row].tolist())))
    return births, deaths


@njit(cache=True, nogil=True)
def _draw(stream, ids, rows, ticks, low, high, out):
    for k in range(len(rows)):
        out[k] = low + (high - low) * uniform_(key_(stream, ticks[k]), ids[rows[k]], 0)
