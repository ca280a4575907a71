"""What the animals of a run are called by: species, brushes, groups, families and states, by index.

A world may drop or rename what it had, and frames of a recording with edits of time (`flockbrush.runs.run_edits`) join
animals of different times.  The catalogue of a run only grows, so that an index means the same in all its moments.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flockbrush.components import Family
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.groups import family_names, group_names, groups_of
from flockbrush.systems.palette import Palette
from flockbrush.systems.program_reports import state_codes, state_keys, state_names


class Label(NamedTuple):
    """A name that every animal bears, which may be empty."""

    names: Callable  # function (world) -> tuple of str; all there are now
    codes: Callable  # function (world) -> (n,) int; a new array: which of them each animal bears
    keys: Callable | None = None  # function (world) -> tuple of str; what tells them apart, where names may change


LABELS: dict[str, Label] = {  # by name; who declares such a column registers it here
    "group": Label(group_names, lambda world: groups_of(world) - 1),
    "family": Label(family_names, lambda world: world.agents[Family.number].copy()),
    "state": Label(lambda world: tuple(state_names(world)) or ("",), state_codes, state_keys),
}


class Catalogue:
    """What a run has had so far.

    Attributes
    ----------
    words : dict of str to list of str
        {column: names by index} of species, brush and all labels; a name is the one that was seen first.
    palette : Palette
        The brushes, each as it was last; that of the world itself where nothing else was ever there.
    species : dict of str to SpeciesSpec or None
        None for a mere name.
    """

    def __init__(self):
        self.palette, self.species = Palette(), {}
        self._brushes: dict = {}
        self._index: dict[str, dict[str, int]] = {name: {} for name in ("species", "brush", *LABELS)}  # by key
        self.words: dict[str, list[str]] = {name: [] for name in self._index}
        self._seen: dict[str, tuple] = {}  # names of the world at the last look
        self._tables: dict[str, np.ndarray] = {}  # index in the catalogue of each of them, where that differs

    def note(self, world, labels=LABELS):
        """Add what a world has now, of `LABELS` only these: groups take time to find."""
        palette, fauna = world.resource(Palette), world.resource(SpeciesList)
        self.species |= dict(zip(fauna.names, fauna.assets, strict=True))
        self._brushes |= {brush.name: brush for brush in palette.brushes}
        if len(self._brushes) == len(palette) and list(self._brushes) == palette.names:
            self.palette = palette
        elif self.palette.brushes != list(self._brushes.values()):
            self.palette = Palette(self._brushes.values())
        self._add("species", tuple(fauna.names))
        self._add("brush", tuple(palette.names))
        for column in labels:
            label = LABELS[column]
            self._add(column, label.names(world), label.keys and label.keys(world))

    def _add(self, column, names, keys=None):
        keys = keys or names
        if self._seen.get(column) == keys:
            return
        index, words = self._index[column], self.words[column]
        for key, name in zip(keys, names, strict=True):
            if key not in index:
                index[key] = len(words)
                words.append(key if key != name and name in words else name)
        table = np.array([index[key] for key in keys], np.int64)
        self._seen[column] = keys
        self._tables.pop(column, None)
        if not np.array_equal(table, np.arange(len(table))):
            self._tables[column] = table

    def word(self, column, key):
        """The name by what makes it unique."""
        return self.words[column][self._index[column][key]]

    def codes(self, column, codes):
        """Indices (n,) into the names of the world at the last look, as indices into those of the catalogue."""
        table = self._tables.get(column)
        return codes if table is None else table[codes].astype(codes.dtype)


def catalogue_of(world, labels=LABELS) -> Catalogue:
    """The catalogue of a world, with what it has now, of `LABELS` only these."""
    catalogue = world.resource(Catalogue) if world.has(Catalogue) else world.insert(Catalogue())
    catalogue.note(world, labels)
    return catalogue
