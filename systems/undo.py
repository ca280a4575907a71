"""Undo: the parts of a world that commands touch, and the commands that put back what has changed in them.

A command names the parts that it touches.  A part is looked at just before the command is applied (`taken`) and just
after (`back`): of what differs, all that the part declares is put back as it was, also what only later ticks change.
"""

from __future__ import annotations

import base64
import zlib
from typing import Any, NamedTuple

import numpy as np
from flockbrush.behaviours.brush import load_brush
from flockbrush.behaviours.file_library import NAME
from flockbrush.behaviours.mixture import load_path
from flockbrush.behaviours.validation import shown
from flockbrush.components import (
    Body,
    BrushBinding,
    Destination,
    ProgramState,
    Species,
)
from flockbrush.engine.commands import command, commands
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.systems.binding import cannot
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList
from flockbrush.systems.programs import Programs
from flockbrush.systems.room import place_newcomers

MOST_AT_ONCE = 10_000  # animals that come back in one command, which must fit into one record


def need(fine, message):
    """Raise ValueError with this message unless the condition holds."""
    if not fine:
        raise ValueError(message)


def need_plain(name):
    """Raise ValueError unless this can be the name of a brush or a program: no path to one."""
    need(NAME.fullmatch(name), f"name must be letters, digits, - and _, at most 64, got {shown(name)}")


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
    ids_wanted = np.sort(np.array(entities, np.int64))
    rows = np.minimum(np.searchsorted(ids, ids_wanted), max(len(ids) - 1, 0))
    return rows[ids[rows] == ids_wanted] if len(ids) else rows[:0]


class TouchedAnimals(NamedTuple):
    """Which animals there are: newborn ones are taken away, and those in ``rows``, whom it removes, return."""

    rows: np.ndarray = np.zeros(0, int)

    def taken(self, world):
        return world.next_entity, world.agents.ids.copy(), bring_back(world, world.agents.ids[self.rows])

    def back(self, world, taken):
        first, ids, again = taken
        returned = np.setdiff1d(world.agents.ids, ids, assume_unique=True).tolist()
        new = sorted({*returned, *range(first, world.next_entity)})
        return [*([RemoveEntities(new)] if new else []), *again]


class TouchedColumns(NamedTuple):
    """Numbers of animals, those in ``rows``."""

    rows: np.ndarray
    fields: tuple
    later: bool = False  # what the command changes shows only later: all are put back

    def taken(self, world):
        return world.agents.ids[self.rows], [_values(world, field)[self.rows] for field in self.fields]

    def back(self, world, taken):
        ids, before = taken
        changed = np.full(len(ids), self.later)
        for old, field in zip(before, self.fields, strict=True):
            new = _values(world, field)[self.rows]
            changed |= (old != new).any(axis=tuple(range(1, old.ndim)))
        return columns_of(self.fields, ids[changed], [old[changed] for old in before])


def _values(world, field):
    """(n, ...) a column; of brushes of their own and of goals the names."""
    if field is BrushBinding.home:
        return np.array([*world.resource(Palette).names, ""])[world.agents[field]]
    if field is Destination.goal:
        return np.array([*(goal.name for goal in world.resource(Landscape).goals), ""])[world.agents[field]]
    return world.agents[field]


def columns_of(fields, ids, values):
    """Commands that give these animals these values of fields: a brush or a goal, each alone, by its name."""
    if fields in ((BrushBinding.home,), (Destination.goal,)):
        give = GiveBrush if fields == (BrushBinding.home,) else Bind
        return [give(name, ids[values[0] == name].tolist()) for name in np.unique(values[0]).tolist()]
    parts = [slice(first, first + MOST_AT_ONCE) for first in range(0, len(ids), MOST_AT_ONCE)]
    return [
        PutColumns(ids[part].tolist(), {repr(f): _packed(v[part]) for f, v in zip(fields, values, strict=True)})
        for part in parts
    ]


class TouchedBrushes(NamedTuple):
    """The brushes of the world, and which of them are mixed."""

    @staticmethod
    def taken(world):
        palette = world.resource(Palette)
        return palette.own, palette.mixed, palette.path_files

    @staticmethod
    def back(world, taken):
        palette, (own, mixed, files) = world.resource(Palette), taken
        known, now = {brush.name: brush for brush in own}, {brush.name: brush for brush in palette.own}
        new_files = [file for file in palette.path_files if file not in files]
        old_files = {file: text for file, text in files.items() if file not in palette.path_files}
        return [
            *(UnmixBrush(name, new_files) for name in palette.mixed if name not in mixed),
            *(ForgetBrush(name) for name in reversed(now) if name not in known),
            *(UseBrush(name, brush.source.decode()) for name, brush in known.items() if now.get(name) is not brush),
            *(MixBrush(name, old_files) for name in mixed if name not in palette.mixed),
        ]


@command
class RemoveEntities:
    """Remove exactly these animals; ids of dead animals are ignored."""

    entities: list

    def touches(self, world):
        return [TouchedAnimals(rows_of(world, self.entities))]

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

    def touches(self, world):
        return [TouchedAnimals()]

    def apply(self, world):
        agents = world.agents
        ids, columns = self.unpacked(agents)
        need(not np.isin(ids, agents.ids).any(), "some of these animals are there already")
        need(ids[-1] < world.next_entity, f"animal {ids[-1]} has never been in this world")
        self.fit(world, columns)
        place_newcomers(world, columns)
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
    """A command to exactly these animals that changes the columns in ``changes``."""

    changes = tuple[Any, ...]()  # fields of components
    needs_fields = tuple[str, ...](["entities: list"])

    def rows(self, world):
        """(k,) rows of the given animals that are alive."""
        return rows_of(world, self.entities)

    def touches(self, world):
        return [TouchedColumns(self.rows(world), tuple(self.changes))]


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
        known = _may_be_put()
        stray = sorted(set(self.columns) - set(known))
        need(not stray, f"{', '.join(stray)} cannot be put back" + did_you_mean(stray[0] if stray else "", known))
        return [known[name] for name in sorted(self.columns)]

    def apply(self, world):
        rows, packed = rows_of(world, self.entities), np.unique(self.entities)
        here = np.isin(packed, world.agents.ids[rows])  # some may have left the world since
        columns = {field: _unpacked(field, self.columns, len(packed))[here] for field in self.changes}
        need_known_programs(world, columns)
        for field, values in columns.items():
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


def _may_be_put():
    """{name: field} of what commands change, and of what programs write; brushes and goals go by their names."""
    said = [cls.changes for cls in commands().values() if isinstance(getattr(cls, "changes", None), tuple)]
    fields = {*ProgramState.fields.values(), *(field for changes in said for field in changes)}
    return {repr(field): field for field in fields - {BrushBinding.home, Destination.goal}}


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
        need_plain(self.name)
        try:
            return load_brush(self.source.encode(), f"{self.name}.brush.toml")
        except ProblemsError as error:
            raise ValueError(str(error)) from None

    def touches(self, world):
        return [TouchedBrushes()]

    def foresee(self, world):
        world.resource(Palette).add(self.brush())

    def apply(self, world):
        self.foresee(world)
        length = world.agents[Body.length]
        if len(length):
            farthest = float(length.max() * world.resource(Palette).view_range.max())
            world.resource(Landscape).see_to(farthest)


@command
class ForgetBrush:
    """Remove the newest brush from the palette, unless it is still in use."""

    name: str

    def touches(self, world):
        return [TouchedBrushes()]

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
        palette = world.resource(Palette)
        palette.named(self.name)
        for file, text in self.paths.items():
            try:
                path = load_path(str(text).encode(), file, palette.own)
            except ProblemsError as error:
                raise ValueError(str(error)) from None
            need(self.name in (path.start, path.end), f"{file}: this path neither begins nor ends at {self.name!r}")

    def touches(self, world):
        return [TouchedBrushes()]

    def foresee(self, world):
        world.resource(Palette).mix(self.name, self.paths)

    def apply(self, world):
        self.foresee(world)


@command
class UnmixBrush:
    """Remove the mixtures with this brush from the palette, unless an animal or a zone uses one."""

    name: str
    paths: list  # names of the files

    def touches(self, world):
        return [TouchedBrushes()]

    def apply(self, world):
        palette = world.resource(Palette)
        first = palette.steps_to(self.name)
        bound = [world.agents[f] for f in (BrushBinding.brush, BrushBinding.previous, BrushBinding.home)]
        zones = world.resource(Landscape).marks.zones
        about = any(zone.brush == self.name and zone.bounds.blend == "mix" for zone in zones)
        if first is not None and not about and not any((column >= first).any() for column in bound):
            palette.unmix(self.name, self.paths)
