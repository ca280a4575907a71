"""Which model moves like the animals of a clip: several fitted to the same turns and compared on blocks held out.

Each kind of model is fitted with every perception it may have (metric, topological, visual); the likeliest is kept.
Each half of a clip, or each of several clips, is then predicted with the numbers of the other, and what the next step
of an animal is likely to be (`flockbrush.learning.next_step`) is averaged over blocks of time.  Two models are told
apart when the mean difference of their blocks is large beside its standard error; blocks, not animals, are counted,
since turns in one block are not independent.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flockbrush.behaviours.behaviour import Behaviour, behaviours
from flockbrush.behaviours.brush import VisionSpec
from flockbrush.behaviours.models.herd import Params
from flockbrush.film.observations import Evidence
from flockbrush.learning.herd_views import told_apart
from flockbrush.learning.initial_conditions import body_of
from flockbrush.learning.likelihood import Likelihood, likelihoods
from flockbrush.learning.next_step import NextSteps, log_density, mean_score, wrapped
from flockbrush.learning.turns import Turns, all_turns, seen_otherwise, turns_of

HERD = "herd"
SPAN = 0.15  # s over which a step is taken
BLOCK, BLOCKS = 0.5, (4, 16)  # s, about; of each clip
FEWEST_BLOCKS = 5  # in all that are needed to distinguish models
TURNS = 2500  # that are looked at in all
REFERENCE = VisionSpec(range=8.0), Params(neighbour_range=8.0)  # leaders by this perception follow no forces: left out
ERRORS = 3.0  # standard errors between two models that are distinguished,
LEAST = 0.01  # and so much of the logarithm of the likelihood of a step
CONTENDS, GAIN, CONTENDERS = 2.0, 0.05, 2  # the same for models that are tried beside the herd, and how many at most
FAR_BEHIND = 0.15  # of the logarithm of the likelihood of a step: general models that are farther behind are not tried
GAIN_WITH_SPEEDS = 0.15  # instead of `GAIN`, of models that set speeds themselves, of which turns tell nothing
NOISIEST = 0.2  # rad: turns with more noise are not used, as of animals that push each other
CLEAR = 1.5  # times the noise of headings: smaller turns are not used


@dataclass
class ModelRow:
    """One kind of model beside the others."""

    name: str  # as ``--model`` names it
    model: str  # of behaviour
    vision: VisionSpec  # the likeliest perception of those tried
    params: Any  # fitted to all frames
    # score, error: logarithm of the likelihood of a step held out (nats), mean over the blocks, and its standard error
    score: float
    error: float
    # behind, behind_error: how much lower than the best, and the standard error of that difference by blocks; 0 of the
    # best itself
    behind: float = 0.0
    behind_error: float = 0.0
    told_apart: bool = False  # whether it is distinguished from the best
    spread: float = math.nan  # of what is left over, rad
    # of its simulated herds from the frames held out, in limits of the battery; NaN if that was not computed
    distance: float = math.nan
    blocks: np.ndarray = field(default_factory=lambda: np.zeros(0))
    halves: list[Any] = field(default_factory=list)  # parameters by the fold they were fitted without

    @property
    def perception(self) -> str:
        """In words."""
        return perception_of(self.vision)

    @property
    def least_gain(self) -> float:
        """By how much turns must be likelier than by the herd, for it to be learned as well."""
        return GAIN if behaviours()[self.model].flight is None else GAIN_WITH_SPEEDS


@dataclass
class ModelComparison:
    """What was compared, the best first."""

    rows: list[ModelRow]
    straight: float  # the score of going straight on
    blocks: int
    reason: str = ""  # why no models are distinguished; "" if some are
    learned: str = HERD  # the kind that was learned

    @property
    def equal(self) -> list[str]:
        """Names of the best and of all that cannot be distinguished from it."""
        return [row.name for row in self.rows if not row.told_apart]

    @property
    def contenders(self) -> list[str]:
        """Kinds that are learned beside the herd; simulated herds decide between them.

        Those by which the turns are clearly likelier than by the herd, and general ones that are not far behind.
        """
        general = [row.name for row in self.rows if likelihoods()[row.name].general and row.behind < FAR_BEHIND]
        return [*self.likelier, *(general if self._tells() else [])]

    def _tells(self) -> bool:
        """Whether the comparison ranks single kinds."""
        return self.reason in ("", _too_few(self.blocks))

    @property
    def likelier(self) -> list[str]:
        """Kinds by which the turns are clearly likelier than by the herd, without general ones."""
        herd = next((row for row in self.rows if row.name == HERD), None)
        if herd is None or not self._tells():
            return []
        best = [row for row in self.rows if row.behind <= max(ERRORS * row.behind_error, LEAST)]
        others = [row for row in best if row is not herd and not likelihoods()[row.name].general][:CONTENDERS]
        gains = [(row, *_mean_and_error(row.blocks - herd.blocks)) for row in others]
        return [row.name for row, gain, error in gains if gain > max(CONTENDS * error, row.least_gain)]

    @property
    def decision(self) -> str:
        """A sentence on the kind that was learned."""
        if not self.contenders:
            return f"Learned: {self.learned}, since no other model makes the turns clearly likelier."
        if self.learned == HERD:
            return f"Learned: herd. Simulated herds of {', '.join(self.contenders)} are farther from the clip."
        if self.learned in self.likelier:
            how = "by which turns are likelier and simulated herds are no farther from the clip"
            return f"Learned: {self.learned}, {how}."
        return f"Learned: {self.learned}, whose simulated herds are nearer to the clip."

    @property
    def sentence(self) -> str:
        """A sentence on which models are distinguished, and which are not."""
        if self.reason:
            return f"The models cannot be distinguished on this clip: {self.reason}."
        best, names = self.rows[0], self.equal
        others = [row for row in self.rows if row.told_apart]
        apart = "; ".join(f"{row.name} by {row.behind:.2f} ± {row.behind_error:.2f}" for row in others)
        if len(names) == 1:
            return (
                f"The best model is {best.name} ({best.perception}): log score of the next step above {apart} (nats)."
            )
        told = f"; behind them: {apart} (nats)" if others else ""
        return f"Not distinguishable: {', '.join(names[:-1])} and {names[-1]}{told}."


def perception_of(vision: VisionSpec) -> str:
    """Whom an animal takes into account, in words."""
    if vision.sight == "topological":
        return f"the {vision.neighbours} nearest animals"
    if vision.sight == "voronoi":
        return "the first shell of neighbours"
    seen = "visible animals" if vision.sight == "exact" and vision.occlusion else "all animals"
    return f"{seen} within {vision.range:g} BL"


def problem_of(clips: Sequence[Evidence], model: Behaviour | None = None) -> str:
    """Why the models of these clips cannot be compared, or not this one; "" where they can."""
    for clip in clips:
        if model is not None and model.flight is not None:
            its = f"animals of the model {model.name} are simulated"
            if clip.fields.obstacle.any():
                return f"it shows obstacles, and {its} on open ground only"
            if clip.fields.shows_part:
                return f"it shows a part of a herd, and {its} in whole herds only"
        if not told_apart(clip):
            return "single animals could not be separated, and models are compared by the turns of single animals"
    return ""


def compare_models(clips: Sequence[Evidence], names: Sequence[str] | None = None, *, seed: int = 0) -> ModelComparison:
    """Fit kinds of models to clips and compare what they say of blocks held out.

    Parameters
    ----------
    clips : sequence of Evidence
        Whose animals are told apart (`problem_of`).
    names : sequence of str, optional
        Of likelihoods; default: all that these clips allow.
    seed : int
        Of the searches.
    """
    known = likelihoods()
    kinds = [known[name] for name in (names or known) if names or not problem_of(clips, known[name].behaviour)]
    blocks = TurnBlocks(clips)
    if not kinds:
        return ModelComparison([], math.nan, 0, problem_of(clips))
    if not blocks.reference:
        return ModelComparison([], math.nan, 0, "no turns of animals are visible")
    return _ranked([_row(kind, blocks, seed) for kind in kinds], blocks)


class TurnBlocks:
    """The turns of all clips in blocks of time, with any perception."""

    def __init__(self, clips):
        self.clips, self.body, self.seen = list(clips), body_of(list(clips)), {}
        self.frames, self.fold = [], []
        animals = sum(len(clip.sightings.xy) for clip in clips)
        for number, clip in enumerate(clips):
            ahead = max(1, round(SPAN * clip.fps))
            usable = max(len(clip.sightings) - ahead, 0)
            many = int(np.clip(usable / clip.fps / BLOCK, *BLOCKS))
            every = max(1, math.ceil(animals / TURNS))
            for k, part in enumerate(np.array_split(np.arange(usable), many)):
                chosen = part[: max(len(part) - ahead, 0) or None : every]  # no step reaches into the next block
                if len(chosen):
                    self.frames.append((number, chosen))
                    self.fold.append(number % 2 if len(clips) > 1 else int(k >= many / 2))
        reference = [self._turns(block) for block in self.frames]
        kept = [k for k, turns in enumerate(reference) if turns is not None and len(turns.rows)]
        self.frames, self.fold = [self.frames[k] for k in kept], np.array([self.fold[k] for k in kept], int)
        self.reference: list[Turns] = [turns for turns in reference if turns is not None and len(turns.rows)]
        self.deflected = not self.reference or _deflected(all_turns(self.reference))  # by animals that they touch
        if not self.deflected:
            self.reference = [turns._replace(radius=0.0) for turns in self.reference]

    def _turns(self, block) -> Turns | None:
        number, frames = block
        return turns_of(self.clips[number], self.body, *REFERENCE, span=SPAN, frames=frames.tolist())

    def of(self, vision) -> list[Turns]:
        """The turns of each block; the same of the same animals whatever they see."""
        if vision not in self.seen:
            everybody = Params(neighbour_range=min(vision.range, 20.0), leader_neighbours=-1)
            self.seen[vision] = [
                seen_otherwise(same, self.clips[number], frames.tolist(), self.body, vision, everybody)
                for (number, frames), same in zip(self.frames, self.reference, strict=True)
            ]
        return self.seen[vision]

    def train(self, vision, fold=None) -> Turns:
        """All turns but those of a fold."""
        return all_turns([t for t, k in zip(self.of(vision), self.fold, strict=True) if k != fold])

    @property
    def noise(self) -> float:
        """Of a turn, rad, by that of the headings."""
        return math.sqrt(2.0) * max((clip.heading_noise for clip in self.clips), default=0.0)


def _deflected(turns: Turns) -> bool:
    """Whether animals turn along those they touch, rather than straight on."""
    along = mean_score(wrapped(turns.turn - NextSteps(turns).by_contact()), turns.weight)[0]
    return along >= mean_score(turns.turn, turns.weight)[0]


def _row(kind: Likelihood, blocks: TurnBlocks, seed) -> ModelRow:
    vision, params = likeliest(kind, blocks, seed)
    scores, halves, model = np.full(len(blocks.frames), np.nan), [], kind.behaviour
    for fold in np.unique(blocks.fold):
        train = blocks.train(vision, fold if len(np.unique(blocks.fold)) > 1 else None)
        own = kind.fit(train, vision, seed, params)
        halves.append(own)
        spread = mean_score(NextSteps(train).off(model, own), train.weight)[1]
        for k in np.flatnonzero(blocks.fold == fold):
            turns = blocks.of(vision)[k]
            density = log_density(NextSteps(turns).off(model, own), spread)
            scores[k] = float((turns.weight * density).sum() / max(turns.weight.sum(), 1e-12))
    every = blocks.train(vision)
    spread = mean_score(NextSteps(every).off(model, params), every.weight)[1]
    score, error = _mean_and_error(scores)
    return ModelRow(kind.name, kind.model, vision, params, score, error, spread=spread, blocks=scores, halves=halves)


def likeliest(kind, blocks, seed):
    """(perception, parameters) of the likeliest fit to all turns; each perception starts from the fit before."""
    best, begin = None, None
    for vision in kind.views:
        turns = blocks.train(vision)
        params = kind.fit(turns, vision, seed, begin)
        loss, begin = NextSteps(turns).loss(kind.behaviour, params), params
        if best is None or loss < best[0]:
            best = loss, vision, params
    assert best is not None  # there is a view
    return best[1:]


def _mean_and_error(values):
    known = values[np.isfinite(values)]
    if len(known) < 2:
        return (float(known[0]) if len(known) else math.nan), math.inf
    return float(known.mean()), float(known.std(ddof=1) / math.sqrt(len(known)))


def _ranked(rows, blocks) -> ModelComparison:
    rows.sort(key=lambda row: -row.score)
    every = all_turns(blocks.reference)
    straight = mean_score(every.turn, every.weight)[0]
    reason = _reason(rows, blocks, every, straight)
    for row in rows[1:]:
        row.behind, row.behind_error = _mean_and_error(rows[0].blocks - row.blocks)
        row.told_apart = not reason and row.behind > max(ERRORS * row.behind_error, LEAST)
    return ModelComparison(rows, straight, len(blocks.frames), reason)


def _reason(rows, blocks, every, straight) -> str:
    """Why the models cannot be compared; "" if they can."""
    usual = float(np.sqrt(np.average(every.turn**2, weights=np.maximum(every.weight, 1e-12))))
    if blocks.noise > NOISIEST:
        return f"the headings of the animals are too noisy: turns are uncertain by {blocks.noise:.2g} rad"
    if usual < CLEAR * blocks.noise:
        return f"turns of {usual:.2g} rad in {SPAN:g} s are hardly larger than the noise of {blocks.noise:.2g} rad"
    if rows[0].score < straight + LEAST:
        return "no model predicts the next step better than straight motion does"
    return _too_few(len(blocks.frames))


def _too_few(blocks) -> str:
    return f"it has {blocks} blocks of {BLOCK:g} s, but {FEWEST_BLOCKS} are needed" if blocks < FEWEST_BLOCKS else ""
