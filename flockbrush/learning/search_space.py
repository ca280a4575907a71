"""Where the search of the recipe begins, and what it may change."""

from __future__ import annotations

import numpy as np

from flockbrush.behaviours.brush import shipped
from flockbrush.learning.herd_views import followed
from flockbrush.learning.likelihood import place, read
from flockbrush.learning.rollout import LEAST, params_of, theta_of
from flockbrush.learning.trials import SIGHTS, WANDER_TIMES

WEAK, STRONG = 0.15, 0.9  # smaller weights are enlarged and Ω reduced, larger ones the other way: only the product is
#                           identifiable, and weights end at 1e-3 and 1
EASED = 6.0  # factor by which weights at their end are reduced
RESPONSE_STEP = 0.14 / 3.0  # of the scatter: what each of nine numbers may change turns by in the limit of the battery
STEP_OF_EXTRAS = 0.04
ABSENT = np.array([0.15, 0.3])  # of broad draws have no cohesion, and no alignment
MILLS = 0.5  # least milling of a herd that mills
BROAD_TURNS = 0.1, 1.2  # decimal logarithms of rad/s: limits of turning of broad draws
LIMITS = 0.8, 0.9, 0.96, 0.99  # of all turns are slower than a limit of turning that is tried
EXTRAS = {  # freed, on a logarithmic scale
    "wander": (0.01, 3.0),
    "wander_time": (float(WANDER_TIMES[0]), float(WANDER_TIMES[-1])),
    "max_turn": (0.4, 20.0),
    "sensitivity": (0.05, 100.0),
}


def rescaled(theta, extras):
    """The same forces by larger weights and a smaller Ω where all weights are small, or the other way round."""
    theta, weights = np.array(theta), np.array(theta)[0:9:3]
    by = 0.5 / weights.max() if weights.max() < WEAK else 1.0 / EASED if weights.max() > STRONG else 1.0
    if by != 1.0:
        theta[0:9:3] = np.clip(weights * by, LEAST, 1.0)
        extras = extras | {"sensitivity": float(np.clip(extras.get("sensitivity", 10.0) / by, *EXTRAS["sensitivity"]))}
    return theta.tolist(), extras


def turn_limits(clips):
    """rad/s: how fast all but a few turns are, from `LIMITS`."""
    seen = [np.abs(clip.sightings.turn) for clip in clips if followed(clip)]
    turns = np.concatenate(seen) if seen else np.zeros(0)
    turns = turns[np.isfinite(turns)]
    return [float(np.clip(q, 0.5, 20.0)) for q in np.quantile(turns, LIMITS)] if len(turns) > 100 else []


def rotation_of(clips):
    """rad/s, positive counter-clockwise: how fast herds that mill turn about their middle; 0 for other herds."""
    spins, mills = [], []
    for fields in (clip.fields for clip in clips):
        velocity = np.nan_to_num(fields.velocity)
        weight = np.nan_to_num(fields.density) * (np.abs(velocity).sum(-1) > 0.0)
        place = np.moveaxis(np.indices(weight.shape[1:])[::-1], 0, -1) * fields.cell
        total = np.maximum(weight.sum((1, 2)), 1e-12)
        away = place - np.einsum("tyx,yxk->tk", weight, place)[:, None, None] / total[:, None, None, None]
        across = away[..., 0] * velocity[..., 1] - away[..., 1] * velocity[..., 0]
        far, fast = np.linalg.norm(away, axis=-1), np.linalg.norm(velocity, axis=-1)
        mills.append((weight * across / np.maximum(far * fast, 1e-12)).sum() / total.sum())
        spins.append((weight * across).sum() / max((weight * far**2).sum(), 1e-12))
    return float(np.mean(spins)) if np.abs(mills).min() > MILLS and len(set(np.sign(mills))) == 1 else 0.0


def begins(seed, starts, angular, brushes, draws=0, rotation=0.0):
    """[(name, theta, extras)]: random ones, all shipped brushes of the herd model, and more random ones to be tried.

    Random ones see as far as `SIGHTS`, one after the other; where there are draws, all see as far as the first two.  Of
    four draws, two have every force, with squares as weights, and two are broad: a herd that scatters has weak forces,
    or lacks some.  In a herd that mills, with a ``rotation`` in rad/s, half of the draws turn steadily, no faster.
    """
    out, sights = [], SIGHTS[:2] if draws else SIGHTS
    for k in range(starts):
        rng = np.random.default_rng([seed, 0, k])
        theta = rng.uniform(0.02, 1.0, 12)
        out.append((f"random {k + 1}", theta, {"neighbour_range": sights[k % len(sights)], "wander": 0.0}))
    library = shipped()
    for name in library.names() if brushes else ():
        brush = library.get(name)
        if brush.model == "herd" and brush.provenance.kind != "learned":  # perhaps from this very clip
            out.append((name, theta_of(brush.params), _extras_of(brush.params)))
    for k in range(draws):
        theta, extras = (_draw, _broad_draw)[k // 2 % 2](np.random.default_rng([seed, 9, k]))
        if rotation and k // 4 % 2:
            extras["turn_bias"] = rotation * float(np.random.default_rng([seed, 10, k]).random())
        out.append((f"draw {k + 1}", theta, {"neighbour_range": sights[k % 2], "wander": 0.0} | extras))
    if not angular:
        out = [(name, np.where(np.arange(12) % 3 == 2, 1.0, theta), extras) for name, theta, extras in out]
    return out


def _draw(rng):
    """(theta, extras) of a draw with every force."""
    theta = rng.uniform(0.02, 1.0, 12)
    theta[0::3] **= 2
    return theta, {}


def _broad_draw(rng):
    """(theta, extras) of a draw with weights of any magnitude, some forces absent, and a limit of turning."""
    theta = rng.uniform(0.02, 1.0, 12)
    theta[0:9:3] = 10.0 ** rng.uniform(-2.0, 0.0, 3)
    absent = rng.random(2) < ABSENT
    theta[3:9:3][absent] = LEAST
    return theta, {"max_turn": float(10.0 ** rng.uniform(*BROAD_TURNS))}


def _extras_of(params):
    """Values of a brush besides the twelve numbers that differ from the defaults."""
    usual = type(params)()
    kept = (
        "neighbour_range", "wander", "wander_time", "max_turn", "sensitivity", "leader_neighbours", "leader_cone",
        "unled",
    )  # fmt: skip
    return {name: getattr(params, name) for name in kept if getattr(params, name) != getattr(usual, name)} | {
        "neighbour_range": params.neighbour_range, "wander": params.wander,
    }  # fmt: skip


class Code:
    """Parameters as numbers between 0 and 1, and back: nine of theta, and the logarithms of the extras.

    ``weak``: the weights as square roots, so that small ones are searched as finely as they matter.
    """

    def __init__(self, theta, extras, angular, weak=False):
        self.theta, self.extras = np.array(theta, float), dict(extras)
        self.free = np.array([k for k in range(9) if angular or k % 3 != 2])
        self.power = np.where(weak & (self.free % 3 == 0), 2.0, 1.0)
        logs = place(EXTRAS, params_of(theta, extras))
        self.numbers = np.concatenate([self.theta[self.free] ** (1.0 / self.power), logs])

    def read(self, numbers):
        """(theta, extras) as JSON holds them."""
        theta = self.theta.copy()
        theta[self.free] = np.clip(numbers[: len(self.free)], 0.0, 1.0) ** self.power
        theta[self.free] = np.maximum(theta[self.free], LEAST)
        extras = self.extras | read(EXTRAS, numbers[len(self.free) :])
        if extras["wander"] <= 1.2 * EXTRAS["wander"][0]:
            extras["wander"] = 0.0
        return theta.tolist(), extras

    def shape(self, stiffness, step):
        """Covariance of a first generation, in squares of the step, that changes turns no more than the battery allows.

        Parameters
        ----------
        stiffness : (12, 12) ndarray
            Fisher information of theta in one turn.
        step : float
            Standard deviation where turns say nothing.
        """
        d, few = len(self.numbers), len(self.free)
        names, by = list(EXTRAS), np.zeros((12, d))
        by[self.free, np.arange(few)] = 1.0
        low, high = EXTRAS["sensitivity"]
        by[0:9:3, few + names.index("sensitivity")] = self.theta[0:9:3] * np.log(high / low)
        most = np.full(d, step)
        most[[few + names.index(name) for name in names if name != "sensitivity"]] = STEP_OF_EXTRAS
        told = by.T @ stiffness @ by / RESPONSE_STEP**2
        return np.linalg.inv(told + np.diag(most**-2.0)) / step**2
