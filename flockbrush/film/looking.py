"""How a user wants a clip looked at or marked.  The command line needs this before it imports what does it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from flockbrush.film.arena import Arena

LENGTHS_PX = 2.0, 2000.0  # of a body in a film
MODES = ("view", "landmarks", "mask", "body", "birds", "sketch")  # of the window for a clip
MODES_OF_SKY = ("view", "sketch")  # of an empty one


@dataclass(frozen=True)
class Looking:
    """Options of the observation of a clip; what is not given is found in the clip."""

    frames: tuple[int, int] | None = None
    landmarks: tuple = ()
    body_colour: str | tuple[int, int, int] = "auto"
    body_length_px: float | None = None
    grid: int = 30
    obstacles: Path | None = None
    regions: Path | None = None
    unit: str | None = None  # of tracks: m, px or bl
    fps: float | None = None  # of tracks
    body_length_m: float | None = None  # of tracks in metres; the same as in pixels: in whichever unit they are
    arena: Arena | None = None  # of tracks
    usual_length_m: float = 1.0  # of tracks in metres that do not state it


def frames_missing(begin: int, end: int, wanted: tuple[int, int | None]) -> list[str]:
    """A note, where more frames are asked for than the clip has, or none.

    >>> frames_missing(0, 39, (0, 100))
    ['has frames 0 to 39; 40 to 100 are not there']
    >>> frames_missing(1, 39, (0, 39))
    ['has frames 1 to 39; 0 is not there']
    """
    first, last = wanted
    gone = [(first, begin - 1)] if first < begin else []
    gone += [(end + 1, last)] if last is not None and last > end else []
    ranges = " and ".join(f"{a} to {b}" if a < b else f"{a}" for a, b in gone)
    verb = "are" if len(gone) > 1 or any(a < b for a, b in gone) else "is"
    return [f"has frames {begin} to {end}; {ranges} {verb} not there"] if gone else []
