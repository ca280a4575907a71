"""From marked birds to a formation: order, spacing, leader, curve, outliers, roles (Klotsman & Tal [1]_, section 4).

What the paper leaves open and what is settled here:

* A V has its apex at the leader and a slope for each side; U and J are one parabola, a J when the shorter side has less
  than 30 % of the birds, and a linear shape with less than 15 % on one side is a line.
* The curve is the cheapest of the three (see `flockbrush.behaviours.formation.curves`); μ_y and σ_y are those of the
*residuals*
  of the birds near it.
* Some flocks are none of these, and are said to be none: a row abreast, a cluster, too few birds.

.. [1] Klotsman, M. & Tal, A. (2012). Animation of flocks flying in line formations. Artificial Life 18(1), 91-105.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.formation.curves import TOLERANCE, CurveFit, fit
from flockbrush.behaviours.formation.formation_shapes import Formation, FrameShape

SHORT_SIDE_OF_LINE = 0.15  # of the birds besides the leader; below: a line
SHORT_SIDE_OF_J = 0.3  # below: a J, from here on a U
ABREAST = 0.06  # depth over width of a row of birds abreast
CROWDED = 0.4  # wingspans between neighbours, on average: less is a cluster, whatever curve goes through it
NOT_IN_FRONT = 1.0  # what it costs, in birds, to call another than the front-most one the leader
LED_BY = 1.0  # wingspans: the leader may fly so far ahead of the arms, or behind the tip of the curve, not farther
CANDIDATES = 3  # for the leader


class Marks(NamedTuple):
    """Marked birds: (frames, n) arrays in wingspans, +y the way they fly."""

    frames: tuple[str, ...]
    birds: tuple[str, ...]
    x: np.ndarray
    y: np.ndarray


def extract(marks: Marks, name="", provenance=None, samples=None) -> Formation:
    """Every frame of a movie as a formation.

    Parameters
    ----------
    samples : int, optional
        RANSAC with so many samples instead of all.

    References
    ----------
    .. [1] Klotsman, M. & Tal, A. (2012). Animation of flocks flying in line formations. Artificial Life 18(1), 91-105.
    """
    shapes = tuple(
        extract_frame(x, y, frame, marks.birds, samples)
        for frame, x, y in zip(marks.frames, marks.x, marks.y, strict=True)
    )
    return Formation(name, shapes, provenance or {})


def extract_frame(x, y, frame="0", birds=None, samples=None, seed=0) -> FrameShape:
    """One frame as a formation.

    Parameters
    ----------
    x, y : array_like (n,)
        Wingspans, +y the way they fly.
    birds : sequence of str, optional
        Names.

    Returns
    -------
    FrameShape
        Of kind ``none``, with the reason in ``why``, when the birds fly in no line formation.
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    names = [str(k) for k in range(len(x))] if birds is None else list(birds)
    order = np.lexsort((y, x))
    x, y, known = x[order], y[order], tuple(names[k] for k in order)
    gaps = np.diff(x)
    spacing = (float(gaps.mean()), float(gaps.std())) if len(gaps) else (0.0, 0.0)
    leader, fitted, why = _look(x, y, samples, seed)
    x, y = x - x[leader], y - y[leader]
    curve, deviation, kind = None, (0.0, 0.0), "none"
    outliers: tuple[int, ...] = ()
    if fitted is not None:
        curve = fitted.curve
        kind, why = _kind(curve.model, x[fitted.inlier])
        outliers = tuple(np.flatnonzero(~fitted.inlier).tolist())
        rest = (y - curve.y(x))[fitted.inlier]
        deviation = (float(rest.mean()), float(rest.std()))
    return FrameShape(
        str(frame), known, tuple(x.tolist()), tuple(y.tolist()), int(leader), kind, why, curve, outliers, spacing,
        deviation,
    )  # fmt: skip


def _look(x, y, samples, seed):
    """(leader, fit or None, why none)."""
    n = len(x)
    front = np.argsort(-y, kind="stable")
    if n < 3:
        return front[0], None, "one bird alone" if n == 1 else "two birds do not make a formation"
    if max(np.ptp(x), np.ptp(y)) < 1e-6:
        return front[0], None, "all birds are marked on one point"
    best = fit_with_leader(x, y, samples, seed)
    if best is None:
        return front[0], None, "a cluster: no line, V or parabola fits the birds and their leader"
    refusal = _refusal(x - x[best.leader], y - y[best.leader], best.seen, samples, seed)
    return (best.leader, None, refusal) if refusal else (best.leader, best.seen, "")


class Led(NamedTuple):
    """Who leads, the curve seen from there, and what both cost, in birds."""

    leader: int
    seen: CurveFit
    cost: float


def fit_with_leader(x, y, samples=None, seed=0) -> Led | None:
    """The leader and the cheapest curve: one of the front-most, near it while whoever flies ahead is off it.

    Parameters
    ----------
    x, y : ndarray (n,)
        Wingspans, +y the way they fly.
    """
    best = None
    front = np.argsort(-y, kind="stable")
    for rank, leader in enumerate(front[:CANDIDATES]):
        curve = _cheapest(x - x[leader], y - y[leader], samples, seed)
        if curve is None or abs(curve.curve.y(0.0)) > LED_BY or curve.inlier[front[:rank]].any():
            continue
        cost = curve.cost + NOT_IN_FRONT * (rank > 0)
        if best is None or cost < best.cost:
            best = Led(leader, curve, cost)
    return best


def _cheapest(x, y, samples, seed):
    models = ("line", "v", "parabola") if len(x) > 4 else ("line",)
    fits = [candidate for model in models if (candidate := fit(model, x, y, TOLERANCE, samples, seed)) is not None]
    return min(fits, key=lambda candidate: candidate.cost) if fits else None


def _refusal(x, y, curve, samples, seed):
    """Why the cheapest curve is no formation; empty when it is one."""
    n, out = len(x), int((~curve.inlier).sum())
    along = curve.curve.y(x[curve.inlier])
    width = float(np.ptp(x[curve.inlier]))
    if width < CROWDED * (n - 1):
        return f"a cluster: the birds are {width / max(n - 1, 1):.2f} wingspans apart to the side"
    if np.ptp(along) < max(ABREAST * width, TOLERANCE) and out <= most_outliers(n):
        return "a row of birds abreast"
    short, others = _sides(x[curve.inlier])
    if curve.curve.model == "line" and short > max(1, SHORT_SIDE_OF_LINE * others):
        return "a straight row, led from its middle"
    turned = (
        [fit(model, x, y, TOLERANCE, samples, seed, upside_down=True) for model in ("v", "parabola")] if n > 4 else []
    )
    cheaper = [candidate for candidate in turned if candidate is not None and candidate.cost < curve.cost - 1.0]
    if cheaper and (~cheaper[0].inlier).sum() <= most_outliers(n):
        return "it opens forward: an inverted V or U"
    if out > most_outliers(n):
        if n <= 4:
            return f"{n} birds that are not in a line are too few to classify"
        return f"a cluster: {out} of {n} birds are off any curve"
    return ""


def most_outliers(n):
    """How many of n birds may be out of line; through few birds some curve goes by chance."""
    return int(n * (0.25 if n >= 10 else 0.15))


def _sides(x):
    """(birds on the side with fewer, birds besides the leader) of birds at x to the right of it."""
    return int(min((x < 0).sum(), (x > 0).sum())), int((x != 0).sum())


def _kind(model, x):
    """(kind, why) from the curve and how many of the birds on it, at x to the right of the leader, are on each side."""
    short, others = _sides(x)
    share = short / max(others, 1)
    if model == "parabola":
        if share < SHORT_SIDE_OF_J:
            return "J", f"a parabola with {short} of {others} birds on the shorter side"
        return "U", f"a parabola with {short} of {others} birds on the shorter side"
    if model == "line" or share < SHORT_SIDE_OF_LINE:
        return "line", f"straight, with {short} of {others} birds on the shorter side"
    return "V", f"two straight arms, {short} of {others} birds on the shorter one"
