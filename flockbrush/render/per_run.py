"""Objects that all pictures of a run share, such as the gaits of its animals."""

from __future__ import annotations

from weakref import WeakKeyDictionary

_OBJECTS: WeakKeyDictionary = WeakKeyDictionary()  # {simulation: {kind: object}}


def of_run(kind, simulation):
    """The only object of a class for a simulation, ``kind(simulation)``, created on first use."""
    own = _OBJECTS.setdefault(simulation, {})
    if kind not in own:
        own[kind] = kind(simulation)
    return own[kind]
