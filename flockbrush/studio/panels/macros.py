"""Simple sliders, each of which changes a few parameters of a brush together.

A slider stands where its first number says; turning it moves the others as far along their own ranges.  Models declare
them (`Parameters.sliders`), with ranges set by eye.  `TABLE` has what ``python benchmarks/macros.py`` measured of
sliders of single brushes, and ranges of their own.  A slider that hardly acts is a sentence; the name that a slider has
goes by what was measured, too.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from flockbrush.behaviours.brush import Brush
from flockbrush.behaviours.sliders import SLIDERS, Range
from flockbrush.behaviours.validation import validated
from flockbrush.studio.panels.knobs import NUMBER, SENTENCE, Knob

TABLE = Path(__file__).with_name("macro_ranges.json")
GOAL = 3.0  # times that the measure a slider is named after moves as far as any other
ENOUGH = 0.5  # polarization that the slider order moves at least
SURE = 2.0  # deviations between seeds: a slider that moves its measure less hardly acts
WORDS = {
    "polarization": "polarization", "milling": "milling", "nnd": "spacing", "group_spread": "spread",
    "largest_part": "splitting", "speed_mean": "speed", "turning": "turning", "aspect_ratio": "width / length",
    "unevenness": "unevenness", "shuffling": "changes of place",
}  # fmt: skip


@dataclass(frozen=True)
class Macro(Knob):
    """A slider that moves several numbers of a brush."""

    ranges: tuple[Range, ...] = ()
    slider: str = ""  # what the model and the table call it

    def value(self, brush: Brush) -> float:
        """Where it stands, 0 to 1, by its first number."""
        first = self.ranges[0]
        return round(min(max(_along(first, getattr(getattr(brush, first.table), first.name)), 0.0), 1.0), 4)

    def said(self, value) -> str:
        """Where it stands, in hundredths."""
        return f"{value:.2f}"

    def turned(self, brush: Brush, value: float) -> Brush:
        """The brush with the slider there; each number stays within the bounds of its model."""
        by = value - self.value(brush)
        tables: dict[str, Any] = {}
        for k, part in enumerate(self.ranges):
            table = tables.setdefault(part.table, dict(getattr(brush, part.table)))
            now = table[part.name]
            table[part.name] = _at(part, value) if k == 0 else _moved(part, now, by / part.over)
        for name, numbers in tables.items():
            made, mistakes = validated(type(getattr(brush, name)), numbers)
            if made is None:
                raise ValueError(f"{self.words}: {mistakes[0][1]}")
            tables[name] = made
        return brush.model_copy(update=tables)


def _at(part, share):
    if part.times:
        return part.low * (part.high / part.low) ** share
    return part.low + share * (part.high - part.low)


def _along(part, value):
    if part.times:
        return math.log(max(value, 1e-12) / part.low) / math.log(part.high / part.low)
    return (value - part.low) / (part.high - part.low)


def _moved(part, now, by):
    """A number moved by a share of its range, and not beyond its ends unless it was there already."""
    value = now * (part.high / part.low) ** by if part.times else now + by * (part.high - part.low)
    low, high = min(part.low, part.high, now), max(part.low, part.high, now)
    return min(max(value, low), high)


@cache
def measured_sliders() -> dict[str, dict[str, dict[str, Any]]]:
    """What was measured of sliders, {slider: {brush: entry}}.

    An entry has ``moves``, the deviations between seeds by which measures move, first the one that the slider is named
    after; the course of that one from end to end under its name; and ``ranges`` of its own, if any.
    """
    return json.loads(TABLE.read_text()) if TABLE.exists() else {}


def macros_of(brush: Brush, measured: Mapping[str, Any] | None = None) -> list[Macro]:
    """The sliders of a brush; those in the table go by it."""
    table = measured_sliders() if measured is None else measured
    found = []
    for slider, (ends, ranges, unproved) in getattr(brush.params, "sliders", SLIDERS).items():
        entry = table.get(slider, {}).get(brush.name, {})
        if "ranges" in entry:
            ranges = tuple(Range(*part) for part in entry["ranges"])
        symbols = ", ".join(part.name for part in ranges)
        kind, note = _note(entry)
        name = slider if reaches_goal(entry) else unproved or slider
        about = f"{ends}. Changes {symbols}{' together' if len(ranges) > 1 else ''}." + (
            f" Measured: {note}." if note else ""
        )
        found.append(Macro("macro", name, kind, "", about, note=note, ranges=ranges, slider=slider))
    return found


def reaches_goal(entry: Mapping[str, Any]) -> bool:
    """Whether a slider was measured to move its measure far, and `GOAL` times as far as any other."""
    if "moves" not in entry:
        return False
    (measure, far), *others = entry["moves"].items()
    low, high = min(entry[measure]), max(entry[measure])
    return high - low >= ENOUGH and far >= max([SURE, *(GOAL * by for _, by in others)])


def _note(entry):
    """(kind, note) on a slider whose measured effect differs from its name."""
    if "moves" not in entry:
        return NUMBER, ""
    (measure, far), *others = entry["moves"].items()
    low, high = min(entry[measure]), max(entry[measure])
    if far < SURE:
        return SENTENCE, f"weak effect: {WORDS[measure]} {low:.2f} to {high:.2f}"
    also = sorted((name for name, by in others if GOAL * by > far), key=lambda name: -entry["moves"][name])[:2]
    return NUMBER, f"also changes {' and '.join(WORDS[one] for one in also)}" if also else ""
