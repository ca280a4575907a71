"""What pictures of a run keep from one moment to the next, shared by all pictures of that run."""

from __future__ import annotations

from weakref import WeakKeyDictionary

_KEPT: WeakKeyDictionary = WeakKeyDictionary()  # {simulation: {kind: object}}


def kept(kind, simulation):
    """The one object of a class that belongs to a simulation, made from it when it is first asked for."""
    mine = _KEPT.setdefault(simulation, {})
    if kind not in mine:
        mine[kind] = kind(simulation)
    return mine[kind]
