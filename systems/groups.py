"""Groups: who belongs together by mutual perception.

Two animals that keep together (of one kin, `flockbrush.systems.fauna`) are linked when each perceives the other, as
their brushes perceive; birds in line formation are linked with their reference birds alone, so that skeins that pass
stay two.  A group is whoever is connected by links.  It is worked out from the present state alone, so that it is the
same in a run, in its replay and after going back; its number is the smallest id in it, which stays while groups join
and leave.
"""

from __future__ import annotations

import functools

import numpy as np
import scipy  # its parts are imported when they are used first, which takes a third of a start
from flockbrush.components import Body, BrushBinding, Family, Heading, Position, Species, Velocity
from flockbrush.components.formation import FormationPlace
from flockbrush.systems.fauna import SpeciesList, kin_of
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.measures import herd_measures
from flockbrush.systems.palette import Palette
from flockbrush.systems.senses import FindNeighbours, Near, See, SeeInSpace, Sight, SightInSpace


class _Aside:
    """A world with senses of its own: what animals perceive now, while those of the tick stay as they are."""

    def __init__(self, world):
        self.agents, self._world = world.agents, world
        self._own = {Near: Near(), Sight: Sight(), SightInSpace: SightInSpace()}

    def resource(self, kind):
        return self._own[kind] if kind in self._own else self._world.resource(kind)


def perceived(world):
    """(`Lists` on the ground, `Lists` in the air or None): whom everybody perceives at this moment."""
    aside = _Aside(world)
    for system in (FindNeighbours(), See(), SeeInSpace()):
        system.process(aside)
    return aside.resource(Sight).lists, aside.resource(SightInSpace).lists


def groups_of(world):
    """(n,) int64: the group of each animal, as the smallest id in it."""
    agents, n = world.agents, len(world.agents)
    if not n:
        return np.zeros(0, np.int64)
    together = kin_of(world.resource(SpeciesList).table, agents[Species.index])
    links = sum(
        (mutual(lists, together) for lists in perceived(world) if lists is not None), scipy.sparse.csr_matrix((n, n))
    )
    placed = np.flatnonzero((agents[FormationPlace.reference] > 0) | (agents[FormationPlace.place] == 0))
    if len(placed):
        links = links.tocoo()
        direct = ~(np.isin(links.row, placed) & np.isin(links.col, placed))
        links = scipy.sparse.coo_matrix((links.data[direct], (links.row[direct], links.col[direct])), shape=(n, n))
    count, label = scipy.sparse.csgraph.connected_components(links + _references(agents), directed=False)
    smallest = np.full(count, np.iinfo(np.int64).max)
    np.minimum.at(smallest, label, agents.ids)
    return smallest[label]


def group_names(world):
    """Names of all groups there can be, by number - 1: the ids of all animals that have been born."""
    return _numbers(world.next_entity)[1:]


def family_names(world):
    """Names of all families there can be, by number, "" of none."""
    return _numbers(world.next_entity)


@functools.lru_cache(maxsize=16)
def _numbers(count):
    return "", *map(str, range(1, count))


def mutual(lists, together):
    """(n, n) sparse: 1 where two of the same number in ``together`` perceive each other."""
    n = len(lists.first) - 1
    seen = np.ones(len(lists.near), np.int8)
    matrix = scipy.sparse.csr_matrix((seen, lists.near, lists.first), shape=(n, n)).tocoo()
    same = together[matrix.row] == together[matrix.col]
    matrix = scipy.sparse.coo_matrix((matrix.data[same], (matrix.row[same], matrix.col[same])), shape=(n, n)).tocsr()
    return matrix.minimum(matrix.T)


def _references(agents):
    """(n, n) sparse: 1 from each bird in formation to the one it keeps its place by."""
    ids, entity = agents.ids, agents[FormationPlace.reference]
    row = np.minimum(np.searchsorted(ids, entity), len(ids) - 1)
    follows = np.flatnonzero((entity > 0) & (ids[row] == entity))
    return scipy.sparse.csr_matrix(
        (np.ones(len(follows), np.int8), (follows, row[follows])), shape=(len(ids), len(ids))
    )


# numbers of parts of a world ---------------------------------------------------------------


def measures_of(world, rows=slice(None)):
    """The measures of all, or of some animals by name (`flockbrush.systems.measures`)."""
    agents = world.agents
    length = float(agents[Body.length][rows].mean()) if len(agents.ids[rows]) else 1.0
    columns = (agents[field][rows] for field in (Position.xyz, Velocity.xyz, Heading.forward))
    flies = bool(world.resource(Palette).flies_free[agents[BrushBinding.brush][rows]].any())
    return herd_measures(*columns, length, world.resource(Landscape).wrap, flies)


def summary(world):
    """{"species": {name: measures}, "brushes": {...}, "groups": [...]} of this moment, for reports.

    Groups are sorted by size, the largest first, each with its number, species and measures, and with its families
    where there are any.
    """
    agents = world.agents
    kinds, brushes = np.array(world.resource(SpeciesList).names), np.array(world.resource(Palette).names)
    return parts_of(
        lambda rows: measures_of(world, rows), kinds[agents[Species.index]], brushes[agents[BrushBinding.brush]],
        groups_of(world), agents[Family.number],
    )  # fmt: skip


def parts_of(measured, species, brush, group, family):
    """What `summary` gives, of any animals.

    Parameters
    ----------
    measured : callable
        Function of rows that gives their measures.
    species, brush : (n,) ndarray of str
    group, family : (n,) ndarray of int
        Family 0 is none.
    """
    return {
        "species": _by(measured, species),
        "brushes": _by(measured, brush),
        "groups": [
            {"group": number, "species": np.unique(species[rows]).tolist()}
            | measured(rows)
            | _families(measured, family[rows], rows)
            for number, rows in _rows_of_groups(group)
        ],
    }


def _by(measured, names):
    return {str(name): measured(np.flatnonzero(names == name)) for name in dict.fromkeys(sorted(names.tolist()))}


def _families(measured, numbers, rows):
    families = [(number, part) for number, part in _rows_of_groups(numbers) if number]
    told = [{"family": number} | measured(rows[part]) for number, part in families]
    return {"families": told} if told else {}


def _rows_of_groups(found):
    numbers, size = np.unique(found, return_counts=True)
    order = np.lexsort((numbers, -size))
    return [(int(numbers[k]), np.flatnonzero(found == numbers[k])) for k in order]
