"""How a herd turns in answer to its neighbours, in a clip and in runs of a brush, by the brush's own forces.

Order, milling and distances of a few seconds are met by many brushes.  Turns tell them apart: each is compared with
what the brush foretells where the neighbours were seen (`flockbrush.learning.turns`).  What is left over is explained
by a change of the nine numbers of avoidance, cohesion and alignment as far as it can be, to first order.  Runs of the
brush are looked at in the same way, with the noise of the clip's sightings, so that whatever the view adds is in both:
only a change that the clip asks for and the runs do not is a difference (a posterior predictive check [1]_ by the
score of the likelihood).  The other measure is how far turns scatter about what is foretold.  Of another model than the
herd's the numbers are those of its likelihood (`flockbrush.learning.likelihood`).

References
----------
.. [1] Gelman, A., Meng, X.-L. & Stern, H. (1996). Posterior predictive assessment of model fitness via realized
   discrepancies. Statistica Sinica 6, 733-807.
.. [2] Gouriéroux, C., Monfort, A. & Renault, E. (1993). Indirect inference. Journal of Applied Econometrics 8,
   S85-S118.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flockbrush.behaviours.models.herd import Params
from flockbrush.film.missing_animals import trust
from flockbrush.film.observations import Evidence, Sightings
from flockbrush.learning.battery import DEVIATIONS, MEASURES, BatteryRow, same_animals, seen_run
from flockbrush.learning.herd_views import told_apart
from flockbrush.learning.likelihood import MANY as FITTED
from flockbrush.learning.likelihood import Slopes, likelihood_of, place, tension
from flockbrush.learning.next_step import NextSteps
from flockbrush.learning.normal_equations import normal_equations
from flockbrush.learning.rollout import Run, theta_of
from flockbrush.learning.turns import FORCES, Turns, predicted, residuals, turns_of

RESPONSE, SCATTER = "response to neighbours", "scatter of turns"
SPAN = 0.12  # s over which a turn is observed where frames are closer
LOOKS = 36  # frames of a clip that are looked at, or more
MANY = 6000  # turns that are enough: of large herds fewer frames are looked at
FEWEST = 100  # turns that are needed
FARTHEST = 20.0  # BL: neighbours that turns are looked up for
FAINTEST = 1e-3  # of the strongest direction in the numbers: weaker directions are not identifiable


class Answer(NamedTuple):
    """How the animals of a clip or a run turn beside what a brush foretells."""

    gram: np.ndarray  # (d, d) rad², mean products of the derivatives of turns by the numbers
    pull: np.ndarray  # (d,) rad², their mean products with what is left over
    scatter: float  # rad
    forces: float  # rad, root mean square turn by neighbours
    turns: float  # effective number of turns, by their weights


def response(
    clip: Evidence, brush, runs: Sequence[Run], turns: Callable[[], Turns | None] | None = None
) -> list[BatteryRow]:
    """Two measures of a clip beside runs of a brush that begin as the clip begins.

    Parameters
    ----------
    brush : Brush or Learned
        Anything with ``params``, ``body`` and ``vision``.
    turns : callable, optional
        ``turns_seen`` of the clip where they are known already.

    Returns
    -------
    list of BatteryRow
        Empty where animals are not told apart, the model has no likelihood, or too few turns are seen.
    """
    if not told_apart(clip) or likelihood_of(brush.params) is None or not runs:
        return []
    mine = _answer(clip.sightings, brush, turns() if turns else turns_seen(clip, clip.sightings, brush))
    theirs = [_answer_of_run(run, clip, brush) for run in runs]
    if mine is None or any(other is None for other in theirs):
        return []
    values, vectors = _told([mine, *theirs])
    if not len(values):
        return []
    whitened = vectors / np.sqrt(values)  # a step of length 1 changes turns by 1 rad, root mean square
    # the share of a step that a prior leaves, of what is asked for and of what is given alike
    likely = np.linalg.inv(np.eye(len(values)) + _held(whitened, mine.scatter, brush.params))
    asked, wished = mine.pull @ whitened @ likely, np.array([a.pull for a in theirs]) @ whitened @ likely
    of_runs, more = wished.mean(0), 1.0 + 1.0 / len(theirs)
    chance = mine.scatter * np.sqrt((likely**2).sum() / mine.turns * more)  # of numbers fitted to so many turns
    scatters = np.array([a.scatter for a in theirs])
    between = scatters.std(ddof=1) if len(theirs) > 1 else 0.0
    rows = [
        (RESPONSE, mine.forces, np.mean([a.forces for a in theirs]), np.linalg.norm(asked - of_runs), chance),
        (SCATTER, mine.scatter, scatters.mean(), abs(mine.scatter - scatters.mean()), between * more**0.5),
    ]
    least = {name: max(MEASURES[name].floor, MEASURES[name].share * mine.scatter) for name in (RESPONSE, SCATTER)}
    return [
        BatteryRow(name, own, float(herd), float(off), max(least[name], DEVIATIONS * chance))
        for name, own, herd, off, chance in rows
    ]


def scatters(
    clip: Evidence, brush, run: Run, turns: Callable[[], Turns | None], span: float = SPAN
) -> tuple[float, float] | None:
    """Scatter of turns of a clip (as for `response`) and of a run about what the brush foretells, rad; None if few."""
    both = turns(), turns_seen(clip, _seen(run, clip), brush, span)
    known = [seen for seen in both if seen is not None and len(seen.rows) >= FEWEST]
    if len(known) < len(both):
        return None
    mine, theirs = (residuals(seen, _turns_foretold(seen, brush.params))[2] for seen in known)
    return mine, theirs


def correction(clip: Evidence, brush, runs: Sequence[Run], turns: Callable[[], Turns | None]) -> np.ndarray | None:
    """By how much to change the nine numbers of a herd so that runs answer to neighbours as the clip does, (9,).

    Of another model by how much to change the positions of its numbers, as far as its prior lets them.

    Turns that last and noise hide a part of the answer, in runs as in the clip; numbers that were fitted to a clip are
    off by that part (indirect inference [2]_, one step). None if too few turns are seen.
    """
    mine = _answer(clip.sightings, brush, turns())
    theirs = [_answer_of_run(run, clip, brush) for run in runs]
    if mine is None or any(other is None for other in theirs):
        return None
    more = mine.pull - np.mean([a.pull for a in theirs], axis=0)
    values, vectors = _told([mine, *theirs])
    return vectors @ np.linalg.solve(np.diag(values) + _held(vectors, mine.scatter, brush.params), more @ vectors)


def _held(vectors, scatter, params):
    """By how much a prior holds the numbers back in these directions (d, k): (k, k) rad², zeros without one."""
    kind = likelihood_of(params)
    if kind is None or kind.prior is None:
        return np.zeros((vectors.shape[1], vectors.shape[1]))
    precision = tension(kind.prior, kind.numbers, place(kind.numbers, params))[1]
    return scatter**2 / FITTED * vectors.T @ precision @ vectors


def _told(answers):
    """Mean squares by which steps (k,) turn animals, for the directions (d, k) in which turns determine the numbers."""
    values, vectors = np.linalg.eigh(np.mean([a.gram for a in answers], axis=0))
    told = values > max(FAINTEST * values.max(), 0.0)
    return values[told], vectors[:, told]


def _answer_of_run(run, clip, brush):
    seen = _seen(run, clip)
    return _answer(seen, brush, turns_seen(clip, seen, brush))


def turns_seen(clip: Evidence, seen: Sightings | None, brush, span: float = SPAN) -> Turns | None:
    """The turns in sightings, of the clip or of a run, over a span (s), at those moments that are looked at."""
    if seen is None or clip.sightings is None:
        return None
    ahead = max(1, round(span * clip.fps))
    every = max(1, len(clip.fields) // LOOKS, -(-len(clip.sightings.xy) // MANY))
    frames = range(0, len(clip.fields) - ahead, every)
    same = replace(clip, sightings=_stepped(seen, clip.fps, ahead))
    rules = brush.params
    if type(rules) is not Params:  # nobody leads
        rules = Params(neighbour_range=min(brush.vision.range, FARTHEST), leader_neighbours=-1)
    return turns_of(same, brush.body, brush.vision, rules, span=span, frames=frames) if len(frames) else None


def _answer(seen, brush, turns):
    """The `Answer` of the turns; None if they are too few."""
    if turns is None or len(turns.rows) < FEWEST:
        return None
    foretold, slopes, by_forces = _foretold(turns, brush.params)
    off, share, scatter = residuals(turns, foretold)
    weight = share / share.sum()
    pull, information = normal_equations(slopes, weight, off)
    trusted = trust(seen.neighbours_seen)
    number = len(turns.rows) * trusted.mean() ** 2 / (trusted**2).mean()
    return Answer(information, pull, scatter, float(np.sqrt((weight * by_forces**2).sum())), number)


def _foretold(turns, params):
    """Turns (k,), rad, their derivatives by the numbers (k, d), and the part that is due to neighbours (k,), rad."""
    if type(params) is Params:
        theta = theta_of(params)
        turn, slopes = predicted(turns, theta, params)
        alone = np.array(theta)
        alone[0:FORCES:3] = 0.0
        return turn, slopes[:, :FORCES], turn - predicted(turns, alone, params, False)[0]
    kind = likelihood_of(params)
    assert kind is not None  # `response` asked
    by_numbers, x = Slopes(turns, kind.behaviour, kind.numbers, params), place(kind.numbers, params)
    off = by_numbers.off(x)
    turn = turns.turn - off
    return turn, by_numbers.slopes(x, off), turn - by_numbers.steps.alone(kind.behaviour, params)


def _turns_foretold(turns, params):
    """Turns (k,), rad."""
    if type(params) is Params:
        return predicted(turns, theta_of(params), params, False)[0]
    kind = likelihood_of(params)
    assert kind is not None  # who asks knows of one
    return turns.turn - NextSteps(turns).off(kind.behaviour, params)


def _seen(run, clip):
    """The sightings of a run as uncertain as those of the clip."""
    first, xy, forward, who = seen_run(run, clip)
    unknown = np.full(len(xy), np.nan)
    return Sightings(first, xy, forward, unknown, unknown, who)


def _stepped(seen, fps, ahead):
    """Sightings whose speeds and turns are differences over several frames of the same animal; NaN elsewhere."""
    speed, turn = np.full(len(seen.xy), np.nan), np.full(len(seen.xy), np.nan)
    angle = np.arctan2(seen.forward[:, 1], seen.forward[:, 0])
    for t in range(len(seen) - ahead):
        here, there = seen.of(t), seen.of(t + ahead)
        mine, later = same_animals(seen.track[here], seen.track[there])
        mine, later = mine + here.start, later + there.start
        named = seen.track[mine] >= 0
        mine, later = mine[named], later[named]
        speed[mine] = np.hypot(*(seen.xy[later] - seen.xy[mine]).T) * (fps / ahead)
        turned = angle[later] - angle[mine]
        turn[mine] = ((turned + np.pi) % (2 * np.pi) - np.pi) * (fps / ahead)
    return replace(seen, speed=speed, turn=turn)
