"""Observations of a herd in a clip: fields on a grid, single animals if they can be separated, and their speeds.

Lengths are body lengths (BL), times seconds; x points right and y **up** in the picture.  A file is a compressed npz
that holds all of it; it is never unpickled.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy import ndimage

from flockbrush.engine.files import refused
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.film.fields_file import damage, flat, packed, part_of, read, unpacked, write
from flockbrush.film.pair_density import RINGS, pairs_scaled
from flockbrush.film.path_smoothing import PathSmoothing, SightSmoothing
from flockbrush.film.speeds import SpeedEvidence, speed_evidence


class CannotObserve(ProblemsError):
    """The clip does not show enough; holds what was seen and what to try."""

    def __init__(self, clip, message: str, seen: dict | None = None):
        super().__init__([Problem(str(clip), None, None, message)])
        self.seen = dict(seen or {})  # measured facts by name; under "pictures", BGR pictures by title

    def __reduce__(self):
        return type(self), (self.problems[0].file, self.problems[0].message, self.seen)


AT_EDGE = 0.01  # share of the animals at the edge of the picture, above which it is thought to show a part of a herd


@dataclass
class Fields:
    """The herd as a continuum: T frames of ny x nx square cells (paper section 4)."""

    fps: float  # rows a second
    cell: float  # side of a cell, BL
    origin: np.ndarray  # (2,); lower left corner of cell (0, 0), BL; rows of cells count upwards, columns to the right
    # (T, ny, nx); animals per BL², on the part of the cell in the picture; NaN outside the picture
    density: np.ndarray
    velocity: np.ndarray  # (T, ny, nx, 2); mean velocity of the bodies, BL/s; NaN without animals
    speed_variance: np.ndarray  # (T, ny, nx); variance of the speeds within the cell, (BL/s)²; NaN without animals
    # (T, ny, nx); variance of the unsigned angle to the cell's mean velocity, degrees²; 180²/12 = 2700 by chance
    angular_variance: np.ndarray
    # (T, ny, nx) bool; whether the cell is in the picture, at least half of it: a stabilised picture moves over the
    # ground
    seen: np.ndarray
    obstacle: np.ndarray  # (ny, nx) bool; cells that animals cannot enter
    region: np.ndarray  # (ny, nx) uint8; number of the region, from 0
    count: np.ndarray  # (T,); animals in the picture
    frames: np.ndarray  # (T,) int; their numbers in the clip, from 0
    # (T, ny, nx); mean speed of the bodies, BL/s, at least the length of `velocity`, which stands in when it is not
    # given
    speed: np.ndarray | None = None
    # (k, 5) or None; edges of the obstacles, x0, y0, x1, y1 in BL, and the number of the obstacle; edges of one follow
    # one another. None: the outline of the cells.
    outline: np.ndarray | None = None
    # (T,) or None; share of what shows animals that is within half a body length of the edge of the picture.  None:
    # nobody knows, and cells at the edge say it.
    at_edge: np.ndarray | None = None
    # (T, RINGS) or None; animals per BL² by distance from a point of a body (`flockbrush.film.pair_density`); NaN where
    # the pixels do not tell.  None: not measured.
    pairs: np.ndarray | None = None

    def __post_init__(self):
        if self.speed is None:
            self.speed = np.linalg.norm(self.velocity, axis=-1)
        wrong = list(self._mistakes())
        if wrong:
            raise ValueError("; ".join(wrong))

    def _mistakes(self):
        """Sentences about arrays that do not fit together."""
        if self.density.ndim != 3:
            yield f"density has shape {self.density.shape}, and not frames x rows x columns"
            return
        cells = self.density.shape
        shapes = dict.fromkeys(_GRIDS, cells) | {"velocity": (*cells, 2)}
        shapes |= {"obstacle": cells[1:], "region": cells[1:], "count": cells[:1], "frames": cells[:1], "origin": (2,)}
        more = {"outline": (*np.shape(self.outline)[:1], 5), "at_edge": cells[:1], "pairs": (*cells[:1], RINGS)}
        shapes |= {name: shape for name, shape in more.items() if getattr(self, name) is not None}
        for name, shape in shapes.items():
            if np.shape(getattr(self, name)) != shape:
                yield f"{name} has shape {np.shape(getattr(self, name))}, density asks for {shape}"
        if not (self.fps > 0 and np.isfinite(self.fps)):
            yield f"fps must be above 0, got {self.fps}"
        if not (self.cell > 0 and np.isfinite(self.cell)):
            yield f"cell must be above 0 body lengths, got {self.cell}"

    def __len__(self):
        return len(self.density)

    @property
    def shape(self) -> tuple[int, int]:
        """(ny, nx)."""
        return self.density.shape[1], self.density.shape[2]

    @property
    def occupied(self) -> np.ndarray:
        """(T, ny, nx) bool: there are animals, and their motion is known."""
        return np.isfinite(self.velocity[..., 0])

    @property
    def tells_motion(self) -> bool:
        """Whether motion is known: not in a photograph, where heads are guessed."""
        return bool(np.isfinite(self.velocity[..., 0]).any())

    @property
    def centres(self) -> np.ndarray:
        """Middles of the cells, (ny, nx, 2) BL."""
        ny, nx = self.shape
        x, y = np.meshgrid(np.arange(nx) + 0.5, np.arange(ny) + 0.5)
        return self.origin + self.cell * np.stack([x, y], axis=-1)

    @cached_property
    def holds_all(self) -> bool:
        """Whether no animal is at the border of the picture, so that the picture holds the whole herd."""
        if self.at_edge is not None:
            return bool(self.at_edge @ self.count <= AT_EDGE * max(self.count.sum(), 1e-12))
        density, seen = np.nan_to_num(self.density), self.seen
        inner = np.zeros_like(seen)
        inner[:, 1:-1, 1:-1] = (
            seen[:, 1:-1, 1:-1] & seen[:, :-2, 1:-1] & seen[:, 2:, 1:-1] & seen[:, 1:-1, :-2] & seen[:, 1:-1, 2:]
        )
        return bool((density * (seen & ~inner)).sum() <= AT_EDGE * max(density.sum(), 1e-12))

    @cached_property
    def rims(self) -> np.ndarray:
        """(T, ny, nx) bool: the cells at the border of the picture."""
        return np.array([seen & ~ndimage.binary_erosion(seen) for seen in self.seen])

    @cached_property
    def shows_part(self) -> bool:
        """Whether animals are at the border of the picture in any frame, where they come and go."""
        at_edge = self.at_edge
        if at_edge is None:
            there = zip(np.nan_to_num(self.density), self.rims, strict=True)
            at_edge = np.array([d[rim].sum() for d, rim in there]) * self.cell**2 / np.maximum(self.count, 1)
        return bool((at_edge > AT_EDGE).any())

    @property
    def enclosed(self) -> bool:
        """Whether obstacles are all around, as in an arena."""
        sides = self.obstacle[0], self.obstacle[-1], self.obstacle[:, 0], self.obstacle[:, -1]
        return all(side.all() for side in sides)

    def cells_of(self, xy):
        """(row, column, inside) of points (n, 2) BL; those outside are clipped to the border and not ``inside``."""
        steps = np.floor((np.asarray(xy, float) - self.origin) / self.cell).astype(int)
        top = np.array(self.shape[::-1]) - 1
        inside = ((steps >= 0) & (steps <= top)).all(-1)
        column, row = np.clip(steps, 0, top).T
        return row, column, inside

    def part(self, chosen) -> Fields:
        """A subset of the frames: a slice."""
        known = [name for name in ("at_edge", "pairs") if getattr(self, name) is not None]
        rows = (*_GRIDS, "velocity", "count", "frames", *known)
        return replace(self, **{name: getattr(self, name)[chosen] for name in rows})

    def scaled(self, by: float) -> Fields:
        """The same in a unit of length that is so many times shorter."""
        return replace(
            self, cell=self.cell * by, origin=np.asarray(self.origin, float) * by, density=self.density / by**2,
            velocity=self.velocity * by, speed=np.asarray(self.speed) * by, speed_variance=self.speed_variance * by**2,
            outline=None if self.outline is None else np.asarray(self.outline) * [by, by, by, by, 1.0],
            pairs=None if self.pairs is None else pairs_scaled(self.pairs, by),
        )  # fmt: skip

    def save(self, path):
        """Write only the fields, as npz.

        Raises
        ------
        OSError
            When the file cannot be written.
        """
        write(path, flat("fields", self))

    @staticmethod
    def load(path) -> Fields:
        """The fields of an npz, which may hold more.

        Raises
        ------
        ProblemsError
            When the file is none of fields, or is damaged.
        """
        return _fields(path, read(path))


_GRIDS = ("density", "speed_variance", "angular_variance", "seen", "speed")


SIGHT_COLUMNS = "xy", "forward", "speed", "turn", "track", "neighbours_seen"  # of sightings


class ByFrame:
    """Rows in order of frames."""

    first: np.ndarray  # (T + 1,) int; rows ``first[t]`` to ``first[t + 1]`` belong to frame t

    def __len__(self):
        return len(self.first) - 1

    def of(self, t) -> slice:
        """The rows of frame t."""
        return slice(int(self.first[t]), int(self.first[t + 1]))

    @property
    def frame(self) -> np.ndarray:
        """(m,) the frame of each row."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))


@dataclass
class Sightings(ByFrame):
    """Single animals: one row per animal and frame."""

    first: np.ndarray  # (T + 1,) int
    xy: np.ndarray  # (m, 2); BL
    forward: np.ndarray  # (m, 2); unit vectors along the body, head first
    speed: np.ndarray  # (m,); BL/s; NaN unknown
    turn: np.ndarray  # (m,); rate of turning to the left, rad/s; NaN unknown
    track: np.ndarray  # (m,) int; the same number in several frames is the same animal; -1: not tracked
    # (m,) share of its nearest neighbours that are seen; 1 if no animal is known to be missing
    neighbours_seen: np.ndarray = field(default_factory=lambda: np.ones(0))

    def __post_init__(self):
        rows = len(self.xy)
        if not len(self.neighbours_seen):
            self.neighbours_seen = np.ones(rows)
        shapes = {name: (rows, 2) if name in ("xy", "forward") else (rows,) for name in SIGHT_COLUMNS}
        for name, shape in shapes.items():
            if np.shape(getattr(self, name)) != shape:
                raise ValueError(f"{name} of the sightings has shape {np.shape(getattr(self, name))}, not {shape}")
        if self.first[0] != 0 or self.first[-1] != rows or (np.diff(self.first) < 0).any():
            raise ValueError(f"first must rise from 0 to the {rows} sightings, got {self.first[0]} to {self.first[-1]}")

    def scaled(self, by: float) -> Sightings:
        """The same in a unit of length that is so many times shorter."""
        return replace(self, xy=self.xy * by, speed=self.speed * by)

    def part(self, chosen) -> Sightings:
        """A subset of the frames: a slice without a step."""
        begin, end, step = chosen.indices(len(self))
        if step != 1:
            raise ValueError("sightings are cut by a slice of frames without a step")
        end = max(begin, end)
        rows = slice(int(self.first[begin]), int(self.first[end]))
        cut = {name: getattr(self, name)[rows] for name in SIGHT_COLUMNS}
        return Sightings(self.first[begin : end + 1] - self.first[begin], **cut)


@dataclass
class Evidence:
    """All observations of a clip."""

    name: str  # of the clip, as the user named it
    sha256: str  # of the clip's file
    fps: float  # frames a second of the fields and sightings
    body_length_px: float  # pixels of the reference picture in one BL
    # {"given", "stated", "assumed", "blobs"}: by a person, by the file, usual for the unit, estimated
    length_source: str
    radius_bl: float  # half the width of a body over its length
    fields: Fields
    sightings: Sightings | None = None  # None if bodies do not separate
    speed: SpeedEvidence | None = None  # None for a single picture
    notes: list[str] = field(default_factory=list)  # notes for the user
    doubt: str = ""  # why this cannot be used for a judgement, or ""
    # (h, w, 3) uint8 or None; the ground and the herd as the stabilised frame shows it, BGR
    picture: np.ndarray | None = None
    # (2, 3) or None; from BL (x, y up) to pixels (x, y down) of `picture`: ``to_pixels[:, :2] @ xy + to_pixels[:, 2]``
    to_pixels: np.ndarray | None = None
    # (T, 2, 3) or None; from pixels of the clip's frame (upright, full size) to pixels of `picture`
    camera: np.ndarray | None = None
    # (k, 3) uint8 or None; red, green, blue of the regions 1 to k in the mask they are from
    region_colours: np.ndarray | None = None
    # place_noise, heading_noise: standard deviations of the places and headings of the sightings, BL along each
    # direction and rad
    place_noise: float = 0.0
    heading_noise: float = 0.0
    smoothing: PathSmoothing | SightSmoothing | None = None  # of the sightings
    # {"px", "m", "bl"}; of ``body_length_px``: pixels of a film, or the unit of a file of tracks
    length_unit: str = "px"
    start: float = 0.0  # s, time of the first frame
    # (2, 3) or None; from BL (x, y up) to x and y of the file of tracks, which are in ``file_unit``
    to_file: np.ndarray | None = None
    file_unit: str = ""
    animals: np.ndarray | None = None  # (P,) of str or None; in a file of tracks, those of the numbers in ``track``

    @property
    def from_tracks(self) -> bool:
        """Whether positions come from a file of tracks, not from pictures."""
        return self.camera is None and self.picture is not None and not self.still

    @property
    def radius_seen(self) -> float | None:
        """Half the width of a body, BL, as pictures show it; None of tracks, which do not."""
        return None if self.from_tracks else self.radius_bl

    @property
    def length_told(self) -> str:
        """One body length with its unit, and where that is from."""
        told = {"blobs": "estimated from the detected bodies", "stated": "stated in the file"}
        how = told.get(self.length_source, self.length_source)
        unit = {"px": "pixels", "m": "m", "bl": "body lengths"}[self.length_unit]
        return f"{self.clip_body_px:{'.1f' if self.length_unit == 'px' else '.3g'}} {unit} ({how})"

    @property
    def still(self) -> bool:
        """Whether it is a photograph, without motion."""
        return len(self.fields) == 1

    @property
    def clip_body_px(self) -> float:
        """A body length in pixels of the clip itself, which is larger than `picture` where that was made smaller."""
        scale = 1.0 if self.camera is None else float(np.sqrt(abs(np.linalg.det(self.camera[0][:, :2]))))
        return self.body_length_px / scale

    def part(self, chosen: slice) -> Evidence:
        """A subset of the frames, with the speeds of those frames only, so that held-out frames stay unknown.

        Raises
        ------
        ValueError
            When no frame is left.
        """
        fields_part = self.fields.part(chosen)
        if not len(fields_part):
            raise ValueError(f"none of the {len(self.fields)} frames of {self.name} is left")
        sightings = self.sightings.part(chosen) if self.sightings is not None else None
        camera = self.camera[chosen] if self.camera is not None else None
        return replace(self.showing(fields_part, sightings), camera=camera, notes=list(self.notes))

    def showing(self, fields: Fields, sightings: Sightings | None) -> Evidence:
        """The same with a part of what was seen, and with the speeds of that part only."""
        speed = None
        if self.speed is not None and len(fields) > 1:
            known = self.speed.body_pixels, self.speed.smoothed, self.speed.errors
            speed = speed_evidence(fields, sightings, *known, self.radius_seen)
        return replace(self, fields=fields, sightings=sightings, speed=speed)

    def in_lengths_of(self, pixels: float) -> Evidence:
        """The same in body lengths of so many pixels of the clip (see `clip_body_px`)."""
        by = self.clip_body_px / pixels
        if by == 1.0:
            return self
        return replace(
            self,
            body_length_px=self.body_length_px / by,
            place_noise=self.place_noise * by,
            fields=self.fields.scaled(by),
            sightings=None if self.sightings is None else self.sightings.scaled(by),
            speed=None if self.speed is None else self.speed.scaled(by),
            smoothing=None if self.smoothing is None else self.smoothing.scaled(by),
            to_pixels=_for_lengths(self.to_pixels, by),
            to_file=_for_lengths(self.to_file, by),
        )

    def save(self, path):
        """Write everything as one npz.

        Raises
        ------
        OSError
            When the file cannot be written.
        """
        arrays = flat("fields", self.fields)
        for name in ("sightings", "speed", "smoothing"):
            if getattr(self, name) is not None:
                arrays |= flat(name, getattr(self, name))
        arrays |= flat("clip", self, leave=("fields", "sightings", "speed", "smoothing", "picture", "notes"))
        arrays["clip.notes"] = np.array(json.dumps(self.notes))
        if self.picture is not None:
            arrays["clip.picture"] = packed(self.picture)
        write(path, arrays)

    @staticmethod
    def load(path) -> Evidence:
        """Load the file that `save` wrote.

        Raises
        ------
        ProblemsError
            When the file is none of fields, has fields alone, or is damaged.
        """
        data = read(path)
        if "clip.name" not in data:
            raise refused(path, "has only fields and no clip; make it with flockbrush fields CLIP")
        parts = {"fields": _fields(path, data)}
        with damage(path):
            if "sightings.xy" in data:
                parts["sightings"] = Sightings(**part_of(data, "sightings"))
            if "speed.mean" in data:
                parts["speed"] = SpeedEvidence.of_arrays(part_of(data, "speed"))
            if smoothing := part_of(data, "smoothing"):
                parts["smoothing"] = (SightSmoothing if "half" in smoothing else PathSmoothing)(**smoothing)
            clip = part_of(data, "clip")
            clip["notes"] = [str(note) for note in json.loads(str(clip["notes"]))]
            if "picture" in clip:
                clip["picture"] = unpacked(path, clip["picture"])
            return Evidence(**clip, **parts)


def _for_lengths(way, by):
    """A map (2, 3) from BL, for a BL that is so many times shorter."""
    return None if way is None else np.column_stack([way[:, :2] / by, way[:, 2]])


def _fields(path, data):
    with damage(path):
        return Fields(**part_of(data, "fields"))
