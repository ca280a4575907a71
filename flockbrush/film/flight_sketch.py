"""Sketched flights: a path is drawn for each bird, and all become tracks over the same frames (Lin's future work)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from flockbrush.film.tracks import Tracks, smoothed

LEAST = 12.0  # pixels of a path: a shorter one is a click
STIFF = (1e-1, 1e7)  # of the smoother at the ends of the slider
USUAL = 0.55  # of the slider: bends shorter than about half a second at 30 frames a second go


@dataclass(frozen=True)
class Path:
    """What was drawn for one bird."""

    bird: int
    # tuple of (float, float, float); x, y in pixels, and seconds since the drawing began
    points: tuple[tuple[float, float, float], ...]

    @property
    def xy(self) -> np.ndarray:
        """(k, 2) pixels."""
        return np.array(self.points)[:, :2]


@dataclass(frozen=True)
class FlightSketch:
    """The paths of a flock."""

    paths: tuple[Path, ...] = ()
    frames: int = 200  # how many frames the flight has
    even: bool = True  # whether birds fly with even speed along what was drawn, or as fast as it was drawn
    smooth: float = USUAL  # 0 (as drawn) to 1

    def with_path(self, points) -> FlightSketch | None:
        """One bird more; None when what was drawn is too short to be a path."""
        points = tuple((float(x), float(y), float(t)) for x, y, t in points)
        if len(points) < 2 or float(np.ptp(np.array(points)[:, :2], axis=0).max()) < LEAST:
            return None
        bird = 1 + max((path.bird for path in self.paths), default=0)
        return replace(self, paths=(*self.paths, Path(bird, points)))

    def without(self, bird) -> FlightSketch:
        """One bird less."""
        return replace(self, paths=tuple(path for path in self.paths if path.bird != bird))

    def moved(self, bird, by) -> FlightSketch:
        """One path shifted by (x, y) pixels."""
        dx, dy = map(float, by)
        paths = tuple(
            Path(path.bird, tuple((x + dx, y + dy, t) for x, y, t in path.points)) if path.bird == bird else path
            for path in self.paths
        )
        return replace(self, paths=paths)

    @cached_property
    def tracks(self) -> Tracks:
        """All paths over the same frames, smoothed."""
        px = np.stack([along(path, self.frames, self.even) for path in self.paths], axis=1)
        sketched = Tracks(px, np.array([path.bird for path in self.paths]))
        if self.smooth <= 0 or self.frames < 4:
            return sketched
        return replace(sketched, px=smoothed(sketched, self.stiffness).px)

    @property
    def stiffness(self) -> float:
        """Of Whittaker's smoother (`flockbrush.film.tracks.smoothed`)."""
        low, high = np.log10(STIFF)
        return float(10 ** (low + (high - low) * self.smooth))


def along(path, frames, even) -> np.ndarray:
    """Places on a path at so many moments from its beginning to its end, (frames, 2) pixels."""
    points = np.array(path.points)
    steps = np.hypot(*np.diff(points[:, :2], axis=0).T)
    time = np.concatenate([[0], np.cumsum(steps if even else np.maximum(np.diff(points[:, 2]), 0))])
    if time[-1] <= 0:  # drawn in no time
        time = np.arange(len(points), dtype=float)
    moments = np.linspace(0, time[-1], frames)
    return np.column_stack([np.interp(moments, time, points[:, k]) for k in (0, 1)])
