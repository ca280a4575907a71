"""Runs of levels: opening by name or path, recording, timing, and rebuilding from a recording."""

from __future__ import annotations

import json
import os
import posixpath
import sys
import time
import warnings
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath

import numpy as np

import flockbrush
from flockbrush import levels
from flockbrush.behaviours.brush import SUFFIX, Brush, load_brush
from flockbrush.engine import limits
from flockbrush.engine.arguments import checked
from flockbrush.engine.commands import Commands
from flockbrush.engine.files import output_problems, refused, sha256_of
from flockbrush.engine.keyframe_spacing import KeyframeSpacing
from flockbrush.engine.locks import Advice
from flockbrush.engine.problems import ProblemsError, did_you_mean
from flockbrush.engine.recording import MANY, RecordedRun, Recorder, Recording, RecordingError, resume
from flockbrush.engine.recording_format import packed_size
from flockbrush.engine.state import snapshot_parts, state_hash
from flockbrush.levels.build import Simulation, build
from flockbrush.levels.checked_nodes import parsed_document
from flockbrush.levels.document_nodes import every_layer, properties_without, values_of
from flockbrush.levels.libraries import brush_library, put_brush, recorded_library
from flockbrush.levels.reader import read_level, read_level_files
from flockbrush.levels.schema import CLASSES
from flockbrush.runs.builds import build_of_run

OF_PROGRAMS = ("Event", "SetState", "GiveProgram")  # commands that only animals with a program obey
SHIPPED = Path(levels.__path__[0]) / "shipped"
KEYFRAME_SECONDS = 10  # s; going to any moment of a recording lives at most so much again,
KEYFRAME_STEPS = 800_000  # and where there are many animals at most so many ticks times animals: a second or two,
KEYFRAME_LEAST = 8  # but no fewer ticks, or recordings of very many would be snapshots and nothing else;
KEYFRAME_ROOM = 10_000_000  # animals in snapshots, 1.4 GB: from there on the next ones get rarer
PACKED_MORE = 60  # bytes by which an animal in a snapshot grows when herds begin to move: 34 to 114 on shipped levels
PACKED_HASH = 45  # bytes of a tick's hash alone, as the playground records it
PACKED_TICK = 400  # bytes of a tick's hash and sums: 310 to 570 on shipped levels of 90 animals and more


# levels ------------------------------------------------------------------------


def shipped_levels() -> list[str]:
    """Names of the shipped levels."""
    return sorted(path.stem for path in SHIPPED.glob("*.tmj"))


@checked(name="the name of a shipped level or a path")
def find_level(name: str | os.PathLike) -> Path:
    """The file of a level given as a path, or as the name of a shipped one.

    Raises
    ------
    ProblemsError
        When there is neither.
    """
    path = Path(name)
    if str(name) in shipped_levels() and not path.is_file():
        return SHIPPED / f"{name}.tmj"
    if path.exists() or path.suffix or path.name != str(name):
        return path  # the reader says what is wrong with it
    hint = did_you_mean(str(name), shipped_levels())
    raise refused(name, f"there is no such file and no shipped level of this name{hint}")


def open_level(name):
    """(level, library of brushes) of a path or a shipped name; ProblemsError."""
    path = find_level(name)
    level = read_level(path)
    return level, brush_library(path, level.files)


@checked(
    name="the name of a shipped level or a path", brush=f"a Brush, the name of one or a {SUFFIX} file",
)  # fmt: skip
def start(
    name: str | os.PathLike, seed: int | None = None, agents: int | None = None,
    brush: Brush | str | os.PathLike | None = None,
) -> Simulation:  # fmt: skip
    """Build the simulation of a level, ready for its first tick.

    Parameters
    ----------
    name : str or path
        A level file, or the name of a shipped level.
    seed : int, optional
        Instead of the level's own.
    agents : int, optional
        So many animals in all, at the level's density.
    brush : Brush, str or path, optional
        What all animals of the level's spawns are given instead of their own: a brush, a name, or a .brush.toml file.
        It also stands for what the level calls so elsewhere, such as painted ground, even where that is a file.

    Raises
    ------
    ProblemsError
    """
    level, library = open_level(name)
    if brush is not None:
        level, library = _with_brush(level, library, brush)
    return begin(level, library, seed, agents)


def _with_brush(level, library, brush):
    """(level, library) with the brush of every spawn in the level's file replaced, and none following a program.

    Keys of the script that only programs obey are left out.

    A recording embeds the file.
    """
    asset = _brush_given(brush, library)
    left = sorted({spawn.program for spawn in level.spawns if spawn.program})
    if left:
        message = f"{level.name}: all animals have the brush {asset.name}, without programs: {', '.join(left)} left out"
        warnings.warn(Advice(message), stacklevel=4)
    built = build(level, library=library)
    files = built.assets()
    built.close()
    name = next(iter(files))
    spawns, document = {spawn.id for spawn in level.spawns}, parsed_document(files[name])
    for layer in every_layer(document["layers"]):
        if "objects" in layer:
            layer["objects"] = [thing for thing in layer["objects"] if not _is_key_of_programs(thing)]
        for thing in layer.get("objects", []):
            if thing["id"] in spawns:
                others = properties_without(thing, CLASSES["Spawn"], ("brush", "program"))
                thing["properties"] = [*others, {"name": "brush", "type": "string", "value": asset.name}]
    files[name] = json.dumps(document).encode()
    if others := [file for file in put_brush(files, asset.name, asset.source) if file in level.files]:
        message = f"{level.name}: the brush {asset.name} that is given counts everywhere, not {', '.join(others)}"
        warnings.warn(Advice(message), stacklevel=4)
    library = recorded_library(files)
    return read_level_files(files, library), library


def _brush_given(brush, library):
    """The brush that is meant; ProblemsError where there is none."""
    if isinstance(brush, Brush):
        return brush
    path = Path(brush)
    return load_brush(path) if path.name.endswith(SUFFIX) else library.get(str(brush))


def _is_key_of_programs(thing):
    """Whether an object gives a command that only animals with a program obey."""
    return values_of(thing, CLASSES["Key"]).get("command") in OF_PROGRAMS


def begin(level, library, seed=None, agents=None) -> Simulation:
    """Build the simulation of a level that was read, as `start` does; ProblemsError."""
    if agents is None:
        return build(level, seed, library=library)
    if not 1 <= agents <= limits.ANIMALS:
        raise refused(level.path, f"the number of animals must be 1 to {limits.ANIMALS}, got {agents}")
    try:
        return build(level, seed, agents, library)
    except ValueError as error:
        raise refused(level.path, str(error)) from None


def from_files(files, seed=None, agents=None) -> Simulation:
    """The world of a level from nothing but the bytes of its files (`Simulation.assets`), the level first.

    Raises
    ------
    ProblemsError
    """
    library = recorded_library(files)
    return begin(read_level_files(files, library), library, seed, agents)


# recordings ------------------------------------------------------------------------


@checked(simulation="a Simulation, such as flockbrush.start('meadow') gives")
def record(path: str | os.PathLike, simulation: Simulation, keyframes: int | None = None) -> Recorder:
    """Begin to record the simulation of a level before its first tick; call ``take()`` after every tick.

    A hash and sums are kept for every tick, so that a replay can name the very tick that differs; ``keyframes`` is the
    number of ticks between snapshots, `usual_keyframes` by default.

    Raises
    ------
    ProblemsError
        Where nothing can be written, or a file of the level would be lost; where there is no level, or it has run.
    """
    beginning = beginning_of(simulation)
    if problems := output_problems([path], simulation.inputs([path])):
        raise ProblemsError(problems)
    spacing = usual_keyframes(simulation, keyframes)
    return Recorder(Recording.create(path, *beginning), simulation.world, 1, spacing)


def usual_keyframes(simulation, keyframes: int | None = None) -> KeyframeSpacing:
    """Interval of snapshots of a recording: as given, or ten seconds, and less if ticks take long."""
    if (keyframes or 0) < 0:
        raise ValueError(f"keyframes must be at least 0, got {keyframes}")
    if keyframes:
        return KeyframeSpacing(keyframes)
    ticks = round(KEYFRAME_SECONDS / simulation.clock.dt)
    return KeyframeSpacing(ticks, KEYFRAME_STEPS, KEYFRAME_LEAST, KEYFRAME_ROOM)


def recording_size(simulation, ticks: int, keyframes: int | None = None) -> int:
    """About how many bytes a recording of so many ticks will have, if the herd stays as large as it is."""
    spacing, animals = usual_keyframes(simulation, keyframes), len(simulation.agents)
    ends = 3 if animals <= MANY else 0
    snapshots = ends + spacing.expected(ticks, animals)
    files = sum(map(len, simulation.assets().values()))
    return files // 4 + ticks * PACKED_TICK + snapshots * _snapshot_size(simulation)


def _snapshot_size(simulation):
    return packed_size(snapshot_parts(simulation.world)) + PACKED_MORE * len(simulation.agents)


def hashed_rate(simulation) -> float:
    """About how many bytes a recording of hashes and snapshots, without sums, grows by in a second of an hour."""
    ticks = round(3600 / simulation.clock.dt)
    snapshots = usual_keyframes(simulation).expected(ticks, len(simulation.agents))
    return (ticks * PACKED_HASH + snapshots * _snapshot_size(simulation)) / 3600


def beginning_of(simulation):
    """(header, assets) of the recording of a simulation before its first tick; ProblemsError where it cannot be one."""
    level, tick = simulation.level, simulation.clock.tick
    if not level.files:
        why = "it was not read from a level file, which a recording embeds; draw a level and start that"
        raise refused(level.name, f"this simulation cannot be recorded: {why}")
    if tick or simulation.world.resource(Commands).log:
        happened = f"it is at tick {tick}" if tick else "commands have changed it already"
        why = f"{happened}, and what was before would be lost; start the level anew and record it from the first tick"
        raise refused(level.path, f"this simulation cannot be recorded: {why}")
    name, assets = rooted(simulation.assets(), level.path)
    header = {
        **simulation.origin,
        "dt": simulation.clock.dt,
        "level": name,
        "flockbrush": flockbrush.__version__,
        "build": {key: value for key, value in build_of_run().as_json().items() if key != "packages"},
    }
    return header, assets


@checked(run="a recording, such as flockbrush.open_recording(path) gives")
def rebuild(run: RecordedRun) -> Simulation:
    """Rebuild the simulation of a recording before its first tick, from the files that the recording embeds.

    Its ticks give the recorded states again: the recorded commands are applied when they were.

    Raises
    ------
    RecordingError
        When the files embedded are no level, or the recording is of something else.
    ProblemsError
        With everything that is wrong with the embedded files.
    """
    simulation = begin_again(run)
    resume(run, simulation.world)
    return simulation


def begin_again(run: RecordedRun) -> Simulation:
    """The simulation of a recording before its first tick, to which only its level's script will happen.

    Raises what `rebuild` does.
    """
    level, library = embedded_level(run)
    seed, agents = run.header["seed"], run.header.get("agents")
    if agents is not None and not isinstance(agents, int):
        raise RecordingError(f"{run.path}: the number of animals in the header must be a whole number, got {agents!r}")
    with _named(run):
        simulation = begin(level, library, seed, agents)
    if run.header["dt"] != simulation.clock.dt:
        raise RecordingError(
            f"{run.path}: recorded with a tick of {run.header['dt']} s; this version uses {simulation.clock.dt} s"
        )
    return simulation


def unlike_recorded(run: RecordedRun, simulation: Simulation) -> str:
    """A sentence if the simulation of a recording is in another state than was recorded for this tick, or ""."""
    tick = simulation.clock.tick
    if run.hashes.get(tick) in (None, state_hash(simulation.world)):
        return ""
    return (
        f"{run.path}: this is not what was recorded: the state at tick {tick} differs. The code that recorded it "
        f"(flockbrush {run.header.get('flockbrush', 'of an unknown version')}) shows the recorded motion; "
        "`flockbrush replay --verify` says where the two part"
    )


def go_to(run: RecordedRun, simulation: Simulation, tick: int, stop=lambda tick: None):
    """Replay a recording to this tick, from the nearest snapshot before it."""
    resume(run, simulation.world, tick)
    while simulation.clock.tick < tick:
        simulation.tick()
        stop(simulation.clock.tick)


def rooted(files, level_path):
    """(name of the level, files) with names that stay below one folder, where a level's own may begin with "../".

    >>> rooted({"a.tmj": b"", "../tilesets/t.tsj": b""}, Path("/designs/shipped/a.tmj"))[0]
    'shipped/a.tmj'
    """
    climbs = max(PurePosixPath(posixpath.normpath(name)).parts.count("..") for name in files)
    above = Path(os.path.abspath(level_path)).parent.parts[1:]
    home = "/".join((("level",) * climbs + above)[-climbs:]) if climbs else ""
    home = home.replace("\\", "_").replace(":", "_")
    renamed = {posixpath.normpath(posixpath.join(home, name)): data for name, data in files.items()}
    return posixpath.join(home, next(iter(files))), renamed


def source_of(path) -> dict[str, str]:
    """Name and SHA-256 of a recording, by label."""
    return {"recording": Path(path).name, "recording SHA-256": sha256_of(path)}


def embedded_level(run: RecordedRun):
    """(level, library of brushes) from the files of a recording; RecordingError, and ProblemsError that names it."""
    files = embedded(run)
    with _named(run):
        library = recorded_library(files)
        return read_level_files(files, library), library


@contextmanager
def _named(run):
    """A context in which problems of the files of a recording name the recording."""
    try:
        yield
    except ProblemsError as error:
        raise ProblemsError(replace(one, file=f"{run.path}: {one.file}") for one in error.problems) from None


def embedded(run: RecordedRun) -> dict[str, bytes]:
    """The files of a recording by their names relative to the level, the level first."""
    name = run.header.get("level")
    if not isinstance(name, str) or name not in run.assets:
        raise RecordingError(f"{run.path}: this is a recording, but not of a level")
    home = posixpath.dirname(name) or "."
    others = {posixpath.relpath(other, home): data for other, data in run.assets.items() if other != name}
    return {posixpath.basename(name): run.assets[name]} | others


# how long it takes --------------------------------------------------------------------


class Stopwatch:
    """Seconds of every tick; the first one, which loads the kernels, counts as part of the start."""

    def __init__(self, simulation):
        self.simulation = simulation
        self.seconds: list[float] = []
        self.startup = float("nan")  # s, from the start of the program to the end of the first tick
        self._loading: dict[str, int] = {}

    def tick(self):
        """One tick, timed."""
        begin = time.perf_counter()
        self.simulation.tick()
        end = time.perf_counter()
        if np.isnan(self.startup):
            self.startup = end - flockbrush.BEGAN
            self._loading = dict(self.simulation.schedule.nanoseconds)
            self._first = end - begin
        else:
            self.seconds.append(end - begin)

    def per_tick(self):
        """{median, p95} in seconds, after the first tick."""
        seconds = self.seconds or ([self._first] if self._loading else [float("nan")])
        return {"median": float(np.median(seconds)), "p95": float(np.percentile(seconds, 95))}

    def systems(self):
        """Seconds spent in each system after the first tick."""
        total = self.simulation.schedule.nanoseconds
        return {name: (spent - self._loading.get(name, 0)) / 1e9 for name, spent in total.items()}


def peak_memory():
    """Peak memory of this process, MiB; NaN if the system does not report it."""
    try:
        import resource
    except ImportError:  # Windows
        return float("nan")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10


def versions():
    """{package: version} of Flockbrush and of the packages that may change a run."""
    from flockbrush.engine.fingerprint import package_versions

    return {"flockbrush": flockbrush.__version__} | package_versions()
