"""Tracks of animals on the ground to be looked at, in the window that shows flights."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flockbrush.engine.files import refused
from flockbrush.engine.problems import ProblemsError
from flockbrush.film.observations import Evidence
from flockbrush.film.open_clip import Looking, look_at
from flockbrush.lifting.flight_show import Show
from flockbrush.lifting.flight_table import read_flight, table_header
from flockbrush.lifting.lift_solver import LiftedFlight

FLAT = 0.01  # m: animals that are never higher walk
UNSIZED = 1.0  # m: the drawn body length if the tracks do not give one


class GroundShow(Show):
    """Animals that walk or swim: bodies without wings, at height 0.

    Parameters
    ----------
    evidence : Evidence
        Of tracks.
    """

    animal, sized_by, floor = "animal", "Body length", 0.0

    def __init__(self, evidence: Evidence):
        self.evidence = evidence
        self.length = evidence.body_length_px if evidence.length_unit == "m" else UNSIZED
        super().__init__(_flat(evidence, self.length), evidence.name, span=self.length)
        self._face()

    def _face(self):
        """Bodies face where the tracks say, also while they stand."""
        sightings = self.evidence.sightings
        self.forward[sightings.frame, sightings.track] = np.column_stack(
            [sightings.forward, np.zeros(len(sightings.xy))]
        )

    def herd(self, k):
        """The animals of frame k as the painters want them."""
        herd, rows = super().herd(k), self.there(k)
        upright = np.broadcast_to((0.0, 0.0, 1.0), (len(rows), 3))
        radius = self.evidence.radius_bl * self.span
        return herd._replace(length=self.span, radius=radius, wings=None, up=upright)


def _flat(evidence, length):
    sightings = evidence.sightings
    count = int(sightings.track.max()) + 1
    xyz = np.full((len(sightings), count, 3), np.nan)
    xyz[sightings.frame, sightings.track] = np.column_stack([sightings.xy * length, np.zeros(len(sightings.xy))])
    return LiftedFlight(
        xyz, np.linalg.norm(xyz, axis=-1), np.arange(count), int(evidence.fields.frames[0]), evidence.fps
    )


def open_show(path, camera=None, looking: Looking | None = None) -> Show:
    """What a file of tracks shows: a flight, birds lifted by a camera, or animals on the ground.

    A table of Flockbrush in which no animal leaves the ground is shown as animals on the ground.

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
    return GroundShow(look_at(path, looking))


def is_flight(path) -> bool:
    """Whether a file is a table of places in space, and some animal in it is above the ground."""
    if not str(path).lower().endswith(".csv") or "z" not in table_header(path):
        return False
    try:
        return bool(np.nanmax(np.abs(read_flight(path).xyz[..., 2])) >= FLAT)
    except ProblemsError:
        return True  # whoever opens it says what is wrong
