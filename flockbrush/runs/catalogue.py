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
from flockbrush.systems.program_reports import state_codes, state_names


class Label(NamedTuple):
    """A name that every animal bears, which may be empty."""

    names: Callable  # function (world) -> tuple of str; all there are now
    codes: Callable  # function (world) -> (n,) int; a new array: which of them each animal bears


LABELS: dict[str, Label] = {  # by name; who declares such a column registers it here
    "group": Label(group_names, lambda world: groups_of(world) - 1),
    "family": Label(family_names, lambda world: world.agents[Family.number].copy()),
    "state": Label(lambda world: tuple(state_names(world)) or ("",), state_codes),
}


class Catalogue:
    """What a run has had so far.

    Attributes
    ----------
    palette : Palette
        The brushes, each as it was last; that of the world itself where nothing else was ever there.
    species : dict of str to SpeciesSpec or None
        None for a mere name.
    """

    def __init__(self):
        self.palette, self.species = Palette(), {}
        self._brushes: dict = {}
        self._index: dict[str, dict[str, int]] = {name: {} for name in ("species", "brush", *LABELS)}
        self._seen: dict[str, tuple] = {}  # names of the world at the last look
        self._tables: dict[str, np.ndarray] = {}  # index in the catalogue of each of them, where that differs

    @property
    def words(self) -> dict[str, list[str]]:
        """{column: names by index} of species, brush and all labels."""
        return {column: list(index) for column, index in self._index.items()}

    def note(self, world, labels=True):
        """Add what a world has now; this is cheaper without labels."""
        palette, fauna = world.resource(Palette), world.resource(SpeciesList)
        self.species |= dict(zip(fauna.names, fauna.assets, strict=True))
        self._brushes |= {brush.name: brush for brush in palette.brushes}
        if len(self._brushes) == len(palette) and list(self._brushes) == palette.names:
            self.palette = palette
        elif self.palette.brushes != list(self._brushes.values()):
            self.palette = Palette(self._brushes.values())
        self._add("species", tuple(fauna.names))
        self._add("brush", tuple(palette.names))
        for column, label in LABELS.items() if labels else ():
            self._add(column, label.names(world))

    def _add(self, column, names):
        if self._seen.get(column) == names:
            return
        index = self._index[column]
        table = np.array([index.setdefault(name, len(index)) for name in names], np.int64)
        self._seen[column] = names
        self._tables.pop(column, None)
        if not np.array_equal(table, np.arange(len(table))):
            self._tables[column] = table

    def codes(self, column, codes):
        """Indices (n,) into the names of the world at the last look, as indices into those of the catalogue."""
        table = self._tables.get(column)
        return codes if table is None else table[codes].astype(codes.dtype)


def catalogue_of(world, labels=True) -> Catalogue:
    """The catalogue of a world, with what it has now."""
    catalogue = world.resource(Catalogue) if world.has(Catalogue) else world.insert(Catalogue())
    catalogue.note(world, labels)
    return catalogue
