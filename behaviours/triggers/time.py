"""Time: of the level, in a state, since a state."""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.amounts import Time, TimeRange
from flockbrush.behaviours.trigger import Condition, Reference, condition, field


@condition
class LevelTime(Condition):
    """The time since the start of the level is in a range."""

    level_time: Time = field(..., "earliest time")
    until: Time | None = field(None, "latest time")

    def holds(self, senses, rows):
        now = senses.tick * senses.dt
        holds = now >= self.level_time.low and (self.until is None or now <= self.until.low)
        return np.full(len(rows), holds)

    def oddity(self):
        past = self.until is not None and self.until.low < self.level_time.low
        return f"never holds: until {self.until} is before {self.level_time}" if past else ""


@condition
class TimeInState(Condition):
    """The animal has been in its state for at least this time."""

    time_in_state: TimeRange = field(..., "how long; with a range, each animal draws its own")

    def holds(self, senses, rows):
        since = senses.since[rows]
        wait = senses.drawn(self.stream, self.time_in_state, rows, since)
        return (senses.tick - since) * senses.dt >= wait


@condition
class SinceState(Condition):
    """At least this time has passed since the animal was last in a state, for example tiredness.

    The time counts from birth if the animal was never in it.
    """

    remembers = True

    since_state: str = field(..., "a state")
    at_least: TimeRange = field(..., "how long ago; with a range, each animal draws its own")

    def holds(self, senses, rows):
        last = senses.last(self, rows)
        wait = senses.drawn(self.stream, self.at_least, rows, last)
        return (senses.tick - last) * senses.dt >= wait

    def held(self, senses, rows):
        return senses.in_state(self.since_state)[rows].astype(bool)

    def memory(self):
        return "state", self.since_state

    def references(self):
        yield Reference("state", self.since_state)
