"""A brush with other numbers of animals than it was learned from: does the herd behave the same?"""

from __future__ import annotations

import numpy as np

from flockbrush.behaviours.brush import Brush
from flockbrush.film.observations import Fields
from flockbrush.learning.initial_conditions import resized_among
from flockbrush.learning.rollout import HerdStart, Walls, rollout
from flockbrush.systems.measures import compute_largest_part, compute_milling, compute_nnd, compute_polarization

FACTORS = 0.25, 1.0, 4.0
SECONDS, SETTLING = 20.0, 10.0  # s of a run, and what of it is not measured
FPS = 2.0  # looks a second
LINK = 4.0  # BL: animals nearer than this belong together
MOST = 4000  # animals of a run


def with_other_numbers(
    brush: Brush, start: HerdStart, seed=0, fields: Fields | None = None, factors=FACTORS, seconds=SECONDS,
) -> list[dict]:  # fmt: skip
    """Measures of herds with multiples of the animals, started like the clip's herd.

    Parameters
    ----------
    start : HerdStart
        The clip's herd.
    fields : Fields, optional
        The clip's, whose obstacles grow with the herd; default: an unbounded plane.
    factors : sequence of float

    Returns
    -------
    list of dict
        ``factor``, ``animals``, ``polarization``, ``milling``, ``spacing`` (BL), ``together``, means of the end.
    """
    rows, walls = [], None if fields is None else Walls.of(fields)
    for factor in factors:
        begun, around = resized_among(start, walls, factor, seed)
        if not 2 <= len(begun) <= MOST:
            continue
        run = rollout(
            begun, brush.params, brush.speed, brush.body, brush.vision, seconds=seconds, fps=FPS, seed=seed,
            around=around,
        )  # fmt: skip
        looks = [t for t in range(len(run)) if run.times[t] >= min(SETTLING, seconds / 2)]
        seen = [(run.xy[run.of(t)], run.forward[run.of(t)]) for t in looks]
        rows.append(
            {
                "factor": factor,
                "animals": len(begun),
                "polarization": float(np.mean([compute_polarization(forward) for _, forward in seen])),
                "milling": float(np.mean([compute_milling(xy, forward) for xy, forward in seen])),
                "spacing": float(np.mean([compute_nnd(xy).mean() for xy, _ in seen])),
                "together": float(np.mean([compute_largest_part(xy, LINK) for xy, _ in seen])),
            }
        )
    return rows
