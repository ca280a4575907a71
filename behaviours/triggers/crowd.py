"""How many neighbours the animal sees."""

from __future__ import annotations

from flockbrush.behaviours.amounts import Length
from flockbrush.behaviours.trigger import ANYONE, Condition, Names, Reference, condition, count_seen, field


class _Count(Condition):
    """Counts visible neighbours."""

    def count(self, senses, rows):
        return count_seen(senses, rows, self.species, self.within)

    def references(self):
        return (Reference("species", name) for name in self.species)


@condition
class SeesMoreThan(_Count):
    """The animal sees more neighbours than this."""

    sees_more_than: int = field(..., "number of animals", ge=0, le=10_000)
    species: Names = field((ANYONE,), "species to count: names, `kin`, `others` or `anyone`")
    within: Length | None = field(None, "animals farther away than this do not count")

    def holds(self, senses, rows):
        return self.count(senses, rows) > self.sees_more_than


@condition
class SeesFewerThan(_Count):
    """The animal sees fewer neighbours than this."""

    sees_fewer_than: int = field(..., "number of animals", ge=1, le=10_000)
    species: Names = field((ANYONE,), "species to count: names, `kin`, `others` or `anyone`")
    within: Length | None = field(None, "animals farther away than this do not count")

    def holds(self, senses, rows):
        return self.count(senses, rows) < self.sees_fewer_than
