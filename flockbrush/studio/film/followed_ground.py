"""The ground of a film: landmarks are followed in the background and give the camera motion."""

from __future__ import annotations

import numpy as np

from flockbrush.film.clip_frames import Film
from flockbrush.film.landmarks import Landmark, followed, lost, motion

JOB = "landmark"


class FollowedGround:
    """Follows the landmarks of a film, one after the other; `Book.followed` keeps where they are.

    Parameters
    ----------
    window : ClipWindow
    """

    def __init__(self, window):
        self.window, self._film = window, None
        self._now: Landmark | None = None  # followed in the job, or failed to be

    @property
    def _marks(self):
        return self.window.book.state.marks.landmarks

    def go_on(self):
        """Begin with the next landmark, if none is being followed."""
        window, places = self.window, self.window.book.followed
        mark = next((mark for mark in self._marks if mark not in places), None)
        if mark is None or JOB in window.jobs or not isinstance(window.film, Film):
            return
        film = self._film = self._film or window.film.again()
        self._now, places[mark] = mark, lost(film, mark)  # whose job fails is not tried again
        window.job(
            JOB,
            "tracking landmarks",
            lambda say: followed(film, mark, say),
            lambda boxes: places.__setitem__(mark, boxes),
        )

    def waits_for(self, mark) -> bool:
        """Whether a landmark is still to be followed."""
        return mark not in self.window.book.followed or (mark == self._now and JOB in self.window.jobs)

    def said(self, mark) -> str:
        """In how many frames a landmark was found, in words."""
        if self.waits_for(mark):
            return "following"
        lacking = int((~np.isfinite(self.window.book.followed[mark][:, 0])).sum())
        if lacking and lacking == len(self.window.film) - 1:
            return "cannot be followed"
        return f"lost in {lacking}" if lacking else "in all frames"

    def box(self, mark, k) -> np.ndarray | None:
        """Where a landmark is in a frame, (4,) x, y, w, h in pixels, or None."""
        boxes = self.window.book.followed.get(mark)
        box = np.array(mark[1:]) if mark.frame == k else None if boxes is None else boxes[k]
        return box if box is not None and np.isfinite(box[0]) else None

    def motion(self, a, b) -> np.ndarray | None:
        """How the picture moved from frame a to frame b, (2, 3); None if not known. Without landmarks it stands."""
        if not self._marks or a == b:
            return np.eye(2, 3)
        if any(self.waits_for(mark) for mark in self._marks):
            return None
        return motion([self.window.book.followed[mark] for mark in self._marks], a, b)
