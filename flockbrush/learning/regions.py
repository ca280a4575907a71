"""Several herds of one clip: a mask with colours gives the part of the ground each brush is learned from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from flockbrush.engine.files import refused
from flockbrush.film.observations import SIGHT_COLUMNS, Evidence, Sightings

MOST = 16  # colours of a mask; more are a photograph, or soft edges
FEWEST = 2.0  # animals of a region on average, below which nothing can be learned of it


@dataclass(frozen=True)
class Region:
    """A part of the ground."""

    number: int  # in `Fields.region`
    colour: str  # of the mask, "#rrggbb"

    @property
    def word(self) -> str:
        """What its brush's name ends with."""
        return _WORDS.get(self.colour, str(self.number))


_WORDS = {
    "#ff0000": "red", "#00ff00": "green", "#0000ff": "blue", "#ffff00": "yellow", "#00ffff": "cyan",
    "#ff00ff": "magenta", "#ffffff": "white",
}  # fmt: skip


def regions_of(path) -> list[Region]:
    """The regions of a mask, numbered as `observe` numbers them: by their red, green and blue; black is none.

    Raises
    ------
    ProblemsError
        When the file is no picture, has no colours, or too many.
    """
    from flockbrush.film.media import read_picture

    image = read_picture(path, "a region mask must be a PNG with one colour per region")
    painted = np.unique(image[:, :, ::-1].reshape(-1, 3), axis=0)
    colours = [tuple(int(part) for part in colour) for colour in painted if colour.any()]
    if not colours:
        raise refused(path, "is all black: paint each region in its own colour")
    if len(colours) > MOST:
        raise refused(
            path,
            f"has {len(colours)} colours; a mask has one colour per region, at most {MOST}: paint without soft edges, "
            "and save as PNG, not as JPEG",
        )
    return [Region(k + 1, "#{:02x}{:02x}{:02x}".format(*colour)) for k, colour in enumerate(sorted(colours))]


def within(evidence: Evidence, region: Region) -> Evidence | None:
    """The observations of one region; the rest counts as out of the picture.  None if it has too few animals."""
    fields = evidence.fields
    here = fields.region == region.number
    seen = fields.seen & here
    known: dict[str, Any] = {
        name: np.where(seen, getattr(fields, name), np.nan)
        for name in ("density", "speed_variance", "angular_variance", "speed")
    }
    count = np.nan_to_num(known["density"]).sum((1, 2)) * fields.cell**2
    if not len(count) or count.mean() < FEWEST:
        return None
    velocity = np.where(seen[..., None], fields.velocity, np.nan)
    part = replace(fields, velocity=velocity, seen=seen, count=count, at_edge=None, pairs=None, **known)
    sightings = None if evidence.sightings is None else _within(evidence.sightings, fields, here)
    notes = [*evidence.notes, f"Learned only from the region painted {region.colour}."]
    return replace(evidence.showing(part, sightings), notes=notes)


def _within(sightings, fields, here):
    """The animals that stand in a region."""
    row, column, inside = fields.cells_of(sightings.xy)
    kept = inside & here[row, column]
    per_frame = np.bincount(sightings.frame[kept], minlength=len(sightings))
    columns = {name: getattr(sightings, name)[kept] for name in SIGHT_COLUMNS}
    return Sightings(np.concatenate([[0], np.cumsum(per_frame)]), **columns)
