"""Regions of the level: its zones, areas and goals with an area, by name."""

from __future__ import annotations

from flockbrush.behaviours.amounts import TimeRange
from flockbrush.behaviours.trigger import Condition, Reference, condition, field


class _Region(Condition):
    """Has to do with one region; it is remembered when the animal was last inside."""

    remembers = True

    @property
    def region(self):
        """The region's name."""
        return getattr(self, next(iter(type(self).model_fields)))

    def held(self, senses, rows):
        return senses.inside(self.region)[rows]

    def memory(self):
        return "region", self.region

    def references(self):
        yield Reference("region", self.region)


@condition
class Inside(Condition):
    """The animal is in a region."""

    inside: str = field(..., "a zone, an area or a goal of the level")

    def holds(self, senses, rows):
        return senses.inside(self.inside)[rows]

    def references(self):
        yield Reference("region", self.inside)


@condition
class Enters(_Region):
    """The animal enters a region in this tick. An animal born in the region does not enter it."""

    enters: str = field(..., "a zone, an area or a goal of the level")

    def holds(self, senses, rows):
        return senses.inside(self.enters)[rows] & (senses.last(self, rows) < senses.tick - 1)


@condition
class Leaves(_Region):
    """The animal leaves a region in this tick."""

    leaves: str = field(..., "a zone, an area or a goal of the level")

    def holds(self, senses, rows):
        return ~senses.inside(self.leaves)[rows] & (senses.last(self, rows) == senses.tick - 1)


@condition
class SinceIn(_Region):
    """At least this time has passed since the animal was last in a region, for example thirst.

    The time counts from birth if the animal was never there.
    """

    since_in: str = field(..., "a zone, an area or a goal of the level")
    at_least: TimeRange = field(..., "how long ago; with a range, each animal draws its own")

    def holds(self, senses, rows):
        last = senses.last(self, rows)
        wait = senses.drawn(self.stream, self.at_least, rows, last)
        return (senses.tick - last) * senses.dt >= wait
