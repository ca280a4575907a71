"""Sees an animal of a species, or anybody at all."""

from __future__ import annotations

from flockbrush.behaviours.amounts import Length
from flockbrush.behaviours.trigger import Condition, Names, Reference, condition, count_seen, field


@condition
class Sees(Condition):
    """The animal sees at least one animal of a species. Walls hide animals."""

    sees: Names = field(..., "species, `kin` (its own kind), `others` (any other) or `anyone`")
    within: Length | None = field(None, "animals farther away than this do not count")

    def holds(self, senses, rows):
        return count_seen(senses, rows, self.sees, self.within) > 0

    def references(self):
        return (Reference("species", name) for name in self.sees)


@condition
class AnyoneWithin(Condition):
    """The animal sees any other animal within a distance."""

    anyone_within: Length = field(..., "largest distance")

    def holds(self, senses, rows):
        return count_seen(senses, rows, within=self.anyone_within) > 0
