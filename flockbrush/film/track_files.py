"""Tracks of animals on the ground, from the file formats of tracking programs: one reader for all commands.

Each format is a function of `flockbrush.film.track_formats` or `flockbrush.film.track_arrays`. Nothing is unpickled.
"""

from __future__ import annotations

import hashlib
import math
import tokenize
import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from flockbrush.behaviours.tomlfile import check_plain
from flockbrush.engine import limits
from flockbrush.engine.files import refused
from flockbrush.engine.problems import ProblemsError
from flockbrush.film import track_arrays as arrays
from flockbrush.film import track_formats as formats
from flockbrush.film.looking import frames_missing
from flockbrush.film.track_table import SAME_RATE, TrackTable

UNITS = "m", "px", "bl"
ENDINGS = ".csv", ".tsv", ".parquet", ".nc", ".h5", ".hdf5", ".npy", ".npz"
UNREADABLE = {
    ".slp": "is a project of SLEAP: export it there as Analysis HDF5",
    ".xml": "is XML, as of TrackMate: export its spots as CSV",
}
DAMAGE = (  # what libraries raise at files that are not whole
    OSError, ValueError, LookupError, ArithmeticError, MemoryError, TypeError, AttributeError, RuntimeError, EOFError,
    SyntaxError, tokenize.TokenError,
)  # fmt: skip
FEWEST = 8  # frames in which an animal must be seen
TURNED = 2 * np.pi + 1e-3  # rad: headings are within


@dataclass(frozen=True)
class Trajectories:
    """Positions of animals by frame."""

    xy: np.ndarray  # (T, N, 2); in ``unit``, x right and y up; NaN where an animal was not seen
    ids: tuple[str, ...]  # (N,) tuple of str
    fps: float  # frames a second
    unit: str  # {"m", "px", "bl"}
    heading: np.ndarray | None = None  # (T, N) or None; radians counter-clockwise from x (y up); NaN unknown
    frames: np.ndarray = field(default_factory=lambda: np.zeros(0, int))  # (T,) int; their numbers in the file
    name: str = "tracks"
    sha256: str = ""
    notes: tuple[str, ...] = ()
    start: float = 0.0  # s, time of the first frame
    axes: tuple[float, float] = (1.0, 1.0)  # by which x and y of the file are multiplied
    file_unit: str = ""  # of x and y in the file; ``unit`` by default
    body_length: float | None = None  # m, usual of the animals, where the file states them

    def __post_init__(self):
        shape = np.shape(self.xy)
        if len(shape) != 3 or shape[2] != 2 or shape[1] != len(self.ids):
            raise ValueError(f"xy must be (frames, animals, 2) with {len(self.ids)} ids, got {shape}")
        if not (math.isfinite(self.fps) and self.fps > 0):
            raise ValueError(f"fps must be above 0, got {self.fps}")
        if self.unit not in UNITS:
            raise ValueError(f"unit must be one of {', '.join(UNITS)}, got {self.unit!r}")
        if not len(self.frames):
            object.__setattr__(self, "frames", np.arange(shape[0]))
        if not self.file_unit:
            object.__setattr__(self, "file_unit", self.unit)

    def __len__(self):
        return len(self.xy)

    @property
    def seen(self) -> np.ndarray:
        """Whether each animal was seen in each frame, (T, N) bool."""
        return np.isfinite(self.xy).all(-1)

    def part(self, first: int, last: int) -> Trajectories:
        """The frames numbered `first` to `last`, both included."""
        rows = (self.frames >= first) & (self.frames <= last)
        notes = (*self.notes, *frames_missing(int(self.frames[0]), int(self.frames[-1]), (first, last)))
        heading = None if self.heading is None else self.heading[rows]
        start = self.start + float(rows.argmax()) / self.fps
        return replace(self, xy=self.xy[rows], heading=heading, frames=self.frames[rows], start=start, notes=notes)


def is_tracks(path) -> bool:
    """Whether a path is a file (or a folder) of tracks, by its name, and not a video."""
    path = Path(path)
    return path.suffix.lower() in (*ENDINGS, *UNREADABLE) or (path.is_dir() and bool(formats.trex_files(path)))


def read_trajectories(path, unit: str | None = None, fps: float | None = None) -> Trajectories:
    """Read tracks.

    Parameters
    ----------
    path : path
        CSV, TSV or Parquet with a row for each animal in each frame (Flockbrush, trackdf, Movebank), CSV of
        DeepLabCut and idtracker.ai, netCDF of movement, analysis HDF5 of SLEAP, a folder of TRex files, or an npy
        array (frames, animals, 2).
    unit : {"m", "px", "bl"}, optional
        Unit of x and y, if the file does not name it.
    fps : float, optional
        Frames per second, if the file has no times.

    Raises
    ------
    ProblemsError
        When the file is damaged, has no tracks, or unit or frame rate are unknown.
    """
    path = Path(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of libraries, about attributes; what is read is checked below
            table = _table_of(path)
    except ProblemsError:
        raise
    except DAMAGE as error:
        raise refused(path, f"cannot be read as tracks: {_first_line(error)}") from None
    if unit is not None and table.stated and unit != table.unit:
        raise refused(path, f"its columns are in {table.unit}, --unit says {unit}: leave it out")
    unit = unit or table.unit
    if unit is None:
        raise refused(path, "has no unit for x and y: give it with --unit m, px or bl")
    if fps is not None and table.fps is not None and abs(fps / table.fps - 1.0) > SAME_RATE:
        raise refused(path, f"its times say {table.fps:.6g} frames per second, --fps says {fps:g}: leave it out")
    rate = fps or table.fps
    if rate is None:
        raise refused(path, "has no times: give the frames per second with --fps")
    if not (math.isfinite(rate) and 0 < rate <= 10_000):
        raise refused(path, f"the frames per second must be above 0 and at most 10,000, got {rate:g}")
    return _checked(path, table, unit, float(rate))


def _first_line(error):
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:200]


def _checked(path, table, unit, fps):
    """The trajectories, without animals seen in fewer than `FEWEST` frames; ProblemsError if none is left."""
    scale = 0.01 if unit == "cm" else 1.0
    down = unit == "px" if table.down is None else table.down
    axes = (scale, -scale if down else scale)
    xy = np.array(table.xy, float) * axes
    xy[~(np.abs(xy) < 1e12).all(-1)] = np.nan
    sights = np.isfinite(xy).all(-1).sum(0)
    enough = sights >= FEWEST
    if not enough.any():
        most = int(sights.max(initial=0))
        raise refused(path, f"no animal is visible in more than {most} frames; at least {FEWEST} are needed")
    if table.heading is not None and np.nanmax(np.abs(table.heading), initial=0.0) > TURNED:
        t, n = np.argwhere(np.abs(table.heading) > TURNED)[0]
        raise refused(
            path,
            f"heading {table.heading[t, n]:g} of animal {table.ids[n]} in frame {table.frames[t]}: headings are in "
            "radians from x towards y, from -6.283 to 6.283; are these degrees?",
        )
    notes = list(table.notes)
    if not enough.all():
        notes.append(f"{int((~enough).sum())} animals visible in fewer than {FEWEST} frames were left out")
    xy, heading = xy[:, enough], None if table.heading is None else table.heading[:, enough]
    rows = np.flatnonzero(np.isfinite(xy[..., 0]).any(1))
    every = int(np.gcd.reduce(np.diff(rows))) or 1  # of files with the positions of every n-th frame
    span = slice(rows[0], rows[-1] + 1, every)
    if down and heading is not None:
        heading = -heading
    ids = tuple(str(name) for name, keep in zip(table.ids, enough, strict=True) if keep)
    return Trajectories(
        xy[span], ids, fps / every, "m" if unit == "cm" else unit, None if heading is None else heading[span],
        np.asarray(table.frames)[span], path.name, _sha256(path), tuple(notes), table.start + rows[0] / fps, axes, unit,
        table.body_length,
    )  # fmt: skip


def _sha256(path):
    digest = hashlib.sha256()
    for part in sorted(path.iterdir()) if path.is_dir() else [path]:
        if part.is_file():
            with open(part, "rb") as file:
                while block := file.read(1 << 20):
                    digest.update(block)
    return digest.hexdigest()


def _table_of(path) -> TrackTable:
    if path.is_dir():
        return formats.trex_folder(path)
    check_plain(path, limits.TRACKS_BYTES)
    read = {
        ".csv": formats.csv_table, ".tsv": formats.csv_table, ".parquet": formats.parquet_table,
        ".nc": arrays.movement_netcdf, ".h5": arrays.sleap_hdf5, ".hdf5": arrays.sleap_hdf5,
        ".npy": arrays.numpy_array, ".npz": formats.trex_file,
    }.get(path.suffix.lower())  # fmt: skip
    if told := UNREADABLE.get(path.suffix.lower()):
        raise refused(path, told)
    if read is None:
        raise refused(path, f"is not a readable file of tracks ({', '.join(ENDINGS)})")
    return read(path)
