"""What a behaviour model is, and which there are.

A model is one file in ``behaviours/models`` with a docstring that cites its
source, a frozen `Params` class and a function::

    @behaviour("herd", Params)
    def steer(scene, rows, params):
        return Wishes(direction, pace)

The folder is scanned; third parties register through the entry point group
``flockbrush.behaviours``.  There is no list to edit.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from typing import Any, NamedTuple

import numpy as np
from pydantic import BaseModel, ConfigDict, Field


class Parameters(BaseModel):
    """Base of every model's ``Params``: frozen, finite, no unknown names, no booleans for numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


def quantity(default: float, unit: str, meaning: str, low: float | None = None, high: float | None = None, **more):
    """A parameter with a unit, bounds and one line of meaning: sliders, brush files and docs come from it."""
    return Field(default, ge=low, le=high, description=meaning, json_schema_extra={"unit": unit}, **more)


class Scene(NamedTuple):
    """What a model sees: frozen columns of all n animals and what each of them perceives.

    Visible neighbours of row i are ``near[first[i]:first[i + 1]]``; the nearest point of each obstacle within its
    reach are ``obstacle_offset[obstacle_first[i]:obstacle_first[i + 1]]``.  Models read and never write.
    """

    dt: float  # s
    tick: int
    key: Callable[[str], np.uint64]  # noise key of a named stream in this tick
    ids: np.ndarray  # (n,) entity ids, for noise
    xyz: np.ndarray  # (n, 3) m
    velocity: np.ndarray  # (n, 3) m/s
    forward: np.ndarray  # (n, 3) unit headings
    speed: np.ndarray  # (n,) m/s, the speed process
    length: np.ndarray  # (n,) m, body length
    leader: np.ndarray  # (n,) 1 for leaders
    species: np.ndarray  # (n,) index of the kind of animal
    danger: np.ndarray  # (n,) 1 for animals that others flee from
    first: np.ndarray  # (n + 1,)
    near: np.ndarray  # (m,) rows
    offset: np.ndarray  # (m, 2) m, from the observer to the neighbour
    obstacle_first: np.ndarray  # (n + 1,)
    obstacle_offset: np.ndarray  # (k, 2) m, from the observer to the nearest point of an obstacle
    guidance: np.ndarray  # (n, 2) navigation field, length at most 1
    slope: np.ndarray  # (n, 2) rise per metre, east and north
    memory: np.ndarray  # (n, 2) m, from the observer to where it last saw others
    known: np.ndarray  # (n,) 1 where there is such a memory
    order: np.ndarray  # (n,) rows in spatial order: neighbours in turn are neighbours in memory
    hidden_points: Any = None  # lists (first, near, offset) by hidden-point removal, if a model present asks for them


class Wishes(NamedTuple):
    """What a model wants for the rows asked."""

    direction: np.ndarray  # (k, 3) unit vectors: the way to face next
    pace: np.ndarray  # (k,) multiplies the brush's speed; 1 leaves it alone


@dataclass(frozen=True)
class Behaviour:
    """A registered model."""

    name: str
    steer: Callable[[Scene, np.ndarray, Any], Wishes]
    Params: type[Parameters]
    doc: str
    danger: bool = False  # prey flees from animals that this model moves
    hidden_points: bool = False  # asks for the lists of hidden-point removal, which cost extra
    explain: Callable[[Scene, int, Any], dict[str, np.ndarray]] | None = None  # the reasons of one animal


_registry: dict[str, Behaviour] = {}


def behaviour(name: str, Params: type[Parameters], danger: bool = False, hidden_points: bool = False, explain=None):
    """Register ``steer(scene, rows, params) -> Wishes`` under a name.

    Parameters
    ----------
    danger : bool
        Prey flees from animals that this model moves.
    hidden_points : bool
        The model wants ``scene.hidden_points``.
    explain : callable, optional
        ``explain(scene, row, params) -> {reason: (2,) vector}`` for one animal, for designers who ask why it turned.
        The vectors add up to one that points where the animal wishes to face; plain numpy is quick enough.

    Raises
    ------
    ValueError
        When the name is taken.
    """

    def register(steer):
        if name in _registry:
            raise ValueError(f"behaviour {name!r} is already in {_registry[name].steer.__module__}")
        doc = importlib.import_module(steer.__module__).__doc__ or ""
        _registry[name] = Behaviour(name, steer, Params, doc, danger, hidden_points, explain)
        return steer

    return register


@cache
def _scan() -> None:
    import behaviours.models as package

    for module in sorted(pkgutil.iter_modules(package.__path__), key=lambda m: m.name):
        importlib.import_module(f"behaviours.models.{module.name}")
    for point in sorted(entry_points(group="flockbrush.behaviours"), key=lambda p: p.name):
        point.load()


def behaviours() -> dict[str, Behaviour]:
    """All models by name, in order of name."""
    _scan()
    return dict(sorted(_registry.items()))
