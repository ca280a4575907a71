"""How the animal moves, and on what ground."""

from __future__ import annotations

from typing import Literal

import numpy as np
from flockbrush.behaviours.amounts import Acceleration, Height, Slope, Speed
from flockbrush.behaviours.trigger import Condition, condition, field


@condition
class SpeedAbove(Condition):
    """The animal is faster than this."""

    speed_above: Speed = field(..., "how fast")

    def holds(self, senses, rows):
        return np.sqrt((senses.velocity[rows] ** 2).sum(1)) > self.speed_above.of(senses.length[rows])


@condition
class SpeedBelow(Condition):
    """The animal is slower than this."""

    speed_below: Speed = field(..., "how fast")

    def holds(self, senses, rows):
        return np.sqrt((senses.velocity[rows] ** 2).sum(1)) < self.speed_below.of(senses.length[rows])


@condition
class AccelerationAbove(Condition):
    """The acceleration in the last tick (speeding up, slowing down or turning) was larger than this."""

    needs = ("before",)
    acceleration_above: Acceleration = field(..., "smallest acceleration")

    def holds(self, senses, rows):
        change = (senses.velocity[rows] - senses.before[rows]) / senses.dt
        return np.sqrt((change**2).sum(1)) > self.acceleration_above.of(senses.length[rows])


@condition
class SlopeAbove(Condition):
    """The ground underfoot is steeper than this, whichever way it faces."""

    slope_above: Slope = field(..., "rise per metre, per cent or degrees")

    def holds(self, senses, rows):
        return np.sqrt((senses.slope[rows] ** 2).sum(1)) > self.slope_above.low


@condition
class SlopeBelow(Condition):
    """The ground underfoot is less steep than this."""

    slope_below: Slope = field(..., "rise per metre, per cent or degrees")

    def holds(self, senses, rows):
        return np.sqrt((senses.slope[rows] ** 2).sum(1)) < self.slope_below.low


class _Height(Condition):
    """Compares a height."""

    def heights(self, senses, rows):
        return senses.xyz[rows, 2] if self.over == "sea" else senses.height()[rows]


@condition
class HeightAbove(_Height):
    """The animal is higher than this."""

    height_above: Height = field(..., "how high")
    over: Literal["ground", "sea"] = field(
        "ground", "ground: height above the ground below; sea: height above 0 of the level"
    )

    def holds(self, senses, rows):
        return self.heights(senses, rows) > self.height_above.of(senses.length[rows])


@condition
class HeightBelow(_Height):
    """The animal is lower than this."""

    height_below: Height = field(..., "how high")
    over: Literal["ground", "sea"] = field(
        "ground", "ground: height above the ground below; sea: height above 0 of the level"
    )

    def holds(self, senses, rows):
        return self.heights(senses, rows) < self.height_below.of(senses.length[rows])
