"""Sliders in a designer's words: a model says what each of them moves (`Parameters.sliders`).

The ranges are set by eye; ranges of single brushes that were measured are in the table of the playground.
"""

from __future__ import annotations

from typing import NamedTuple


class Range(NamedTuple):
    """One number of a brush and the values between which a slider moves it."""

    table: str  # "params" or "speed"
    name: str
    low: float
    high: float
    times: bool = False  # even steps multiply; otherwise they add
    over: float = 1.0  # share of the slider in which it goes from one end to the other; the first number takes all


class DesignerSlider(NamedTuple):
    """What the two ends of a slider mean, and the numbers that it moves together; the first says where it stands.

    ``unproved`` is its name in brushes for which no measurement shows that it does mainly what its own name says.
    """

    ends: str
    ranges: tuple[Range, ...]
    unproved: str = ""


def moves(name: str, low: float, high: float, times: bool = False) -> Range:
    """The range of a parameter of the model."""
    return Range("params", name, low, high, times)


def pace(low: float, high: float) -> DesignerSlider:
    """The slider of the speed, in body lengths per second."""
    numbers = "mean", "deviation", "common"
    return DesignerSlider("Slow and calm to fast", tuple(Range("speed", name, low, high, True) for name in numbers))


SLIDERS = {"pace": pace(0.1, 20.0)}  # of every model
