"""The picture of the ground during a run: updates by paint and by objects that are added or moved."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.output.scene_meshes import TEXTURE, SceneMeshes, jpeg_of

EVERY = 1.0  # s: the whole picture is drawn anew no more often, as while an obstacle glides


class GroundPatch(NamedTuple):
    """A part of the picture that has changed."""

    # left, top: pixels from the picture's upper left corner
    left: int
    top: int
    pixels: np.ndarray  # (h, w, 3) uint8


class PaintedGround:
    """The ground's picture, followed moment by moment.

    Parameters
    ----------
    place : SceneMeshes
        Of the simulation that goes on.
    side : int
        Pixels of the longer side.
    """

    def __init__(self, place: SceneMeshes, side=TEXTURE):
        self._scenery, self._painter = place.scenery, place.painter(side)
        self.picture = self._painter.ground.copy()  # (h, w, 3) uint8, as it was when last looked at
        self._whole, self._drawn = False, -np.inf

    def take(self, time) -> GroundPatch | None:
        """What has changed until a moment (s); None for nothing."""
        boxes = self._scenery.changes()
        self._whole |= "all" in boxes
        if self._whole:
            if time - self._drawn < EVERY:
                return None
            boxes, self._whole, self._drawn = ["all"], False, time
        if not boxes:
            return None
        for box in boxes:
            self._painter.repaint(box)
        return self._difference(self._painter.ground)

    def late(self) -> GroundPatch | None:
        """What still waits for its second (`EVERY`) at the end of the run; None for nothing."""
        if not self._whole:
            return None
        self._whole = False
        self._painter.repaint("all")
        return self._difference(self._painter.ground)

    def _difference(self, picture):
        rows, columns = np.nonzero((picture != self.picture).any(axis=2))
        if not len(rows):
            return None
        top, bottom, left, right = rows.min(), rows.max() + 1, columns.min(), columns.max() + 1
        self.picture[top:bottom, left:right] = picture[top:bottom, left:right]
        return GroundPatch(int(left), int(top), picture[top:bottom, left:right].copy())


class GroundPictures:
    """Pictures of the painted ground for scene exports, at most one per second.

    Parameters
    ----------
    fps : float
        Of the moments that it is told.
    """

    def __init__(self, place: SceneMeshes, fps):
        self._ground, self._fps = PaintedGround(place), fps
        self.first = jpeg_of(self._ground.picture)  # the picture before the first moment, a JPEG
        self._frame, self._next, self._stale = 0, 0.0, False

    def take(self, time) -> tuple[int, bytes] | None:
        """The next moment (s): its frame and the picture that is shown from there on, None for the one before."""
        frame = self._frame
        self._frame += 1
        self._stale |= self._ground.take(time) is not None
        if not self._stale or frame < self._next:
            return None
        return self._picture(frame)

    def late(self) -> tuple[int, bytes] | None:
        """The last frame and its picture, where something was painted since the picture before."""
        self._stale |= self._ground.late() is not None
        return self._picture(self._frame - 1) if self._stale else None

    def _picture(self, frame):
        self._next, self._stale = frame + self._fps, False
        return frame, jpeg_of(self._ground.picture)
