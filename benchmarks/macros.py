"""Measure the effect of the slider "order" on herds: ``python benchmarks/macros.py [BRUSH ...] [--search]``.

Herds with random headings run on an endless plane with the slider at 0, 1/4, 1/2, 3/4 and 1, side by side in one world
for each seed.  The value of a run is the mean over its last part.  A measure moves by the difference of its largest
and smallest mean, in standard deviations between seeds (pooled over the five positions, and at least `LEAST` of the
measure).  The goal is that polarization moves three times as far as any other measure.

``--search`` looks for ranges of a brush with smaller herds and separate seeds.  It compares them with the general rule
on other seeds and takes the better one (it keeps the general rule if that does well), measures the slider on new seeds
and writes the result to the table of the sliders.  ``--ranges alignment_weight=0:0.59 avoidance_weight=0.84:0.73``
tries these ranges instead of a search; ``--general`` writes the result of the general rule.

``--effects`` prints, for the other sliders of every brush, the measure that each is named after at both ends.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import replace

import numpy as np
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.sliders import Range
from flockbrush.components import Heading, Position, Velocity
from flockbrush.levels.build import herds_apart
from flockbrush.systems.measures import herd_measures

from flockbrush.learning.evolution import Evolution
from flockbrush.studio.panels.knobs import knobs_of
from flockbrush.studio.panels.macros import GOAL, TABLE, Macro, macros_of, ranges_by_brush

PLACES = (0.0, 0.25, 0.5, 0.75, 1.0)
MEASURES = ("polarization", "milling", "nnd", "group_spread", "largest_part", "speed_mean")
DENSITY, RATE = 0.6, 32
FRESH, TRAINING, CHOICE = 9001, 1, 5001  # first seeds: of the table, of the search, of the choice
SECONDS, SETTLED = 20, 12  # s of a run, and of its unmeasured start
LEAST = 0.005  # of the largest value
GENERATIONS, CANDIDATES, SMALL = 10, 8, 25  # of the search; animals of its herds
ENOUGH = 0.5  # polarization that a slider should move at least
EFFECTS = {  # the measure that a slider is named after, and whether it grows (1) or shrinks (-1) along it
    "tightness": ("nnd", -1), "personal space": ("nnd", 1), "wander": ("turning", 1), "pace": ("speed_mean", 1),
}  # fmt: skip
COMPENSATED = {  # parameters that may move with the first one: {model: {name: share of the range it has left}}
    "herd": {
        "avoidance_weight": 0.6, "cohesion_weight": 0.6, "avoidance_radial": 0.5, "alignment_radial": 0.5,
        "wander": 0.5,
    },
    "boids": {
        "matching_time": 0.6, "centring_strength": 0.6, "separation_strength": 0.6, "separation": 0.2,
    },
}  # fmt: skip


def with_slider(name):
    """Return the names of the shipped brushes whose model has this slider."""
    library = shipped()
    return [one for one in library.names() if name in library.get(one).params.sliders]


def runs_of(brushes, animals, seed, seconds=SECONDS, settled=SETTLED, measures=MEASURES):
    """Return means (brushes, measures) over the last part of a run, with separate herds of the brushes.

    Besides the measures of herds there is ``turning``, the mean angle between headings one second apart, rad.
    """
    named = [brush.model_copy(update={"name": f"place-{k}"}) for k, brush in enumerate(brushes)]
    fastest, farthest = max(b.speed.mean for b in named), max(b.vision.range for b in named)
    length, seen = named[0].body.length, []
    reach = 2.0 * (fastest * seconds + math.sqrt(animals / DENSITY)) + farthest
    simulation = herds_apart(named, animals, DENSITY, "scatter", seed, apart=reach * length)
    agents = simulation.agents
    simulation.run(settled * RATE)
    for _ in range(seconds - settled):
        before = agents[Heading.forward].copy()
        simulation.run(RATE)
        columns = [agents[one] for one in (Position.xyz, Velocity.xyz, Heading.forward)]
        flies = bool(columns[0][:, 2].any())
        parts = [[column[k * animals : (k + 1) * animals] for column in columns] for k in range(len(named))]
        turned = np.arccos(np.clip((before * columns[2]).sum(axis=1), -1.0, 1.0)).reshape(len(named), animals)
        told = [
            herd_measures(*part, length, flies=flies) | {"turning": angles.mean()}
            for part, angles in zip(parts, turned, strict=True)
        ]
        seen.append([[one[name] for name in measures] for one in told])
    simulation.close()
    return np.mean(seen, axis=0)


def course_of(brush, slider, animals, first, seeds):
    """Return the measures of a slider, (positions, seeds, measures)."""
    turned = [slider.turned(brush, place) for place in PLACES]
    return np.stack([runs_of(turned, animals, first + seed) for seed in range(seeds)], axis=1)


def deviations(values):
    """Return deviations (measures,) pooled between seeds, from (..., seeds, measures)."""
    pooled = np.sqrt(values.var(axis=-2, ddof=1).reshape(-1, values.shape[-1]).mean(axis=0))
    return np.maximum(pooled, LEAST * np.abs(values).reshape(-1, values.shape[-1]).max(axis=0))


def moved(values, deviation=None):
    """Return how far each measure moves, in deviations, (measures,), from (positions, seeds, measures)."""
    return np.ptp(values.mean(axis=1), axis=0) / (deviations(values) if deviation is None else deviation)


def ratio(far):
    """Return how far polarization moves, divided by the largest movement of another measure."""
    return far[0] / max(far[1:].max(), 1e-9)


class Ways:
    """Ranges of a slider for one brush, as points of a cube; all of them contain the brush itself."""

    def __init__(self, brush, slider):
        self.brush, self.slider = brush, slider
        self.first = slider.ranges[0]
        known = {knob.name: knob for knob in knobs_of(brush)}
        self.knob = known[self.first.name]
        self.others = [(known[name], share) for name, share in COMPENSATED[brush.model].items()]
        self.size = 2 + len(self.others)

    def at(self, point):
        """Return the slider at a point; None where its first parameter hardly moves."""
        own, knob = self.knob.value(self.brush), self.knob
        low, high = np.clip((np.asarray(point[:2]) - 0.3) / 0.7, 0.0, 1.0)  # a corner keeps the brush's value
        low, high = own - low * (own - knob.low), own + high * (min(knob.high, 1.0) - own)
        if high - low < 0.02:
            return None
        stands, ranges = (
            (own - low) / (high - low),
            [Range("params", self.first.name, round(float(low), 4), round(float(high), 4))],
        )
        for (other, share), along in zip(self.others, 2.0 * np.asarray(point[2:]) - 1.0, strict=True):
            has = other.value(self.brush)
            room = np.array([has - other.low, other.high - has])
            before, after = room if along > 0 else room[::-1]
            ends = [way / part for way, part in ((before, stands), (after, 1.0 - stands)) if part > 1e-6]
            by = share * along * min([*ends, other.high - other.low])
            if abs(by) > 0.02 * (other.high - other.low):
                ends = (round(float(has + part * by), 4) for part in (-stands, 1.0 - stands))
                ranges.append(Range(other.table, other.name, *ends))
        return Macro(*self._words(), ranges=tuple(ranges))

    def _words(self):
        one = self.slider
        return one.table, one.name, one.kind, one.unit, one.help


def worth(values, deviation):
    """Return the loss of a slider, from (positions, seeds, measures)."""
    course = values[:, :, 0].mean(axis=1)
    steady = np.minimum(np.diff(course), 0.0).sum()
    return -(
        math.log(min(max(ratio(moved(values, deviation)), 0.01), 8.0)) + min(np.ptp(course) / ENOUGH, 1.0) + steady
    )


def search(brush, slider, seeds):
    """Return the best slider that the search found."""
    ways, places = Ways(brush, slider), (0.0, 0.5, 1.0)
    begin = np.full(ways.size, 0.5)
    begin[:2] = 1.0, 0.6
    hunt, spread = Evolution(begin, 0.25, CANDIDATES, (TRAINING,)), None
    for generation in range(GENERATIONS):
        asked = [ways.at(point) for point in hunt.ask()]
        brushes = [one.turned(brush, place) for one in asked if one is not None for place in places]
        first = TRAINING + seeds * generation
        values = np.stack([runs_of(brushes, SMALL, first + seed, 14, 10) for seed in range(seeds)], axis=1)
        values = values.reshape(-1, len(places), *values.shape[1:])
        now = deviations(values)
        spread, left = now if spread is None else 0.5 * (spread + now), iter(values)
        hunt.tell([10.0 if one is None else worth(next(left), spread) for one in asked])
    return ways.at(np.abs(np.mod(hunt.mean + 1.0, 2.0) - 1.0))


def given(slider, texts):
    """Return the slider with ranges given as ``name=low:high``; raises ValueError."""
    ranges = []
    for text in texts:
        name, _, ends = text.partition("=")
        low, _, high = ends.partition(":")
        ranges.append(Range("params", name, float(low), float(high)))
    return replace(slider, ranges=tuple(ranges))


def settle(brush, name, seeds, animals, texts=()):
    """Search, then choose on other seeds between the result and the general rule: (slider, whether found)."""
    general = next(one for one in macros_of(brush, {}) if one.name == name)
    values = course_of(brush, general, animals, CHOICE, seeds)
    if ratio(moved(values)) >= 1.5 * GOAL and not texts:
        return general, False
    found = given(general, texts) if texts else search(brush, general, 2)
    if found is None:
        return general, False
    others = course_of(brush, found, animals, CHOICE, seeds)
    better = worth(others, deviations(others)) < worth(values, deviations(values))
    return (found, True) if better else (general, False)


def keep(name, brush, slider, own, values, far):
    """Write a slider and its measurements to the table of the sliders."""
    ranges_by_brush.cache_clear()  # another search may have written meanwhile
    table = ranges_by_brush()
    entry = {
        "polarization": [round(float(one), 2) for one in values[:, :, 0].mean(axis=1)],
        "moves": {one: round(float(by), 1) for one, by in zip(MEASURES, far, strict=True)},
    }
    if own:
        entry["ranges"] = [[part.table, part.name, part.low, part.high] for part in slider.ranges]
    table.setdefault(name, {})[brush.name] = entry
    text = ",\n".join(
        f'  "{one}": {{\n' + ",\n".join(f'    "{b}": {json.dumps(table[one][b])}' for b in sorted(table[one])) + "\n  }"
        for one in sorted(table)
    )
    TABLE.write_text(f"{{\n{text}\n}}\n")
    ranges_by_brush.cache_clear()


def effects(brushes, animals, seeds):
    """Print what sliders do to the measures that they are named after."""
    print("| brush | slider | measure | at 0 | at 1 | moves, deviations between seeds | as named |")
    print("|---|---|---|---|---|---|---|")
    for name in brushes:
        brush = shipped().get(name)
        for slider in macros_of(brush):
            if slider.name not in EFFECTS:
                continue
            measure, sign = EFFECTS[slider.name]
            ends = [slider.turned(brush, place) for place in (0.0, 1.0)]
            values = np.stack(
                [runs_of(ends, animals, FRESH + seed, measures=(measure,)) for seed in range(seeds)], axis=1
            )
            (low, high), by = values.mean(axis=(1, 2)), float(moved(values)[0])
            named = "hardly acts" if by < 2.0 else "yes" if sign * (high - low) > 0 else "the other way"
            print(f"| {name} | {slider.name} | {measure} | {low:.2f} | {high:.2f} | {by:.1f} | {named} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("brushes", nargs="*", metavar="BRUSH", help="default: all brushes that have the slider")
    parser.add_argument("--slider", default="order")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--animals", type=int, default=50)
    parser.add_argument("--search", action="store_true", help="find ranges and write the slider table")
    parser.add_argument("--general", action="store_true", help="write the result of the general rule")
    parser.add_argument("--effects", action="store_true", help="print the effects of the other sliders")
    parser.add_argument(
        "--ranges", nargs="+", default=[], metavar="NAME=LOW:HIGH", help="try these ranges, for one brush"
    )
    told = parser.parse_args()
    if told.effects:
        return effects(told.brushes or shipped().names(), told.animals, told.seeds)
    if told.ranges and len(told.brushes) != 1:
        parser.error("--ranges needs the name of one brush")
    known = with_slider(told.slider)
    if wrong := [name for name in told.brushes if name not in known]:
        parser.error(f"no slider {told.slider!r} has {', '.join(wrong)}; {', '.join(known) or 'no brush'} has it")
    print(f"| brush | initial position | polarization at {', '.join(f'{place:g}' for place in PLACES)} | "
          f"{' | '.join(MEASURES)} | polarization / next largest |")  # fmt: skip
    print("|---" * (len(MEASURES) + 4) + "|")
    for name in told.brushes or known:
        brush = shipped().get(name)
        own = False
        if told.general:
            slider = next(one for one in macros_of(brush, {}) if one.name == told.slider)
        elif told.search or told.ranges:
            slider, own = settle(brush, told.slider, told.seeds, told.animals, told.ranges)
        else:
            slider = next(one for one in macros_of(brush) if one.name == told.slider)
        values = course_of(brush, slider, told.animals, FRESH, told.seeds)
        far = moved(values)
        if told.search or told.ranges or told.general:
            keep(told.slider, brush, slider, own, values, far)
        course = ", ".join(f"{value:.2f}" for value in values[:, :, 0].mean(axis=1))
        print(f"| {name} | {slider.value(brush):.2f} | {course} | {' | '.join(f'{one:.1f}' for one in far)} | "
              f"{ratio(far):.1f}{'' if ratio(far) >= GOAL else ', below the goal'} |", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
