"""Gradient descent on the errors of the paper: parameters from the fields of a clip whose animals are not separated.

A herd is begun as the clip begins and walks along with it.  In every frame the errors of its next headings (eqs. 7 and
8, `flockbrush.learning.torch_losses`) say how the parameters should change, and they do, while the herd goes on:
section 6.1 of [1]_.  Leaders follow the clip and are not counted; where the densities differ too much, animals are
taken from where there are too many and put where there are too few; a picture that sees a part of a herd has borders
where animals come and go.

Steps along the slope have a fixed length, and go in a random direction where there is none.  The result is the mean of
the way of the best pass through the clips instead of its last point [2]_.

.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.
.. [2] Polyak, B. T. & Juditsky, A. B. (1992). Acceleration of stochastic approximation by averaging. SIAM Journal on
   Control and Optimization 30(4), 838-855.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from scipy import ndimage

from flockbrush.behaviours.brush import SpeedSpec
from flockbrush.learning.initial_conditions import start_of
from flockbrush.learning.perceive import perceive
from flockbrush.learning.rollout import (
    BODY,
    DT,
    LEAST,
    MOST,
    VISION,
    ClipGuide,
    Gates,
    HerdStart,
    PlaneHerd,
    Surroundings,
    Walls,
    params_of,
    pass_gates,
)
from flockbrush.learning.torch_herd import device_of, headings, sight_of, theta_tensor, threads
from flockbrush.learning.torch_losses import ALONE, aims, density_of, error_mean, error_var

USE = frozenset({"occlusion", "angular", "density", "variance"})
STEP = 0.01  # of the authors' steps, all of the same length
TOO_FAR = 1.0  # sum of |ρ' - ρ| over the sum of ρ, above which animals are put elsewhere.  By trial; 2 is no overlap
BROAD = 4.0  # BL over which densities are compared for that
SHARE = 0.1  # of the animals, put elsewhere in a frame at most.  By trial
PATIENCE = 3  # passes through the clips without a better mean error before it ends
ALIGNMENT = slice(6, 9)  # of theta: the numbers that disorder depends on (section 6.1)
PHOTO = 64  # ticks that a herd of a photograph runs before it is restarted


@dataclass
class Descent:
    """Result of a descent.

    Attributes
    ----------
    theta : (12,) ndarray
        The mean over the best pass through the clips.
    losses : (k,) ndarray
        Error of each step.
    """

    theta: np.ndarray
    losses: np.ndarray


def descend(clips, theta, *, free=None, seed=0, steps=400) -> Descent:
    """Parameters that make a herd go along with the fields of clips.

    Parameters
    ----------
    clips : list of FollowedClip
        Of one kind of animal; they are gone through in turn.
    theta : (12,) array_like
        Where to begin.
    free : (12,) bool array_like, optional
        Which numbers may change.
    steps : int
        Frames looked at, at most.
    """
    theta, free = np.clip(np.asarray(theta, float), LEAST, MOST), np.ones(12, bool) if free is None else free
    losses: list[float] = []
    least, best, passes, since = np.inf, None, 0, 0
    with threads(1):
        while len(losses) < steps and since < PATIENCE:
            way, before = [], len(losses)
            chance = np.random.default_rng([seed, passes])
            for number, clip in enumerate(clips):
                start = int(np.random.SeedSequence([seed, passes, number]).generate_state(1)[0])
                for loss, slope in clip.frames(theta, start):
                    if len(losses) >= steps:
                        break
                    theta[:] = fixed_step(theta, np.where(free, slope, 0.0), chance, free)
                    way.append(theta.copy())
                    losses.append(loss)
            if not way:
                break
            passes += 1
            error = float(np.mean(losses[before:]))
            if error < least - 1e-3:
                least, best, since = error, np.where(free, np.mean(way, axis=0), theta), 0
            else:
                since += 1
    return Descent(theta if best is None else best, np.array(losses))


def fixed_step(theta, slope, chance, free):
    """The authors' rule: always as far, and anywhere where there is no slope."""
    size = np.linalg.norm(slope)
    if size < 1e-12:
        slope = np.where(free, chance.standard_normal(12), 0.0)
        size = max(np.linalg.norm(slope), 1e-12)
    return np.clip(theta - STEP * slope / size, LEAST, MOST)


class FollowedClip:
    """A herd that walks along with a clip, and what each frame says about the parameters.

    Parameters
    ----------
    clip : Evidence
    use : set of {"occlusion", "angular", "density", "variance"}
        What is made use of: without density eq. 11 has β = 0, without variance eq. 8 is left out.
    beta : float
        Eq. 11.
    speed : SpeedSpec, optional
        Of the animals; default: that of the clip.
    body, vision : BodySpec, VisionSpec
    extras : mapping
        Other parameters of the herd model.
    device : str, optional
        "cpu" or "cuda"; CUDA when there is one.
    """

    def __init__(self, clip, use=USE, beta=0.5, speed=None, body=BODY, vision=VISION, extras={}, device=None):  # noqa: B006  read only
        self.clip, self.body, self.vision, self.extras, self.device = clip, body, vision, extras, device_of(device)
        self.still = clip.still
        self.beta = (1.0 if self.still else beta) if "density" in use else 0.0
        self.disorder = "variance" in use
        self.speed = speed or _speed_of(clip)
        unmoved = not np.isfinite(clip.fields.velocity).any()  # of a photograph: the target is the same all over
        self.block = max(1, round(BROAD / clip.fields.cell)) if unmoved else 1
        self.fields = _with_disorder(clip.fields) if self.still else clip.fields
        guide, gates = (None, None) if self.still else (ClipGuide.of(clip.fields), Gates.of(clip.fields))
        self.around = Surroundings(Walls.of(clip.fields), guide, gates)

    def frames(self, theta, seed):
        """(error, slope) of each frame, with ``theta`` (12,) as it is then."""
        chance = np.random.default_rng(seed)
        herd = self._begin(theta, seed)
        for t in range(PHOTO if self.still else max(len(self.fields) - 1, 1)):
            frame = 0 if self.still else t
            if not len(herd):
                return
            herd.params = params_of(theta, self.extras)
            herd._tables()
            yield self._errors(herd, theta, min(frame + 1, len(self.fields) - 1))
            after = t + 1 if self.still else (t + 1) / self.fields.fps / DT
            while herd.tick_number < after - 1e-9:
                herd.tick()
            if self.around.gates is not None:
                pass_gates(herd, self.around.gates, (t + 1) / self.fields.fps)
            self._put_elsewhere(herd, min(frame + 1, len(self.fields) - 1), chance)

    def _begin(self, theta, seed):
        start = start_of(self.clip, 0, seed, self.body)
        if self.still:
            angle = np.random.default_rng([seed, 1]).uniform(-np.pi, np.pi, len(start))
            start = HerdStart(start.xy, np.column_stack([np.cos(angle), np.sin(angle)]))
        return PlaneHerd(
            start, params_of(theta, self.extras), self.speed, self.body, self.vision, seed=seed,
            around=self.around,
        )  # fmt: skip

    def _errors(self, herd, theta, t):
        """Eqs. 7 and 8 of the next headings, and their slopes; disorder depends on alignment alone."""
        params, xy = herd.params, herd.xyz[:, :2]
        percept = perceive(xy, herd.forward[:, :2], self.body, self.vision, params, walls=self.around.walls)
        sight = sight_of(percept, params.neighbour_range, self.device)
        leaf = theta_tensor(theta, self.device, True)
        ahead = headings(leaf, sight, DT, sensitivity=params.sensitivity)
        aim = aims(self.fields, t, xy, self.beta, self.device, self.block)
        follows = ~sight.leader
        error = error_mean(ahead, aim, follows)
        (slope,) = torch.autograd.grad(error, leaf, retain_graph=True)
        slope, loss = slope.cpu().numpy().copy(), float(error.detach())
        if self.disorder:
            error = error_var(ahead, aim, follows, int(np.prod(self.fields.shape)))
            slope[ALIGNMENT] += torch.autograd.grad(error, leaf)[0].cpu().numpy()[ALIGNMENT]
            loss += float(error.detach())
        return loss, slope

    def _put_elsewhere(self, herd, t, chance):
        """From where there are too many to where there are too few, when the densities differ too much."""
        target = np.where(self.fields.seen[t], np.nan_to_num(self.fields.density[t]), 0.0)
        over = self._smooth(density_of(herd.xyz[:, :2], self.fields) - target)
        off = np.abs(over).sum() / max(target.sum(), 1e-9)
        many = int(min(SHARE * len(herd), 0.5 * (off - TOO_FAR) * len(herd)))
        if self.beta == 0.0 or off <= TOO_FAR or many < 1:
            return
        row, column, inside = self.fields.cells_of(herd.xyz[:, :2])
        crowd = np.where(inside, over[row, column], np.inf) + 1e-6 * chance.random(len(herd))
        out = np.argsort(-crowd)[:many]
        xy, forward = self._empty_places(over, t, many, chance)
        speed = herd.drawn[out[: len(xy)]]
        herd.keep(np.setdiff1d(np.arange(len(herd)), out[: len(xy)]))
        herd.join(HerdStart(xy, forward, speed))

    def _smooth(self, density):
        """Over some body lengths: cells as small as an animal differ without meaning."""
        return ndimage.uniform_filter(density, max(1, round(BROAD / self.fields.cell)), mode="constant")

    def _empty_places(self, over, t, many, chance):
        """Places in the sparsest cells and headings as the clip has them there, (k, 2) each."""
        sparse = np.argsort(over, axis=None)[:many]
        sparse = sparse[over.ravel()[sparse] < 0]
        row, column = np.unravel_index(sparse, over.shape)
        place = np.column_stack([column, row]) + chance.random((len(sparse), 2))
        heading = self.fields.velocity[t, row, column]
        angle = chance.uniform(-np.pi, np.pi, len(sparse))
        size = np.hypot(heading[:, 0], heading[:, 1])
        known = np.isfinite(size) & (size > 1e-9)
        angle[known] = np.arctan2(heading[known, 1], heading[known, 0])
        return self.fields.origin + self.fields.cell * place, np.column_stack([np.cos(angle), np.sin(angle)])


def _speed_of(clip):
    if clip.speed is None:
        return SpeedSpec(mean=0.5, deviation=0.05)
    rate = clip.speed.likely
    deviation = np.nan_to_num(clip.speed.deviation) * np.sqrt(2 * rate)
    return SpeedSpec(mean=clip.speed.mean, deviation=float(min(deviation, 50.0)), reversion=rate)


def _with_disorder(still):
    """The fields of a photograph: disorder as in the paper, and no velocity."""
    variance = np.where(np.isfinite(still.angular_variance), still.angular_variance, ALONE)
    return replace(still, angular_variance=variance)
