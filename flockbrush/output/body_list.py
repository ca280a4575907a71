"""The bodies of animals during a run: species and size, which edits of a recording may change."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class AnimalBody(NamedTuple):
    """The body of an animal during a part of a run."""

    species: int  # index of the species
    length: float  # m
    width: float  # m


class BodyList:
    """All bodies that each animal has had.

    Attributes
    ----------
    of : dict of int to list of AnimalBody
        By id, in the order in which the animals and their bodies appeared; each body once.
    """

    def __init__(self):
        self.of: dict[int, list[AnimalBody]] = {}
        self._ids, self._last, self._numbers = np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0, np.int64)

    def take(self, moment) -> np.ndarray:
        """(n,) index of the body that each animal of a moment has, in its own list of `of`."""
        now = np.column_stack([moment.species, moment.length, 2 * moment.radius]).astype(float)
        numbers, changed = np.zeros(len(moment), np.int64), np.ones(len(moment), bool)
        if np.array_equal(self._ids, moment.ids):
            numbers, changed = self._numbers.copy(), (now != self._last).any(axis=1)
        for row in np.flatnonzero(changed).tolist():
            species, length, width = now[row].tolist()
            body, known = AnimalBody(int(species), length, width), self.of.setdefault(int(moment.ids[row]), [])
            if body not in known:
                known.append(body)
            numbers[row] = known.index(body)
        self._ids, self._last, self._numbers = moment.ids, now, numbers
        return numbers
