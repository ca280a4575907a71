"""Alone for some time."""

from __future__ import annotations

from flockbrush.behaviours.amounts import Length, TimeRange
from flockbrush.behaviours.trigger import KIN, Condition, Names, Reference, condition, count_seen, field


@condition
class AloneFor(Condition):
    """The animal has seen no animal of its own species for some time."""

    remembers = True

    alone_for: TimeRange = field(..., "how long; with a range, each animal draws its own")
    species: Names = field((KIN,), "species that must be absent: names, `kin`, `others` or `anyone`")
    within: Length | None = field(None, "animals farther away than this do not count")

    def holds(self, senses, rows):
        last = senses.last(self, rows)
        wait = senses.drawn(self.stream, self.alone_for, rows, last)
        return (senses.tick - last) * senses.dt >= wait

    def held(self, senses, rows):
        return count_seen(senses, rows, self.species, self.within) > 0

    def memory(self):
        return "company", self.species, self.within

    def references(self):
        return (Reference("species", name) for name in self.species)
