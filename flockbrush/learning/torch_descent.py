"""Down the errors of the paper: parameters from the fields of a clip, where its animals cannot be told apart.

A herd is begun as the clip begins and walks along with it.  In every frame the errors of its next headings (eqs. 7 and
8, `flockbrush.learning.torch_losses`) say how the parameters should change, and they do, while the herd goes on:
section 6.1 of [1]_.  Leaders follow the clip and are not counted; where the densities differ too much, animals are
taken from where there are too many and put where there are too few; a picture that sees a part of a herd has borders
where animals come and go.

``authors`` takes steps of fixed length along the slope, in a random direction where there is none.  ``adam`` is Adam
[2]_ on the same slopes.  Both end with the mean of the way of their best pass through the clips instead of its last
point [3]_.

.. [1] Gong, X. et al. (2025). Herds from video: learning a microscopic herd model from macroscopic motion data.
   Computer Graphics Forum 44(6), e70225.
.. [2] Kingma, D. P. & Ba, J. (2015). Adam: a method for stochastic optimization. ICLR.
.. [3] Polyak, B. T. & Juditsky, A. B. (1992). Acceleration of stochastic approximation by averaging. SIAM Journal on
   Control and Optimization 30(4), 838-855.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path

import numpy as np
import torch
from scipy import ndimage

from flockbrush.behaviours.brush import SpeedSpec
from flockbrush.engine.files import write_bytes
from flockbrush.engine.plain_json import read_json
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
    Walls,
    _pass_gates,
    params_of,
)
from flockbrush.learning.torch_herd import device_of, headings, sight_of, theta_tensor, threads
from flockbrush.learning.torch_losses import ALONE, aims, density_of, error_mean, error_var

USE = frozenset({"occlusion", "angular", "density", "variance"})
STEP = 0.01  # of the authors' steps, all of the same length
TOO_FAR = 1.0  # sum of |ρ' - ρ| over the sum of ρ, above which animals are put elsewhere.  By trial; 2 is no overlap
BROAD = 4.0  # BL over which densities are compared for that
SHARE = 0.1  # of the animals, put elsewhere in a frame at most.  By trial
PATIENCE = 3  # passes through the clips without a better mean error before it ends
ALIGNMENT = slice(6, 9)  # of theta: what disorder speaks of (section 6.1)
PHOTO = 64  # ticks that a herd of a photograph is let go before it begins anew


@dataclass
class DescentState:
    """Where a descent stands, between two passes through its clips: plain numbers, which a file can hold."""

    theta: list[float]
    first: list[float] = field(default_factory=lambda: [0.0] * 12)  # moments of Adam
    second: list[float] = field(default_factory=lambda: [0.0] * 12)
    step: int = 0
    passes: int = 0
    losses: list[float] = field(default_factory=list)
    best: list[float] | None = None  # the numbers of the best pass
    best_loss: float = float("inf")
    since: int = 0  # passes since the best
    converged: bool = False

    def save(self, path):
        """Write it as JSON."""
        write_bytes(path, json.dumps(asdict(self)).encode())

    @staticmethod
    def load(path) -> DescentState:
        """What `save` wrote.

        Raises
        ------
        ValueError
            When the file holds anything else.
        """
        data = read_json(path)
        names = {f.name for f in fields(DescentState)}
        if not isinstance(data, dict) or set(data) != names:
            raise ValueError(f"{path} is not the state of a descent: it should have {', '.join(sorted(names))}")
        return DescentState(**data)


@dataclass
class Descent:
    """What a descent found.

    Attributes
    ----------
    theta : (12,) ndarray
        The mean over the best pass through the clips.
    losses : (k,) ndarray
        Error of each step.
    state : State
        To go on from.
    interrupted, converged : bool
    """

    theta: np.ndarray
    losses: np.ndarray
    state: DescentState
    interrupted: bool = False

    @property
    def converged(self) -> bool:
        """It ended because it got no better."""
        return self.state.converged


def descend(
    evidences, theta, *, recipe="authors", free=None, seed=0, steps=400, use=USE, beta=0.5, speed=None, body=BODY,
    vision=VISION, extras=None, dt=DT, state=None, keep=None, say=None, stop=None, device=None, jobs=1,
) -> Descent:  # fmt: skip
    """Parameters that make a herd go along with the fields of clips.

    Parameters
    ----------
    evidences : list of Evidence
        Of one kind of animal; they are gone through in turn.
    theta : (12,) array_like
        Where to begin.
    recipe : {"authors", "adam"}
    free : (12,) bool array_like, optional
        Which numbers may change.
    steps : int
        Frames looked at, at most.
    use : set of {"occlusion", "angular", "density", "variance"}
        What is made use of: without density eq. 11 has β = 0, without variance eq. 8 is left out.
    beta : float
        Eq. 11.
    speed : SpeedSpec, optional
        Of the animals; as the clips say unless told.
    body, vision : BodySpec, VisionSpec
    extras : mapping, optional
        Other parameters of the herd model.
    state : State or path, optional
        Goes on from there, to the same numbers as without a pause.
    keep : path, optional
        Where the state is written after each pass.
    say : callable, optional
        ``say(step, loss, theta)``.
    stop : callable, optional
        Ends when it says True, as Ctrl-C does; the best so far is kept.
    device : str, optional
        "cpu" or "cuda"; CUDA when there is one.
    jobs : int
        Threads of torch.
    """
    state = DescentState.load(state) if isinstance(state, (str, Path)) else state
    state = state or DescentState(np.clip(np.asarray(theta, float), LEAST, MOST).tolist())
    free = np.ones(12, bool) if free is None else np.asarray(free, bool)
    tracks = [_Along(clip, use, beta, speed, body, vision, extras or {}, dt, device_of(device)) for clip in evidences]
    run = _Run(state, tracks, recipe, free, seed, say, stop)
    with threads(jobs):
        try:
            while state.step < steps and not state.converged and not run.interrupted:
                run.one_pass(steps)
                if keep is not None and not run.interrupted:
                    state.save(keep)
        except KeyboardInterrupt:
            run.interrupted = True
    found = state.best if state.best is not None else run.theta
    return Descent(np.array(found), np.array(run.losses), state, run.interrupted)


class _Run:
    """A descent on its way."""

    def __init__(self, state, tracks, recipe, free, seed, say, stop):
        self.state, self.tracks, self.free, self.seed, self.say, self.stop = state, tracks, free, seed, say, stop
        self.rule = {"authors": fixed_step, "adam": adam}[recipe]
        self.theta, self.losses, self.interrupted = np.array(state.theta), list(state.losses), False

    def one_pass(self, steps):
        """Once through all clips; what it learned counts when it is done."""
        state, way, before = self.state, [], len(self.losses)
        chance = np.random.default_rng([self.seed, state.passes])
        moments = np.array(state.first), np.array(state.second)
        done = state.step
        for number, track in enumerate(self.tracks):
            seed = int(np.random.SeedSequence([self.seed, state.passes, number]).generate_state(1)[0])
            for loss, slope in track.frames(lambda: self.theta, seed):
                if done >= steps or (self.stop is not None and self.stop()):
                    self.interrupted = done < steps
                    break
                self.theta, moments = self.rule(
                    self.theta, np.where(self.free, slope, 0.0), moments, done, chance, self.free
                )
                done += 1
                way.append(self.theta)
                self.losses.append(loss)
                if self.say is not None:
                    self.say(done, loss, self.theta)
        if self.interrupted:
            return
        state.step, state.passes, state.theta, state.losses = done, state.passes + 1, self.theta.tolist(), self.losses
        state.first, state.second = (m.tolist() for m in moments)
        self._judge(way, self.losses[before:])
        if not way:
            state.converged = True

    def _judge(self, way, losses):
        """Keep the mean of the way of the best pass; end when passes get no better."""
        state, mean = self.state, float(np.mean(losses)) if losses else np.inf
        if mean < state.best_loss - 1e-3:
            middle = np.where(self.free, np.mean(way, axis=0), self.theta)
            state.best_loss, state.best, state.since = mean, middle.tolist(), 0
        else:
            state.since += 1
            state.converged = state.since >= PATIENCE


def fixed_step(theta, slope, moments, step, chance, free):
    """The authors' rule: always as far, and anywhere where there is no slope."""
    size = np.linalg.norm(slope)
    if size < 1e-12:
        slope = np.where(free, chance.standard_normal(12), 0.0)
        size = max(np.linalg.norm(slope), 1e-12)
    return np.clip(theta - STEP * slope / size, LEAST, MOST), moments


def adam(theta, slope, moments, step, chance, free, rate=0.02):
    """Adam, with a rate that falls with the root of the steps."""
    first, second = 0.9 * moments[0] + 0.1 * slope, 0.99 * moments[1] + 0.01 * slope**2
    better = first / (1 - 0.9 ** (step + 1)) / (np.sqrt(second / (1 - 0.99 ** (step + 1))) + 1e-8)
    return np.clip(theta - rate / np.sqrt(1 + step / 100) * better, LEAST, MOST), (first, second)


class _Along:
    """A herd that walks along with a clip, and what each frame says about the parameters."""

    def __init__(self, clip, use, beta, speed, body, vision, extras, dt, device):
        self.clip, self.body, self.vision, self.extras, self.dt, self.device = clip, body, vision, extras, dt, device
        self.still = clip.still
        self.beta = (1.0 if self.still else beta) if "density" in use else 0.0
        self.disorder = "variance" in use
        self.speed = speed or _speed_of(clip)
        unmoved = not np.isfinite(clip.fields.velocity).any()  # of a photograph: the target is the same all over
        self.block = max(1, round(BROAD / clip.fields.cell)) if unmoved else 1
        self.fields = _with_disorder(clip.fields) if self.still else clip.fields
        self.walls, self.guide = Walls.of(clip.fields), None if self.still else ClipGuide.of(clip.fields)
        self.gates = None if self.still else Gates.of(clip.fields)

    def frames(self, theta, seed):
        """(error, slope) of each frame, with ``theta()`` as it is then."""
        chance = np.random.default_rng(seed)
        herd = self._begin(theta(), seed)
        for t in range(PHOTO if self.still else max(len(self.fields) - 1, 1)):
            frame = 0 if self.still else t
            if not len(herd):
                return
            herd.params = params_of(theta(), self.extras)
            herd._tables()
            yield self._errors(herd, theta(), min(frame + 1, len(self.fields) - 1))
            after = t + 1 if self.still else (t + 1) / self.fields.fps / self.dt
            while herd.tick_number < after - 1e-9:
                herd.tick()
            if self.gates is not None:
                _pass_gates(herd, self.gates, (t + 1) / self.fields.fps)
            self._put_elsewhere(herd, min(frame + 1, len(self.fields) - 1), chance)

    def _begin(self, theta, seed):
        start = start_of(self.clip, 0, seed, self.body)
        if self.still:
            angle = np.random.default_rng([seed, 1]).uniform(-np.pi, np.pi, len(start))
            start = HerdStart(start.xy, np.column_stack([np.cos(angle), np.sin(angle)]))
        return PlaneHerd(
            start, params_of(theta, self.extras), self.speed, self.body, self.vision, seed=seed, dt=self.dt,
            walls=self.walls, guide=self.guide,
        )  # fmt: skip

    def _errors(self, herd, theta, t):
        """Eqs. 7 and 8 of the next headings, and their slopes; disorder speaks of alignment alone."""
        params, xy = herd.params, herd.xyz[:, :2]
        percept = perceive(
            xy, herd.forward[:, :2], self.body, self.vision, walls=self.walls, neighbour_range=params.neighbour_range,
            leader_neighbours=params.leader_neighbours, leader_cone=params.leader_cone,
        )  # fmt: skip
        sight = sight_of(percept, params.neighbour_range, self.device)
        leaf = theta_tensor(theta, self.device, True)
        ahead = headings(leaf, sight, self.dt, sensitivity=params.sensitivity)
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
    rate = clip.speed.reversion or 1.0
    deviation = np.nan_to_num(clip.speed.deviation) * np.sqrt(2 * rate)
    return SpeedSpec(mean=clip.speed.mean, deviation=float(min(deviation, 50.0)), reversion=rate)


def _with_disorder(still):
    """The fields of a photograph: what nobody can see there is the paper's disorder, and no velocity."""
    variance = np.where(np.isfinite(still.angular_variance), still.angular_variance, ALONE)
    return replace(still, angular_variance=variance)
