"""How fast the animals of a clip go: mean, deviation, how soon a speed is forgotten, what crowding does to it.

Paper section 6.2.  The speeds are those of pixels that show animals.  If the flow of the N_bp pixels of one animal were
independent, the deviation of animals would be that of pixels over sqrt(N_bp), which is what the paper takes.  Where
animals are told apart their own speeds say it directly.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from behaviours.learning.speed_process import SMOOTHED, speed_process

BINS = 6  # of the table of speed against density
SIGHTS = 50  # speeds of single animals, below which those of pixels are taken


@dataclass
class SpeedEvidence:
    """Speeds of single animals, BL/s.

    Attributes
    ----------
    mean, deviation : float
        BL/s, over animals and time: of animals that are followed where there are any, else of pixels as in the paper.
        (The spread of speeds, and not the strength of chance in eq. 6, which is ``deviation * sqrt(2 * reversion)``.)
    reversion : float or None
        Rate at which a speed returns to the mean (the Ornstein-Uhlenbeck rate), 1/s; None where the clip does not say.
    by_density : list of (float, float)
        (animals a BL², speed there over the mean), rising in density.
    body_pixels : float
        Pixels of one animal in the reference picture (N_bp).
    pixel_deviation : float
        Of the speeds of pixels, before the correction by sqrt(N_bp), BL/s.
    smoothed : float
        s over which the speeds of single animals are averages.
    """

    mean: float
    deviation: float
    reversion: float | None = None
    by_density: list[tuple[float, float]] = field(default_factory=list)
    body_pixels: float = 1.0
    pixel_deviation: float = float("nan")
    smoothed: float = SMOOTHED

    @staticmethod
    def of_arrays(arrays) -> SpeedEvidence:
        """From what a file holds: the table is an array there."""
        table = np.asarray(arrays.pop("by_density", [])).reshape(-1, 2)
        return SpeedEvidence(**arrays, by_density=[(float(a), float(b)) for a, b in table])


def speed_evidence(fields, sightings=None, body_pixels=1.0, smoothed=SMOOTHED) -> SpeedEvidence | None:
    """The speeds of a clip from its fields, and from single animals where there are some.

    Parameters
    ----------
    fields : Fields
    sightings : Sightings, optional
    body_pixels : float
        N_bp.
    smoothed : float
        s over which the speeds of the sightings are averages.

    Returns
    -------
    SpeedEvidence or None
        None when nobody is seen to move or stand.
    """
    there = fields.occupied & (fields.density > 0)
    if not there.any():
        return None
    body_pixels = body_pixels if body_pixels >= 1 else 1.0  # also where it is not known: NaN
    weight, speed = fields.density[there], fields.speed[there]
    mean = float(np.average(speed, weights=weight))
    within = np.nan_to_num(fields.speed_variance[there])
    pixel_deviation = float(np.sqrt(np.average(within + (speed - mean) ** 2, weights=weight)))
    single = _of_animals(sightings, fields.fps, smoothed)
    return SpeedEvidence(
        mean=mean if single is None else float(single.mean),
        deviation=float(pixel_deviation / np.sqrt(body_pixels)) if single is None else float(single.spread),
        reversion=None if single is None else single.reversion,
        by_density=_by_density(weight, speed, mean),
        body_pixels=float(body_pixels),
        pixel_deviation=pixel_deviation,
        smoothed=float(smoothed),
    )


def _of_animals(sightings, fps, smoothed):
    """The process of the speeds of single animals, None where too few are followed."""
    if sightings is None or np.isfinite(sightings.speed).sum() < SIGHTS:
        return None
    return speed_process(sightings, fps, smoothed)


def _by_density(density, speed, mean):
    """[(density, factor)]: bins that hold equally many animals."""
    if mean <= 0:
        return []
    order = np.argsort(density, kind="stable")
    share = np.cumsum(density[order]) / density.sum()
    table = []
    for chosen in np.split(order, np.searchsorted(share, np.arange(1, BINS) / BINS)):
        if len(chosen):
            weight = density[chosen]
            where = float(np.average(weight, weights=weight))
            table.append((where, float(np.average(speed[chosen], weights=weight) / mean)))
    return [row for k, row in enumerate(table) if k == 0 or row[0] > table[k - 1][0]]
