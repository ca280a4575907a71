"""One photograph: a film in which density stands still and the directions are as varied as the bodies lie.

The paper learns its seals from a photograph: it matches density and direction variance alone, with a variance of
3000 degrees² for assuming random directions and speeds from what is known of seals [1]_.

.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.  Section 7.2.4.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from flockbrush.film.observations import Evidence, Sightings
from flockbrush.film.speeds import SpeedEvidence
from flockbrush.learning.axis_variance import RANDOM, variance_of_axes

SECONDS, FPS = 4.0, 12.5  # how long the picture stands
SPEED = 0.5  # body lengths a second, of animals at rest on land (the paper's seals), where nobody says
SPREAD = 0.1  # of the speed


def standing(photo: Evidence, speed: float = SPEED, seconds: float = SECONDS) -> Evidence:
    """A photograph as the evidence of a few seconds in which nothing changes.

    Parameters
    ----------
    photo : Evidence
        Of one frame.
    speed : float
        Speed of the animals, body lengths a second: the picture does not show it.

    Returns
    -------
    Evidence
        Density and bodies stand still, nobody's velocity is known, and the angular variance is that of the bodies' axes
        where they can be told apart, else that of assuming random directions.  Which end of a body is the head is
        guessed.
    """
    frames = max(2, round(seconds * FPS))
    target, told = angular_variance(photo)
    fields = photo.fields
    again: dict[str, Any] = {
        name: np.repeat(getattr(fields, name), frames, axis=0)
        for name in ("density", "seen", "count", "frames", "at_edge", "pairs")
        if getattr(fields, name) is not None
    }
    unknown = np.full(again["density"].shape, np.nan)
    long = replace(
        fields, fps=FPS, velocity=np.stack([unknown, unknown], axis=-1), speed=unknown.copy(),
        speed_variance=unknown.copy(), angular_variance=np.repeat(target[None], frames, axis=0), **again,
    )  # fmt: skip
    camera = None if photo.camera is None else np.repeat(photo.camera, frames, axis=0)
    how = "measured from the axes of the bodies" if told else f"{RANDOM:g} degrees², assuming random directions"
    notes = [
        *photo.notes,
        "Learned from a photograph: only from density, spacing and the variance of directions; motion is not known.",
        f"Variance of directions: {how}. Speed: {speed:g} body lengths/s, as given.",
    ]
    sightings = None if photo.sightings is None else _lying(photo.sightings, speed, frames)
    speeds = SpeedEvidence(mean=speed, deviation=SPREAD * speed)
    return replace(photo, fps=FPS, fields=long, sightings=sightings, speed=speeds, camera=camera, notes=notes)


def _lying(seen: Sightings, speed, frames) -> Sightings:
    """The bodies of a photograph in so many frames, with heads as a herd may have them.

    Bodies that lie alike head alike; where they lie at random, heads are on either side.
    """
    angle = np.arctan2(seen.forward[:, 1], seen.forward[:, 0])
    mean = np.exp(2j * angle).mean() if len(angle) else 0j
    ahead = np.array([np.cos(np.angle(mean) / 2), np.sin(np.angle(mean) / 2)])
    backwards = np.random.default_rng(len(angle)).random(len(angle)) > 0.5 * (1.0 + abs(mean))
    forward = seen.forward * np.where((seen.forward @ ahead < 0) != backwards, -1.0, 1.0)[:, None]
    n, many = len(angle), frames * len(angle)
    return Sightings(
        np.arange(frames + 1) * n, np.tile(seen.xy, (frames, 1)), np.tile(forward, (frames, 1)),
        np.full(many, float(speed)), np.full(many, np.nan), np.full(many, -1),
    )  # fmt: skip


def angular_variance(photo: Evidence) -> tuple[np.ndarray, bool]:
    """((ny, nx) degrees² for every cell, whether any was measured).

    A body shows its axis and not always its head: angles between axes are doubled, so that axes at random have the
    variance of assuming random directions and parallel axes none.
    """
    fields = photo.fields
    target = np.where(np.nan_to_num(fields.density[0]) > 0, RANDOM, np.nan)
    if photo.sightings is None:
        return target, False
    rows = photo.sightings.of(0)
    measured = variance_of_axes(fields, photo.sightings.xy[rows], photo.sightings.forward[rows])
    told = np.isfinite(measured) & np.isfinite(target)
    target[told] = measured[told]
    return target, bool(told.any())
