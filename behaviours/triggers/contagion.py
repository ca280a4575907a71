"""What the neighbours that are seen do: states spread from animal to animal."""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.amounts import Length
from flockbrush.behaviours.trigger import KIN, Condition, Names, Reference, condition, count_seen, field


@condition
class ShareOfSeenIn(Condition):
    """At least a share of the visible neighbours is in a state."""

    share_of_seen_in: Names = field(..., "states of the same program; PROGRAM/STATE names a state of another program")
    at_least: float = field(..., "share of the visible animals", gt=0, le=1)
    species: Names = field((KIN,), "species to count: names, `kin`, `others` or `anyone`")
    within: Length | None = field(None, "animals farther away than this do not count")
    of: int = field(1, "smallest number of visible animals", ge=1, le=10_000)

    def holds(self, senses, rows):
        flags = np.zeros(len(senses.ids), np.uint8)
        for state in self.share_of_seen_in:
            flags |= senses.in_state(state)
        if not flags.any():  # a share above 0 of no animals does not hold
            return np.zeros(len(rows), bool)
        visible = count_seen(senses, rows, self.species, self.within)
        some = count_seen(senses, rows, self.species, self.within, flags)
        return (visible >= self.of) & (some >= self.at_least * visible)

    def references(self):
        yield from (Reference("state", name) for name in self.share_of_seen_in)
        yield from (Reference("species", name) for name in self.species)
