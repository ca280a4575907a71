"""A flight for viewing: read or lifted, solved again when settings change, exported, made into a formation brush.

Nothing here draws, and nothing knows of windows; `flockbrush.studio.lift_window` shows it.
"""

from __future__ import annotations

import time
from collections import defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from flockbrush.behaviours.formation.extraction import Marks, extract
from flockbrush.engine.files import claimed, refused
from flockbrush.film.clip_jobs import ClipJob
from flockbrush.film.track_table import rate_of
from flockbrush.film.tracks import Tracks, read_tracks
from flockbrush.lifting.flight_files import attitude, write_flight
from flockbrush.lifting.flight_table import PLACES, read_flight, table_header, wingspan_of
from flockbrush.lifting.lens import Camera, read_camera
from flockbrush.lifting.lift_solver import LiftedFlight, LiftError, LiftWish, lift_sight, prepared
from flockbrush.lifting.lift_thesis import lift_by_thesis
from flockbrush.render.gaits import BEAT, FASTEST_BEAT
from flockbrush.runs.catalogue import LABELS, Catalogue
from flockbrush.systems.ground_height import Heights
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.terrain import relief_of

GLANCE = 5  # while a slider is dragged every so manieth frame is solved
SPANS = 2.5  # wingspans from bird to bird, assumed if their size is not given
USUAL_SPAN = (0.15, 2.5)  # m: limits of the assumed wingspan
SLENDER = 0.62  # body length over wingspan
ENDINGS = (".csv", ".parquet", ".usdc", ".usda")
METHODS = ("smooth", "cobyla")


@dataclass(frozen=True)
class Wanted:
    """What a flight is solved with."""

    wish: LiftWish = field(default_factory=LiftWish)
    method: str = "smooth"  # {"smooth", "cobyla"}


class Show:
    """A flight, and where it is from.

    Parameters
    ----------
    name : str
        Of the file it was read from.
    camera : Camera, optional
        That filmed the tracks it is lifted from; without one it is as it was read.
    sight : Sight, optional
        The tracks made ready.
    wanted : Wanted
        What it was solved with.
    span : float, optional
        Wingspan of the birds, m; guessed from how near they fly unless given.

    Attributes
    ----------
    velocity, forward, up : (F, N, 3) ndarray
        m/s and unit vectors; NaN where a bird is not there.
    """

    animal, sized_by = "bird", "Wingspan"  # what one is called, and which length of it is drawn
    unit, flies = "m", True  # of all lengths; whether all of them fly

    def __init__(self, flight: LiftedFlight, name, camera=None, tracks=None, sight=None, wanted=None, span=None):
        self.name, self.camera, self.tracks, self.sight = name, camera, tracks, sight
        self.wanted = wanted or Wanted()
        self.take(flight)
        self.span = float(span or _guessed_span(flight.xyz))

    @classmethod
    def open(cls, path, camera=None, span=None) -> Show:
        """The flight of a table: read as it is, or lifted from tracks in pixels with the camera's file.

        Raises
        ------
        ProblemsError
            With what is wrong with table or camera, or why nothing can be lifted.
        """
        name = str(path)
        if table_header(path) >= set(PLACES):
            if camera is not None:
                raise refused(path, "is a flight in metres; leave out --camera, which is for tracks in pixels")
            return cls(read_flight(path), name, span=span or wingspan_of(path))
        if camera is None:
            message = (
                f"is not a flight (columns {', '.join(PLACES)}); to lift tracks (frame, id, x, y in pixels), give the"
                " camera that filmed them:  --camera cam.toml"
            )
            raise refused(path, message)
        return cls.lifted(read_tracks(path), read_camera(camera), name, span)

    @classmethod
    def lifted(cls, tracks: Tracks, camera: Camera, name, span=None) -> Show:
        """The flight that tracks show."""
        try:
            sight = prepared(tracks, camera)
            flight = lift_sight(sight, camera)
        except LiftError as error:
            raise refused(name, str(error)) from None
        return cls(flight, name, camera, tracks, sight, span=span)

    def __len__(self):
        return len(self.flight.xyz)

    def take(self, flight: LiftedFlight):
        """Show another flight of the same birds."""
        self.flight = flight
        self.velocity, pitch, bank = attitude(flight.xyz, flight.fps)
        self.forward, self.up = _attitudes(self.velocity, pitch, bank)

    @property
    def long(self) -> float:
        """Length of a body, m."""
        return SLENDER * self.span

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return (len(self) - 1) / self.flight.fps

    # solving -----------------------------------------------------------------------

    def solved(self, wanted: Wanted, glance=False) -> LiftedFlight:
        """The flight as it is wanted; a glance is quick and coarse, and by the global solve.

        Raises
        ------
        ProblemsError
            When there is none.
        """
        if self.camera is None or self.sight is None:
            raise refused(self.name, "cannot be lifted again without its tracks and camera")
        try:
            if wanted.method == "cobyla":
                return lift_by_thesis(self.tracks, self.camera, wanted.wish)
            return lift_sight(self.sight, self.camera, wanted.wish, GLANCE if glance else 1)
        except LiftError as error:
            raise refused(self.name, str(error)) from None

    # looking -----------------------------------------------------------------------

    def there(self, k) -> np.ndarray:
        """Rows of the birds that are seen in frame k."""
        return np.flatnonzero(np.isfinite(self.flight.xyz[k]).all(-1))

    def herd(self, k):
        """The birds of frame k as the painters want them."""
        from flockbrush.render.drawn_herd import DrawnHerd

        rows, flight = self.there(k), self.flight
        long = self.long
        beat = min(BEAT / np.sqrt(long), FASTEST_BEAT)
        wings = np.sin(2 * np.pi * ((beat * k / flight.fps + 0.381966 * flight.ids[rows]) % 1.0))
        return DrawnHerd(
            flight.xyz[k, rows], self.forward[k, rows], long, 0.13 * long, wings=wings, up=self.up[k, rows],
            ids=flight.ids[rows],
        )  # fmt: skip

    def way(self, k, seconds) -> np.ndarray:
        """Where birds were in the seconds up to frame k, (frames, N, 3) m, NaN where a bird was not there."""
        first = max(0, k - round(seconds * self.flight.fps))
        return self.flight.xyz[first : k + 1]

    def facts(self, k) -> list[str]:
        """What there is to know of the birds of frame k, a line each."""
        rows = self.there(k)
        facts = [f"{len(rows)} {self.animal}{'s' * (len(rows) != 1)}"]
        if len(rows):
            speed = np.linalg.norm(self.velocity[k, rows], axis=-1).mean()
            away = np.linalg.norm(self.flight.xyz[k, rows], axis=-1)
            order = np.linalg.norm(_unit(self.velocity[k, rows]).mean(0))
            facts[0] += f" at {speed:.1f} {self.unit}/s"
            far = f"{away.min():.0f} to {away.max():.0f} {self.unit}"
            facts += [f"polarization {order:.3f}", f"{far} from the {'origin' if self.camera is None else 'camera'}"]
        return facts

    def about(self, k, bird) -> str:
        """A line about one bird of frame k, empty when it is not there."""
        row = self.row(bird)
        if row is None or row not in self.there(k):
            return ""
        right = _unit(np.cross(self.forward[k, row], (0.0, 0.0, 1.0)))
        lean = np.degrees(np.arcsin(np.clip(self.up[k, row] @ right, -1, 1)))
        side = "right" if lean > 0 else "left"
        speed, away = np.linalg.norm(self.velocity[k, row]), np.linalg.norm(self.flight.xyz[k, row])
        called = f"{self.animal} {self.flight.names[row]}"
        return f"{called}: {speed:.1f} {self.unit}/s, {away:.0f} {self.unit}, {abs(lean):.0f}° {side}"

    def row(self, bird):
        """Row of a bird by its number, None when there is none."""
        rows = np.flatnonzero(self.flight.ids == bird) if bird is not None else ()
        return int(rows[0]) if len(rows) else None

    @property
    def floor(self) -> float:
        """Height of the ground that is drawn, m: under the camera and under all birds."""
        low = float(np.nanmin(self.flight.xyz[..., 2]))
        return low - 3 * self.span if self.camera is None else min(-1.6, low - 3 * self.span)

    def frustum(self, k) -> tuple[np.ndarray, np.ndarray]:
        """The picture in space: its corners (4, 3) m, and where the birds of frame k are in it (n, 3) m.

        It stands at two fifths of the way to the birds.
        """
        camera, rows = self.camera, self.there(k)
        corners = camera.rays(
            np.array([(0, 0), (camera.width, 0), (camera.width, camera.height), (0, camera.height)], float)
        )
        far = 0.4 * float(np.nanmedian(self.flight.xyz[..., 1]))
        ray = self.flight.xyz[k, rows]
        return corners * far / corners[:, 1:2], ray * far / ray[:, 1:2]

    # keeping -------------------------------------------------------------------------

    def check_exports(self, paths, options=None):
        """Check that the flight can be written to files of these names, before any is.

        Raises
        ------
        ProblemsError
        """
        from flockbrush.output.export import check_exports
        from flockbrush.output.exporter import exporter_of

        if self.unit != "m":
            told = "is shown in body lengths, and flights are written in metres; open tracks in metres (--unit m)"
            raise refused(self.name, told)
        for path in map(Path, paths):
            kind = exporter_of(path)  # .movebank.csv is none of these
            if kind is None or not set(kind.endings) & set(ENDINGS):
                got = repr("".join(path.suffixes)) if path.suffix else "none"
                raise refused(path, f"the file extension of a flight must be one of {', '.join(ENDINGS)}; got {got}")
        check_exports(paths, [self.name], options=options)

    def export(self, path, **options):
        """Write the flight: .csv as `flockbrush lift` does, .parquet and .usdc as `flockbrush export` does.

        Raises
        ------
        ProblemsError
            When it cannot be written.
        """
        from flockbrush.output.exporter import exporter_of

        path = Path(path)
        self.check_exports([path], options)
        if path.suffix.lower() == ".csv":
            self.write_table(path)
            return
        exporter = exporter_of(path)(path, _AsRun(self), self.flight.fps, **options)
        try:
            exporter.open()
            for k in range(len(self)):
                exporter.take(self._moment(k))
            exporter.close()
        except BaseException:
            exporter.abandon()
            raise

    def write_table(self, path):
        """Write the flight as a trajectory table with its metadata beside it."""
        from flockbrush.output.trajectory_table import metadata_of, write_about

        known = (None, None) if self.flies else (self.forward, self.long)
        write_flight(path, self.flight, self.animal, self.flies, *known)
        rate = rate_of(self.flight.frames, self.flight.times)  # some frames may be left out
        write_about(path, metadata_of(_AsRun(self), rate or self.flight.fps))

    def _moment(self, k):
        from flockbrush.runs.snapshots import Moment

        rows, flight, long = self.there(k), self.flight, self.long
        count = len(rows)
        zero, wide = np.zeros(count, np.int64), np.full(count, 0.13 * long)
        return Moment(
            float(flight.times[k]), flight.ids[rows].astype(np.int64), flight.xyz[k, rows],
            self.velocity[k, rows], self.forward[k, rows], np.full(count, long), wide, zero, zero,
            np.zeros(count, bool), zero, self.up[k, rows], dict.fromkeys(LABELS, zero),
        )  # fmt: skip

    def formation(self, k):
        """The birds of frame k as a formation: ahead is the flock's way, aside is where it is widest across that.

        Raises
        ------
        ProblemsError
            When they fly in none, with the reason.
        """
        rows = self.there(k)
        x, y = _abreast(self.flight.xyz[k, rows], self.velocity[k, rows])
        names = tuple(self.flight.names[row] for row in rows)
        frame = int(self.flight.frames[k])
        marks = Marks((str(frame),), names, x[None] / self.span, y[None] / self.span)
        about = {"marks": Path(self.name).name, "frame": frame, "wingspan_m": self.span, "method": "lifted from tracks"}
        formation = extract(marks, Path(self.name).name.split(".")[0], about)
        if not formation.usable:
            why = formation.frames[0].why
            raise refused(self.name, f"frame {frame}: the birds do not fly in a line formation: {why}")
        return formation

    @staticmethod
    def formation_files(path) -> tuple[Path, Path]:
        """Where `formation_level` writes: the brush, in the folder ``brushes`` that levels look in, and the level."""
        path = Path(path)
        folder = path.parent.parent if path.parent.name == "brushes" else path.parent
        return folder / "brushes" / path.name, folder / f"{path.name.removesuffix('.brush.toml')}.tmj"

    def formation_level(self, k, path) -> Path:
        """Write a brush as `formation_brush` and a level in which birds fly with it; returns the level's path."""
        from flockbrush.levels.sketch import LevelSketch

        brush, level = self.formation_files(path)
        brush.parent.mkdir(exist_ok=True)
        with claimed([brush]):
            self.formation_brush(k, brush)
        sky = LevelSketch(120, 40, 10.0, ".", boundary="despawn")
        sky.document.data["tilesets"] = []
        count = len(self.there(k))
        side = float(np.clip(6.0 * np.sqrt(count), 20, 300))
        middle = 0.5 * sky.height
        sky.box(
            "Spawn", 160, middle, side, side, "flock", species="goose", brush=level.stem, count=count, heading="east",
            altitude=50,
        )  # fmt: skip
        sky.draw("Key", [(600, middle)], "on", at=0, command="Migrate", x=1e5, y=middle, z=50, species="goose")
        return sky.save(level)

    def formation_brush(self, k, path, like="geese") -> str:
        """Write a brush of the formation of frame k; returns a sentence about it.  The caller has claimed the file.

        Raises
        ------
        ProblemsError
            When it cannot be made or written.
        """
        from flockbrush.output.formation_brush import write_brush

        formation = self.formation(k)
        learned = write_brush(formation, path, like, f"frame {self.flight.frames[k]} of {Path(self.name).name}")
        return f"{path}: {learned['shape']} of {len(self.there(k))} birds"


class _AsRun:
    """What exporters ask of a simulation, answered for a flight."""

    def __init__(self, show: Show):
        source = Path(show.name)
        content = source.read_bytes() if source.is_file() else b""
        self.level = SimpleNamespace(
            name=source.name, files={source.name: content}, width=0.0, height=0.0, boundary="open"
        )
        self.origin, self.clock, self.world = {"seed": 0}, SimpleNamespace(dt=1 / show.flight.fps), self
        self.banks = show.flies
        self.next_entity = 1  # no births, so there are no groups
        self.agents: dict = defaultdict(lambda: np.zeros(0))
        self._kind = _OneKind(show)

    def has(self, kind):
        """Whether there is a resource of a type: yes."""
        return True

    def resource(self, kind):
        """Names of species and of brushes: one species, and no brush. The ground is level; of all else is nothing."""
        if kind is Landscape:
            return SimpleNamespace(heights=Heights(relief_of(), 1.0, (0.0, 0.0)))
        return self._kind if kind is Catalogue else kind()


class _OneKind(Catalogue):
    """One species and one brush without a name, which flies or does not."""

    def __init__(self, show: Show):
        flies = np.array([show.flies])
        self.palette = SimpleNamespace(names=[""], brushes=[], flies=flies, flies_free=flies, grounded=~flies)
        self.species = {show.animal: SimpleNamespace(look="bird" if show.flies else "beast")}
        self.words = {"species": [show.animal], "brush": [""], **{name: [""] for name in LABELS}}

    def note(self, world, labels=LABELS):
        """Nothing comes."""


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def _attitudes(velocity, pitch, bank):
    """(forward, up) of birds, (F, N, 3), as `flockbrush.render.body_meshes.attitude_of` has them."""
    from flockbrush.render.body_meshes import attitude_of

    return attitude_of(np.arctan2(velocity[..., 1], velocity[..., 0]), pitch, bank)


def _guessed_span(xyz):
    """A wingspan that suits how near birds fly to each other, m."""
    near = []
    for places in xyz[:: max(1, len(xyz) // 20)]:
        known_places = places[np.isfinite(places).all(-1)]
        if len(known_places) > 1:
            gaps = np.linalg.norm(known_places[:, None] - known_places[None], axis=-1) + np.diag(
                np.full(len(known_places), np.inf)
            )
            near.append(np.median(gaps.min(1)))
    return float(np.clip(np.median(near) / SPANS, *USUAL_SPAN)) if near else 1.0


def _abreast(xyz, velocity):
    """(metres to the right, metres ahead) of birds, from above the plane in which they fly."""
    ahead = velocity.mean(0)
    ahead = ahead / max(np.linalg.norm(ahead), 1e-9)
    about = xyz - xyz.mean(0)
    rest = about - (about @ ahead)[:, None] * ahead
    aside = np.linalg.svd(rest, full_matrices=False)[2][0]
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    aside = aside if aside @ right >= 0 else -aside
    return rest @ aside, about @ ahead


# solving beside a window ---------------------------------------------------------------


class Solver:
    """Solves in a thread of its own; only the latest wish counts."""

    def __init__(self, show: Show):
        self.show, self.seconds = show, 0.0  # seconds: the last solve took
        self._job: ClipJob | None = None
        self._next: tuple | None = None
        self._asked = self._solved = show.wanted, False  # the latest wish, and what came: whether it was a glance

    @property
    def busy(self) -> bool:
        """Whether something is being solved, or waits."""
        return self._job is not None or self._next is not None

    def has(self, wanted: Wanted) -> bool:
        """Whether the flight is solved so, in all its frames."""
        return self._solved == (wanted, False)

    def ask(self, wanted: Wanted, glance=False):
        """Solve this as soon as what is being solved is done; an older wish that waits is dropped."""
        if self.busy and self._asked == (wanted, glance):
            return
        self._next = self._asked = wanted, glance
        if self._job is None:
            self._begin()

    def _begin(self):
        (wanted, glance), self._next = self._next, None  # type: ignore[misc]
        began = time.perf_counter()

        def solve(say):
            return self.show.solved(wanted, glance), time.perf_counter() - began

        def take(solved):
            flight, self.seconds = solved
            self.show.wanted, self._solved = wanted, (wanted, glance)
            self.show.take(flight)

        self._job = ClipJob("lift", solve, take)

    def look(self) -> bool:
        """Take what was solved, if it is ready; whether the flight has changed.  Raises what went wrong."""
        job = self._job
        if job is None or not job.is_over():
            return False
        self._job = None
        if self._next is not None:
            self._begin()
        return job.look()


def with_wish(wanted: Wanted, **changes) -> Wanted:
    """The same with other weights or another method."""
    method = changes.pop("method", wanted.method)
    return replace(wanted, wish=replace(wanted.wish, **changes), method=method)
