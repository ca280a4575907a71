"""The species of a world, as numbers by index: who fears, hunts, follows whom, and what each body can do."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.species import SpeciesLibrary, SpeciesSpec, WalkSpec, shipped_species

NOTHING, FEAR, HUNT, FOLLOW = range(4)  # of `Relations.verb`: what one notices others for
NOTICED = {"fear": FEAR, "hunt": HUNT, "follow": FOLLOW}
LENGTHS = 20.0  # body lengths of the larger one: at so much an unknown danger is noticed
PLANE, AIR, WATER = range(3)  # media, in the order of `flockbrush.behaviours.species.MEDIA`
NO_LIMIT = 1e6  # m/s, m/s², rad/s of a species without a file
SOLITARY = -1  # of `SpeciesTable.kin`
STEEPEST = WalkSpec().steepest  # slope on which a species without a file walks


class SpeciesTable(NamedTuple):
    """What species are, by index."""

    known: np.ndarray  # (s,) bool, whether there is a file of it; others may do anything
    kin: np.ndarray  # (s,) int32, the same number for species that keep together; `SOLITARY` for others
    media: np.ndarray  # (s, 3) bool: walk, fly, swim
    speed: np.ndarray  # (s, 3) m/s in each medium
    flee: np.ndarray  # (s, 3) m/s in full fear
    acceleration: np.ndarray  # (s, 3) m/s²
    turn: np.ndarray  # (s, 3) rad/s
    steepest: np.ndarray  # (s,) rise per metre of the steepest ground that it walks on
    slowest: np.ndarray  # (s,) m/s in the air
    climb: np.ndarray  # (s,) m/s
    sink: np.ndarray  # (s,) m/s
    height: np.ndarray  # (s,) m above the ground in the air
    view: np.ndarray  # (s,) rad, full field of view of the eyes
    eyes: np.ndarray  # (s,) height of the eyes, body lengths
    calm: np.ndarray  # (s,) s
    ignore: np.ndarray  # (s, s) bool, the row does not give way to the column


class Relations(NamedTuple):
    """Who notices whom for what.  A kind is ``2 * species + (1 where its brush makes it dangerous)``."""

    verb: np.ndarray  # (2 s, 2 s) uint8, `NOTHING`, `FEAR`, `HUNT` or `FOLLOW`
    weight: np.ndarray  # (2 s, 2 s) 0 to 1
    notice: np.ndarray  # (2 s, 2 s) m; below 0: in body lengths of the larger one
    prey: np.ndarray  # (2 s, 2 s) bool, prey of the models that hunt
    removes: np.ndarray  # (s, s) bool, a catch takes the prey out of the world


@dataclass
class SpeciesList:
    """Names of species by index, and what is known of them."""

    names: list[str] = field(default_factory=list)
    library: SpeciesLibrary = field(default_factory=shipped_species)
    _cached: tuple = (None, [], None, None)

    def state(self):
        """The names (see `flockbrush.engine.state`)."""
        return json.dumps(self.names).encode()

    def set_state(self, data):
        """Take back what `state` gave."""
        self.names = json.loads(data)

    def index(self, name):
        """Index of this species, new or known."""
        if name not in self.names:
            self.names.append(name)
        return self.names.index(name)

    @property
    def assets(self) -> list[SpeciesSpec | None]:
        """The species by index; None for a mere name. Files are read once for each list of names."""
        return self._tables()[0]

    @property
    def table(self) -> SpeciesTable:
        """Their numbers."""
        return self._tables()[1]

    @property
    def relations(self) -> Relations:
        """What they make of each other."""
        return self._tables()[2]

    def _tables(self):
        names = tuple(self.names)
        if self._cached[0] != (names, self.library):
            assets = [self.library.find(name) for name in names]
            tables = species_table(names, assets), relations_among(names, assets)
            self._cached = (names, self.library), assets, *tables
        return self._cached[1:]


def species_table(names, assets) -> SpeciesTable:
    """The numbers of species; those without an asset have no limits."""

    def column(value, default, dtype=float):
        return np.array([default if a is None else value(a) for a in assets], dtype).reshape(len(names))

    def by_medium(name):
        rows = [[NO_LIMIT] * 3 if a is None else [getattr(getattr(a, m), name) for m in ("walk", "fly", "swim")]
                for a in assets]  # fmt: skip
        return np.array(rows, float).reshape(len(names), 3)

    media = [[True] * 3 if a is None else [a.can(m) for m in ("walk", "fly", "swim")] for a in assets]
    return SpeciesTable(
        known=column(lambda a: True, False, bool),
        kin=_kin(names, assets),
        media=np.array(media, bool).reshape(len(names), 3),
        speed=by_medium("speed"),
        flee=by_medium("flee"),
        acceleration=by_medium("acceleration"),
        turn=by_medium("turn"),
        steepest=column(lambda a: a.walk.steepest, STEEPEST),
        slowest=column(lambda a: a.fly.slowest, 0.0),
        climb=column(lambda a: a.fly.climb, 2.0),
        sink=column(lambda a: a.fly.sink, 3.0),
        height=column(lambda a: a.fly.height, 0.0),
        view=np.radians(column(lambda a: a.eyes.field_of_view, 360.0)),
        eyes=column(lambda a: a.eyes.height, 0.5),
        calm=column(lambda a: a.calm, 6.0),
        ignore=_ignored(names, assets),
    )


def _relation(assets, names, i, j):
    """The relation of species i to species j, None for none; its own kind only by name."""
    if assets[i] is None:
        return None
    if i == j:
        return assets[i].relations.get(names[i])
    return assets[i].relation_to(names[j], () if assets[j] is None else assets[j].tags)


def _kin(names, assets):
    """Numbers of species that keep together: those that name each other kin."""
    label = np.arange(len(names), dtype=np.int32)
    for i in range(len(names)):
        for j in range(i):
            both = _relation(assets, names, i, j), _relation(assets, names, j, i)
            if all(r is not None and r.verb == "kin" and r.weight > 0 for r in both):
                label[label == label[i]] = label[j]
    for i in range(len(names)):
        own = _relation(assets, names, i, i)
        if own is not None and own.verb != "kin":
            label[i] = SOLITARY
    return label


def _ignored(names, assets):
    ignored = np.zeros((len(names), len(names)), bool)
    for i in range(len(names)):
        for j in range(len(names)):
            relation = _relation(assets, names, i, j)
            ignored[i, j] = relation is not None and relation.verb == "ignore"
    return ignored


def relations_among(names, assets) -> Relations:
    """What species make of each other, with what is assumed of those that nobody has described.

    Who has no file, or meets somebody who has none, flees from what a hunting brush moves, and is prey to it, as long
    as it does not hunt itself.
    """
    n = len(names)
    verb, weight = np.zeros((2 * n, 2 * n), np.uint8), np.zeros((2 * n, 2 * n))
    notice, prey = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2 * n), bool)
    removes = np.zeros((n, n), bool)
    for i in range(n):
        for j in range(n):
            relation = _relation(assets, names, i, j)
            own = slice(2 * i, 2 * i + 2), slice(2 * j, 2 * j + 2)
            if relation is not None and relation.verb in NOTICED:
                verb[own], weight[own], notice[own] = NOTICED[relation.verb], relation.weight, relation.notice
                prey[own] = relation.verb == "hunt"
                removes[i, j] = relation.catch == "remove"
            elif assets[i] is None or assets[j] is None:
                prey[own[0], 2 * j] = True
                if i != j:
                    calm, danger = 2 * i, 2 * j + 1
                    verb[calm, danger], weight[calm, danger], notice[calm, danger] = FEAR, 1.0, -LENGTHS
    return Relations(verb, weight, notice, prey, removes)


def kinds_of(species, danger):
    """(n,) int32 kinds, as `Relations` counts them."""
    return (2 * species + danger).astype(np.int32)


def by_medium(table: SpeciesTable, species, aloft, *columns):
    """Columns of the table (s, 3), for each animal in the medium where it is, (n,) each.

    ``aloft`` is (n,) bool, who is in the air, or None where nobody is.
    """
    ground = np.where(table.media[:, WATER] & ~table.media[:, PLANE], WATER, PLANE)
    if aloft is None:
        return [column[np.arange(len(ground)), ground][species] for column in columns]
    medium = np.where(aloft, AIR, ground[species])
    return [column[species, medium] for column in columns]


def kin_of(table: SpeciesTable, species):
    """(n,) int32: the same number for animals that keep together; by default the species."""
    if (table.kin == np.arange(len(table.kin))).all():
        return species
    label = table.kin[species].astype(np.int32)
    alone = label == SOLITARY
    label[alone] = -1 - np.flatnonzero(alone)
    return label
