"""Changes from outside as data: submitted, applied at the start of a tick, recorded, replayed."""

from __future__ import annotations

import heapq
import itertools
from dataclasses import asdict, dataclass, fields

from engine.clock import Clock

COMMANDS: dict[str, type] = {}


def command(cls):
    """Make a class with an ``apply(world)`` method a frozen dataclass, recordable by its name.

    Its fields must be numbers, strings, booleans, None, or lists and dicts of those, so that a
    recording can hold them as JSON.
    """
    cls = dataclass(frozen=True)(cls)
    if cls.__name__ in COMMANDS:
        raise ValueError(f"command {cls.__name__} is already registered by {COMMANDS[cls.__name__].__module__}")
    COMMANDS[cls.__name__] = cls
    return cls


def to_record(cmd):
    """(name, fields) of a command, ready for JSON."""
    return type(cmd).__name__, asdict(cmd)


def from_record(name, values):
    """The command of this name; ValueError that lists what there is."""
    if name not in COMMANDS:
        raise ValueError(f"unknown command {name!r}; there are {', '.join(sorted(COMMANDS))}")
    cls = COMMANDS[name]
    known = {f.name for f in fields(cls)}
    wrong = sorted(set(values) - known)
    if wrong:
        raise ValueError(f"{name} has no field {wrong[0]!r}; it has {', '.join(sorted(known))}")
    try:
        return cls(**values)
    except TypeError as error:
        raise ValueError(f"{name}: {error}") from None


class Commands:
    """The queue: what is due, and what was applied when."""

    def __init__(self):
        self._order = itertools.count()
        self._pending: list[tuple[int, int, object]] = []
        self.log: list[tuple[int, object]] = []  # (tick, command), as applied

    def submit(self, cmd, tick=0):
        """Apply a command at the start of the given tick, or of the next one if that has begun."""
        heapq.heappush(self._pending, (tick, next(self._order), cmd))

    def apply(self, world):
        """Apply all that is due, in order of tick, then of submission."""
        now = world.resource(Clock).tick
        while self._pending and self._pending[0][0] <= now:
            _, _, cmd = heapq.heappop(self._pending)
            self.log.append((now, cmd))
            cmd.apply(world)
