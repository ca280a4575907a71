"""Learning at its smallest: what calls the kernels that learning begins with."""

from __future__ import annotations

import numpy as np

from flockbrush.behaviours.brush import shipped
from flockbrush.film.observations import Evidence
from flockbrush.film.track_evidence import evidence_of_tracks
from flockbrush.film.track_files import Trajectories
from flockbrush.learning.comparison import compared
from flockbrush.learning.simulate import simulated
from flockbrush.runs.kernel_helper import FEW

FRAMES, FPS = 12, 16.0
APART = 2.0  # BL, at the start
BRUSH = "march"


def rehearse() -> None:
    """Simulate a small herd that begins as a made-up clip begins, and compare the two."""
    clip = _clip()
    compared(clip, [simulated(clip, shipped().get(BRUSH))])


def _clip() -> Evidence:
    """A block of animals that walk beside one another, none quite straight on."""
    places = APART * np.stack(np.divmod(np.arange(FEW), 4), 1)
    headings = np.linspace(-0.3, 0.3, FEW)
    steps = np.stack([np.cos(headings), np.sin(headings)], 1) / FPS
    xy = places + np.arange(FRAMES)[:, None, None] * steps
    return evidence_of_tracks(Trajectories(xy, tuple(map(str, range(FEW))), FPS, "bl"), 1.0)
