"""The systems of a tick and their order."""

from __future__ import annotations

import enum
import random
import time
from contextlib import contextmanager
from itertools import combinations

import esper
import numpy as np


class Stage(enum.IntEnum):
    """The parts of a tick, in order.  Within a stage the order must not matter."""

    COMMANDS = 0  # what designers, scripts and the replay asked for
    GROUND = 1  # what is underfoot
    NEAR = 2  # animals nearby
    SENSE = 3  # visible animals and things
    DECIDE = 4  # leader or follower, reference bird, way to go
    STEER = 5  # models turn senses into wishes
    SPEED = 6  # how fast
    MOVE = 7  # the only writer of position and velocity
    LIVE = 8  # arrivals, exits, births, deaths
    RECORD = 9  # measure, write; nothing changes state here


class System(esper.Processor):
    """A processor that declares its stage and the data it reads and writes.

    ``reads`` and ``writes`` name component classes and resource types; a base
    class stands for all its subclasses.  Keep them true: `Schedule.ambiguities`
    trusts them, and `Schedule.undeclared_writes` finds those who lie.
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

    Attributes
    ----------
    nanoseconds : dict of str to int
        Time spent since the start, by name of system; "flush" is the end of the tick.
    watch : callable or None
        Called with the name of each system when it has run, and with "flush".

    Raises
    ------
    Ambiguity
        When the order inside a stage would matter; one line for each pair.
    """

    def __init__(self, systems, shuffle_seed=None):
        systems = list(systems)
        for system in systems:
            if not isinstance(getattr(system, "stage", None), Stage):
                raise TypeError(
                    f"{type(system).__name__} must declare its stage, one of {', '.join(Stage.__members__)}"
                )
        if shuffle_seed is not None:
            random.Random(shuffle_seed).shuffle(systems)
        self.systems = sorted(systems, key=lambda s: s.stage)
        self.nanoseconds = {type(s).__name__: 0 for s in self.systems} | {"flush": 0}
        self.watch = None
        clashes = self.ambiguities()
        if clashes:
            raise Ambiguity("\n".join(_in_words(*clash) for clash in clashes))

    def run(self, world):
        """One tick."""
        for system in self.systems:
            begin = time.perf_counter_ns()
            system.process(world)
            self.nanoseconds[type(system).__name__] += time.perf_counter_ns() - begin
            if self.watch is not None:
                self.watch(type(system).__name__)
        begin = time.perf_counter_ns()
        world.flush()
        self.nanoseconds["flush"] += time.perf_counter_ns() - begin
        if self.watch is not None:
            self.watch("flush")

    @contextmanager
    def watched(self, watch):
        """Ticks in this context call ``watch`` with the name of each system when it has run."""
        self.watch = watch
        try:
            yield
        finally:
            self.watch = None

    def ambiguities(self):
        """(name, name, shared) of systems of one stage of which one writes what the other touches."""
        ambiguous = []
        for a, b in combinations(self.systems, 2):
            if a.stage == b.stage:
                shared = _overlap(a.writes, (*b.reads, *b.writes)) | _overlap(b.writes, a.reads)
                if shared:
                    ambiguous.append((type(a).__name__, type(b).__name__, shared))
        return ambiguous

    def undeclared_writes(self, world):
        """Run one tick and return (system, type) of each system that changed data it does not declare as written.

        Slow, for tests.  It sees the columns of animals that live before and
        after the system, and resources with a ``state``.
        """
        undeclared = []
        for system in self.systems:
            before = _watched(world)
            system.process(world)
            after = _watched(world)
            changed = [kind for kind in before if kind in after and _differ(before[kind], after[kind])]
            allowed = tuple(system.writes)
            undeclared += [(type(system).__name__, kind.__name__) for kind in changed if not issubclass(kind, allowed)]
        world.flush()
        return undeclared


def _overlap(some, others):
    """The types of which one side names the type itself or a base of it."""
    return {b for a in some for b in others if issubclass(b, a)} | {a for a in some for b in others if issubclass(a, b)}


def _in_words(a, b, shared):
    names = ", ".join(sorted(kind.__name__ for kind in shared))
    return f"{a} and {b} both access {names} in one stage; give them different stages"


def _watched(world):
    """{type: [copies]} of all columns and of all states of resources."""
    agents = world.agents
    columns = {kind: [agents.ids.copy(), *(agents[f].copy() for f in kind.fields.values())] for kind in agents.kinds}
    return columns | {type(r): r.state() for r in world.resources() if hasattr(r, "state")}


def _differ(before, after):
    if isinstance(before, bytes):
        return before != after
    stay, kept_after = np.isin(before[0], after[0]), np.isin(after[0], before[0])
    return any(
        not np.array_equal(old[stay], new[kept_after], equal_nan=old.dtype.kind == "f")
        for old, new in zip(before[1:], after[1:], strict=True)
    )
