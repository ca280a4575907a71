"""How many neighbours the animal sees."""

from __future__ import annotations

from flockbrush.behaviours.amounts import Length
from flockbrush.behaviours.trigger import ANYONE, Condition, Names, Reference, condition, count_seen, given


class _Count(Condition):
    """Counts visible neighbours."""

    def count(self, senses, rows):
        return count_seen(senses, rows, self.species, self.within)

    def references(self):
        return (Reference("species", name) for name in self.species)


@condition
class SeesMoreThan(_Count):
    """The animal sees more neighbours than so many."""

    sees_more_than: int = given(..., "how many", ge=0, le=10_000)
    species: Names = given((ANYONE,), "of which species: names, `kin`, `others` or `anyone`")
    within: Length | None = given(None, "only those nearer than this")

    def holds(self, senses, rows):
        return self.count(senses, rows) > self.sees_more_than


@condition
class SeesFewerThan(_Count):
    """The animal sees fewer neighbours than so many."""

    sees_fewer_than: int = given(..., "how many", ge=1, le=10_000)
    species: Names = given((ANYONE,), "of which species: names, `kin`, `others` or `anyone`")
    within: Length | None = given(None, "only those nearer than this")

    def holds(self, senses, rows):
        return self.count(senses, rows) < self.sees_fewer_than
