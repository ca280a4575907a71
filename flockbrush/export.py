"""Files that leave us: video, pictures, tables and scenes, written as the run goes on and never held in memory whole.

`Exports` takes moments from a running simulation and hands them to one `Exporter` for each file; the ending of the
name says which.  A file gets its name when it is complete; one that was interrupted is complete up to there, and one
that failed is not there.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

import flockbrush
from behaviours.problems import Problem, ProblemsError
from components import Body, Position
from engine.clock import Clock
from flockbrush.files import output_problems, publish, refused, temporary_beside, write_text
from flockbrush.moments import Moment, Sampler, names_of
from systems.measures import compute_milling, compute_polarization

SCHEMA = "flockbrush.trajectory/1"
COLUMNS = (
    "frame", "time", "id", "x", "y", "z", "vx", "vy", "vz", "heading", "speed", "species", "brush", "role", "reference",
)  # fmt: skip
BEAT, FASTEST_BEAT = 3.4, 6.0  # wing beats a second: of a bird 1 m long, and as many as can be seen in a video
WALKING = 2.0  # body lengths a second: a bird on the ground that is faster flies
IN_SPACE = (1280, 720)  # pixels of a picture in space
WORDS = 90  # pixels for title, legend and scale
ROLES = np.array(["follower", "leader"])


class Exporter:
    """Writes the moments of a run into one file.

    Subclasses get ready in `open`, write to ``self.temporary`` in `take`, and complete it in `finish`.
    """

    fps = 32.0  # moments per second unless told; 32 is every tick
    needs: tuple[tuple[str, str], ...] = ()  # (module, package) beyond what Flockbrush itself needs

    def __init__(self, path, simulation, fps, **options):
        self.path, self.simulation, self.fps, self.options = Path(path), simulation, float(fps), options
        self.frames = 0
        self.temporary = temporary_beside(path)

    def open(self):
        """Get ready for the first moment."""

    def take(self, moment: Moment):
        """Write one moment."""
        raise NotImplementedError

    def finish(self):
        """Complete the temporary file."""

    def let_go(self):
        """Close what is open without completing it."""

    def close(self):
        """Complete the file and give it its name."""
        self.finish()
        publish(self.temporary, self.path)

    def abandon(self):
        """Leave no trace; what had the name before keeps it."""
        try:
            self.let_go()
        except Exception:  # noqa: BLE001  it is half written: it may complain about that
            pass
        self.temporary.unlink(missing_ok=True)


# tables --------------------------------------------------------------------------


def columns_of(moment: Moment, frame, species, brushes):
    """{column of `COLUMNS`: array} of one moment; species and brush are indices into their names."""
    x, y, z = moment.xyz.T
    vx, vy, vz = moment.velocity.T
    n = len(moment)
    return {
        "frame": np.full(n, frame, np.int32),
        "time": np.full(n, moment.time),
        "id": moment.ids,
        "x": x, "y": y, "z": z, "vx": vx, "vy": vy, "vz": vz,
        "heading": np.arctan2(moment.forward[:, 1], moment.forward[:, 0]),
        "speed": np.linalg.norm(moment.velocity, axis=1),
        "species": moment.species,
        "brush": moment.brush,
        "role": moment.leader.astype(int),
        "reference": moment.reference,
    }  # fmt: skip


def metadata_of(simulation, fps):
    """What a reader of a table must know beside its columns."""
    level = simulation.level
    first = next(iter(level.files.values()), b"")
    return {
        "schema": SCHEMA,
        "fps": fps,
        "unit": "m",
        "unit_time": "s",
        "unit_angle": "rad",
        "axes": "x east, y north, z up; heading counter-clockwise from east",
        "level": level.name,
        "level_sha256": hashlib.sha256(first).hexdigest(),
        "width": level.width,
        "height": level.height,
        "boundary": level.boundary,
        "seed": simulation.origin["seed"],
        "dt": simulation.clock.dt,
        "version": flockbrush.__version__,
    }


class Csv(Exporter):
    """A table for everybody: six decimals, and the metadata in ``NAME.csv.json`` beside it."""

    _ROW = "%d,%.6f,%d,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%.6f,%s,%s,%s,%d\n"

    def open(self):
        self._file = open(self.temporary, "w", encoding="utf-8", newline="", buffering=1 << 20)
        self._file.write(",".join(COLUMNS) + "\n")

    def take(self, moment):
        species, brushes = ([_quoted(name) for name in names] for names in names_of(self.simulation))
        table = columns_of(moment, self.frames, species, brushes)
        for name in ("x", "y", "z", "vx", "vy", "vz", "heading", "speed"):
            table[name] = np.round(table[name], 6) + 0.0  # no "-0.000000"
        table["species"] = [species[k] for k in moment.species]
        table["brush"] = [brushes[k] for k in moment.brush]
        table["role"] = ROLES[table["role"]]
        columns = [column if isinstance(column, list) else column.tolist() for column in table.values()]
        self._file.writelines(map(self._ROW.__mod__, zip(*columns, strict=True)))
        self.frames += 1

    def finish(self):
        self._file.close()
        text = json.dumps(metadata_of(self.simulation, self.fps) | {"frames": self.frames}, indent=2)
        write_text(sidecar(self.path), text + "\n")

    def let_go(self):
        self._file.close()


def _quoted(name):
    """A name as one field of a CSV."""
    return '"' + name.replace('"', '""') + '"' if any(c in name for c in ',"\r\n') else name


def sidecar(path) -> Path:
    """Where the metadata of a CSV goes."""
    return Path(f"{path}.json")


class Parquet(Exporter):
    """A table for large runs: exact numbers, metadata in the schema."""

    needs = (("pyarrow", "pyarrow"),)
    _ROWS = 1 << 18  # in memory before they are written

    def open(self):
        import pyarrow as pa
        import pyarrow.parquet as pq

        self._pa, self._waiting, self._rows = pa, [], 0
        words = pa.dictionary(pa.int32(), pa.string())
        kinds = {"frame": pa.int32(), "id": pa.int64(), "reference": pa.int64()}
        kinds |= {"species": words, "brush": words, "role": words}
        schema = pa.schema([(name, kinds.get(name, pa.float64())) for name in COLUMNS])
        about = {key: str(value) for key, value in metadata_of(self.simulation, self.fps).items()}
        self._writer = pq.ParquetWriter(self.temporary, schema.with_metadata(about), compression="zstd")
        self._schema = self._writer.schema

    def take(self, moment):
        pa = self._pa
        species, brushes = names_of(self.simulation)
        table = columns_of(moment, self.frames, species, brushes)
        for name, words in (("species", species), ("brush", brushes), ("role", ROLES)):
            codes = pa.array(np.asarray(table[name], np.int32))
            table[name] = pa.DictionaryArray.from_arrays(codes, pa.array(list(words), pa.string()))
        arrays = [table[name] if name in ("species", "brush", "role") else pa.array(table[name]) for name in COLUMNS]
        self._waiting.append(pa.Table.from_arrays(arrays, schema=self._schema))
        self._rows += len(moment)
        self.frames += 1
        if self._rows >= self._ROWS:
            self._write()

    def _write(self):
        if self._waiting:
            whole = self._pa.concat_tables(self._waiting).unify_dictionaries()
            self._writer.write_table(whole, row_group_size=self._ROWS)
        self._waiting, self._rows = [], 0

    def finish(self):
        self._write()
        self._writer.close()

    def let_go(self):
        self._writer.close()


# pictures ----------------------------------------------------------------------------


def herd_of(simulation, moment: Moment):
    """The animals of a moment as the painter wants them."""
    from flockbrush.draw.herd import Herd
    from systems.palette import Palette

    palette = simulation.world.resource(Palette)
    danger = palette.danger.astype(bool)
    return Herd(
        xy=moment.xyz[:, :2],
        forward=moment.forward,
        length=moment.length,
        radius=moment.radius,
        leader=moment.leader,
        brush=moment.brush,
        species=moment.species,
        brush_colours=tuple(brush.colour for brush in palette.brushes),
        brush_names=tuple(palette.names),
        predator=danger[moment.brush] if len(danger) else None,
        ids=moment.ids,
        z=moment.xyz[:, 2],
        wings=_wings(moment, palette),
        up=moment.up,
    )


def _wings(moment, palette):
    """How high wings are, as `Herd` wants it: those of animals under brushes that fly beat, small ones faster."""
    kinds = palette.flies & ~palette.grounded
    birds = kinds[moment.brush] if len(kinds) else np.zeros(len(moment), bool)
    fast = np.linalg.norm(moment.velocity, axis=1) > WALKING * moment.length
    birds = birds & ((moment.xyz[:, 2] > 0) | fast)  # on flat ground who is fast is taken to fly
    if not birds.any():
        return None
    rate = np.minimum(BEAT / np.sqrt(moment.length), FASTEST_BEAT)
    turn = rate * moment.time + 0.381966 * moment.ids  # no two neighbours at once
    return np.where(birds, np.sin(2 * np.pi * (turn % 1.0)), np.nan)


def painter_of(simulation, size=None, theme="light", view="plan", azimuth=90.0, elevation=None):
    """A painter for a running world: of the plan with the level's proportions unless a size is given, or of space.

    `azimuth` and `elevation`, in degrees, say from where one looks in space: counter-clockwise from east, and upwards;
    flocks in the air are looked at from lower down than herds on the ground unless told.
    """
    from flockbrush.draw import Painter, Scenery

    if view != "space":
        return Painter(Scenery(simulation), size=size or picture_size(simulation.level), theme=theme)
    from flockbrush.draw.space import SpacePainter

    painter = SpacePainter(Scenery(simulation), size or IN_SPACE, theme)
    if elevation is None:
        agents = simulation.agents
        flying = len(agents) and (agents[Position.xyz][:, 2] > agents[Body.length]).mean() > 0.5
        elevation = 14.0 if flying else 30.0
    painter.look(replace(painter.camera, azimuth=np.radians(azimuth), elevation=np.radians(elevation)))
    return painter


def picture_size(level, across=1920, ground=960):
    """(width, height) in even pixels of a picture with a level's proportions, and room above and below for words."""
    scale = min(across / level.width, ground / level.height)
    width, height = max(640.0, scale * level.width), max(200.0, scale * level.height)
    return 2 * round(width / 2), 2 * round((height + WORDS) / 2)


def _measured(moment: Moment):
    """What is written above the ground."""
    return {
        "polarization": compute_polarization(moment.forward),
        "milling": compute_milling(moment.xyz[:, :2], moment.forward),
    }


def _look(options):
    """The options that are about looks."""
    told = ("size", "theme", "view", "azimuth", "elevation")
    return {name: options[name] for name in told if options.get(name) is not None}


class _Pictures(Exporter):
    """Draws every moment, for trails need them all."""

    def open(self):
        self._painter = painter_of(self.simulation, **_look(self.options))

    def draw(self, moment):
        """The picture of a moment."""
        measures = _measured(moment) if len(moment) else None
        herd = herd_of(self.simulation, moment)
        if self.options.get("view") == "space" and len(moment):
            self._painter.chase(herd, 1 / self.fps if self.frames else None)
        return self._painter.frame(herd, time=moment.time, measures=measures)


class Mp4(_Pictures):
    """A video of the whole level."""

    def open(self):
        from flockbrush.draw import Video

        super().open()
        self._video = Video(self.temporary, self.fps, self._painter.size)
        self._video.__enter__()

    def take(self, moment):
        self._video.write(self.draw(moment))
        self.frames += 1

    def finish(self):
        self._video.__exit__(None, None, None)

    def let_go(self):
        self._video.__exit__(Exception, None, None)


class Png(_Pictures):
    """A picture of the last moment."""

    def take(self, moment):
        self._frame = self.draw(moment)
        self.frames += 1

    def finish(self):
        from flockbrush.draw import write_png

        write_png(self.temporary, self._frame)


def _usd(path, simulation, fps, **options):
    from flockbrush.export_usd import UsdScene

    return UsdScene(path, simulation, fps, **options)


_usd.fps, _usd.needs = 24.0, (("pxr", "usd-core"),)  # type: ignore[attr-defined]

EXPORTERS = {".mp4": Mp4, ".png": Png, ".csv": Csv, ".parquet": Parquet, ".usdc": _usd, ".usda": _usd}


# all of them -----------------------------------------------------------------------------


def check_exports(paths, inputs=(), others=()):
    """Make sure before the run that every export can be written, and every other output.

    Raises
    ------
    ProblemsError
        For unknown endings, packages that are not installed, and names that cannot be written.
    """
    problems = []
    for path in map(Path, paths):
        exporter = EXPORTERS.get(path.suffix.lower())
        if exporter is None:
            got = f"{path.suffix!r}" if path.suffix else "none"
            message = f"the ending of an export is one of {', '.join(EXPORTERS)}; got {got}"
            problems.append(Problem(str(path), None, None, message))
            continue
        for module, package in exporter.needs:
            if importlib.util.find_spec(module) is None:
                message = (
                    f"this needs the package {package}: pip install {package}   (or: pip install flockbrush[export])"
                )
                problems.append(Problem(str(path), None, None, message))
    beside = [sidecar(path) for path in paths if Path(path).suffix.lower() == ".csv"]
    problems += output_problems([*paths, *others], inputs)
    problems = problems or output_problems([*paths, *beside, *others], inputs)
    if problems:
        raise ProblemsError(problems)


class Exports:
    """The files a run writes: call `take` at the start and after every tick; use it in a ``with``.

    Parameters
    ----------
    paths : sequence of path
        After `check_exports`.
    simulation : Simulation
    fps : float, optional
        Moments per second; each kind of file has its own unless told: every tick for tables and videos, 24 for USD.
    options
        For the exporters that know them: ``size``, ``theme``, ``view``, ``azimuth``, ``elevation``, ``usd_mode``.
    """

    def __init__(self, paths, simulation, fps=None, **options):
        ticks = 1 / simulation.world.resource(Clock).dt
        if fps is not None and not 0 < fps <= ticks:
            raise refused("--fps", f"must be more than 0 and at most {ticks:g}, the ticks of a second, got {fps:g}")
        self._pairs = []
        try:
            for path in paths:
                kind = EXPORTERS[Path(path).suffix.lower()]
                rate = kind.fps if fps is None else fps
                self._pairs.append((kind(path, simulation, rate, **options), Sampler(simulation, rate)))
                self._pairs[-1][0].open()
        except BaseException:
            self.abandon()
            raise

    def take(self):
        """Write the moments that are due."""
        for exporter, sampler in self._pairs:
            for moment in sampler.due():
                exporter.take(moment)

    def close(self):
        """Complete all files."""
        while self._pairs:
            exporter, _ = self._pairs[0]
            exporter.close()
            del self._pairs[0]

    def abandon(self):
        """Remove all files that are not complete."""
        for exporter, _ in self._pairs:
            exporter.abandon()
        self._pairs = []

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        from flockbrush.terminal import Stopped

        if kind is not None and not issubclass(kind, Stopped):
            self.abandon()
            return
        try:
            self.close()
        except BaseException:
            self.abandon()
            raise
