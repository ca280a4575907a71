"""How fast the animals of a clip go: mean, deviation, how soon a speed is forgotten, what crowding does to it.

Paper section 6.2.  The speeds are those of pixels that show animals.  If the flow of the N_bp pixels of one animal were
independent, the deviation of animals would be that of pixels over sqrt(N_bp), which is what the paper takes.  Where
animals are told apart their own speeds say it directly.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.ndimage import convolve

from flockbrush.film.body_gaps import with_room
from flockbrush.film.missing_animals import trust
from flockbrush.film.pauses import pauses_of
from flockbrush.film.speed_process import SMOOTHED, speed_process
from flockbrush.systems.grid import sort_into_cells
from flockbrush.systems.pace import crowding

BINS = 6  # of the table of speed against density
FACTORS = 0.2, 3.0  # that a table may have
REACH = 2.0  # BL, of `flockbrush.systems.pace.crowding`
EVERY = 3  # frames: neighbouring frames tell the same
SIGHTS = 50  # speeds of single animals, below which those of pixels are taken


@dataclass
class SpeedEvidence:
    """Speeds of single animals, BL/s."""

    # mean, deviation: BL/s: of animals that are followed where there are any, each in time, else of pixels as in the
    # paper. (The spread of speeds, and not the strength of chance in eq. 6, which is ``deviation * sqrt(2 *
    # reversion)``.)
    mean: float
    deviation: float
    # rate at which a speed returns to the mean (the Ornstein-Uhlenbeck rate), 1/s; None where the clip does not say
    reversion: float | None = None
    likely: float = 1.0  # 1/s, what is taken for it where the clip does not say
    # individual, common: BL/s, standard deviations of the usual speeds of animals, and of that of the herd in time;
    # common_time: s for which that lasts
    individual: float = 0.0
    common: float = 0.0
    common_time: float = 3.0
    # list of (float, float); (others a BL² within two body lengths, speed there over the mean), rising in density: the
    # crowding by which it is looked up again (`flockbrush.systems.pace.crowding`). Its mean over the animals of the
    # clip is 1.
    by_density: list[tuple[float, float]] = field(default_factory=list)
    weight: float = 1.0  # animals, counted in every frame, that it rests on
    # stops, starts, imitation: of animals that stand and walk by turns (`flockbrush.film.pauses`); mean, deviation,
    # reversion and table are then of those that walk. 0: one kind of speed.
    stops: float = 0.0
    starts: float = 0.0
    imitation: float = 0.0
    body_pixels: float = 1.0  # pixels of one animal in the reference picture (N_bp)
    pixel_deviation: float = float("nan")  # of the speeds of pixels, before the correction by sqrt(N_bp), BL/s
    smoothed: float = SMOOTHED  # s over which the speeds of single animals are averages
    # covariances of the errors of those so many frames apart, BL²/s²; empty if unknown
    errors: list[float] = field(default_factory=list)

    def scaled(self, by: float) -> SpeedEvidence:
        """The same in a unit of length that is so many times shorter."""
        lengths = "mean", "deviation", "individual", "common", "pixel_deviation"
        return replace(
            self, **{name: getattr(self, name) * by for name in lengths},
            by_density=[(density / by**2, factor) for density, factor in self.by_density],
            errors=[error * by**2 for error in self.errors],
        )  # fmt: skip

    @staticmethod
    def of_arrays(arrays) -> SpeedEvidence:
        """From what a file holds: the table is an array there."""
        table = np.asarray(arrays.pop("by_density", [])).reshape(-1, 2)
        errors = np.asarray(arrays.pop("errors", [])).tolist()
        return SpeedEvidence(**arrays, errors=errors, by_density=[(float(a), float(b)) for a, b in table])


def speed_evidence(
    fields, sightings=None, body_pixels=1.0, smoothed=SMOOTHED, errors=(), radius=None
) -> SpeedEvidence | None:
    """The speeds of a clip from its fields, and from single animals where there are some.

    Parameters
    ----------
    body_pixels : float
        N_bp.
    smoothed : float
        s over which the speeds of the sightings are averages.
    errors : (k,) array_like
        Covariances of the errors of their speeds (see `flockbrush.film.speed_process`); empty if unknown.
    radius : float, optional
        Half the width of a body, BL: speeds of single animals are then of those `with_room`.

    Returns
    -------
    SpeedEvidence or None
        None when nobody is seen to move or stand.
    """
    occupied = fields.occupied & (fields.density > 0)
    if not occupied.any():
        return None
    body_pixels = body_pixels if body_pixels >= 1 else 1.0  # also where it is not known: NaN
    weight, speed = fields.density[occupied], fields.speed[occupied]
    mean = float(np.average(speed, weights=weight))
    within = np.nan_to_num(fields.speed_variance[occupied])
    pixel_deviation = float(np.sqrt(np.average(within + (speed - mean) ** 2, weights=weight)))
    pauses = None if sightings is None else pauses_of(sightings, fields.fps)
    if pauses is not None:
        sightings = replace(sightings, speed=np.where(sightings.speed >= pauses.slow, sightings.speed, np.nan))
    if sightings is not None and radius is not None:
        room = with_room(sightings, radius, fields.fps)
        sightings = replace(sightings, speed=np.where(room, sightings.speed, np.nan))
    single = _of_animals(sightings, fields.fps, smoothed, errors)
    crowd = _crowd_of_fields(fields, occupied) if single is None else _crowd_of_animals(sightings)
    if single is None:
        told = {"mean": mean, "deviation": float(pixel_deviation / np.sqrt(body_pixels))}
    else:
        told = {"mean": float(single.mean), "deviation": float(single.spread)}
        told |= {name: getattr(single, name) for name in ("reversion", "likely", "individual", "common", "common_time")}
        told |= {} if pauses is None else {name: getattr(pauses, name) for name in ("stops", "starts", "imitation")}
    return SpeedEvidence(
        **told, by_density=table_of(*crowd), weight=float(crowd[2].sum()), body_pixels=float(body_pixels),
        pixel_deviation=pixel_deviation, smoothed=float(smoothed), errors=np.asarray(errors, float).tolist(),
    )  # fmt: skip


def _of_animals(sightings, fps, smoothed, errors):
    """The process of the speeds of single animals, None where too few are followed."""
    if sightings is None or np.isfinite(sightings.speed).sum() < SIGHTS:
        return None
    return speed_process(sightings, fps, smoothed, errors)


# how crowded it is -----------------------------------------------------------------------


def crowding_of(xy) -> np.ndarray:
    """(n,) others a BL² within two body lengths of each of the animals at (n, 2) BL: the measure that levels use."""
    n = len(xy)
    flat, one = np.column_stack([xy, np.zeros(n)]), np.ones(n)
    cells = sort_into_cells(flat, np.tile([1.0, 0.0, 0.0], (n, 1)), one, 0.5 * one, REACH)
    density = np.zeros(n)
    crowding(0, n, cells, one, density)
    return density


def _crowd_of_animals(sightings):
    """(crowding, speed, weight) of animals in every `EVERY`-th frame."""
    rows = [sightings.of(t) for t in range(0, len(sightings), EVERY)]
    crowd = np.concatenate([crowding_of(sightings.xy[r]) for r in rows if len(sightings.xy[r])])
    speed, seen = (np.concatenate([column[r] for r in rows]) for column in (sightings.speed, sightings.neighbours_seen))
    known = np.isfinite(speed)
    return crowd[known], speed[known], EVERY * trust(seen[known])


def _crowd_of_fields(fields, occupied):
    """(crowding, speed, animals) of cells: the others within two body lengths, or within a larger cell."""
    reach = max(REACH, fields.cell / np.sqrt(np.pi))
    disc = _disc(reach / fields.cell)
    number = np.nan_to_num(fields.density) * fields.cell**2
    others = np.array([convolve(frame, disc, mode="constant") for frame in number]) - 1.0
    return np.maximum(others[occupied], 0.0) / (np.pi * reach**2), np.asarray(fields.speed)[occupied], number[occupied]


def _disc(radius):
    """How much of each cell a disc about the middle of the central one covers, (k, k)."""
    half, fine = int(np.ceil(radius + 0.5)), 9  # points across a cell
    at = (np.arange((2 * half + 1) * fine) + 0.5) / fine - half - 0.5
    inside = (at[:, None] ** 2 + at[None, :] ** 2 <= radius**2).astype(float)
    side = 2 * half + 1
    cover = inside.reshape(side, fine, side, fine).mean((1, 3))
    return cover * (np.pi * radius**2 / cover.sum())


def table_of(crowd, speed, weight) -> list[tuple[float, float]]:
    """[(crowding, factor)] in bins that hold equally many animals; the mean factor of all is 1."""
    total = weight.sum()
    mean = float(np.average(speed, weights=weight)) if total > 0 else 0.0
    if mean <= 0:
        return []
    order = np.argsort(crowd, kind="stable")
    share = np.cumsum(weight[order]) / total
    table: list[tuple[float, float]] = []
    for chosen in np.split(order, np.searchsorted(share, np.arange(1, BINS) / BINS)):
        if weight[chosen].sum() > 0:
            here = float(np.average(crowd[chosen], weights=weight[chosen]))
            factor = float(np.clip(np.average(speed[chosen], weights=weight[chosen]) / mean, *FACTORS))
            if not table or here > table[-1][0]:
                table.append((here, factor))
    at, factors = np.array(table).T
    used = float(np.average(np.interp(crowd, at, factors), weights=weight))
    return [(density, factor / used) for density, factor in table]


def joined(tables: list[SpeedEvidence]) -> list[tuple[float, float]]:
    """One table of several clips, each row with the speed of its clip."""
    rows = [(d, f * s.mean, s.weight / len(s.by_density)) for s in tables for d, f in s.by_density]
    if len(tables) == 1 or not rows:
        return list(tables[0].by_density) if tables else []
    return table_of(*np.array(rows).T)
