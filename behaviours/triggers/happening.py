"""What happens once: named events, deaths and births near by."""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.amounts import Length
from flockbrush.behaviours.trigger import ANYONE, KIN, OTHERS, Condition, Names, Reference, condition, count_seen, field
from flockbrush.engine.seam import short_way_
from numba import njit


@condition
class EventHeard(Condition):
    """The animal hears a named event from a script, Python, the mouse, a zone or another trigger."""

    event: str = field(..., "name of the event", min_length=1)

    def holds(self, senses, rows):
        heard = np.zeros(len(rows), bool)
        for happening in senses.events:
            if happening.name != self.event:
                continue
            if happening.entity:
                heard |= senses.ids[rows] == happening.entity
            elif np.isinf(happening.reach):
                heard[:] = True
            else:
                _hear(senses.xyz, rows, *happening.xyz[:2], happening.reach, senses.wrap, heard)
        return heard

    def references(self):
        yield Reference("event", self.event)


@njit(cache=True, nogil=True)
def _hear(xyz, rows, x, y, reach, wrap, heard):
    """Who is within reach of a place, in plan; across the seam of a periodic map too."""
    for k in range(len(rows)):
        dx, dy = short_way_(xyz[rows[k], 0] - x, xyz[rows[k], 1] - y, wrap)
        heard[k] = heard[k] or dx * dx + dy * dy <= reach * reach


@condition
class DeathOf(Condition):
    """An animal was removed from the world (caught, arrived, deleted) where this animal could see it."""

    needs = ("deaths",)
    death_of: Names = field(..., "species, `kin`, `others` or `anyone`")
    within: Length | None = field(None, "largest distance")

    def holds(self, senses, rows):
        held = np.zeros(len(rows), bool)
        if not senses.deaths:
            return held
        reach = np.inf if self.within is None else self.within.of(senses.length[rows])
        for death in senses.deaths:
            concerned = concerns(self.death_of, death.name, senses, rows)
            if concerned.any():
                held |= concerned & senses.perceives(rows, death, reach)
        return held

    def references(self):
        return (Reference("species", name) for name in self.death_of)


@condition
class BirthOf(Condition):
    """An animal was born or added to the world where this animal can see it."""

    needs = ("births",)
    birth_of: Names = field(..., "species, `kin`, `others` or `anyone`")
    within: Length | None = field(None, "largest distance")

    def holds(self, senses, rows):
        if not senses.births.any():
            return np.zeros(len(rows), bool)
        return count_seen(senses, rows, self.birth_of, self.within, senses.births) > 0

    def references(self):
        return (Reference("species", name) for name in self.birth_of)


def concerns(names, species, senses, rows):
    """(k,) bool: whether an animal of this species is one of the names, for each animal."""
    same = senses.is_kin(species)[rows]
    is_named = ANYONE in names or species in names
    return np.full(len(rows), is_named) | (same & (KIN in names)) | (~same & (OTHERS in names))
