"""The knobs of a brush: one for each number, switch and choice of the model's `Params`.

Nothing here knows a model, and nothing knows a window: a model written tomorrow has its sliders tomorrow.
"""

from __future__ import annotations

import math
import types
import typing
from dataclasses import dataclass, replace
from typing import Any, Literal

from flockbrush.behaviours.validation import bounds, span, unit

NUMBER, WHOLE, SWITCH, CHOICE = "number", "whole number", "switch", "choice"
SENTENCE = "sentence"  # nothing to turn: the note says why
TABLES = {"params": "Behaviour", "speed": "Speed", "vision": "Sight"}
SHORT = {"body lengths": "BL", "degrees": "°"}


@dataclass(frozen=True)
class Knob:
    """One parameter of a brush that can be changed in the panel."""

    table: str  # {"params", "speed", "vision"}; which part of the brush has it
    name: str
    kind: str  # {"number", "whole number", "switch", "choice"}
    unit: str
    help: str
    # low, high: ends of the slider; those of the model where it has any
    low: float = 0.0
    high: float = 1.0
    choices: tuple[str, ...] = ()
    hard: bool = True  # whether the ends are the model's: beyond them nothing is taken
    note: str = ""  # a line below

    @property
    def words(self) -> str:
        """The name for people."""
        return self.name.replace("_", " ")

    @property
    def measure(self) -> str:
        """The unit, short enough to stand beside the name."""
        short = self.unit
        for long, brief in SHORT.items():
            short = short.replace(long, brief)
        short = short.replace("√s", "s^½")  # the window's font has no root
        return f"× {short}" if short[:1].isdigit() and "/" not in short else short

    def value(self, brush) -> Any:
        """What the brush has there."""
        return getattr(getattr(brush, self.table), self.name)

    def said(self, value) -> str:
        """A value as people write it, without its unit."""
        if self.kind == NUMBER:
            return written(value)
        return {True: "yes", False: "no"}[value] if self.kind == SWITCH else str(value)

    def read(self, text: str):
        """The typed value; ValueError with a message for the user."""
        try:
            value = float(text.strip().replace(",", "."))
        except ValueError:
            raise ValueError(
                f"{self.words} must be a number, such as {written(max(self.low, 0.5))}; got {text.strip()!r}"
            ) from None
        if not math.isfinite(value):
            raise ValueError(f"{self.words} must be a finite number")
        if self.kind == WHOLE and value != round(value):
            raise ValueError(f"{self.words} must be a whole number, got {text.strip()!r}")
        if self.hard and not self.low <= value <= self.high:
            raise ValueError(f"{self.words} must be from {self.low:g} to {self.high:g}; got {text.strip()}")
        return int(value) if self.kind == WHOLE else value


def written(number: float) -> str:
    """A number in three or four digits: 0.40, 12.5, 1000."""
    if number == round(number) and abs(number) >= 1:
        return f"{number:.0f}"
    text = f"{number:.2f}"
    return text if float(text) == float(f"{number:.4g}") else f"{number:.4g}"


def knobs_of(brush) -> list[Knob]:
    """Everything that can be tuned in a brush, in the order in which its file has it."""
    knobs = []
    for table in ("speed", "params", "vision"):
        model = type(getattr(brush, table))
        for name, field in model.model_fields.items():
            knob = knob_of(table, name, field, getattr(getattr(brush, table), name))
            if knob is not None:
                knobs.append(knob)
    return knobs


def knob_of(table: str, name: str, field, value=None) -> Knob | None:
    """The knob of one field of a model; None for what no knob can turn (lists, texts)."""
    kind = kind_of(field.annotation)
    if kind is None:
        return None
    knob = Knob(table, name, kind, unit_of(field, kind), help_of(field, kind))
    if kind == CHOICE:
        return replace(knob, choices=tuple(map(str, typing.get_args(field.annotation))))
    if kind == SWITCH:
        return knob
    low, high, hard = ends(field, value)
    return replace(knob, low=low, high=high, hard=hard)


def kind_of(annotation) -> str | None:
    """What kind of knob turns values of a type."""
    if annotation is bool:
        return SWITCH
    if annotation is int:
        return WHOLE
    if annotation is float:
        return NUMBER
    if typing.get_origin(annotation) is Literal and all(isinstance(v, str) for v in typing.get_args(annotation)):
        return CHOICE
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        kinds = {kind_of(part) for part in typing.get_args(annotation)} - {None}
        return NUMBER if kinds == {WHOLE, NUMBER} and type(None) not in typing.get_args(annotation) else None
    return None


def unit_of(field, kind) -> str:
    """The unit of a field, "" for pure numbers."""
    return unit(field) if kind in (NUMBER, WHOLE) else ""


def help_of(field, kind) -> str:
    """What turning it does, its unit and its range, as sentences."""
    meaning = " ".join((field.description or "").split()).rstrip(".")
    parts = [meaning[:1].upper() + meaning[1:]] if meaning else []
    if kind in (NUMBER, WHOLE):
        parts.append(f"Unit: {unit(field) or 'none'}")
        limits = bounds(field)
        if str(limits):
            parts.append(f"Range: {span(field) if not unit(field)[:1].isdigit() else str(limits)}")
    elif kind == CHOICE:
        parts.append(f"One of: {', '.join(map(str, typing.get_args(field.annotation)))}")
    return ". ".join(parts) + "."


def ends(field, value=None) -> tuple[float, float, bool]:
    """(low, high, hard): the ends of a slider; guessed about the value where the model has none."""
    limits = bounds(field)
    low = limits.least if limits.least is not None else limits.above
    high = limits.most if limits.most is not None else limits.below
    hard = low is not None and high is not None
    about = abs(float(value)) if isinstance(value, (int, float)) else 1.0
    if low is None:
        low = 0.0 if (value is None or value >= 0) and (high is None or high > 0) else -4.0 * about
    if high is None:
        high = max(4.0 * about, low + 1.0)
    if limits.above is not None and limits.least is None:
        low += (high - low) * 1e-3  # the end itself is not allowed
    if limits.below is not None and limits.most is None:
        high -= (high - low) * 1e-3
    return float(low), float(high), hard


@dataclass(frozen=True)
class Scale:
    """How far along a slider a value lies, 0 to 1.

    A range that dwarfs the asset's value is bent, so that the value is not squeezed to the edge: sensitivity 10 of
    0 to 1000 lies a third along.
    """

    low: float
    high: float
    bend: float = 1.0
    whole: bool = False

    @classmethod
    def of(cls, knob: Knob, asset: float) -> Scale:
        """The scale of a knob for an asset's value."""
        span = knob.high - knob.low
        share = (float(asset) - knob.low) / span if span > 0 else 0.5
        bend = 1.0
        if 0 < share < 0.1:
            bend = min(math.log(share) / math.log(0.35), 6.0)
        elif share <= 0 and span > 20:
            bend = 3.0
        return cls(knob.low, knob.high, bend, knob.kind == WHOLE)

    def along(self, value: float) -> float:
        """How far along the slider a value is; its ends for those beyond."""
        if self.high <= self.low:
            return 0.0
        return min(max((float(value) - self.low) / (self.high - self.low), 0.0), 1.0) ** (1 / self.bend)

    def value(self, along: float):
        """The value at a place of the slider, in no more digits than a hand can set."""
        along = min(max(along, 0.0), 1.0)
        exact = self.low + (self.high - self.low) * along**self.bend
        if self.whole:
            return round(exact)
        step = (self.high - self.low) * max(self.bend * max(along, 0.01) ** (self.bend - 1), 1e-4) / 200
        digits = max(0, -math.floor(math.log10(step))) if step > 0 else 3
        return min(max(round(exact, digits), self.low), self.high)
