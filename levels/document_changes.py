"""The two small steps in which a level's document is changed, and the way back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from flockbrush.levels.tile_data import TileGrid

MISSING: Any = object()


class EditError(ValueError):
    """The level's file cannot take this edit; the text says why."""


@dataclass
class KeySet:
    """A key of a node was set, or taken out."""

    node: dict
    key: str
    before: Any
    after: Any

    def back(self):
        """As it was."""
        put(self.node, self.key, self.before)

    def again(self):
        """As it became."""
        put(self.node, self.key, self.after)


def put(node, key, value):
    """Set a key of a node, or take it out."""
    if value is MISSING:
        node.pop(key, None)
    else:
        node[key] = value


@dataclass
class TilesPut:
    """Tiles of a layer were set."""

    grid: TileGrid
    rows: np.ndarray
    columns: np.ndarray
    before: np.ndarray
    after: np.ndarray

    def back(self):
        """As they were."""
        self.grid.put(self.rows, self.columns, self.before)

    def again(self):
        """As they became."""
        self.grid.put(self.rows, self.columns, self.after)
