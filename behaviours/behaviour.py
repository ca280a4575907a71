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
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Literal, NamedTuple, get_args

import numpy as np
from flockbrush.behaviours.sliders import SLIDERS, DesignerSlider
from flockbrush.engine.plugins import blaming, load_entry_points, load_modules
from flockbrush.engine.seam import short_way
from pydantic import BaseModel, ConfigDict, Field

Guided = Literal["front", "everyone", "share", "appointed"]  # who follows guides (`flockbrush.systems.leaders`)
GUIDED = get_args(Guided)
TAKES_UP = 0.4  # s in which an animal takes up a new effort, or the velocity of a drive.  By eye


class Parameters(BaseModel):
    """Base of every model's ``Params``: frozen, finite, no unknown names, no booleans for numbers.

    ``sliders`` are those in a designer's words, by name; a model puts its own before these.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    sliders: ClassVar[dict[str, DesignerSlider]] = SLIDERS


def quantity(
    default: float,
    unit: str,
    meaning: str,
    low: float | None = None,
    high: float | None = None,
    chance: bool = False,
    **more,
):
    """A parameter with a unit, bounds and one line of meaning: sliders, brush files and docs come from it.

    With ``chance`` it is the strength of noise, and 0 is none: tests of symmetry set it to 0.
    """
    extra: dict[str, Any] = {"unit": unit} | ({"chance": True} if chance else {})
    return Field(default, ge=low, le=high, description=meaning, json_schema_extra=extra, **more)


def guided_parameter(default: str, meaning: str):
    """The parameter ``guided`` of a model that follows guides, a `Guided`; ``meaning`` ends its line."""
    text = f"which animals follow a guide: {meaning}"
    return Field(default=default, description=text, json_schema_extra={"unit": "-"})


def guided_share_parameter():
    """The parameter ``guided_share`` of a model that follows guides."""
    return quantity(0.1, "1", "share of animals that follow a guide if `guided` is share", 0, 1)


def no_ground(name: str) -> np.ndarray:
    """What a scene without ground, such as that of animals in a film, says of a property of the ground."""
    raise ValueError(f"there is no {name!r} of the ground here: only levels have ground")


class Scene(NamedTuple):
    """What a model sees: frozen columns of all n animals and what each of them perceives.

    Visible neighbours of row i are ``near[first[i]:first[i + 1]]``; the nearest point of each obstacle within its
    reach are ``obstacle_offset[obstacle_first[i]:obstacle_first[i + 1]]``.  Models read and never write.
    """

    dt: float  # s
    tick: int
    key: Callable[..., np.uint64]  # noise key of a named stream, in this tick or in another one that is given
    ids: np.ndarray  # (n,) entity ids, for noise
    xyz: np.ndarray  # (n, 3) m
    velocity: np.ndarray  # (n, 3) m/s
    forward: np.ndarray  # (n, 3) unit headings
    speed: np.ndarray  # (n,) m/s, the speed process
    effort: np.ndarray  # (n,) what the pace that models wish has become, which follows it within `TAKES_UP`
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
    air: Air | None = None  # what flyers perceive; None in a world without any
    formation: Any = None  # what birds in line formation know (`behaviours.models.line_formation.InFormation`)
    relations: Kinds | None = None  # relations of fear and hunting, by kind of animal
    noticed: NoticedLists | None = None  # dangers, prey and leaders that animals notice
    bodies: Bodies | None = None  # what drives know of bodies; None where no drive could act
    by_slot: BySlot | None = None  # the same neighbours for models that say so (`Behaviour.by_slot`)
    # m, size of a map that goes on at the opposite border, where places are apart as `flockbrush.engine.seam` says;
    # (0, 0) of another
    wrap: tuple[float, float] = (0.0, 0.0)
    ground: Callable[[str], np.ndarray] = no_ground  # (n,) a property of the ground under each animal, by its name

    @property
    def animals(self) -> Animals:
        """Its columns of the animals, for kernels."""
        return Animals(*(getattr(self, name) for name in Animals._fields))


class Animals(NamedTuple):
    """The columns of a `Scene` that kernels of models and drives read, by row."""

    ids: np.ndarray  # (n,)
    species: np.ndarray  # (n,) the same number for animals that keep together
    xyz: np.ndarray  # (n, 3) m
    velocity: np.ndarray  # (n, 3) m/s
    forward: np.ndarray  # (n, 3) unit headings
    speed: np.ndarray  # (n,) m/s, the speed process
    length: np.ndarray  # (n,) m
    guidance: np.ndarray  # (n, 2) navigation field, length at most 1
    wrap: tuple[float, float]  # m, size of a map that goes on at the opposite border; (0, 0) of another


class NoticedLists(NamedTuple):
    """Whom everybody notices: those of row i are ``first[i]:first[i + 1]``."""

    first: np.ndarray  # (n + 1,) int64
    near: np.ndarray  # (m,) int32 rows
    offset: np.ndarray  # (m, 3) m, from the observer, across the seam of a wrapped map where that is shorter
    verb: np.ndarray  # (m,) uint8, `flockbrush.systems.fauna.FEAR`, `HUNT` or `FOLLOW`
    weight: np.ndarray  # (m,) 0 to 1
    notice: np.ndarray  # (m,) m, within which it is noticed


def empty_noticed_lists(n) -> NoticedLists:
    """The lists of n animals that notice no other."""
    none = np.zeros(0)
    first, offset = np.zeros(n + 1, np.int64), none.reshape(0, 3)
    return NoticedLists(first, none.astype(np.int32), offset, none.astype(np.uint8), none, none)


class BySlot(NamedTuple):
    """Visible neighbours in the order of the cells: whoever is near in the field is near in memory.

    Row i sees ``seen[begin[slot[i]]:][:count[i]]``, slots; their offset is ``(x[j] - x[slot[i]], y[j] - y[slot[i]])``.
    """

    slot: np.ndarray  # (n,) int32; -1 for animals in the air, which see none here
    begin: np.ndarray  # (slots,) int64
    count: np.ndarray  # type: ignore[assignment]  # (n,) int64, by row
    seen: np.ndarray  # int32 slots
    x: np.ndarray  # (slots,) m
    y: np.ndarray
    fx: np.ndarray  # (slots,) heading
    fy: np.ndarray
    species: np.ndarray  # (slots,) int32


class ByRow(NamedTuple):
    """Visible neighbours of row i: ``near[first[i]:first[i + 1]]``."""

    first: np.ndarray  # (n + 1,)
    near: np.ndarray  # (m,) rows
    offset: np.ndarray  # (m, 2) m, from the observer


class FlockBySlot(NamedTuple):
    """The same of those in the air: row i sees ``seen[begin[slot[i]]:][:count[i]]``, places in a table of birds.

    A line of the table is what neighbours need to know of a bird, in one piece of memory.
    """

    slot: np.ndarray  # (n,) int32, the animal's own line; -1 for animals on the ground, which see none here
    begin: np.ndarray  # (lines,) int64
    count: np.ndarray  # type: ignore[assignment]  # (n,) int64, by row
    seen: np.ndarray  # int32; the last of each list are eight in full, filled up with the animal itself
    bird: np.ndarray  # (lines, 8) place in m, velocity in m/s, kind, nothing


class Kinds(NamedTuple):
    """Who fears and hunts whom: ``fears[kind[i], kind[j]]``."""

    kind: np.ndarray  # (n,) int32
    fears: np.ndarray  # (c, c) bool
    prey: np.ndarray  # (c, c) bool


class Bodies(NamedTuple):
    """What drives know of the bodies they move, by row."""

    aloft: np.ndarray  # (n,) bool
    height: np.ndarray  # (n,) m above the ground
    top: np.ndarray  # (n,) m/s, the fastest the species moves in this medium
    flee: np.ndarray  # (n,) m/s in full fear
    acceleration: np.ndarray  # (n,) m/s^2
    slowest: np.ndarray  # (n,) m/s in the air; 0 on the ground
    alarm: np.ndarray  # (n,) 0 to 1, what is left of a fright
    threat: np.ndarray  # (n, 3) m, from there to where the danger was last seen
    cruise: np.ndarray  # (n,) m above the ground where the species flies
    climb: np.ndarray  # (n,) m/s, the fastest it rises
    sink: np.ndarray  # (n,) m/s, its top sink rate when it lands
    walls: np.ndarray  # (k, 4) m, edges of what keeps bodies on the ground out
    relief: np.ndarray  # (my, mx, 3) heights and slopes (`systems.terrain.relief_of`)
    relief_cell: float  # m
    transit: np.ndarray  # (n,) uint8, 1 lands, 2 takes off (`components.agent.Transit`)
    radius: np.ndarray  # (n,) m, half the width
    family: np.ndarray  # (n,) int32, number of the family; 0: none
    solids: Any  # what is in the way of those in the air (`flockbrush.engine.solids.Solids`)
    foresight: np.ndarray  # (n,) s of flight that each looks ahead
    wished: np.ndarray  # (n, 3) m/s, what models wish, where the steered are sent (`systems.allocation.with_wishes`)


def kinds_in(scene: Scene) -> Kinds:
    """Who fears and hunts whom in a scene; without a species table those of another species that are dangerous."""
    if scene.relations is not None:
        return scene.relations
    both = scene.species.astype(np.int64) * 2 + scene.danger
    names, kind = np.unique(both, return_inverse=True)
    species, danger = names // 2, (names % 2).astype(bool)
    fears = danger[None, :] & (species[:, None] != species[None, :])
    return frozen(Kinds(kind.ravel().astype(np.int32), fears, np.repeat(~danger[None, :], len(names), axis=0)))


class Air(NamedTuple):
    """What animals in the air perceive, in three dimensions.  Rows of walkers see nobody here.

    Visible others of row i are ``near[first[i]:first[i + 1]]``; left out where all models take them by slot.  What lies
    ahead is what the heading would hit within the model's `Flight.foresight`; ``aim`` is where to steer instead, past
    its nearest silhouette edge.
    """

    first: np.ndarray  # (n + 1,)
    near: np.ndarray  # (m,) rows
    offset: np.ndarray  # (m, 3) m, from the observer to the neighbour
    up: np.ndarray  # (n, 3) unit vectors out of the back
    hit: np.ndarray  # (n,) m along the heading to what lies ahead; inf: nothing
    aim: np.ndarray  # (n, 3) unit vectors
    gap: np.ndarray  # (n,) m to the nearest surface within foresight; inf: none
    normal: np.ndarray  # (n, 3) unit vectors away from that surface
    height: np.ndarray  # (n,) m above the ground
    bound: np.ndarray  # (n,) migration: 0 nowhere, 1 a direction, 2 a point
    target: np.ndarray  # (n, 3) the direction, or the offset to the point, m
    danger_first: np.ndarray  # (n + 1,) dangers that row i notices are danger_offset[first[i]:first[i + 1]]
    danger_offset: np.ndarray  # (k, 3) m, from the observer
    by_slot: FlockBySlot | None = None  # the same neighbours for models that say so (`Behaviour.by_slot`)


def air_of(scene: Scene) -> Air:
    """What flyers perceive in a scene; made of the walkers' lists, over no ground, where there is nothing better."""
    if scene.air is not None:
        return scene.air
    n = len(scene.ids)
    rise = scene.xyz[scene.near, 2] - np.repeat(scene.xyz[:, 2], np.diff(scene.first))
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    air = Air(
        scene.first, scene.near, np.column_stack([scene.offset, rise]), up, np.full(n, np.inf), scene.forward,
        np.full(n, np.inf), up, np.full(n, np.inf), np.zeros(n, np.uint8), np.zeros((n, 3)),
        *_all_dangers(scene),
    )  # fmt: skip
    return frozen(air)


def flock_of(scene: Scene, air: Air) -> FlockBySlot:
    """Visible others in the air by slot; made of the lists where there is nothing better."""
    if air.by_slot is not None:
        return air.by_slot
    n, count = len(air.first) - 1, np.diff(air.first)
    bird = np.zeros((n + len(air.near), 8))  # all observers are in the middle; then come the birds that they see
    bird[n:, :3], bird[n:, 3:6], bird[n:, 6] = air.offset, scene.velocity[air.near], scene.species[air.near]
    slot, neighbours = np.arange(n, dtype=np.int32), np.arange(n, len(bird), dtype=np.int32)
    begin = np.zeros(len(bird), np.int64)
    seen, begin[:n] = padded_lists(neighbours, count, slot)
    return frozen(FlockBySlot(slot, begin, count, seen, bird))


def padded_lists(lists: np.ndarray, count: np.ndarray, other: np.ndarray):
    """Lists that follow one another, (m,), each filled up to eight in full with what is ``other`` to it, (n,).

    Returns them, with sixteen more numbers behind them, and where each of them begins.
    """
    full = -(-count // 8) * 8
    begin, before = np.cumsum(full) - full, np.cumsum(count) - count
    out = np.concatenate([np.repeat(other, full), np.zeros(16, other.dtype)])
    out[np.arange(len(lists)) + np.repeat(begin - before, count)] = lists
    return out, begin


def _all_dangers(scene: Scene):
    """(first, offset) of all that each animal fears, wherever they are; few fear, or none."""
    kinds = kinds_in(scene)
    timid, feared = (np.flatnonzero(np.asarray(kinds.fears.any(axis))[kinds.kind]) for axis in (1, 0))
    pairs = kinds.fears[kinds.kind[timid, None], kinds.kind[feared]] & (timid[:, None] != feared)
    observer, who = (rows[k] for rows, k in zip((timid, feared), np.nonzero(pairs), strict=True))
    first = np.zeros(len(scene.ids) + 1, np.int64)
    np.cumsum(np.bincount(observer, minlength=len(scene.ids)), out=first[1:])
    offset = scene.xyz[who] - scene.xyz[observer]
    offset[:, :2] = short_way(offset[:, :2], scene.wrap)
    return first, offset


def frozen(columns):
    """A named tuple whose arrays are views that cannot be written: one type for the kernels, which compile once."""
    return type(columns)(*[read_only(column) if isinstance(column, np.ndarray) else column for column in columns])


def read_only(array):
    """A view of an array that cannot be written."""
    view = array.view()
    view.setflags(write=False)  # dozens of times in each tick: an object of flags takes as long again
    return view


class Wishes(NamedTuple):
    """What a model wants for the rows asked.

    On the ground direction and pace say all.  In the air (`Behaviour.flight`) a model may say an acceleration, or,
    if its `Flight` is exact, the velocity itself; without either a bird turns to the direction at its own speed.
    """

    direction: np.ndarray  # (k, 3) unit vectors: the way to face next
    pace: np.ndarray  # (k,) multiplies the brush's speed; 1 leaves it alone
    acceleration: np.ndarray | None = None  # (k, 3) m/s^2
    velocity: np.ndarray | None = None  # (k, 3) m/s


class Flight(NamedTuple):
    """What air and muscles allow a body; lengths in its own body lengths.  As it stands, everything.

    The geometric flight of Reynolds 1987: see `flockbrush.systems.flight`.
    """

    min_speed: float = 0.0  # BL/s
    max_speed: float = np.inf  # BL/s
    max_acceleration: float = np.inf  # BL/s^2, of what a model wishes
    damping: float = 0.0  # 1/s, how soon the speed returns to the bird's own (`Speed.target`)
    weight: float = 0.0  # share of gravity that pulls
    buoyancy: float = 0.0  # share of the weight that the air bears by itself
    lift: float = 0.0  # share of the weight that the wings bear at the bird's own speed; grows with its square
    banking: float = 0.0  # 1: a coordinated turn; 0: upright; -1: flung outwards
    roll_time: float = 0.25  # s in which a change of bank is made
    foresight: float = 0.0  # s of flight that the bird looks ahead for obstacles
    grounded: bool = False  # held to the terrain: a herd
    exact: bool = False  # the model says the velocity, and nothing limits it


@dataclass(frozen=True)
class Behaviour:
    """A registered model."""

    name: str
    steer: Callable[..., Wishes]  # of a scene, rows, parameters, and what `summary` says of the rows where it is known
    Params: type[Parameters]
    doc: str
    danger: bool = False  # prey flees from animals that this model moves
    flight: Callable[[Any], Flight] | None = None  # of its parameters: then its animals move in the air
    formation: bool = False  # its animals have places in a line formation
    explain: Callable[[Scene, int, Any], dict[str, np.ndarray]] | None = None  # the reasons of one animal
    has: tuple[str, ...] = ()  # names of the drives that the model does by itself
    by_slot: bool = False  # takes its neighbours from `Scene.by_slot`; then the lists by row are not made
    needs: tuple[str, ...] = ()  # names of the drives that act on top of it under every brush that says nothing of them
    summary: Callable[[Scene, np.ndarray], Any] | None = None  # hangs neither on parameters nor on headings of the rows

    def blaming(self):
        """A context in which errors name this model (`flockbrush.engine.plugins.blaming`)."""
        return blaming("model", self.name, self.steer.__module__)

    def flight_of(self, params) -> Flight | None:
        """Within what limits its animals move in the air; None where they walk."""
        with self.blaming():
            return None if self.flight is None else self.flight(params)


_registry: dict[str, Behaviour] = {}


def behaviour(
    name: str,
    Params: type[Parameters],
    danger: bool = False,
    flight: Callable[[Any], Flight] | None = None,
    formation: bool = False,
    explain=None,
    has: tuple[str, ...] = (),
    by_slot: bool = False,
    needs: tuple[str, ...] = (),
    summary: Callable[[Scene, np.ndarray], Any] | None = None,
):
    """Register ``steer(scene, rows, params) -> Wishes`` under a name.

    Parameters
    ----------
    danger : bool
        Prey flees from animals that this model moves.
    flight : callable, optional
        ``flight(params) -> Flight``: animals of this model move in the air, within these limits.
    formation : bool
        Animals of this model are given places in a line formation (``scene.formation``).
    explain : callable, optional
        ``explain(scene, row, params) -> {reason: vector}`` for one animal, for designers who ask why it turned.
        The vectors, (2,) or (3,), add up to one that points where the animal wishes to face, or to the velocity that
        the model says; plain numpy is quick enough.  Without it the reasons are its heading and its model.
    has : tuple of str
        Names of the drives (`flockbrush.behaviours.drive`) that the model does itself: act only where a brush asks.
    by_slot : bool
        The model takes its neighbours from ``scene.by_slot`` where that is not None, or from `flock_of`.  In a world in
        which all models do, and no drive could act, ``near``, ``first`` and ``offset`` of the scene and of its air are
        not made: they are None then.
    needs : tuple of str
        Names of the drives that act on top of the model under every brush that does not mention them.
    summary : callable, optional
        ``summary(scene, rows)``: what ``steer`` makes of the scene whatever the parameters and the headings of these
        rows are.  Learning, which tries many parameters on one scene, calls ``steer(scene, rows, params, summary)``.

    Raises
    ------
    ValueError
        When the name is taken.  In a notebook or a terminal (module ``__main__``) the new model replaces the old.
    """

    def register(steer):
        again = steer.__module__ == "__main__"  # a cell of a notebook is run again: its model replaces the old one
        if name in _registry and not (again and _registry[name].steer.__module__ == "__main__"):
            raise ValueError(f"behaviour {name!r} is already in {_registry[name].steer.__module__}")
        doc = importlib.import_module(steer.__module__).__doc__ or ""
        _registry[name] = Behaviour(
            name, steer, Params, doc, danger, flight, formation, explain, has, by_slot, needs, summary
        )
        return steer

    return register


@cache
def _scan() -> None:
    import flockbrush.behaviours.models as package

    load_modules(package)
    load_entry_points("flockbrush.behaviours")


def behaviours() -> dict[str, Behaviour]:
    """All models by name, in order of name."""
    _scan()
    return dict(sorted(_registry.items()))
