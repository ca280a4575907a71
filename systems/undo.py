"""Commands that undo others: they remove, restore, rebind and change exactly the given animals."""

from __future__ import annotations

import base64
import zlib
from typing import Any

import numpy as np
from flockbrush.behaviours.brush import load_brush
from flockbrush.behaviours.mixture import load_path
from flockbrush.components import (
    Body,
    BrushBinding,
    Destination,
    Heading,
    Leading,
    Migration,
    Position,
    ProgramState,
    Species,
)
from flockbrush.components.formation import FormationPlace
from flockbrush.engine.commands import command
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.systems.binding import cannot
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList, bodies_of, ground_for, inset
from flockbrush.systems.programs import Programs
from flockbrush.systems.spawning import Capsules, inside_polygon, nearest_free, overlaps_, touching
from numba import njit

MOST_AT_ONCE = 10_000  # animals restored by one command, which must fit into one record
PRESSED = 1e-6  # m that bodies may overlap by rounding


def need(fine, message):
    """Raise ValueError with this message unless the condition holds."""
    if not fine:
        raise ValueError(message)


def goal_index(land, name):
    """Index of the goal of this name; LookupError that lists the goals."""
    names = [goal.name for goal in land.goals]
    if name not in names:
        raise LookupError(f"there is no goal {name!r}{did_you_mean(name, names)}")
    return names.index(name)


def need_entities(entities):
    """Raise ValueError unless these are ids of animals without repetition."""
    whole = all(type(e) is int and 0 < e < 2**62 for e in entities)
    need(whole and len(set(entities)) == len(entities), "entities must be different whole numbers above 0")


def rows_of(world, entities):
    """(k,) rows of the given animals that are alive."""
    need_entities(entities)
    ids = world.agents.ids
    wanted = np.sort(np.array(entities, np.int64))
    rows = np.minimum(np.searchsorted(ids, wanted), max(len(ids) - 1, 0))
    return rows[ids[rows] == wanted] if len(ids) else rows[:0]


@command
class RemoveEntities:
    """Remove exactly these animals; ids of dead animals are ignored."""

    entities: list

    def inverse(self, world):
        return bring_back(world, world.agents.ids[rows_of(world, self.entities)])

    def apply(self, world):
        remove(world, world.agents.ids[rows_of(world, self.entities)])


def remove(world, entities):
    """Remove these animals immediately."""
    for entity in entities.tolist():
        world.delete_entity(entity)
    world.flush()


@command
class BringBack:
    """Restore removed animals with their old state and ids.

    An animal whose place is taken by another animal or a wall is placed beside it.
    """

    entities: list
    columns: dict  # of each component's field: its rows, packed

    def inverse(self, world):
        return [RemoveEntities(list(self.entities))]

    def apply(self, world):
        agents = world.agents
        ids, columns = self.unpacked(agents)
        need(not np.isin(ids, agents.ids).any(), "some of these animals are there already")
        need(ids[-1] < world.next_entity, f"animal {ids[-1]} has never been in this world")
        self.fit(world, columns)
        make_place(world, columns)
        everybody = np.concatenate([agents.ids, ids])
        order = np.argsort(everybody, kind="stable")
        merged = {f: np.concatenate([agents[f], columns[f]])[order] for f in agents.arrays}
        world.become(everybody[order], merged, world.plain_entities(), world.next_entity)

    def unpacked(self, agents):
        """(ids, {field: rows}); ValueError if the data are invalid."""
        need(self.entities, "there are no animals to restore")
        need_entities(self.entities)
        ids, columns = np.array(self.entities, np.int64), {}
        need((np.diff(ids) > 0).all(), "entities must ascend")
        for field in agents.arrays:
            columns[field] = _unpacked(field, self.columns, len(ids))
        return ids, columns

    @staticmethod
    def fit(world, columns):
        """Raise ValueError if a brush, species or program of the rows no longer exists; missing goals become none."""
        brushes, goals = len(world.resource(Palette)), len(world.resource(Landscape).goals)
        for field in (BrushBinding.brush, BrushBinding.previous, BrushBinding.home):
            need(((columns[field] >= 0) & (columns[field] < brushes)).all(), "a brush of these animals is gone")
        kinds = len(world.resource(SpeciesList).names)
        need(((columns[Species.index] >= 0) & (columns[Species.index] < kinds)).all(), "their species is unknown")
        columns[Destination.goal][columns[Destination.goal] >= goals] = -1
        need_known_programs(world, columns)


def bring_back(world, entities):
    """Commands that restore these animals after their removal."""
    out = []
    for first in range(0, len(entities), MOST_AT_ONCE):
        some = entities[first : first + MOST_AT_ONCE]
        rows = rows_of(world, some.tolist())
        columns = {repr(f): _packed(world.agents[f][rows]) for f in sorted(world.agents.arrays, key=repr)}
        out.append(BringBack(some.tolist(), columns))
    return out


def _packed(rows):
    return base64.b64encode(zlib.compress(np.ascontiguousarray(rows).tobytes(), 1)).decode()


def _unpacked(field, columns, count):
    """The rows of a field that `_packed` packed; ValueError if they are damaged."""
    try:
        data = zlib.decompress(base64.b64decode(columns[repr(field)], validate=True))
        rows = np.frombuffer(data, field.default.dtype).reshape(count, *field.default.shape).copy()
    except (KeyError, TypeError, ValueError, zlib.error):
        raise ValueError(f"the column {field!r} of these animals is missing or damaged") from None
    return field.checked_rows(rows, (count,)).astype(field.default.dtype)


class OfThese:
    """A command to exactly these animals; undo restores the columns in ``changes``."""

    changes = tuple[Any, ...]()  # fields of components

    def rows(self, world):
        """(k,) rows of the given animals that are alive."""
        return rows_of(world, self.entities)

    def inverse(self, world):
        return columns_now(world, self.rows(world), self.changes)


@command
class GiveBrush(OfThese):
    """Give exactly these animals another own brush."""

    changes = (BrushBinding.home,)
    brush: str
    entities: list

    def apply(self, world):
        palette, fauna, rows = world.resource(Palette), world.resource(SpeciesList), rows_of(world, self.entities)
        index, kinds = palette.named(self.brush), world.agents[Species.index][rows]
        for kind in np.unique(kinds).tolist():
            why = cannot(palette, fauna, self.brush, fauna.names[kind])
            need(not why, why)
        world.agents[BrushBinding.home][rows] = index


@command
class Bind(OfThese):
    """Bind exactly these animals to a goal by its name; an empty name unbinds them."""

    changes = (Destination.goal,)
    goal: str
    entities: list

    def apply(self, world):
        goal = goal_index(world.resource(Landscape), self.goal) if self.goal else -1
        world.agents[Destination.goal][rows_of(world, self.entities)] = goal


@command
class PutColumns(OfThese):
    """Restore columns of exactly these animals, such as the destination of a flock or the wind it felt."""

    entities: list
    columns: dict  # of a component's field: its rows, packed

    @property
    def changes(self):
        """The fields, in order of name; ValueError for fields that must not be restored this way."""
        known = {repr(f): f for f in _MAY_BE_PUT}
        stray = sorted(set(self.columns) - set(known))
        need(not stray, f"{', '.join(stray)} cannot be put back" + did_you_mean(stray[0] if stray else "", known))
        return [known[name] for name in sorted(self.columns)]

    def apply(self, world):
        rows = rows_of(world, self.entities)
        given = {field: _unpacked(field, self.columns, len(rows)) for field in self.changes}
        need_known_programs(world, given)
        for field, values in given.items():
            world.agents[field][rows] = values


def need_known_programs(world, columns):
    """Raise ValueError unless the programs and states in these columns are in the world."""
    number = columns.get(ProgramState.program)
    if number is None or not (number >= 0).any():
        return
    sizes = np.array([len(program.states) for program in world.resource(Programs).programs], int)
    need((number < len(sizes)).all(), "the program of these animals is gone")
    state, follow = columns.get(ProgramState.state, number), number >= 0
    need(((state[follow] >= 0) & (state[follow] < sizes[number[follow]])).all(), "a state of these animals is gone")


_MAY_BE_PUT = (
    Leading.appointed, Leading.kind, Leading.target,
    Migration.kind, Migration.target, Migration.next, Migration.left,
    FormationPlace.gust, FormationPlace.wind, FormationPlace.felt, FormationPlace.lull,
    *ProgramState.fields.values(),
)  # fmt: skip


def columns_now(world, rows, fields):
    """Commands that restore the present values of these fields for the animals in these rows.

    A brush or a goal, each alone in ``fields``, is restored by its name.
    """
    ids = world.agents.ids[rows]
    named = next(iter(fields), None)
    if named in (BrushBinding.home, Destination.goal):
        brush, now = named is BrushBinding.home, world.agents[named][rows]
        goals = [*(goal.name for goal in world.resource(Landscape).goals), ""]
        give, names = (GiveBrush, world.resource(Palette).names) if brush else (Bind, goals)
        return [give(names[k], ids[now == k].tolist()) for k in np.unique(now).tolist()]
    parts = [slice(first, first + MOST_AT_ONCE) for first in range(0, len(rows), MOST_AT_ONCE)]
    return [
        PutColumns(ids[part].tolist(), {repr(f): _packed(world.agents[f][rows[part]]) for f in fields})
        for part in parts
    ]


@command
class UseBrush:
    """Add a brush to the world by its name and the text of its file; one of the same name is replaced."""

    name: str
    source: str

    def check(self, world):
        self.brush()

    def ground_box(self, world):
        return "all"

    def brush(self):
        """The brush; ValueError that describes its mistakes."""
        try:
            return load_brush(self.source.encode(), f"{self.name}.brush.toml")
        except ProblemsError as error:
            raise ValueError(str(error)) from None

    def inverse(self, world):
        return brush_now(world, self.name)

    def apply(self, world):
        palette, land, length = world.resource(Palette), world.resource(Landscape), world.agents[Body.length]
        palette.add(self.brush())
        if len(length):
            land.see_to(float(length.max() * palette.view_range.max()))


def brush_now(world, name):
    """The command, in a list, that restores the present entry of a brush in the palette, or its absence."""
    palette = world.resource(Palette)
    there = name in palette.index
    return [UseBrush(name, palette.brushes[palette.named(name)].source.decode()) if there else ForgetBrush(name)]


@command
class ForgetBrush:
    """Remove the newest brush from the palette, unless it is still in use."""

    name: str

    def inverse(self, world):
        return brush_now(world, self.name)

    def apply(self, world):
        palette, land = world.resource(Palette), world.resource(Landscape)
        index = palette.named(self.name)
        bound = [world.agents[f] for f in (BrushBinding.brush, BrushBinding.previous, BrushBinding.home)]
        about = (land.painted.brush == index).any() or any((column >= index).any() for column in bound)
        about |= any(zone.brush == self.name for zone in land.marks.zones)
        if not about and palette.own[-1].name == self.name:
            palette.forget(self.name)


@command
class MixBrush:
    """Add mixtures of this brush with every other brush of its model, for zones of partial weight.

    ``paths`` are measured paths, {name of the file: its text}; without them parameters are interpolated linearly.
    """

    name: str
    paths: dict

    def check(self, world):
        world.resource(Palette).named(self.name)
        for file, text in self.paths.items():
            try:
                path = load_path(str(text).encode(), file)
            except ProblemsError as error:
                raise ValueError(str(error)) from None
            need(self.name in (path.start, path.end), f"{file}: this path neither begins nor ends at {self.name!r}")

    def inverse(self, world):
        palette = world.resource(Palette)
        return [] if self.name in palette.over else [UnmixBrush(self.name, list(self.paths))]

    def apply(self, world):
        world.resource(Palette).mix(self.name, self.paths)


@command
class UnmixBrush:
    """Remove the mixtures with this brush from the palette, unless an animal or a zone uses one."""

    name: str
    paths: list  # names of the files

    def apply(self, world):
        palette = world.resource(Palette)
        first = palette.steps_to(self.name)
        bound = [world.agents[f] for f in (BrushBinding.brush, BrushBinding.previous, BrushBinding.home)]
        zones = world.resource(Landscape).marks.zones
        about = any(zone.brush == self.name and zone.bounds.blend == "mix" for zone in zones)
        if first is not None and not about and not any((column >= first).any() for column in bound):
            palette.unmix(self.name, self.paths)


# room for bodies -----------------------------------------------------------------


def make_room(world, trapped):
    """Move these animals, (n,) bool, to the nearest free place.

    Raises
    ------
    ValueError
        When there is none nearby.  No animal has moved then.
    """
    if not trapped.any():
        return
    agents = world.agents
    half, radius = agents[Body.axis], agents[Body.radius]
    bodies = [np.ascontiguousarray(c) for c in (*agents[Position.xyz][:, :2].T, *agents[Heading.forward][:, :2].T)]
    x, y, fx, fy = bodies
    find = _finder(world, 2.0 * float((half + radius).max()))
    stands = ~trapped
    for row in np.flatnonzero(trapped):
        others = Capsules(*(np.ascontiguousarray(c[stands]) for c in (x, y, fx, fy, half, radius)))
        found, x[row], y[row] = find(x[row], y[row], fx[row], fy[row], half[row], radius[row], others)
        need(found, f"animal {agents.ids[row]} stands there, and has no room to step aside")
        stands[row] = True
    agents[Position.xyz][:, 0], agents[Position.xyz][:, 1] = x, y


def make_place(world, columns):
    """Move newcomers, given as columns, that would overlap others or walls to the nearest free place."""
    land, agents = world.resource(Landscape), world.agents
    xyz, forward = columns[Position.xyz], columns[Heading.forward]
    half, radius = columns[Body.axis], columns[Body.radius]
    reach = 2.0 * float((half + radius).max())
    others = bodies_of(agents, land.wrap, reach)
    walls = np.ascontiguousarray(land.solid.ends)
    pressed = touching(xyz, forward, half, np.maximum(radius - PRESSED, 0.0), walls)
    pressed |= pressing(xyz, forward, half, radius, others)
    for polygon in land.solids:
        pressed |= inside_polygon(xyz, polygon)
    iy, ix = cell_under(land, xyz)
    pressed |= ~land.walkable[iy, ix] & on_map(land, xyz)
    if not pressed.any():
        return
    find = _finder(world, reach)
    mine = [xyz[:, 0].copy(), xyz[:, 1].copy(), forward[:, 0], forward[:, 1], half, radius]
    stands = ~pressed
    for row in np.flatnonzero(pressed):
        around = Capsules(*(np.concatenate([o, m[stands]]) for o, m in zip(others, mine, strict=True)))
        found, mine[0][row], mine[1][row] = find(*(m[row] for m in mine), around)
        need(found, "an animal cannot come back: there is no room where it stood")
        stands[row] = True
    xyz[:, 0], xyz[:, 1] = mine[0], mine[1]


def _finder(world, reach):
    """`nearest_free` for this landscape: (x, y, fx, fy, half, radius, others) to (found, x, y)."""
    land = world.resource(Landscape)
    ground = ground_for(land, reach, ~land.walkable)

    def find(x, y, fx, fy, half, radius, others):
        inside = ground._replace(bounds=inset(land, half + radius))
        return nearest_free(x, y, fx, fy, half, radius, inside, others)

    return find


def cell_under(land, xyz):
    """(iy, ix) of the cell under each animal; outside the map the nearest cell."""
    ny, nx = land.brush.shape
    return tuple(np.clip(np.floor(xyz[:, k] / land.cell), 0, n - 1).astype(np.int64) for k, n in ((1, ny), (0, nx)))


def on_map(land, xyz):
    """(n,) bool, animals on the map."""
    return (xyz[:, 0] >= 0) & (xyz[:, 1] >= 0) & (xyz[:, 0] < land.width) & (xyz[:, 1] < land.height)


@njit(cache=True, nogil=True, error_model="numpy")
def pressing(xyz, forward, half, radius, others):
    """(n,) bool, animals whose body overlaps another."""
    out = np.zeros(len(xyz), np.bool_)
    for i in range(len(xyz)):
        x, y, ux, uy = xyz[i, 0], xyz[i, 1], forward[i, 0], forward[i, 1]
        for j in range(len(others.x)):
            if overlaps_(x, y, ux, uy, half[i], radius[i] - PRESSED, others, j):
                out[i] = True
                break
    return out
