"""Amounts with units, as a person writes them in a program: ``"20 m"``, ``"0.4 /s"``, ``"8..12 s"``."""

from __future__ import annotations

import functools
import math
import re
from dataclasses import dataclass
from typing import Annotated

from pydantic import BeforeValidator, InstanceOf


@dataclass(frozen=True, eq=False)
class Dimension:
    """What is measured: its units (None: in body lengths of the animal), and the bounds in the first unit."""

    name: str
    units: dict[str, float | None]
    low: float
    high: float
    example: str

    @property
    def unit(self) -> str:
        """The unit that amounts are kept in."""
        return next(iter(self.units))

    @property
    def span(self) -> str:
        """The bounds in words: "from 0 to 1000 m"."""
        return f"from {self.low:.10g} to {self.high:.10g} {self.unit}".rstrip()


LENGTH = Dimension("a length", {"m": 1.0, "cm": 0.01, "km": 1000.0, "BL": None}, 0.0, 1e6, "20 m")
HEIGHT = Dimension("a height", {"m": 1.0, "km": 1000.0, "BL": None}, -1e5, 1e5, "30 m")
TIME = Dimension("a time", {"s": 1.0, "ms": 0.001, "min": 60.0, "h": 3600.0}, 0.0, 1e6, "8 s")
SPEED = Dimension("a speed", {"m/s": 1.0, "km/h": 1 / 3.6, "BL/s": None}, 0.0, 1000.0, "3 m/s")
ACCELERATION = Dimension(
    "an acceleration", {"m/s²": 1.0, "m/s^2": 1.0, "m/s2": 1.0, "BL/s²": None}, 0.0, 10_000.0, "2 m/s²"
)
RATE = Dimension("a rate", {"1/s": 1.0, "/s": 1.0, "1/min": 1 / 60, "/min": 1 / 60}, 0.0, 1000.0, "0.1 /s")
SLOPE = Dimension("a slope", {"": 1.0, "%": 0.01, "°": math.nan}, 0.0, 100.0, "0.3 or 17°")


@dataclass(frozen=True)
class Amount:
    """A number with a unit, or a range of which each animal draws its own."""

    # low, high: in the first unit of the dimension, or in body lengths; equal when there is nothing to draw
    low: float
    high: float
    own: bool  # in the animal's own body lengths
    text: str  # as it was written

    def __eq__(self, other):
        same = isinstance(other, Amount)
        return same and (self.low, self.high, self.own) == (other.low, other.high, other.own)

    def __hash__(self):
        return hash((self.low, self.high, self.own))

    def __str__(self):
        return self.text

    def of(self, length):
        """In metres (or m/s, m/s²) for animals of these body lengths."""
        return self.low * length if self.own else self.low


_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]+)?|\.[0-9]+)(?:e[-+]?[0-9]+)?"
_AMOUNT = re.compile(rf"\s*(?P<low>{_NUMBER})(?:\s*\.\.\s*(?P<high>{_NUMBER}))?\s*(?P<unit>[^\d\s.].*?)?\s*")


def amount(value, dimension: Dimension, ranges: bool = False) -> Amount:
    """What a person wrote as an amount; ValueError with what would be right."""
    if isinstance(value, Amount):
        return value
    low, high, unit = _parts(value, dimension)
    if high < low:
        raise ValueError("must have the lower number first")
    if high > low and not ranges:
        raise ValueError("must be one number, not a range")
    factor = dimension.units[unit]
    if unit == "°":
        low, high = math.tan(math.radians(low)), math.tan(math.radians(high))
        factor = 1.0
    low, high = low * (factor or 1.0), high * (factor or 1.0)
    if not dimension.low <= low <= high <= dimension.high:
        raise ValueError(f"must be {dimension.span}")
    return Amount(low, high, factor is None, value if isinstance(value, str) else f"{value:g}")


def _parts(value, dimension):
    """(low, high, unit) of what was written."""
    if isinstance(value, (int, float)) and not isinstance(value, bool) and "" in dimension.units:
        return float(value), float(value), ""
    match = _AMOUNT.fullmatch(value) if isinstance(value, str) and len(value) < 64 else None
    if match is None:
        raise ValueError(f'must be {dimension.name} such as "{dimension.example}"')
    low = float(match["low"])
    high = float(match["high"]) if match["high"] else low
    unit = match["unit"] or ""
    if unit not in dimension.units:
        units = ", ".join(unit for unit in dimension.units if unit)
        raise ValueError(f"must be {dimension.name} in {units}")
    return low, high, unit


def kind(dimension: Dimension, ranges: bool = False):
    """The pydantic type of a field that holds an amount of this dimension."""
    read = functools.partial(amount, dimension=dimension, ranges=ranges)
    return Annotated[InstanceOf[Amount], BeforeValidator(read), dimension]


Length, Height, Time, TimeRange = kind(LENGTH), kind(HEIGHT), kind(TIME), kind(TIME, ranges=True)
Speed, Acceleration, Rate, Slope = kind(SPEED), kind(ACCELERATION), kind(RATE), kind(SLOPE)
