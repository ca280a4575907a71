"""Sees an animal of a species, or anybody at all."""

from __future__ import annotations

from flockbrush.behaviours.amounts import Length
from flockbrush.behaviours.trigger import Condition, Names, Reference, condition, count_seen, given


@condition
class Sees(Condition):
    """The animal sees at least one animal of a species. Behind a wall or another body nobody is seen."""

    sees: Names = given(..., "species, `kin` (its own), `others` (any other) or `anyone`")
    within: Length | None = given(None, "only those nearer than this")

    def holds(self, senses, rows):
        return count_seen(senses, rows, self.sees, self.within) > 0

    def references(self):
        return (Reference("species", name) for name in self.sees)


@condition
class AnyoneWithin(Condition):
    """Anybody at all is seen within a distance."""

    anyone_within: Length = given(..., "how near")

    def holds(self, senses, rows):
        return count_seen(senses, rows, within=self.anyone_within) > 0
