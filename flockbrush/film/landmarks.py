"""Landmarks: rectangles on things that stand still, followed through the film by CSRT to tell how the camera moved."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np

from flockbrush.film.camera_maps import fitted
from flockbrush.film.clip_reader import WORK

LEAST = 8  # pixels of a rectangle's side, in the pictures that `flockbrush learn` works on
SIDE = 640  # pixels: larger pictures are made so small to be followed in
MOST = 8  # landmarks of a film


class Landmark(NamedTuple):
    """A rectangle in one frame, pixels."""

    frame: int
    x: float
    y: float
    w: float
    h: float

    @property
    def argument(self) -> str:
        """The form of the command line: "12:310,205,64,48"."""
        return f"{self.frame}:" + ",".join(str(round(part)) for part in self[1:])


def least_side(size) -> int:
    """The least side of a landmark in a film of this size, pixels of the film."""
    return math.ceil(LEAST * max(1.0, max(size) / WORK))


def between(frame, one, other, size) -> Landmark | None:
    """The landmark between two corners, within the picture; None when it is too small."""
    low = np.clip(np.minimum(one, other), 0, size)
    high = np.clip(np.maximum(one, other), 0, size)
    x, y, w, h = (float(v) for v in np.round([*low, *(high - low)]))
    return Landmark(frame, x, y, w, h) if min(w, h) >= least_side(size) else None


def followed(film, landmark, say=lambda share: None) -> np.ndarray:
    """Where a landmark is in every frame, (F, 4) x, y, w, h in pixels, NaN where it is lost: CSRT both ways.

    One that CSRT cannot follow, such as a rectangle of one pixel of the reduced picture, is in its own frame alone.

    Parameters
    ----------
    film : Film
        No other reader may use it meanwhile.
    say : callable, optional
        Called with the share that is done.
    """
    boxes, done = lost(film, landmark), 1
    scale = min(1.0, SIDE / max(film.size))
    for way in (range(landmark.frame + 1, len(film)), range(landmark.frame - 1, -1, -1)):
        tracker = csrt()
        try:
            tracker.init(_small(film.frame(landmark.frame), scale), tuple(round(part * scale) for part in landmark[1:]))
        except cv2.error:
            break
        for k in way:
            fine, box = tracker.update(_small(film.frame(k), scale))
            if not fine:
                break
            boxes[k] = np.array(box) / scale
            done += 1
            say(done / len(film))
    return boxes


def lost(film, landmark) -> np.ndarray:
    """The places of a landmark that is in its own frame alone, as `followed` gives them."""
    boxes = np.full((len(film), 4), np.nan)
    boxes[landmark.frame] = landmark[1:]
    return boxes


def csrt():
    """A CSRT tracker that is quick enough for two rectangles on two cores."""
    params = cv2.TrackerCSRT.Params()
    params.template_size, params.number_of_scales = 120, 17
    return cv2.TrackerCSRT.create(params)


def _small(image, scale):
    return image if scale == 1 else cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)


def motion(boxes, a, b) -> np.ndarray | None:
    """The motion of the picture from frame a to frame b, (2, 3), from the centres of landmarks; None if unknown.

    Two or more give shift, turn and size; one gives a shift.

    Parameters
    ----------
    boxes : list of (F, 4) ndarray
    """
    if a == b:
        return np.eye(2, 3)
    pairs = [(box[a], box[b]) for box in boxes if np.isfinite(box[[a, b]]).all()]
    if not pairs:
        return None
    start, end = (np.array([pair[k][:2] + pair[k][2:] / 2 for pair in pairs]) for k in (0, 1))
    if ((start - start.mean(0)) ** 2).sum() < 1.0:  # one place
        return np.column_stack([np.eye(2), end.mean(0) - start.mean(0)])
    return fitted(start, end)
