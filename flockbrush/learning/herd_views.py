"""Views of a herd by frame, in a clip or in a simulation."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from flockbrush.film.cell_statistics import cell_statistics
from flockbrush.film.missing_animals import trust
from flockbrush.film.observations import ByFrame, Evidence, Fields
from flockbrush.learning.rollout import Run


@dataclass
class HerdView(ByFrame):
    """The observed state of a herd: points by frame."""

    first: np.ndarray  # (T + 1,)
    xy: np.ndarray  # (m, 2) BL
    heading: np.ndarray  # (m, 2) unit vectors; zero where unknown
    speed: np.ndarray  # (m,) BL/s; NaN unknown
    weight: np.ndarray  # (m,) animals
    single: bool  # points are animals, not cells
    middle: np.ndarray  # (2,) BL, of the picture
    cell: float  # BL, of the cells that density is counted on
    # (m,) how much the distances to its neighbours count of each point: less where neighbours are missing
    trust: np.ndarray = field(default_factory=lambda: np.ones(0))

    def __post_init__(self):
        if not len(self.trust):
            self.trust = np.ones(len(self.xy))


def told_apart(evidence: Evidence) -> bool:
    """Whether most animals of a clip are separated."""
    seen = evidence.sightings
    if seen is None or not len(seen.xy):
        return False
    return evidence.from_tracks or len(seen.xy) >= 0.6 * np.nansum(evidence.fields.count)


def followed(evidence: Evidence) -> bool:
    """Whether most animals are seen one by one, and which way they go."""
    return told_apart(evidence) and evidence.fields.tells_motion


def view_of(evidence: Evidence, single=None) -> HerdView:
    """The view of a clip.

    Parameters
    ----------
    single : bool, optional
        True: its animals; False: its cells; told by `told_apart` unless given.
    """
    single = told_apart(evidence) if single is None else single
    fields = evidence.fields
    seen = evidence.sightings
    if not single or seen is None:
        return view_of_fields(fields)
    ones, middle, heading, speed = np.ones(len(seen.xy)), _middle(fields), seen.forward, seen.speed
    if not fields.tells_motion:
        heading, speed = np.zeros_like(heading), np.full_like(speed, np.nan)
    return HerdView(seen.first, seen.xy, heading, speed, ones, True, middle, fields.cell, trust(seen.neighbours_seen))


def view_of_run(run: Run, evidence: Evidence, single=None) -> HerdView:
    """The view of a simulated herd in that clip; a longer run continues with the clip's last frame."""
    single = told_apart(evidence) if single is None else single
    fields = evidence.fields
    if not single:
        return view_of_fields(fields_of(run, fields))
    inside = in_picture(run, fields)
    first = np.searchsorted(run.frame[inside], np.arange(len(run) + 1))
    ones = np.ones(inside.sum())
    ahead = np.maximum((run.velocity * run.forward).sum(1), 0.0)[inside]  # as of animals that are followed in a film
    return HerdView(first, run.xy[inside], run.forward[inside], ahead, ones, True, _middle(fields), fields.cell)


def in_picture(run: Run, fields: Fields):
    """(m,) bool, which animals of a run are in the picture; all, when the picture holds the whole herd."""
    if fields.holds_all:
        return np.ones(len(run.xy), bool)
    row, column, inside = fields.cells_of(run.xy)
    return inside & fields.seen[np.minimum(run.frame, len(fields) - 1), row, column]


def _middle(fields):
    ny, nx = fields.shape
    return np.asarray(fields.origin, float) + 0.5 * fields.cell * np.array([nx, ny])


def view_of_fields(fields: Fields) -> HerdView:
    there = np.nan_to_num(fields.density) > 1e-6
    frame, row, column = np.nonzero(there)
    velocity = np.nan_to_num(fields.velocity[there])
    size = np.hypot(*velocity.T)
    heading = velocity / np.maximum(size, 1e-12)[:, None]
    # headings of a cell that disagree do not add up to one: order is what the cell's own variance leaves of it
    spread = np.radians(np.sqrt(np.nan_to_num(fields.angular_variance[there], nan=2700.0)))
    heading *= np.cos(np.minimum(spread, np.pi / 2))[:, None]
    xy = np.asarray(fields.origin, float) + fields.cell * (np.column_stack([column, row]) + 0.5)
    first = np.searchsorted(frame, np.arange(len(fields.density) + 1))
    weight = fields.density[there] * fields.cell**2
    return HerdView(first, xy, heading, np.asarray(fields.speed)[there], weight, False, _middle(fields), fields.cell)


def fields_of(run: Run, like: Fields) -> Fields:
    """The fields of a simulated herd on the grid of a clip's; the last frame's picture is that of all later ones.

    Where the picture holds the whole herd, so does the grid: it grows to where the herd goes.
    """
    cell, origin, (ny, nx), before = like.cell, np.asarray(like.origin, float), like.shape, np.zeros(2, int)
    if like.holds_all and len(run.xy):
        before = np.maximum(np.ceil((origin - run.xy.min(0)) / cell), 0).astype(int)
        after = np.maximum(np.floor((run.xy.max(0) - origin) / cell).astype(int) - (nx - 1, ny - 1), 0)
        before, after = np.minimum(before, 500), np.minimum(after, 500)
        origin, nx, ny = origin - before * cell, nx + before[0] + after[0], ny + before[1] + after[1]
        seen = np.ones((len(run), ny, nx), bool)
        obstacle, region = np.zeros((ny, nx), bool), np.zeros((ny, nx), np.uint8)
    else:
        seen = like.seen[np.minimum(np.arange(len(run)), len(like) - 1)]
        obstacle, region = like.obstacle, like.region
    frame = run.frame
    at = np.floor((run.xy - origin) / cell).astype(int)
    inside = ((at >= 0) & (at < (nx, ny))).all(1)
    inside[inside] = seen[frame[inside], at[inside, 1], at[inside, 0]]
    flat = (frame[inside] * ny + at[inside, 1]) * nx + at[inside, 0]
    made = cell_statistics(flat, run.forward[inside], run.velocity[inside], (len(run), ny, nx))
    density = np.where(seen, made.pop("number") / cell**2, np.nan)
    count = np.bincount(frame[inside], minlength=len(run)).astype(float)
    fps = 1.0 / (run.times[1] - run.times[0]) if len(run) > 1 else like.fps
    return Fields(
        fps=fps, cell=cell, origin=origin, density=density, seen=seen, obstacle=obstacle, region=region, count=count,
        frames=np.arange(len(run)), **made,
    )  # fmt: skip
