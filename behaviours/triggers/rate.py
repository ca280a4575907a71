"""Chance: so often a second, more often the more neighbours do so."""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.amounts import Length, Rate
from flockbrush.behaviours.trigger import KIN, OTHERS, Condition, Names, NeighbourFilter, Reference, condition, field
from flockbrush.engine.maths import exp_, log_
from flockbrush.engine.noise import uniform_
from flockbrush.engine.parallel import over_rows
from numba import njit


@condition
class RandomRate(Condition):
    """At random, at a rate: the probability in a tick is 1 - exp(-rate dt).

    With ``imitating`` it grows with the number m of visible neighbours in a state, with ``spread`` and ``packed`` with
    the mean distance l to the nearest ones:
    rate ((l / spread or packed / l) (1 + gain m))^power (Ginelli et al. 2015, eqs. 1 and 2).
    """

    rate: Rate = field(..., "the rate")
    imitating: Names | None = field(
        None, "states of visible neighbours that increase the rate; PROGRAM/STATE names a state of another program"
    )
    gain: float = field(1.0, "multiplies the rate by 1 + gain × the number of such neighbours", ge=0, le=10_000)
    power: float = field(1.0, "exponent of the product of all these factors", ge=0.1, le=10)
    spread: Length | None = field(
        None, "multiplies the rate by the mean distance of the nearest neighbours, divided by this"
    )
    packed: Length | None = field(
        None, "multiplies the rate by this, divided by the mean distance of the nearest neighbours"
    )
    nearest: int = field(0, "number of nearest neighbours that count; 0: all visible ones", ge=0, le=100)
    within: Length | None = field(None, "neighbours farther away than this do not count")
    species: Names = field((KIN,), "species that count: names, `kin`, `others` or `anyone`")

    def holds(self, senses, rows):
        many = len(senses.ids)
        flags = np.zeros(many, np.uint8)
        for state in self.imitating or ():
            flags |= senses.in_state(state)
        factor = np.ones(len(rows))
        if self.imitating or self.spread or self.packed:
            self._weigh(senses, rows, flags, factor)
        chance = np.empty(len(rows), bool)
        key = senses.key(self.stream)
        over_rows(_chance, len(rows), rows, senses.ids, key, self.rate.low * senses.dt, factor, self.power, chance)
        return chance

    def _weigh(self, senses, rows, flags, factor):
        counts, distance = neighbourhood(senses, rows, self.species, self.within, self.nearest, flags)
        factor *= 1.0 + self.gain * counts
        if self.spread is not None:
            factor *= distance / self.spread.of(senses.length[rows])
        if self.packed is not None:
            factor *= np.where(distance > 0, self.packed.of(senses.length[rows]) / np.maximum(distance, 1e-9), 0.0)

    def references(self):
        yield from (Reference("state", name) for name in self.imitating or ())
        yield from (Reference("species", name) for name in self.species)


def neighbourhood(senses, rows, names, within, nearest, flags):
    """(k,) flagged ones among the nearest visible neighbours, and (k,) m, their mean distance; 0 if there are none."""
    reach = np.full(len(senses.ids), np.inf) if within is None else within.of(senses.length) + 0.0 * senses.length
    flagged = senses.flags(names)
    counts, distance = np.zeros(len(rows), np.int64), np.zeros(len(rows))
    most, query = nearest or 1_000_000, NeighbourFilter(flagged, senses.kin, KIN in names, OTHERS in names)
    for lists in senses.seen:
        over_rows(_neighbourhood, len(rows), rows, lists, query, flags, reach, most, counts, distance)
    return counts, distance


@njit(cache=True, nogil=True, error_model="numpy")
def _neighbourhood(lo, hi, rows, lists, asked, flags, reach, most, counts, distance):
    first, near, offset = lists
    wanted, kind, kin, others = asked
    longest = 1
    for k in range(lo, hi):
        longest = max(longest, first[rows[k] + 1] - first[rows[k]])
    d2, flagged = np.empty(longest), np.empty(longest, np.uint8)
    for k in range(lo, hi):
        i, n = rows[k], 0
        r2 = reach[i] * reach[i]
        for at in range(first[i], first[i + 1]):
            j = near[at]
            same = kind[j] == kind[i]
            if not (wanted[j] or (kin and same) or (others and not same)):
                continue
            square = 0.0
            for c in range(offset.shape[1]):
                square += offset[at, c] * offset[at, c]
            if square <= r2:
                d2[n], flagged[n] = square, flags[j]
                n += 1
        if n == 0:
            continue
        # the nearest few, by picking the smallest again and again
        total, few = 0.0, min(n, most)
        for m in range(few):
            if few < n:
                best = m
                for q in range(m + 1, n):
                    if d2[q] < d2[best]:
                        best = q
                d2[m], d2[best] = d2[best], d2[m]
                flagged[m], flagged[best] = flagged[best], flagged[m]
            total += np.sqrt(d2[m])
            counts[k] += flagged[m]
        distance[k] = total / few


@njit(cache=True, nogil=True, error_model="numpy")
def _chance(lo, hi, rows, ids, key, rate, factor, power, chance):
    for k in range(lo, hi):
        f = factor[k]
        if power != 1.0:
            f = exp_(power * log_(f)) if f > 0.0 else 0.0
        chance[k] = uniform_(key, ids[rows[k]], 0) < 1.0 - exp_(-rate * f)
