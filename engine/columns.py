"""Components kept in numpy columns, one row per agent.

A component such as ``Position(xyz=(3, 4, 0))`` is an ordinary object until its
entity is created.  From then on its values live in the world's `Table`, and
the same object is a window on its row: kernels read whole columns, designers
and tests read one animal.
"""

from __future__ import annotations

from typing import Any, ClassVar

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

    def __reduce__(self):
        return getattr, (self.owner, self.name)  # a copy is the field itself: columns are found by it

    def __get__(self, component, owner=None) -> Any:
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
        return self.checked_rows(value, ())

    def checked_rows(self, value, rows):
        """The value as an array of shape ``(*rows, *shape of a row)``, which one row may stand for.

        Raises
        ------
        ValueError
            When it does not fit, is not finite, or would lose its fraction.
        """
        shape = (*rows, *self.default.shape)
        try:
            given = np.asarray(value)
            row = np.broadcast_to(np.asarray(value, self.default.dtype), shape)
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f"{self!r} holds {_shape_in_words(shape)}{self._kind()}, got {_short(value)}") from None
        if self.default.dtype.kind in "iu" and given.dtype.kind == "f" and not (given == np.floor(given)).all():
            raise ValueError(f"{self!r} holds whole numbers, got {_short(value)}")
        if self.finite and not np.isfinite(row).all():
            raise ValueError(f"{self!r} must be finite, got {_short(value)}")
        return row

    def _kind(self):
        return f" of {self.default.dtype}" if self.default.dtype.kind in "iu" else ""


def _shape_in_words(shape):
    return f"an array of shape {shape}" if shape else "a single number"


def _short(value):
    text = repr(value)
    return text if len(text) < 80 else f"{text[:70]}..."


class Component:
    """Base of every component stored by column.

    A kind that only some worlds use says ``optional = True``: its columns belong to the state hash only while some
    animal has another value than at birth, so worlds that never use it keep their hashes.
    """

    __slots__ = ("_entity", "_home")
    fields: ClassVar[dict[str, Field]] = {}
    optional: ClassVar[bool] = False

    def __init__(self, **values):
        self._home, self._entity = {}, 0
        for name, value in values.items():
            if name not in self.fields:
                raise TypeError(_no_field(self, name))
            setattr(self, name, value)

    def __setattr__(self, name, value):
        if name not in self.fields and name not in Component.__slots__:
            raise AttributeError(_no_field(self, name))
        object.__setattr__(self, name, value)

    def __getattr__(self, name):
        raise AttributeError(_no_field(self, name))

    def __repr__(self):
        inside = ", ".join(f"{name}={getattr(self, name)}" for name in self.fields)
        return f"{type(self).__name__}({inside})"


def _no_field(component, name):
    return f"{type(component).__name__} has no field {name!r}; it has {', '.join(component.fields)}"


class Table:
    """The agents of one world: rows in order of entity id, one array per field.

    Rows whose bits are all zero from birth are not written, so columns that nobody uses take no memory.
    """

    def __init__(self, kinds, capacity=256):
        self.kinds = tuple(kinds)
        self.count = 0
        self._fresh = 0  # the first row never used: all zero in every column
        self._ids = np.zeros(capacity, np.int64)
        self.arrays = {
            f: np.zeros((capacity, *f.default.shape), f.default.dtype)
            for kind in self.kinds
            for f in kind.fields.values()
        }
        self.fields = {repr(f): f for f in sorted(self.arrays, key=repr)}  # in order of name

    def __repr__(self):
        return f"<Table: {self.count} animals, {len(self.fields)} columns such as {next(iter(self.fields), 'none')}>"

    @property
    def ids(self):
        """(n,) entity ids, ascending."""
        return self._ids[: self.count]

    def __len__(self):
        return self.count

    def __contains__(self, entity):
        row = self._ids[: self.count].searchsorted(entity)
        return bool(row < self.count and self._ids[row] == entity)

    def __getitem__(self, field):
        """The rows of a column, ``table[Position.xyz]``; a view that is valid until rows are added or removed."""
        try:
            return self.arrays[field][: self.count]
        except KeyError:
            own = getattr(field, "fields", None)  # of a whole component
            hint = f"; write {next(iter(own.values()))!r}" if isinstance(own, dict) and own else ""
            raise KeyError(f"this world has no column {field!r}{hint}") from None

    def row(self, entity):
        """The row of an agent, valid for this tick only."""
        row = self._ids[: self.count].searchsorted(entity)
        if row < self.count and self._ids[row] == entity:
            return int(row)
        raise KeyError(f"agent {entity} is not alive")

    def append(self, entities):
        """Add a row of defaults for each entity.

        They must ascend and be newer than every row present, for rows are found by halving.
        """
        fresh = np.asarray(entities, np.int64)
        newest = self._ids[self.count - 1] if self.count else 0
        if len(fresh) and (fresh[0] <= newest or (np.diff(fresh) <= 0).any()):
            raise ValueError("new agents need ascending ids above those of all agents present")
        first, self.count = self.count, self.count + len(fresh)
        self._reserve(self.count)
        rows, used = slice(first, self.count), slice(first, min(self._fresh, self.count))
        self._ids[rows] = fresh
        for field, array in self.arrays.items():
            here = rows if _has_bits(field.default) else used
            array[here] = field.default
        self._fresh = max(self._fresh, self.count)
        return rows

    def remove(self, entities):
        """Drop the rows of these entities and close the gaps, keeping the order of the rest."""
        keep = ~np.isin(self.ids, np.fromiter(entities, np.int64))
        kept_count = int(keep.sum())
        for array in (self._ids, *self.arrays.values()):
            array[:kept_count] = array[: self.count][keep]
        self.count = kept_count

    def replace(self, ids, columns):
        """Put these agents in the place of all that were here, as a snapshot does.

        Parameters
        ----------
        ids : (n,) int64, ascending
        columns : dict of Field to array
            Every column of this table, n rows each.
        """
        self.count = 0
        rows = self.append(ids)
        for field, values in columns.items():
            self.arrays[field][rows] = values

    def _reserve(self, count):
        if count <= len(self._ids):
            return
        capacity = max(2 * len(self._ids), count)
        self._ids = _longer(self._ids, capacity)
        for field, array in self.arrays.items():
            self.arrays[field] = _longer(array, capacity)


def _longer(array, capacity):
    """The same rows with room for more."""
    grown = np.zeros((capacity, *array.shape[1:]), array.dtype)
    if _has_bits(array):
        grown[: len(array)] = array
    return grown


def _has_bits(array):
    """Whether a bit of it is set: -0.0 is more than memory holds at first."""
    return bool(np.ascontiguousarray(array).reshape(-1).view(f"u{array.itemsize}").any())
