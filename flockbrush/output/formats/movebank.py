"""Movebank CSV export: tracks in degrees of latitude and longitude about an origin."""

from __future__ import annotations

import math
from datetime import UTC, datetime, timedelta

from flockbrush.output.exporter import Exporter, Option, exporter

HEAD = (
    "event-id,visible,timestamp,location-long,location-lat,external-temperature,height-above-ellipsoid,ground-speed,"
    "heading,sensor-type,individual-taxon-canonical-name,tag-local-identifier,individual-local-identifier,study-name,comments,"
    "body-length-m\n"
)
NEAR_ZERO = 111_319.49079327358  # m of a degree at the equator
START = datetime(2000, 1, 1, tzinfo=UTC)


@exporter(".movebank.csv")
class Movebank(Exporter):
    """A table in Movebank's terms. Metres become degrees about an origin, by a plate carrée that is true there."""

    contents = "tracks with the columns of Movebank, degrees relative to --origin, time from 2000-01-01 UTC"
    opens_in = "Movebank, move2 (R), Google Earth (through Movebank)"
    fps = 1.0
    choices = (
        Option(
            "origin", "0,0", "Latitude and longitude of the south-west corner of the level, degrees.", metavar="LAT,LON"
        ),
    )

    @classmethod
    def problems(cls, path, options):
        try:
            latitude, longitude = place_of(options.get("origin") or "0,0")
        except ValueError:
            latitude, longitude = math.nan, math.nan
        if abs(latitude) <= 85 and abs(longitude) <= 180:
            return []
        return [f"--origin must be latitude,longitude in degrees, -85 to 85 and -180 to 180, got {options['origin']!r}"]

    def open(self):
        self._file = open(self.temporary, "w", encoding="utf-8", newline="")
        self._file.write(HEAD)
        self._event = 0

    def take(self, moment):
        import numpy as np

        from flockbrush.output.trajectory_table import quoted
        from flockbrush.runs.snapshots import words_of

        latitude, longitude = place_of(self.options["origin"])
        words = words_of(self.simulation)
        stamp = (START + timedelta(seconds=moment.time)).strftime("%Y-%m-%d %H:%M:%S.%f")[:-3]
        north = latitude + moment.xyz[:, 1] / NEAR_ZERO
        east = longitude + moment.xyz[:, 0] / (NEAR_ZERO * math.cos(math.radians(latitude)))
        course = np.degrees(np.arctan2(moment.forward[:, 0], moment.forward[:, 1])) % 360
        speed = np.linalg.norm(moment.velocity[:, :2], axis=1)
        study = quoted(self.simulation.level.name)
        for row in range(len(moment)):
            self._event += 1
            codes = {"brush": moment.brush, **moment.labels}
            comment = "; ".join(f"{name} {word}" for name in codes if (word := words[name][codes[name][row]]))
            kind = quoted(words["species"][moment.species[row]])
            animal = int(moment.ids[row])
            self._file.write(
                f"{self._event},true,{stamp},{east[row]:.8f},{north[row]:.8f},,{moment.xyz[row, 2]:.3f},"
                f"{speed[row]:.4f},{course[row]:.2f},simulation,{kind},{animal},{animal},{study},{quoted(comment)},"
                f"{moment.length[row]:.6g}\n"
            )
        self.frames += 1

    def finish(self):
        self._file.close()

    def let_go(self):
        self._file.close()


def place_of(text) -> tuple[float, float]:
    """(latitude, longitude) of "LAT,LON"; ValueError."""
    latitude, longitude = (float(part) for part in text.split(","))
    return latitude, longitude
