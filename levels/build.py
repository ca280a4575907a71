"""Builds the simulation of a level: columns, resources and systems."""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath

import numpy as np
from flockbrush.behaviours.brush import Brush, BrushSource, shipped
from flockbrush.behaviours.mixture import path_between
from flockbrush.behaviours.program import known_brushes
from flockbrush.behaviours.species import shipped_species
from flockbrush.components import AGENT
from flockbrush.components.level_things import ENUMS
from flockbrush.engine import limits
from flockbrush.engine.arguments import checked
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import Commands, from_record, tick_at
from flockbrush.engine.noise import Noise, seed_of
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.engine.schedule import Schedule
from flockbrush.engine.world import World
from flockbrush.levels.libraries import input_files
from flockbrush.levels.scaling import scaled
from flockbrush.levels.schema import Level, Spawn
from flockbrush.levels.terrain_kinds import TERRAINS, Terrain, TerrainKind, default_terrain
from flockbrush.systems import edits as _edits  # noqa: F401  a designer's commands are known wherever a level is
from flockbrush.systems import mark_commands as _mark_commands  # noqa: F401
from flockbrush.systems import program_commands as _program_commands
from flockbrush.systems.binding import mixed_brushes, sheets_of
from flockbrush.systems.commands import ApplyCommands
from flockbrush.systems.decide import Roles
from flockbrush.systems.foresight import Ahead, SeeAhead, ShiftMigration
from flockbrush.systems.ground import Underfoot
from flockbrush.systems.groups import measures_of, summary
from flockbrush.systems.landscape import (
    BARE,
    NATIVE,
    OF_BARE,
    Landscape,
    Native,
    Painted,
)
from flockbrush.systems.level_lists import rehearsal, rehearse
from flockbrush.systems.life import Live, Nursery, births_due, spawn_animals
from flockbrush.systems.marks import MapMarks
from flockbrush.systems.motion import Move
from flockbrush.systems.noticing import BeAlarmed, Notice, Noticed
from flockbrush.systems.pace import Pace
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import NoRoom, SpeciesList
from flockbrush.systems.program_reports import count_by_state, transitions
from flockbrush.systems.programs import Programs, RunPrograms
from flockbrush.systems.senses import (
    FindNeighbours,
    Near,
    ObstaclesInSight,
    See,
    SeeInSpace,
    SeeObstacles,
    Sight,
    SightInSpace,
)
from flockbrush.systems.spawning import INNER
from flockbrush.systems.steer import AskModels
from flockbrush.systems.terrain import compose_brushes, relief_of

DT = 1 / 32  # s; a power of two: tick * dt is exact


class Simulation:
    """A running level: its world, its schedule and its measures."""

    def __init__(self, world: World, level: Level, shuffle_seed: int | None = None):
        self.world, self.level = world, level
        self.origin: dict[str, int | None] = {}  # seed and number of animals that were asked for, if `build` made it
        self.schedule = Schedule(systems(), shuffle_seed)

    def __repr__(self):
        clock = self.clock
        return f"<Simulation {self.level.name}: {len(self.agents)} animals, tick {clock.tick} ({clock.now:g} s)>"

    def __copy__(self):
        return copy.deepcopy(self)  # one that goes on by itself

    @property
    def clock(self) -> Clock:
        return self.world.resource(Clock)

    @property
    def agents(self):
        """The columns of all animals."""
        return self.world.agents

    def tick(self) -> None:
        """Run one tick."""
        self.schedule.run(self.world)
        self.clock.tick += 1

    @checked()
    def run(self, ticks: int) -> None:
        """Run some ticks; TypeError or ValueError where it is no whole number, or less than 0."""
        if ticks < 0:
            raise ValueError(f"ticks must be at least 0, got {ticks}")
        for _ in range(ticks):
            self.tick()

    def submit(self, command, tick: int = 0) -> None:
        """Submit a command, which is applied at the start of the given tick, or of the next tick."""
        self.world.resource(Commands).submit(command, tick)

    def measures(self) -> dict[str, float]:
        """Measures at this tick by name (`flockbrush.systems.measures`)."""
        return measures_of(self.world)

    def parts(self):
        """Counts and measures at this tick by species, brush and group (`flockbrush.systems.groups`)."""
        return summary(self.world)

    def inputs(self, outputs: Sequence = ()) -> list[Path]:
        """The files on disk that this simulation was made from; nothing may be written in their place.

        A recording does not know where its level is: those of the ``outputs`` that hold one of its files are among
        them.
        """
        assets = self.assets()
        sizes = set(map(len, assets.values()))
        there = [path for path in map(Path, outputs) if path.is_file() and path.stat().st_size in sizes]
        return input_files(self.level.path, assets) + [path for path in there if path.read_bytes() in assets.values()]

    def assets(self) -> dict[str, bytes]:
        """All files this simulation was made from, as bytes by name; a recording embeds them."""
        palette = self.world.resource(Palette)
        species = [one for one in self.world.resource(SpeciesList).assets if one is not None]
        names = {PurePosixPath(name).name: data for name, data in self.level.files.items()}
        own = {f"{brush.name}.brush.toml": brush.source for brush in palette.own}
        files = {f"brushes/{name}": data for name, data in own.items() if names.get(name) != data} | self.level.paths
        files |= {f"species/{one.name}.species.toml": one.source for one in species}
        programs = self.world.resource(Programs).programs
        return self.level.files | files | {f"programs/{p.name}.program.toml": p.source for p in programs}

    def event(self, name, x=0.0, y=0.0, radius=0.0):
        """Send a named event to programs in the next tick: for all animals, or those within a radius (m) of a place."""
        self.submit(_program_commands.Event(name, x, y, radius), self.clock.tick)

    def states(self):
        """{program: {state: how many animals are in it}}."""
        return count_by_state(self.world)

    def transitions(self):
        """{program: {from: {to: how often animals went so}}}, since the start."""
        return transitions(self.world)

    def close(self) -> None:
        """Release the world."""
        self.world.close()


def systems():
    """The systems of a tick, in order."""
    return [
        ApplyCommands(),
        Underfoot(),
        FindNeighbours(),
        See(),
        SeeObstacles(),
        SeeInSpace(),
        SeeAhead(),
        Notice(),
        ShiftMigration(),
        Roles(),
        BeAlarmed(),
        RunPrograms(),
        AskModels(),
        Pace(),
        Move(),
        Live(),
    ]


@checked(level="a Level, such as flockbrush.read_level(path) gives", library="a BrushLibrary")
def build(
    level: Level,
    seed: int | None = None,
    agents: int | None = None,
    library: BrushSource | None = None,
    shuffle_seed: int | None = None,
) -> Simulation:
    """Build the simulation of a level.

    Parameters
    ----------
    seed : int, optional
        Instead of the level's own.
    agents : int, optional
        So many animals in all, instead of the level's counts; spawn areas are scaled so that density stays, and
        the map grows where they would not fit.
    library : BrushLibrary, optional
        Where brushes are looked up; the shipped ones by default.
    shuffle_seed : int, optional
        Shuffle systems inside their stages: a test that order does not matter.

    Raises
    ------
    ProblemsError
        When animals do not fit into their spawn, or a script command is unknown.
    """
    library = shipped() if library is None else library
    species = list(dict.fromkeys(spawn.species for spawn in level.spawns))  # scripts may name species that do not come
    if agents is not None:
        level = scaled(level, agents)
    world = World(AGENT, capacity=max(256, level.agents))
    palette, seed = _palette(level, library), seed_of(level.seed if seed is None else seed)
    for resource in (
        Clock(DT),
        Noise(seed),
        Commands(),
        SpeciesList(species, getattr(library, "species", None) or shipped_species()),
        palette,
        Near(),
        Sight(),
        ObstaclesInSight(),
        SightInSpace(),
        Ahead(),
        Noticed(),
        programs_of(level, palette),
    ):
        world.insert(resource)
    world.insert(landscape_of(level, palette))
    simulation = Simulation(world, level, shuffle_seed)
    simulation.origin = {"seed": seed, "agents": agents}
    _bear_first(world, level)
    _queue_script(simulation, level)
    return simulation


def _palette(level, library):
    """The brushes of a level, and those between two that its paint of part weight gives."""
    brushes, over, paths = [_brush_of(library, name) for name in brushes_used(level)], mixed_brushes(level), {}
    level.paths = {}
    for start, end in itertools.product(brushes, over):
        path = path_between(library, start.name, end) if start.name != end else None
        if path is not None:
            file, source = library.path_between(start.name, end)
            level.paths[f"brushes/{file.name}"] = source
            paths[start.name, end] = path
    try:
        return Palette(brushes, over, paths)
    except ValueError as error:  # a model refuses the numbers between two brushes
        raise ProblemsError([Problem(str(level.path), None, None, f"paint of part weight: {error}")]) from None


def _brush_of(library, name):
    if isinstance(brush := library.get(name), Brush):
        return brush
    raise TypeError(f"library must be a BrushLibrary; its get({name!r}) gave {brush!r}")


def brushes_used(level):
    """Names of all brushes a level names, sorted."""
    names = {spawn.brush for spawn in level.spawns}
    names |= {name for layer in level.brush_layers for name in layer.assets}
    names |= {zone.brush for zone in level.zones if zone.brush}
    brought = [(key.args.get("name"), key.at) for key in level.script if key.command == "UseBrush"]
    for key in level.script:
        name = key.args.get("brush")
        if name and not any(other == name and at <= key.at for other, at in brought):
            names.add(name)
    names |= {brush for program in level.programs.values() for brush in program.brushes}
    return sorted(names)


def programs_of(level, palette):
    """The programs of a level, in order of name; ProblemsError for brushes that there are not."""
    programs, problems = Programs(), []
    for name in sorted(level.programs):
        problems += known_brushes(level.programs[name], palette.names, f"{name}.program.toml")
        programs.put(level.programs[name])
    if problems:
        raise ProblemsError(problems)
    return programs


def landscape_of(level, palette):
    """The landscape of a level as the kernels want it."""
    shape, terrain = level.shape, level.terrain or Terrain.blank(level.shape)
    height = level.height_map
    cap = np.full(shape, np.inf) if level.cap is None else level.cap.values.copy()
    painted = Painted(
        compose_brushes([b for b in level.brush_layers if b.plain], [], shape, level.cell, palette.names),
        cap,
        np.full(shape, NATIVE, np.int16),
    )
    kinds = kinds_of_ground(level)
    native = Native(
        terrain.speed_factor.copy(),
        terrain.walkable.copy(),
        terrain.blocks_view.copy(),
        terrain.cost.copy(),
        _kinds_of(terrain, kinds),
        more={name: values for name, values in terrain.values.items() if name not in OF_BARE},
    )
    land = Landscape(
        level.width,
        level.height,
        level.boundary,
        level.cell,
        np.stack([native.factor, cap], axis=-1),
        painted.brush.copy(),
        native.walkable,
        native.blind,
        native.cost,
        relief_of() if height is None else relief_of(height.values, height.cell, level.boundary == "wrap"),
        1.0 if height is None else height.cell,
        [replace(o) for o in level.obstacles],
        [replace(guide) for guide in level.guides],
        [replace(goal, xy=np.asarray(goal.xy, float)) for goal in level.goals],
        [replace(way_out) for way_out in level.exits],
        _farthest_view(level, palette),
        kinds=kinds,
        of_bare=default_terrain(),
        painted=painted,
        native=native,
        marks=MapMarks(
            level.zones, level.lines, level.areas, level.script, palette.names, sheets_of(level, palette.names),
            None if level.factor is None else level.factor.values,
        ),
    )  # fmt: skip
    land.marks.lay(land)
    land.rebuild()
    return land


def kinds_of_ground(level):
    """What one can paint: the kinds of the level's tilesets, and the standard ones it does not have."""
    names = {kind.name for kind in level.kinds}
    return [*level.kinds, *(TerrainKind.of(kind) for kind in TERRAINS if kind["name"] not in names)]


def _kinds_of(terrain, kinds):
    """(ny, nx) int16, the ground of a level counted in kinds; `BARE` for a kind that no tileset has."""
    names = [kind.name for kind in kinds]
    of = [names.index(name) if name in names else BARE for name in terrain.names]
    return np.array([*of, BARE], np.int16)[terrain.index]


def _farthest_view(level, palette):
    """Metres: of any animal under any brush it may meet."""
    lengths = [s.body_length or palette.brushes[palette.named(s.brush)].body.length for s in level.spawns]
    return float(max(lengths, default=1.0) * max(palette.view_range, default=4.0))


def _bear_first(world, level):
    """Spawns that start at once bring their animals before the first tick; the others later."""
    world.insert(nursery := Nursery())
    problems, full = [], None
    for spawn in level.spawns:
        born = 0
        if births_due(spawn, 0.0) >= spawn.count > 0 and spawn.start <= 0:
            born = spawn.count
            try:
                spawn_animals(world, spawn, spawn.count, f"spawn {spawn.id}")
            except NoRoom as error:
                full = error
                problems.append(_no_room(level, spawn, full))
        nursery.put(replace(spawn), born)
    if problems:
        raise ProblemsError(problems) from full


def _no_room(level, spawn, full):
    where = f"object {spawn.id} {spawn.name!r} in layer 'spawns'"
    return Problem(
        str(level.path), None, where, f"{full}; enlarge the area, reduce the count, or remove obstacles from the area"
    )


def _queue_script(simulation, level):
    if not level.script:
        return
    world, given, problems = simulation.world, {}, []
    with rehearsal(world):  # what can be known before the run is said before the run
        for k, key in sorted(enumerate(level.script), key=lambda entry: tick_at(entry[1].at, DT)):
            try:
                given[k] = from_record(key.command, key.args)
                if any(there.id == key.id for there in world.resource(Landscape).marks.keys):  # else one took it away
                    rehearse(world, given[k])
            except (ValueError, LookupError) as error:
                where = f"object {key.id} {key.name!r} in layer 'script'"
                problems.append(Problem(str(level.path), key.line, where, str(error.args[0] if error.args else error)))
    if problems:
        raise ProblemsError(sorted(problems, key=lambda problem: problem.line or 0))
    for k, key in enumerate(level.script):
        world.resource(Commands).submit(given[k], tick_at(key.at, DT), key.id)


# without a level file --------------------------------------------------------------


@checked(brush="a Brush, such as flockbrush.shipped().get('march')")
def plane(
    brush: Brush,
    count: int,
    density: float = 0.7,
    start: str = "scatter",
    seed: int = 0,
    heading: float | None = None,
    body_length: float | None = None,
) -> Simulation:
    """A simulation of one herd on an endless plane, for brush previews, searches and tests.

    Parameters
    ----------
    brush : Brush
    count : int
    density : float
        Animals per square body length at the start.
    start : {"scatter", "grid", "ring", "mill", "line"}
        As `flockbrush.systems.spawning.place`.
    heading : float, optional
        Radians; None: each its own.

    Raises
    ------
    TypeError, ValueError
        When something is not of its kind, or out of range.
    ProblemsError
        When so many animals have no room at this density.
    """
    return herds_apart([brush], count, density, start, seed, heading, body_length)


@checked()
def herds_apart(
    brushes: Sequence[Brush],
    count: int,
    density: float = 0.7,
    start: str = "scatter",
    seed: int = 0,
    heading: float | None = None,
    body_length: float | None = None,
    apart: float = 0.0,
) -> Simulation:
    """A simulation of several herds on one endless plane, each with its own brush; cheaper than several worlds.

    Parameters
    ----------
    brushes : sequence of Brush
        Of different names.  Herd k has the rows from ``k * count`` on.
    count : int
        Animals of each herd.
    apart : float
        Metres between the middles of two herds, at least: farther than they can go and see.

    The others as `plane`.
    """
    if start not in ENUMS["Formation"]:
        raise ValueError(f"start must be one of {', '.join(ENUMS['Formation'])}, got {start!r}")
    length = brushes[0].body.length if body_length is None else body_length
    if not (0 <= count <= limits.ANIMALS and 0 < density < math.inf and 0 < length < math.inf):
        raise ValueError(f"count must be 0 to {limits.ANIMALS}, density and body_length > 0: {count, density, length}")
    side = math.sqrt(count / density) * length
    size = max(3 * side + 20 * length, apart)
    low, high = 0.5 * (size - side), 0.5 * (size + side)
    if start in INNER:  # the ring leaves the middle free, and a disc leaves the corners
        grow = 0.5 * side * (math.sqrt(4 / math.pi / (1 - INNER[start] ** 2)) - 1)
        low, high = low - grow, high + grow
    square = np.array([(low, low), (high, low), (high, high), (low, high)])
    columns = math.ceil(math.sqrt(len(brushes)))
    spawns = [
        Spawn(
            k + 1, "herd", square + size * np.array([k % columns, k // columns]), "animal", brush.name, count,
            heading, formation=start, body_length=body_length,
        )
        for k, brush in enumerate(brushes)
    ]  # fmt: skip
    width, depth = size * columns, size * math.ceil(len(brushes) / columns)
    cell = max(max(width, depth) / 64, length)
    level = Level("plane", None, width, depth, cell, "open", seed, spawns=spawns)  # type: ignore[arg-type]
    try:
        return build(level, library=_Named(brushes))
    except ProblemsError as error:
        if not isinstance(error.__cause__, NoRoom):
            raise
        words = f"{error.__cause__} at {density:g} per square body length"
        raise ProblemsError([Problem("density", None, None, words)]) from None


class _Named:
    """A library that holds these brushes and no others."""

    def __init__(self, brushes):
        self.brushes = {brush.name: brush for brush in brushes}

    def get(self, name):
        return self.brushes[name]
