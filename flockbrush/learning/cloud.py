"""An evolution of the herd's numbers about one attempt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flockbrush.learning.evolution import Evolution
from flockbrush.learning.learned_parameters import Attempt
from flockbrush.learning.search_space import Code
from flockbrush.learning.trials import Setting, stiffness

GENERATION = 8  # candidates
STEP, WIDE_STEP = 0.1, 0.12  # of an evolution where turns say nothing; where fields alone say how animals turn
GOOD, NARROW = 0.4, 0.2  # score from which on steps grow, to full ones at 1 more; least part of a step


@dataclass
class Cloud:
    """A cloud of candidates, and what is known of its generations."""

    begin: Attempt
    code: Code
    evolution: Evolution
    worths: list[float]  # of the beginning, and of the best of each generation
    luckiest: np.ndarray  # numbers of the best candidate so far
    least: float = np.inf  # its score

    @classmethod
    def about(cls, begin: Attempt, given: Setting, seed: tuple[int, ...], by_fields: bool) -> Cloud:
        """A cloud that has not evolved yet; narrow about a good attempt, and shaped so that turns stay as likely."""
        code = Code(begin.theta, begin.extras, "angular" in given.use, by_fields)
        step = WIDE_STEP if by_fields else STEP
        width = step if by_fields else step * float(np.clip(begin.score - GOOD, NARROW, 1.0))
        told = stiffness(given, begin.theta, begin.extras)
        shape = None if told is None else code.shape(told, step)
        evolution = Evolution(code.numbers, width, GENERATION, seed, shape)
        return cls(begin, code, evolution, [begin.score], code.numbers)

    def ask(self) -> tuple[np.ndarray, list]:
        """The numbers of a generation, (GENERATION, d), and its (theta, extras)."""
        asked = self.evolution.ask()
        return asked, [self.code.read(numbers) for numbers in asked]

    def tell(self, asked: np.ndarray, scores: list[float]) -> None:
        """The score of each of a generation."""
        self.evolution.tell(scores)
        first = int(np.argmin(scores))
        self.worths.append(scores[first])
        if scores[first] < self.least:
            self.least, self.luckiest = scores[first], asked[first]

    @property
    def ends(self) -> list[Attempt]:
        """What comes of it: the middle, and the luckiest candidate."""
        return [self._end("evolved", self.evolution.mean), self._end("evolved, luckiest", self.luckiest)]

    def _end(self, text, numbers):
        theta, extras = self.code.read(np.clip(numbers, 0.0, 1.0))
        begin, curve = self.begin, np.array(self.worths)
        return Attempt(f"{begin.name}, {text}", begin.seed, begin.first_theta, np.array(theta), extras, curve)
