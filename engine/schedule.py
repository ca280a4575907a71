"""What runs in a tick, and in which order."""

from __future__ import annotations

import enum
import random
import time

import esper


class Stage(enum.IntEnum):
    """The parts of a tick, in order.  Within a stage the order must not matter."""

    COMMANDS = 0  # what designers, scripts and the replay asked for
    GROUND = 1  # what is underfoot
    NEAR = 2  # who is near
    SENSE = 3  # who and what is visible
    DECIDE = 4  # leader or follower, reference bird, way to go
    STEER = 5  # models turn senses into wishes
    SPEED = 6  # how fast
    MOVE = 7  # the only writer of position and velocity
    LIVE = 8  # arrivals, exits, births, deaths
    RECORD = 9  # measure, write; nothing changes state here


class System(esper.Processor):
    """A processor that says when it runs and what it touches.

    ``reads`` and ``writes`` name component classes and resource types.  Keep
    them true: `Schedule.ambiguities` trusts them.
    """

    stage: Stage
    reads: tuple = ()
    writes: tuple = ()

    def process(self, world):
        raise NotImplementedError


class Ambiguity(ValueError):
    """Two systems of one stage touch the same data, and one of them writes it."""


class Schedule:
    """The systems of a world in running order, timed as they run.

    Parameters
    ----------
    systems : iterable of System
        Sorted by stage; the order given is kept inside a stage.
    shuffle_seed : int, optional
        Shuffle inside the stages first: the herd must not notice.

    Raises
    ------
    Ambiguity
        When the order inside a stage would matter.
    """

    def __init__(self, systems, shuffle_seed=None):
        systems = list(systems)
        if shuffle_seed is not None:
            random.Random(shuffle_seed).shuffle(systems)
        self.systems = sorted(systems, key=lambda s: s.stage)
        self.nanoseconds = {type(s).__name__: 0 for s in self.systems}
        clashes = self.ambiguities()
        if clashes:
            a, b, shared = clashes[0]
            names = ", ".join(sorted(k.__name__ for k in shared))
            raise Ambiguity(f"{a} and {b} both touch {names} in one stage; give them different stages")

    def run(self, world):
        """One tick."""
        for system in self.systems:
            begin = time.perf_counter_ns()
            system.process(world)
            self.nanoseconds[type(system).__name__] += time.perf_counter_ns() - begin
        world.flush()

    def ambiguities(self):
        """(name, name, shared) of systems of one stage of which one writes what the other touches."""
        found = []
        for i, a in enumerate(self.systems):
            for b in self.systems[i + 1 :]:
                shared = set(a.writes) & {*b.reads, *b.writes} | set(b.writes) & set(a.reads)
                if a.stage == b.stage and shared:
                    found.append((type(a).__name__, type(b).__name__, shared))
        return found
