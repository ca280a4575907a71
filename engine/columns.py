"""Components kept in numpy columns, one row per agent.

A component such as ``Position(xyz=(3, 4, 0))`` is an ordinary object until its
entity is created.  From then on its values live in the world's `Table`, and
the same object is a window on its row: kernels read whole columns, designers
and tests read one animal.
"""

from __future__ import annotations

import numpy as np


class Field:
    """One column of a component: a default, which fixes the shape of a row, and a dtype.

    Parameters
    ----------
    default : array_like
        Value of a fresh row; its shape is the shape of every row.
    dtype : dtype
        How the column is stored.
    finite : bool
        Refuse NaN and infinity in `Component` windows (a cap may be infinite, a position may not).
    """

    def __init__(self, default, dtype=np.float64, finite=True):
        self.default = np.asarray(default, dtype)
        self.finite = finite and self.default.dtype.kind == "f"

    def __set_name__(self, owner, name):
        self.owner, self.name = owner, name
        owner.fields = {**owner.fields, name: self}

    def __repr__(self):
        return f"{self.owner.__name__}.{self.name}"

    def __get__(self, component, owner=None):
        if component is None:
            return self
        home = component._home
        if isinstance(home, Table):
            return home.arrays[self][home.row(component._entity)]
        return home.setdefault(self, self.default.copy())

    def __set__(self, component, value):
        value = self.checked(value)
        home = component._home
        if isinstance(home, Table):
            home.arrays[self][home.row(component._entity)] = value
        else:
            home[self] = np.array(value)

    def checked(self, value):
        """The value as one row of this column; ValueError when it does not fit or is not finite."""
        try:
            row = np.broadcast_to(np.asarray(value, self.default.dtype), self.default.shape)
        except (TypeError, ValueError):
            shape = self.default.shape or "a single number"
            raise ValueError(f"{self!r} holds {shape}, got {value!r}") from None
        if self.finite and not np.isfinite(row).all():
            raise ValueError(f"{self!r} must be finite, got {value!r}")
        return row


class Component:
    """Base of every component stored by column."""

    __slots__ = ("_entity", "_home")
    fields: dict[str, Field] = {}

    def __init__(self, **values):
        self._home, self._entity = {}, 0
        for name, value in values.items():
            if name not in self.fields:
                raise TypeError(f"{type(self).__name__} has no field {name!r}; it has {', '.join(self.fields)}")
            setattr(self, name, value)

    def __repr__(self):
        inside = ", ".join(f"{name}={getattr(self, name)}" for name in self.fields)
        return f"{type(self).__name__}({inside})"


class Table:
    """The agents of one world: rows in order of entity id, one array per field."""

    def __init__(self, kinds, capacity=256):
        self.kinds = tuple(kinds)
        self.count = 0
        self._ids = np.zeros(capacity, np.int64)
        self._row_of: dict[int, int] = {}
        self.arrays = {
            f: np.empty((capacity, *f.default.shape), f.default.dtype)
            for kind in self.kinds
            for f in kind.fields.values()
        }

    @property
    def ids(self):
        """(n,) entity ids, ascending."""
        return self._ids[: self.count]

    def __len__(self):
        return self.count

    def __contains__(self, entity):
        return entity in self._row_of

    def __getitem__(self, field):
        """The live rows of a column, ``table[Position.xyz]``.  Good until rows are added or removed."""
        try:
            return self.arrays[field][: self.count]
        except KeyError:
            raise KeyError(f"this world has no column {field!r}") from None

    def row(self, entity):
        """The row of an agent now.  Nobody keeps it past the tick."""
        try:
            return self._row_of[entity]
        except KeyError:
            raise KeyError(f"agent {entity} is not alive") from None

    def append(self, entities):
        """Add a row of defaults for each entity, which must be newer than every row present."""
        first, self.count = self.count, self.count + len(entities)
        if self.count > len(self._ids):
            self._grow()
        rows = slice(first, self.count)
        self._ids[rows] = entities
        self._row_of.update(zip(entities, range(first, self.count), strict=True))
        for field, array in self.arrays.items():
            array[rows] = field.default
        return rows

    def remove(self, entities):
        """Drop the rows of these entities and close the gaps, keeping the order of the rest."""
        keep = ~np.isin(self.ids, list(entities))
        kept = int(keep.sum())
        for array in (self._ids, *self.arrays.values()):
            array[:kept] = array[: self.count][keep]
        self.count = kept
        self._row_of = dict(zip(self.ids.tolist(), range(kept), strict=True))

    def _grow(self):
        capacity = max(2 * len(self._ids), self.count)
        self._ids = np.resize(self._ids, capacity)
        for field, array in self.arrays.items():
            self.arrays[field] = np.resize(array, (capacity, *array.shape[1:]))
