"""How what was seen of animals was smoothed, so that simulated herds can be observed in the same way.

Smooth paths turn less sharply than animals do, and their errors last as long as the smoother's window.  A herd that is
compared with them must have gone through the same smoother.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flockbrush.film.local_fits import local_values
from flockbrush.film.tracks import central_differences, smoothed_alike


@dataclass(frozen=True)
class SightSmoothing:
    """The local polynomials of the bodies in a film (`flockbrush.film.sightings`), and the noise before them."""

    half: int  # frames to each side
    place: float  # BL along each direction
    heading: float  # rad

    def scaled(self, by: float) -> SightSmoothing:
        """The same in other lengths."""
        return replace(self, place=self.place * by)

    def observed(self, xy, angle, fps: float, rng) -> tuple[np.ndarray, np.ndarray]:
        """Paths and headings as they would be observed in such a film; arguments of `PathSmoothing.observed`."""
        who, frame = np.nonzero(np.isfinite(xy[..., 0]).T)
        begin = np.searchsorted(who, np.arange(xy.shape[1] + 1))
        values = np.column_stack([xy[frame, who], np.unwrap(angle[frame, who])])
        values += rng.normal(size=values.shape) * (self.place, self.place, self.heading)
        seen = np.empty_like(values)
        local_values(frame.astype(float), values, begin, float(self.half), seen)
        paths, headings = np.full_like(xy, np.nan), np.full_like(angle, np.nan)
        paths[frame, who], headings[frame, who] = seen[:, :2], seen[:, 2]
        return paths, headings


@dataclass(frozen=True)
class PathSmoothing:
    """The smoother of one file of tracks, and the noise that it removed."""

    stiffness: float  # `flockbrush.film.tracks.smoothed`
    noise: float  # BL along each direction, of the positions in the file
    slow: float  # BL/s, below which directions of motion say nothing
    heading: float | None = None  # rad, noise of headings from the file; None: headings are directions of motion

    def scaled(self, by: float) -> PathSmoothing:
        """The same in other lengths."""
        return replace(self, noise=self.noise * by, slow=self.slow * by)

    def observed(self, xy, angle, fps: float, rng) -> tuple[np.ndarray, np.ndarray]:
        """Paths and headings as they would be observed in such a file.

        Parameters
        ----------
        xy : (F, N, 2) array_like
            BL; NaN where an animal is not there.
        angle : (F, N) array_like
            Headings, rad.
        rng : numpy.random.Generator

        Returns
        -------
        ndarray (F, N, 2), ndarray (F, N)
        """
        paths = smoothed_alike(xy + self.noise * rng.normal(size=np.shape(xy)), self.stiffness)
        if self.heading is not None:
            return paths, angle + self.heading * rng.normal(size=np.shape(angle))
        return paths, headings_of(central_differences(paths) * fps, self.slow, angle)[0]


def headings_of(velocity, slow, otherwise) -> tuple[np.ndarray, np.ndarray]:
    """Directions of motion (F, N), rad, unwrapped, and whether they were observed (F, N).

    An animal below the speed ``slow`` keeps its last heading; one that was never faster has that of ``otherwise``
    (F, N) in its first frame.
    """
    there = np.isfinite(velocity[..., 0])
    angle = np.arctan2(velocity[..., 1], velocity[..., 0])
    return held(angle, there, there & (np.hypot(velocity[..., 0], velocity[..., 1]) > slow), otherwise)


def held(angle, there, sure, otherwise) -> tuple[np.ndarray, np.ndarray]:
    """Headings (F, N), rad, unwrapped, of which those that are not ``sure`` are the last or first sure ones."""
    out = np.full(angle.shape, np.nan)
    for k in range(angle.shape[1]):
        rows, known = np.flatnonzero(there[:, k]), np.flatnonzero(there[:, k] & sure[:, k])
        if len(known):
            nearest = known[np.clip(np.searchsorted(known, rows, side="right") - 1, 0, None)]
            out[rows, k] = np.unwrap(angle[nearest, k])
        else:  # any direction is as good
            out[rows, k] = np.nan_to_num(otherwise[rows[:1], k])
    return out, sure & there
