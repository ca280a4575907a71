"""Whether the ground of a clip has enough texture to track the camera, also without the animals on it."""

from __future__ import annotations

import cv2
import numpy as np

from flockbrush.film.camera_maps import moved_by, scaled_maps
from flockbrush.film.clip_reader import Clip
from flockbrush.film.observations import CannotObserve
from flockbrush.film.stabilise import SIDE, GroundFollower

PLAIN = 0.7  # least eigenvalue of the gradients, (grey levels)²: of grain alone .1 to .5, of faint grass 2
ASTRAY = 3.0  # px at the corners of the picture by which the ground with and without animals may differ
FIRST = 8  # frames that are compared


def ground_alone(clip: Clip, animals, maps) -> bool:
    """Whether the first frames give the same camera motion from the ground without the animals.

    Raises
    ------
    CannotObserve
        When the ground without animals is too plain to be tracked.
    """
    follower = GroundFollower(animals, min(1.0, SIDE / max(clip.size)))
    corners = np.array([(0, 0), (clip.size[0], 0), (0, clip.size[1]), clip.size], float)
    for k, picture in clip.read(range(min(FIRST, len(clip)))):
        if not follower.step(k, picture) or follower.bare:
            raise CannotObserve(
                clip.name,
                "the ground has too little texture to measure the motion of the camera; mark something that does not "
                "move, in two frames: --landmark FRAME:x,y,w,h",
                {"pictures": {f"frame {int(clip.numbers[k])}": picture}},
            )  # fmt: skip
    pairs = zip(scaled_maps(follower.maps, 1 / follower.scale), maps, strict=False)
    return all(np.abs(moved_by(a, corners) - moved_by(b, corners)).max() < ASTRAY for a, b in pairs)


def is_plain(picture, away) -> bool:
    """Whether hardly anything on the ground of a picture could show that the camera moves; ``away`` covers animals."""
    grey = cv2.GaussianBlur(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), (0, 0), 2.0).astype(np.float32)
    firm = cv2.cornerMinEigenVal(grey, 7, ksize=3)
    ground = cv2.dilate(away.astype(np.uint8), np.ones((15, 15), np.uint8)) == 0
    return bool(ground.any() and np.quantile(firm[ground], 0.99) < PLAIN)
