"""Goals, and how far places are."""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.amounts import Length
from flockbrush.behaviours.trigger import Condition, Reference, condition, field


@condition
class ReachesGoal(Condition):
    """The animal is in a goal."""

    reaches_goal: str = field(..., "a goal of the level; `its own` is the goal that the animal is heading for")

    def holds(self, senses, rows):
        return senses.at_goal("" if self.reaches_goal == "its own" else self.reaches_goal)[rows]

    def references(self):
        if self.reaches_goal != "its own":
            yield Reference("goal", self.reaches_goal)


@condition
class DistanceTo(Condition):
    """The horizontal distance to the centre of a place, the nearest one of the name, is in a range."""

    distance_to: str = field(..., "a goal, a zone or an area of the level")
    below: Length | None = field(None, "nearer than this")
    above: Length | None = field(None, "farther than this")

    def holds(self, senses, rows):
        away = senses.away(self.distance_to)[rows]
        return between(away, self.below, self.above, senses.length[rows])

    def references(self):
        yield Reference("place", self.distance_to)

    def oddity(self):
        low, high = self.above, self.below
        if low is None and high is None:
            return "holds everywhere: give it below or above"
        never = low is not None and high is not None and low.own == high.own and low.low >= high.low
        return f"never holds: nothing is above {low} and below {high}" if never else ""


def between(values, below, above, length):
    """(k,) bool: below one amount and above another, where they are given."""
    holds = np.ones(len(values), bool)
    if below is not None:
        holds &= values < below.of(length)
    if above is not None:
        holds &= values > above.of(length)
    return holds
