"""Where animals have been in space: the last seconds of each, to be drawn as a line behind it."""

from __future__ import annotations

import numpy as np

ROOM = 40  # moments kept of each animal
MOST = 24_000  # places kept of all of them: of large herds the ways are coarser


class Ways:
    """The last seconds of every animal.

    Parameters
    ----------
    seconds : float
        So long a way is kept.

    Attributes
    ----------
    places : (k, n, 3)
        Metres, a ring of moments; NaN where an animal was not there yet.
    first, last : int
        Its oldest and its newest moment.
    """

    def __init__(self, seconds: float = 3.0):
        if not (np.isfinite(seconds) and seconds > 0):
            raise ValueError(f"trails last a positive time, got {seconds} s")
        self.seconds = float(seconds)
        self.clear()

    def clear(self):
        """Forget everything, as after a jump in time."""
        self.places = np.zeros((ROOM, 0, 3))
        self.first = self.last = 0
        self.ids: np.ndarray | None = None
        self.time = self._begun = -np.inf

    def go(self, xyz, ids=None, time=None):
        """The animals are at (n, 3) m now, at `time` (s); a step back in time clears what was."""
        time = self.time + 1 / 30 if time is None and np.isfinite(self.time) else (0.0 if time is None else float(time))
        if not 0 <= time - self.time <= self.seconds:
            self.clear()
        self._follow(xyz, ids)
        self._begun = max(self._begun, time - self.seconds)
        step = self.seconds / (len(self.places) - 1)
        if np.isfinite(self.time) and time - self._begun >= step:
            self._begun = time
            self.last = (self.last + 1) % len(self.places)
            if self.last == self.first:
                self.first = (self.first + 1) % len(self.places)
        self.time = time
        self.places[self.last] = xyz

    def _follow(self, xyz, ids):
        """Keep the columns of animals that are still there."""
        ids = np.arange(len(xyz)) if ids is None else np.asarray(ids)
        if self.ids is not None and np.array_equal(ids, self.ids):
            return
        before, known, room = self.places, self.ids, int(np.clip(MOST // max(len(xyz), 1), 6, ROOM))
        if known is None or room != len(before):
            self.places, self.first, self.last = np.full((room, len(xyz), 3), np.nan), 0, 0
            self.places[0] = xyz
        else:
            self.places = np.full((room, len(xyz), 3), np.nan)
            if len(known):
                order = np.argsort(known, kind="stable")
                rows = order[np.clip(np.searchsorted(known, ids, sorter=order), 0, len(known) - 1)]
                known_before = known[rows] == ids
                self.places[:, known_before] = before[:, rows[known_before]]
        self.ids = ids.copy()
