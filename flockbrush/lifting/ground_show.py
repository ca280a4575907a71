"""Tracks of animals on the ground to be looked at, in the window that shows flights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from flockbrush.engine.files import refused
from flockbrush.engine.problems import ProblemsError
from flockbrush.film.observations import Evidence
from flockbrush.film.open_clip import Looking, look_at
from flockbrush.lifting.flight_show import Show
from flockbrush.lifting.flight_table import PLACES, read_flight, table_header, whole_numbers
from flockbrush.lifting.lift_solver import LiftedFlight
from flockbrush.output.run_table import read_run_table

FLAT = 0.01  # m: what is never higher does not fly
UNSIZED = 1.0  # m: the drawn body length if the tracks do not give one


class GroundShow(Show):
    """Animals of which some walk or swim: bodies without wings.

    Parameters
    ----------
    evidence : Evidence
        Of tracks.
    flight : LiftedFlight, optional
        The same animals in space, for their heights; 0 without it.
    """

    animal, sized_by, floor, flies = "animal", "Body length", 0.0, False

    def __init__(self, evidence: Evidence, flight: LiftedFlight | None = None):
        self.evidence = evidence
        self.unit = "m" if evidence.length_unit == "m" else "BL"
        self.length = evidence.body_length_px if evidence.length_unit == "m" else UNSIZED
        heights = 0.0 if flight is None else _heights(evidence, self.length, flight)
        super().__init__(_placed(evidence, self.length, heights), evidence.name, span=self.length)
        self._face()

    @property
    def long(self) -> float:
        return self.span

    def _face(self):
        """Bodies face where the tracks say, also while they stand."""
        ahead = self.evidence.sightings.forward
        self.forward[_at(self.evidence)] = np.column_stack([ahead, np.zeros(len(ahead))])

    def herd(self, k):
        """The animals of frame k as the painters want them."""
        herd, rows = super().herd(k), self.there(k)
        upright = np.broadcast_to((0.0, 0.0, 1.0), (len(rows), 3))
        radius = self.evidence.radius_bl * self.span
        return herd._replace(radius=radius, wings=None, up=upright)


def _heights(evidence, length, flight):
    """(m,) m: height of each sighting, that of the nearest animal of its frame."""
    heights, frames = np.zeros(len(evidence.sightings.xy)), evidence.fields.frames
    for t, k in enumerate(np.searchsorted(flight.frames, frames).tolist()):
        if k == len(flight.frames) or flight.frames[k] != frames[t]:
            continue
        rows, places = evidence.sightings.of(t), flight.xyz[k]
        places = places[np.isfinite(places[:, 0])]
        if len(places):
            nearest = cKDTree(places[:, :2]).query(evidence.sightings.xy[rows] * length)[1]
            heights[rows] = places[nearest, 2]
    return heights


def _placed(evidence, length, heights):
    sightings, names = evidence.sightings, np.unique(evidence.animals).tolist()
    xyz = np.full((len(sightings), len(names), 3), np.nan)
    xyz[_at(evidence)] = np.column_stack([sightings.xy * length, np.broadcast_to(heights, len(sightings.xy))])
    ids = whole_numbers(names)
    if ids is None or len(set(ids.tolist())) < len(names):
        ids = np.arange(len(names))
    return LiftedFlight(
        xyz, np.linalg.norm(xyz, axis=-1), ids, evidence.fields.frames, evidence.fps, start=evidence.start,
        names=tuple(names),
    )  # fmt: skip


def _at(evidence):
    """Frame and animal of each sighting; an animal whose track was cut is one animal."""
    return evidence.sightings.frame, np.unique(evidence.animals, return_inverse=True)[1][evidence.sightings.track]


def open_show(path, camera=None, looking: Looking | None = None) -> Show:
    """What a file of tracks shows: a flight, birds lifted by a camera, or animals on the ground.

    A table of a run in which some animal never flies is shown as animals on the ground (`is_flight`).

    Raises
    ------
    ProblemsError
        When the file cannot be read or does not say enough.
    """
    looking = looking or Looking()
    if camera is not None:
        return Show.open(path, camera)
    table = str(path).lower().endswith(".csv")
    header = table_header(path) if table else set()
    if table and is_flight(path):
        return Show.open(path)
    pixels = table and looking.unit is None and header >= {"frame", "id", "x", "y"} and "time" not in header
    if pixels:
        raise refused(
            path,
            "has x and y without saying their unit. To show animals on the ground, add --unit m, px or bl and --fps; "
            "to lift birds (pixels), name the camera that filmed them: --camera cam.toml",
        )
    if looking.unit is None and looking.body_length_px is not None:
        looking = replace(looking, unit="px")
    evidence = look_at(path, looking)
    in_space = table and header >= set(PLACES) and evidence.length_unit == "m"
    return GroundShow(evidence, read_flight(path) if in_space else None)


def is_flight(path) -> bool:
    """Whether a file is a table of places in space in which all animals fly.

    The metadata of a run say which brushes fly; an animal need not do so all the time.  Without them a table with banks
    is a flight, as is one without brushes in which some animal is above the ground.
    """
    header = table_header(path) if str(path).lower().endswith(".csv") else set()
    if "z" not in header:
        return False
    try:
        run = read_run_table(path)
        if run is not None:
            animals = run.numbers["id"]
            return bool(np.isin(animals, animals[np.isin(run.words["brush"], run.about.flying)]).all())
        if "brush" in header:
            return "bank" in header
        return bool(np.nanmax(np.abs(read_flight(path).xyz[..., 2])) >= FLAT)
    except ProblemsError:
        return True  # whoever opens it says what is wrong
