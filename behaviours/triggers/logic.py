"""Conditions of conditions."""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.trigger import Condition, answer, condition, field


@condition
class All(Condition):
    """All of these conditions hold."""

    inner = "many"
    all: tuple[Condition, ...] = field(..., "conditions")

    def holds(self, senses, rows):
        held = np.ones(len(rows), bool)
        for part in self.all:
            held[held] = answer(part, senses, rows[held])
            if not held.any():
                break
        return held

    def parts(self):
        return self.all


@condition
class Any(Condition):
    """At least one of these conditions holds."""

    inner = "many"
    any: tuple[Condition, ...] = field(..., "conditions")

    def holds(self, senses, rows):
        held = np.zeros(len(rows), bool)
        for part in self.any:
            held[~held] = answer(part, senses, rows[~held])
            if held.all():
                break
        return held

    def parts(self):
        return self.any


@condition
class Not(Condition):
    """The condition does not hold."""

    word = "not"  # no name for a field of Python
    inner = "one"
    denied: Condition = field(..., "a condition")

    def holds(self, senses, rows):
        return ~answer(self.denied, senses, rows)

    def parts(self):
        return (self.denied,)
