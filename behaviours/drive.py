"""Drives: what acts on top of any model of behaviour.

A model answers what its animals would do among their own.  A drive is one file in ``behaviours/drives`` with a frozen
`Params` class and a function::

    @drive("flee", Params, always=True)
    def flee(scene, rows, params):
        return Urges(acceleration, urgency)

Arbitration is prioritised allocation (Reynolds 1987 [1]_, "Arbitrating independent behaviours"), for all models: in the
order of the brush each drive takes its urgency's share of what the body can do; the model gets what is left.

.. [1] Reynolds, C. W. (1987). Flocks, herds, and schools: a distributed behavioral model. Computer Graphics 21(4),
   25-34.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from flockbrush.behaviours.behaviour import TAKES_UP, Parameters, Scene, quantity
from flockbrush.engine.plugins import load_entry_points, load_modules

LOW = 5.0  # body lengths above the ground: the lowest dive
EASE = 2.0  # s before that in which a dive is ended
BEHIND = -0.9  # cosine of the angle to the way of flight beyond which a bird turns off to the side first


class DriveParameters(Parameters):
    """Base of every drive's ``Params``."""

    strength: float = quantity(1.0, "1", "largest share of control that the drive may take; 0 switches it off", 0, 1)


class Urges(NamedTuple):
    """What a drive asks for, for the rows asked."""

    acceleration: np.ndarray  # (k, 3) m/s^2
    urgency: np.ndarray  # (k,) 0 to 1: the share of the body it takes, if those before it leave so much


@dataclass(frozen=True)
class Drive:
    """A registered drive."""

    name: str
    urge: Callable[[Scene, np.ndarray, Any], Urges | None]
    Params: type[DriveParameters]
    doc: str
    always: bool = False  # acts under every brush that says nothing of it
    safety: bool = False  # keeps the body whole: acts also on animals that are steered
    notices: tuple[str, ...] = ()  # of the relations hunt and follow, those whose animals it asks for


_registry: dict[str, Drive] = {}


def drive(
    name: str,
    Params: type[DriveParameters],
    always: bool = False,
    safety: bool = False,
    notices: tuple[str, ...] = (),
):
    """Register ``urge(scene, rows, params) -> Urges``; None where it has nothing to ask for.

    Parameters
    ----------
    always : bool
        It acts under every brush that does not mention it, unless the brush's model does the same by itself.
    safety : bool
        It keeps the body whole, and so acts on steered animals (`flockbrush.systems.leaders.Steer`), too; other drives
        do not.
    notices : tuple of str
        ``hunt`` and ``follow`` where it needs to know whom the species hunts or follows; dangers are always noticed.

    Raises
    ------
    ValueError
        When another module has a drive of this name.
    """

    def register(urge):
        known = _registry.get(name)
        if known is not None and known.urge.__module__ != urge.__module__:
            raise ValueError(f"drive {name!r} is already in {known.urge.__module__}")
        doc = importlib.import_module(urge.__module__).__doc__ or ""
        _registry[name] = Drive(name, urge, Params, doc, always, safety, notices)
        return urge

    return register


@cache
def _scan() -> None:
    import flockbrush.behaviours.drives as package

    load_modules(package)
    load_entry_points("flockbrush.drives")


def drives() -> dict[str, Drive]:
    """All drives by name, in order of name."""
    _scan()
    return dict(sorted(_registry.items()))


def drives_of(brush, model) -> list[tuple[Drive, Any]]:
    """The drives that act under a brush in order of priority, with their parameters.

    Those that always act, or act on top of its model, come first, then those of the brush in the order of its file.
    """
    known = drives()
    return _with_those_of(brush, [
        one for one in known.values() if (one.always or one.name in model.needs) and one.name not in model.has
    ])  # fmt: skip


def drives_of_steered(brush, model) -> list[tuple[Drive, Any]]:
    """The drives that act on steered animals: those that keep the body whole, and then the way where they are sent.

    As nothing is left to the model, drives do what it does by itself, and look ahead for obstacles.
    """
    usual = [
        one for one in drives().values() if one.always or one.name in (*model.needs, *model.has, "avoid_obstacles")
    ]
    return [*((one, p) for one, p in _with_those_of(brush, usual) if one.safety), (STEERED, DriveParameters())]


def _with_those_of(brush, usual):
    """These drives, unless the brush mentions them, and those of the brush; without those that are switched off."""
    active = [(one, one.Params()) for one in usual if one.name not in brush.drives]
    active += [(drives()[name], params) for name, params in brush.drives.items()]
    return [(one, params) for one, params in active if params.strength > 0.0]


def towards(velocity, velocity_wish, most):
    """(k, 3) m/s²: the acceleration that takes up a velocity within `TAKES_UP`, at most ``most`` (k,)."""
    change = (velocity_wish - velocity) / TAKES_UP
    size = np.sqrt((change**2).sum(axis=1))
    share = np.minimum(1.0, most / np.maximum(size, 1e-300))
    return change * share[:, None]


def _where_sent(scene, rows, p):
    """All that is left of the body goes where the animal is sent."""
    bodies = scene.bodies
    return Urges(towards(scene.velocity[rows], bodies.wished[rows], bodies.acceleration[rows]), np.ones(len(rows)))


STEERED = Drive("steered", _where_sent, DriveParameters, "Where a leader is sent; no brush names it.")


def unit_rows(vectors):
    """(k, 3) with length 1; (0, 0, 0) where there is no direction."""
    size = np.sqrt((vectors**2).sum(axis=1, keepdims=True))
    return np.where(size > 1e-12, vectors / np.maximum(size, 1e-300), 0.0)


def within_wings(scene, rows, wish):
    """(k, 3) m/s: as fast as wanted, but no faster up or down than wings allow; to the side the way it is or flies."""
    bodies, speed = scene.bodies, np.sqrt((wish**2).sum(axis=1))
    room = np.maximum(bodies.height[rows] - LOW * scene.length[rows], 0.0)
    rise = np.clip(wish[:, 2], -np.minimum(bodies.sink[rows], room / EASE), bodies.climb[rows])
    aside = np.sqrt((wish[:, :2] ** 2).sum(axis=1)) > 0.1 * speed
    ahead = unit_rows(scene.forward[rows][:, :2])
    level = unit_rows(np.where(aside[:, None], wish[:, :2], ahead))
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    side = np.where((left * level).sum(axis=1) >= 0.0, 1.0, -1.0)[:, None]
    level = np.where((ahead * level).sum(axis=1)[:, None] < BEHIND, side * left, level)
    return np.column_stack([level * np.sqrt(np.maximum(speed**2 - rise**2, 0.0))[:, None], rise])
