"""Observed turns of animals against those predicted by the herd model: the most precise evidence on its parameters.

Animals that are seen one by one show by how much they turn from a frame to a later one.  The model says it, too: some
ticks of it, with the neighbours where they were seen (teacher forcing), each body turned aside by those it touches and
no faster than it can, as in a run.  There are only twelve parameters: the derivatives are carried along by hand, and
Gauss-Newton steps damped after Levenberg and Marquardt [1]_ find the least differences.  Differences are taken to be
Student's t [2]_, so that an animal that did something else does not pull the others.

`flockbrush.learning.torch_herd` has the same formulas and is the test's oracle.

.. [1] Marquardt, D. W. (1963). An algorithm for least-squares estimation of nonlinear parameters. Journal of the
   Society for Industrial and Applied Mathematics 11(2), 431-441.
.. [2] Lange, K. L., Little, R. J. A. & Taylor, J. M. G. (1989). Robust statistical modeling using the t distribution.
   Journal of the American Statistical Association 84(408), 881-896.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from flockbrush.behaviours.models.herd import Params
from flockbrush.behaviours.wander import rms_turn
from flockbrush.engine.parallel import over_rows
from flockbrush.film.missing_animals import trust
from flockbrush.learning.normal_equations import normal_equations
from flockbrush.learning.perceive import Percept, half_and_radius, perceive, together
from flockbrush.learning.rollout import BODY, DT, LEAST, MOST, VISION, Walls, theta_of
from flockbrush.learning.turn_kernels import TurnLaw, is_inside, room_kernel, spin_kernel, turn_kernel

FREEDOM = 4.0  # degrees of freedom of Student's t: the usual choice between robust and sharp
FORCES = 9  # of the twelve numbers: without those of obstacles
SMALLEST = 1e-7  # rad, of the spread of differences: below it all agree
SPAN = 0.1  # s over which a turn is observed where frames are closer.  By trial: see docs/decisions-learning.md
STILL = 1e-6  # rad
ENOUGH, NEAR = 0.25, 4.0  # of the sightings, and BL: if fewer have all in sight in the picture, less must be there
PAIRS = 1_500_000  # visible neighbours that are looked at in a step, at most; of more frames every second or third


class Turns(NamedTuple):
    """Observed turns, and all that the model needs to predict them."""

    percept: Percept  # of all frames together
    velocity: np.ndarray  # (n, 2) BL/s
    spin: np.ndarray  # (n,) rad/s, 0 where unknown
    rows: np.ndarray  # (k,) of the percept: animals with an observed turn that do not lead
    ticks: np.ndarray  # (k,) between the two looks; need not be whole
    turn: np.ndarray  # (k,) rad, counter-clockwise
    weight: np.ndarray  # (k,) 1, or less for whoever says less
    half: float  # BL, of the axis of a body
    radius: float  # BL
    dt: float = DT  # s


@dataclass
class TurnFit:
    """Parameters fitted to the turns of a clip."""

    theta: np.ndarray  # (12,)
    loss: np.ndarray  # (k,); negative logarithm of the likelihood a turn, after each accepted step
    spread: float  # of the differences, rad: the scale of Student's t
    information: np.ndarray  # (12, 12); Fisher information of theta
    interrupted: bool = False
    deviation: np.ndarray = field(init=False)  # (12,) least standard deviation of each number (Cramér-Rao)

    def __post_init__(self):
        self.deviation = cramer_rao(self.information)


def turns_of(
    evidence, body=BODY, vision=VISION, params=None, *, span=SPAN, pairs=PAIRS, dt=DT, frames=None
) -> Turns | None:  # fmt: skip
    """The turns in a clip; None if its animals are not separated.

    Parameters
    ----------
    body : BodySpec
        For contacts; the radius counts as a share of the length.
    vision : VisionSpec
    params : Params, optional
        Of the herd model: range and the rule of who leads, who does not follow the forces and is left out.
    span : float
        Seconds over which a turn is observed: as many frames as fit best, one at least.
    pairs : int
        Frames are left out evenly until there are not many more visible neighbours than this.
    frames : sequence of int, optional
        These frames and no others, however many that are.
    """
    seen, fields = evidence.sightings, evidence.fields
    if seen is None or len(seen) < 2 or not len(seen.xy):
        return None
    ahead = max(1, round(span * evidence.fps))
    every = np.arange(max(len(seen) - ahead, 1))
    walls, params = Walls.of(fields), params or Params()
    looks, total = {}, 0
    for t in _evenly(every) if frames is None else frames:
        looks[t] = _look(seen, t, body, vision, walls, params)
        total += len(looks[t].near)
        if total > pairs and frames is None:
            break
    chosen = sorted(looks)
    parts = [_seen_turns(seen, t, ahead, evidence.fps) for t in chosen]
    percept = together([looks[t] for t in chosen])
    turn, seconds = (np.concatenate(column) for column in zip(*parts, strict=True))
    inside = _inside(evidence, chosen, params.neighbour_range)
    rows = np.flatnonzero(np.isfinite(turn) & (percept.leader == 0) & inside)
    velocity, spin = _motion(seen, chosen)
    half, radius = half_and_radius(body)
    around = np.concatenate([seen.neighbours_seen[seen.of(t)] for t in chosen])[rows]
    weight = _at_liberty(percept, rows, turn[rows], half, radius) * trust(around)
    return Turns(percept, velocity, spin, rows, seconds[rows] / dt, turn[rows], weight, half, radius, dt)


def _inside(evidence, frames, reach):
    """Whose surroundings are seen as far as it sees itself; not so far where only a few would be left."""
    inside = is_inside(evidence, frames, reach)
    while inside.sum() < ENOUGH * len(inside) and reach > NEAR:
        reach = max(0.5 * reach, NEAR)
        inside = is_inside(evidence, frames, reach)
    return inside


def seen_otherwise(turns: Turns, evidence, frames, body, vision, params) -> Turns:
    """The same turns, of `turns_of` with these frames, by animals of another sight."""
    walls = Walls.of(evidence.fields)
    looks = [_look(evidence.sightings, t, body, vision, walls, params) for t in sorted(frames)]
    return turns._replace(percept=together(looks))


def _evenly(frames):
    """Frames in an order of which every beginning lies about evenly over the clip."""
    n, width = len(frames), 1
    while width < n:
        width *= 2
    bits = max(width.bit_length() - 1, 0)
    order = [int(format(k, f"0{bits}b")[::-1], 2) if bits else 0 for k in range(width)]
    return [int(frames[k]) for k in order if k < n]


def _look(seen, t, body, vision, walls, params):
    rows = seen.of(t)
    return perceive(seen.xy[rows], seen.forward[rows], body, vision, params, walls=walls)


def _at_liberty(percept, rows, turn, half, radius, enough=40.0):
    """(k,) weights: 0 for animals that touching bodies keep from turning, if there are others.

    A disc turns on the spot, but one that does not turn at all is wedged.
    """
    free = np.ones(percept.animals)
    if radius > 0.0:
        room_kernel(percept, half, radius, free)
    weight = free[rows] if half > 0.0 else np.where(np.abs(turn) < STILL, free[rows], 1.0)
    return weight if weight.sum() > enough else np.maximum(weight, 0.1)


def _seen_turns(seen, t, ahead, fps):
    """Turn of each animal of a frame, rad, and its duration, s; NaN if unknown."""
    here, there = seen.of(t), seen.of(min(t + ahead, len(seen) - 1))
    turn, seconds = seen.turn[here] * ahead / fps, np.full(here.stop - here.start, ahead / fps)
    track, later = seen.track[here], seen.track[there]
    order = np.argsort(later, kind="stable")
    at = order[np.minimum(np.searchsorted(later[order], track), len(later) - 1)] if len(later) else None
    if at is not None and t + ahead < len(seen):
        same = (track >= 0) & (later[at] == track)
        f, g = seen.forward[here][same], seen.forward[there][at[same]]
        turn[same] = np.arctan2(f[:, 0] * g[:, 1] - f[:, 1] * g[:, 0], (f * g).sum(1))
    return turn, seconds


def _motion(seen, frames):
    """Velocities and rates of turning of all animals of these frames, for the time until the later look."""
    rows = np.concatenate([np.arange(seen.first[t], seen.first[t + 1]) for t in frames])
    speed = np.where(np.isfinite(seen.speed), seen.speed, np.nanmean(seen.speed) if len(seen.speed) else 0.0)
    return np.nan_to_num(speed[rows, None]) * seen.forward[rows], np.nan_to_num(seen.turn[rows])


def all_turns(parts) -> Turns:
    """Several clips of one kind of animal as one: they are learned together."""
    parts = [part for part in parts if part is not None]
    rows = np.cumsum([0] + [part.percept.animals for part in parts])
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("velocity", "spin", "ticks", "turn", "weight")
    }
    shifted = np.concatenate([part.rows + shift for part, shift in zip(parts, rows[:-1], strict=True)])
    bodies = parts[0].half, parts[0].radius, parts[0].dt
    return Turns(together([part.percept for part in parts]), rows=shifted, half=bodies[0], radius=bodies[1],
                 dt=bodies[2], **joined)  # fmt: skip


# the model's turns -----------------------------------------------------------------------


def predicted(turns: Turns, theta, params=None, sloped=True):
    """Turns as the model says on average, (k,) rad, and their derivatives by theta, (k, 12).

    ``params`` has what theta has not: Ω, range, wander and the limit of turning.  Without ``sloped`` the derivatives
    are empty.
    """
    params = params or Params()
    k = len(turns.rows)
    turn, slope = np.empty(k), np.empty((k, 12) if sloped else (0, 0, 12))
    limit, drift = params.max_turn * turns.dt, rms_turn(params.wander, params.wander_time, turns.dt)
    law = TurnLaw(params.sensitivity, params.neighbour_range, limit, drift, params.turn_bias * turns.dt)
    spun = np.empty((len(turns.spin), 2))
    spin_kernel(turns.spin * turns.dt, spun)
    over_rows(turn_kernel, k, turns, spun, np.asarray(theta, float), law, turn, slope, chunk=512)
    return turn, slope


# the least differences -------------------------------------------------------------------


def fit_turns(turns: Turns, theta, params=None, *, free=None, steps=60, tolerance=1e-7) -> TurnFit:
    """The parameters near ``theta`` that say the turns best; after Ctrl-C the best so far.

    Parameters
    ----------
    theta : (12,) array_like
        Where to begin.
    params : Params, optional
        What theta has not (see `predicted`).
    free : (12,) bool array_like, optional
        Free numbers; the others are fixed, as in an ablation.
    steps : int
        Upper limit.
    tolerance : float
        Ends when a step betters the likelihood of a turn by less.
    """
    theta = np.clip(np.asarray(theta, float), LEAST, MOST)
    free = np.ones(12, bool) if free is None else np.asarray(free, bool)
    if not len(turns.rows):
        return TurnFit(theta, np.zeros(0), np.inf, np.zeros((12, 12)))
    now = _judged(turns, predicted(turns, theta, params), None)
    assert now is not None
    losses, damping, interrupted = [now.loss], 1e-3, False
    try:
        for _ in range(steps):
            better = None
            while better is None and damping < 1e9:
                trial = _step(theta, now, free, damping)
                judged = _judged(turns, predicted(turns, trial, params), now.spread, now.loss - 1e-15)
                if judged is not None:
                    better, damping = (trial, judged), max(damping / 5.0, 1e-9)
                else:
                    damping *= 4.0
            if better is None:
                break
            gain = now.loss - better[1].loss
            theta, now = better
            losses.append(now.loss)
            if gain < tolerance:
                break
    except KeyboardInterrupt:
        interrupted = True
    return TurnFit(theta, np.array(losses), now.spread, now.information, interrupted)


def best_fit(
    turns: Turns, params=None, *, seed=0, starts=16, first=(), free=None, held=None, rows=3000
) -> TurnFit:  # fmt: skip
    """The best of several starts: all of them on a part of the turns, the best three on all.

    Parameters
    ----------
    turns, params, free
        As for `fit_turns`.
    seed, starts : int
        So many random starts.
    first : sequence of (12,) array_like
        Other places to begin.
    held : (12,) array_like, optional
        What those numbers are that are not free.
    rows : int
        Turns that every start is tried on.
    """
    chance = np.random.default_rng(seed)
    begins = [np.asarray(theta, float) for theta in first] + [chance.uniform(0.05, 1.0, 12) for _ in range(starts)]
    if free is not None and held is not None:
        begins = [np.where(free, theta, held) for theta in begins]
    few, tried = thinned(turns, rows), []
    try:
        for theta in begins:
            tried.append(fit_turns(few, theta, params, free=free, tolerance=1e-5))
            if tried[-1].interrupted:
                return min(tried, key=lambda fit: fit.loss[-1])
    except KeyboardInterrupt:
        if not tried:
            raise
        return replace(min(tried, key=lambda fit: fit.loss[-1]), interrupted=True)
    tried.sort(key=lambda fit: fit.loss[-1])
    last = []
    for fit in tried[:3]:
        last.append(fit_turns(turns, fit.theta, params, free=free))
        if last[-1].interrupted:
            break
    best = min(last, key=lambda fit: fit.loss[-1])
    return replace(best, theta=theta_seen(best, turns, free), interrupted=any(fit.interrupted for fit in last))


def theta_seen(fit: TurnFit, turns: Turns, free=None) -> np.ndarray:
    """The numbers of a fit (12,), with defaults for those of obstacles where none is seen by who turns.

    Of a force that has vanished, turns tell nothing either, but that it has vanished.
    """
    if np.diff(turns.percept.walls_first)[turns.rows].any():
        return fit.theta
    unsaid = ~np.isfinite(fit.deviation) & (np.ones(12, bool) if free is None else np.asarray(free, bool))
    unsaid[:FORCES] = False
    return np.where(unsaid, theta_of(Params()), fit.theta)


def thinned(turns: Turns, rows) -> Turns:
    """An even subset of at most so many turns."""
    if len(turns.rows) <= rows:
        return turns
    some = np.linspace(0, len(turns.rows) - 1, rows).astype(int)
    return turns._replace(
        rows=turns.rows[some], ticks=turns.ticks[some], turn=turns.turn[some], weight=turns.weight[some]
    )


class _Judged(NamedTuple):
    loss: float  # negative logarithm of the likelihood a turn
    spread: float  # rad
    pull: np.ndarray  # (12,) the slope of the likelihood, upwards
    information: np.ndarray  # (12, 12)


def likelihood(turns: Turns, foretold) -> float:
    """Log-likelihood per turn of `predicted` turns, at the likeliest spread."""
    return -_loss(turns, *residuals(turns, foretold[0])[::2])


def residuals(turns: Turns, foretold, spread=None):
    """What is left of the turns, how much each counts, and their spread.

    Parameters
    ----------
    foretold : (k,) ndarray
        rad.
    spread : float, optional
        rad, to begin with.

    Returns
    -------
    off, share : (k,) ndarray
        rad; weights of Student's t.
    spread : float
        rad, the scale that is likeliest.
    """
    off = turns.turn - foretold
    off -= 2 * np.pi * np.round(off / (2 * np.pi))
    total = turns.weight.sum()
    if spread is None:
        spread = max(1.4826 * float(np.median(np.abs(off))), SMALLEST)
    for _ in range(4):  # by expectation and maximisation
        share = turns.weight * (FREEDOM + 1.0) / (FREEDOM + (off / spread) ** 2)
        spread = max(float(np.sqrt((share * off * off).sum() / total)), SMALLEST)
    return off, turns.weight * (FREEDOM + 1.0) / (FREEDOM + (off / spread) ** 2), spread


def _judged(turns, foretold, spread, below=None):
    """How likely the turns are, by Student's t, and the normal equations; None if the loss is not below a limit."""
    turn, slope = foretold
    off, share, spread = residuals(turns, turn, spread)
    loss = _loss(turns, off, spread)
    if below is not None and not loss < below:
        return None
    return _Judged(loss, spread, *normal_equations(slope, share / spread**2, off))


def _loss(turns, off, spread):
    tail = np.log1p((off / spread) ** 2 / FREEDOM)
    return float((turns.weight * (FREEDOM + 1.0) / 2 * tail).sum() / turns.weight.sum() + np.log(spread))


def _step(theta, now, free, damping):
    """One damped step within the bounds; a number at its bound that would leave it is fixed."""
    moving = free & ~((theta <= LEAST) & (now.pull <= 0)) & ~((theta >= MOST) & (now.pull >= 0))
    out = theta.copy()
    scale = np.diag(now.information)
    scale = np.maximum(scale, 1e-9 * max(scale.max(), 1e-30))
    for _ in range(12):
        if not moving.any():
            return out
        at = np.ix_(moving, moving)
        system = now.information[at] + np.diag(damping * scale[moving])
        move = np.zeros(12)
        move[moving] = np.linalg.solve(system, now.pull[moving])
        trial = theta + move
        # numbers that reach a bound stop there; the others move as if these were fixed
        out = np.clip(trial, LEAST, MOST)
        hit = moving & (out != trial) & ((theta <= LEAST) | (theta >= MOST))
        if not hit.any():
            return out
        moving &= ~hit
    return out


def cramer_rao(information):
    """The least standard deviation that any estimate could have, by the Fisher information; inf without any."""
    scale = np.sqrt(np.diag(information))
    known = scale > 1e-9
    out = np.full(len(scale), np.inf)
    if known.any():
        at = np.ix_(known, known)
        normal = information[at] / np.outer(scale[known], scale[known])
        values, vectors = np.linalg.eigh(normal)
        inverse = (vectors**2 / np.maximum(values, 1e-12)).sum(1)
        out[known] = np.sqrt(inverse) / scale[known]
    return out
