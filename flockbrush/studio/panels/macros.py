"""Simple sliders, each of which changes a few parameters of a brush together.

A slider stands where its first number says; turning it moves the others as far along their own ranges.  Models declare
them (`Parameters.sliders`), with ranges set by eye.  `TABLE` has ranges for single brushes, found by
``python benchmarks/macros.py --search``, and what was measured of the slider there.
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
GOAL = 3.0  # times that polarization should move as far as any other measure
HARDLY, SURE = 0.2, 2.0  # of polarization, and deviations between seeds: a slider that moves less hardly acts
ALSO = {
    "milling": "milling", "nnd": "spacing", "group_spread": "spread", "largest_part": "splitting",
    "speed_mean": "speed",
}  # fmt: skip


@dataclass(frozen=True)
class Macro(Knob):
    """A slider that moves several numbers of a brush."""

    ranges: tuple[Range, ...] = ()

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
            table[part.name] = _at(part, value) if k == 0 else _moved(part, now, by)
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
def ranges_by_brush() -> dict[str, dict[str, dict[str, Any]]]:
    """What was measured of sliders: {slider: {brush: {"polarization", "moves", ..., and "ranges" of its own}}}.

    Only the slider order has measurements.
    """
    return json.loads(TABLE.read_text()) if TABLE.exists() else {}


def macros_of(brush: Brush, measured: Mapping[str, Any] | None = None) -> list[Macro]:
    """The sliders of a brush; those in the table go by it."""
    table = ranges_by_brush() if measured is None else measured
    found = []
    for name, (words, ranges) in getattr(brush.params, "sliders", SLIDERS).items():
        entry = table.get(name, {}).get(brush.name, {})
        if "ranges" in entry:
            ranges = tuple(Range(*part) for part in entry["ranges"])
        symbols = ", ".join(part.name for part in ranges)
        kind, note = _note(name, entry)
        about = f"{words}. Changes {symbols} together." + (f" Measured: {note}." if note else "")
        found.append(Macro("macro", name, kind, "", about, note=note, ranges=ranges))
    return found


def _note(name, entry):
    """(kind, note): what was measured of a slider where it does less than its name says, or more."""
    if "polarization" not in entry:
        return NUMBER, ""
    low, high = min(entry["polarization"]), max(entry["polarization"])
    moves = entry["moves"]
    if high - low < HARDLY or moves["polarization"] < SURE:
        spread = (high - low) / max(moves["polarization"], 0.1)
        return SENTENCE, f"weak effect: polarization {low:.2f} to {high:.2f} ± {spread:.2f}"
    also = [one for one in ALSO if GOAL * moves[one] > moves["polarization"]]
    also = sorted(also, key=lambda one: -moves[one])[:2]
    return NUMBER, f"also changes {' and '.join(ALSO[one] for one in also)}" if also else ""
