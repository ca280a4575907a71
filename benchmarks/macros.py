"""Measure the effect of the slider "order" on herds: ``python benchmarks/macros.py [BRUSH ...]``.

Herds run on an endless plane with the slider at 0, 1/4, 1/2, 3/4 and 1, many of each, apart in one world.  They start
as `bands.json` says of the brush; other brushes start with one heading (`ALIGNED`) or random headings.  The value
of a run is the mean over its last part.  A measure moves by the difference between the positions at which it is largest
and smallest, in standard deviations between seeds (pooled over the five positions, and at least `LEAST` of the
measure).  The two positions for a seed are chosen by the other seeds, so that a measure that does not move moves by 0
on average.  The goal is that polarization moves three times as far as any other measure; resampled seeds give the
interval of this ratio.

``--ranges alignment_weight=0:1 wander=2.5:0:.3`` gives a brush ranges of its own (the last number: the share of the
slider in which wander falls, about the brush's own position).  They are compared with those that it
has and with the general ones on other seeds; the best are measured on new seeds and written to the table of the
sliders.
``--general`` writes the result of the general ranges, ``--write`` that of the present ones.

``--effects`` measures the other sliders of every brush by the measure that each is named after, at both ends; with
``--write`` it writes this to the table.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.sliders import Range
from flockbrush.components import Heading, Position, Velocity
from flockbrush.levels.build import herds_apart
from flockbrush.systems.measures import compute_nnd, herd_measures

from flockbrush.studio.panels.macros import ENOUGH, SURE, TABLE, macros_of, measured_sliders

sys.path.insert(0, str(Path(__file__).parent.parent))  # the repository, when run as a program
from benchmarks.brush_bands import stated

PLACES = (0.0, 0.25, 0.5, 0.75, 1.0)
MEASURES = ("polarization", "milling", "nnd", "group_spread", "largest_part", "speed_mean")
RATE = 32
SCENE = {"start": "scatter", "density": 0.6, "heading": None}  # of brushes without bands
ALIGNED = ("boids-herd", "bolt", "cranes", "evacuate", "falcon", "falcon-hunt", "geese", "lion-rush", "merino-run",
           "pelicans", "skein", "sparrows", "starlings", "to-goal", "wolf-hunt")  # these: one heading  # fmt: skip
FRESH, CHOICE = 9001, 5001  # first seeds: of the table, of the choice between ranges
SECONDS, SETTLED = 16, 10  # s of a run, and of its unmeasured start
LEAST = 0.005  # of the largest value
RESAMPLED, INTERVAL = 400, (5, 95)  # times that seeds are drawn again, and percentiles of the ratio
EFFECTS = {  # the measure that a slider is named after, and whether it grows (1) or shrinks (-1) along it
    "tightness": ("nnd", -1), "personal space": ("nnd", 1), "wander": ("turning", 1), "pace": ("speed_mean", 1),
    "sweep": ("aspect_ratio", -1),
}  # fmt: skip
IN_FORMATION = {"regularity": ("unevenness", -1), "wander": ("shuffling", 1)}  # of models that fly in formation
SKEIN, FLIGHT, FORMED = 12, 90, 60  # birds of these, s of a run, and until a formation stands
FORMATIONS = ("line_formation", "v_rules")


def with_slider(name):
    """Return the names of the shipped brushes that have this slider."""
    return [one for one in shipped().names() if name in shipped().get(one).params.sliders]


def scene_of(name):
    """Return how herds of a brush start: formation, density and heading."""
    scene = stated().get(name, {}).get("scene", SCENE | ({"heading": 0.0} if name in ALIGNED else {}))
    return {key: scene[key] for key in SCENE}


def runs_of(brushes, animals, first, seeds, seconds=SECONDS, settled=SETTLED, measures=MEASURES):
    """Return means (brushes, seeds, measures) over the last part of runs of variants of a brush.

    All herds are in one world, apart; each has its own random numbers.

    Besides the measures of herds there are those of `movements`.
    """
    named = [brush.model_copy(update={"name": f"place-{k}"}) for k, brush in enumerate(brushes)]
    scene = scene_of(brushes[0].name)
    fastest, farthest = max(b.speed.mean for b in named), max(b.vision.range for b in named)
    length, seen = named[0].body.length, []
    reach = 2.0 * (fastest * seconds + math.sqrt(animals / scene["density"])) + farthest
    herds = [brush for brush in named for _ in range(seeds)]
    simulation = herds_apart(herds, animals, seed=first, apart=reach * length, **scene)
    simulation.run(settled * RATE)
    parts = [slice(k * animals, (k + 1) * animals) for k in range(len(herds))]
    for _ in range(seconds - settled):
        moments = [_columns(simulation)]
        for ticks in (RATE // 2, RATE // 4, RATE // 4):
            simulation.run(ticks)
            moments.append(_columns(simulation))
        flies = bool(moments[-1][0][:, 2].any())
        told = [
            herd_measures(*(column[part] for column in moments[-1]), length, flies=flies)
            | movements([[column[part] for column in moment] for moment in moments], length)
            for part in parts
        ]
        seen.append([[one[name] for name in measures] for one in told])
    simulation.close()
    return np.mean(seen, axis=0).reshape(len(named), seeds, len(measures))


def _columns(simulation):
    return [simulation.agents[one].copy() for one in (Position.xyz, Velocity.xyz, Heading.forward)]


def movements(moments, length):
    """Return what animals do within a herd, from positions, velocities and headings 1, 1/2, 1/4 and 0 s ago.

    ``turning``: mean change of an animal's turn from one quarter of a second to the next, rad; on a circle 0.
    ``shuffling``: mean movement within the herd in a second, body lengths.  ``unevenness``: standard deviation of the
    distances to the nearest neighbour, divided by their mean.
    """
    headings = [np.arctan2(forward[:, 1], forward[:, 0]) for _, _, forward in moments[1:]]
    turns = np.angle(np.exp(1j * np.diff(headings, axis=0)))
    places = []
    for xyz, _, forward in (moments[0], moments[-1]):
        ahead = forward[:, :2].mean(axis=0)
        across = xyz[:, :2] - xyz[:, :2].mean(axis=0)
        places.append((across[:, 0] + 1j * across[:, 1]) * np.exp(-1j * np.arctan2(ahead[1], ahead[0])))
    near = compute_nnd(moments[-1][0][:, :2])
    return {
        "turning": float(np.abs(np.angle(np.exp(1j * (turns[1] - turns[0])))).mean()),
        "shuffling": float(np.abs(places[1] - places[0]).mean() / length),
        "unevenness": float(near.std() / near.mean()),
    }


def course_of(brush, slider, animals, first, seeds):
    """Return the measures of a slider, (positions, seeds, measures)."""
    return runs_of([slider.turned(brush, place) for place in PLACES], animals, first, seeds)


def deviations(values, times=None):
    """Return deviations (measures,) pooled between seeds, from (positions, seeds, measures); seeds may count often."""
    times = np.ones(values.shape[1]) if times is None else times
    mean = np.average(values, axis=1, weights=times)[:, None]
    pooled = np.sqrt((times[:, None] * (values - mean) ** 2).sum(axis=1).mean(axis=0) / (times.sum() - 1))
    return np.maximum(pooled, LEAST * np.abs(values).reshape(-1, values.shape[-1]).max(axis=0))


def moved(values, deviation=None, times=None):
    """Return how far each measure moves, in deviations, (measures,), from (positions, seeds, measures).

    The other seeds choose the positions between which a seed is measured.
    """
    times = np.ones(values.shape[1]) if times is None else times
    counted = times[:, None] * values
    others = (counted.sum(axis=1, keepdims=True) - counted) / (times.sum() - times)[:, None]
    ends = [np.take_along_axis(values, at[None], axis=0)[0] for at in (others.argmax(axis=0), others.argmin(axis=0))]
    far = np.average(ends[0] - ends[1], axis=0, weights=times)
    return np.maximum(far, 0.0) / (deviations(values, times) if deviation is None else deviation)


def ratio(far, seeds):
    """Return how far polarization moves, divided by the largest movement of another measure.

    What moves by less than the standard error of a difference counts as this error.
    """
    return far[0] / max(far[1:].max(), math.sqrt(2.0 / seeds))


def interval(values):
    """Return the ends of the interval of the ratio, with seeds drawn again."""
    seeds = values.shape[1]
    rng = np.random.default_rng(0)
    drawn = rng.multinomial(seeds, np.full(seeds, 1.0 / seeds), RESAMPLED).astype(float)
    drawn = drawn[(drawn > 0).sum(axis=1) > 1]
    return np.percentile([ratio(moved(values, times=times), seeds) for times in drawn], INTERVAL)


def given(slider, texts):
    """Return the slider with ranges given as ``name=low:high[:times][:over]``; raises ValueError."""
    ranges = []
    for text in texts:
        name, _, ends = text.partition("=")
        low, high, *more = ends.split(":")
        over = float(next((one for one in more if one != "times"), 1.0))
        table = "speed" if name == "mean" else "params"
        ranges.append(Range(table, name, float(low), float(high), "times" in more, over))
    return replace(slider, ranges=tuple(ranges))


def settle(brush, name, seeds, animals, texts):
    """Return the best of the general ranges, the present and the given ones, on other seeds."""
    general, present = _slider(brush, name, {}), _slider(brush, name)
    tried = list({one.ranges: one for one in (general, present, given(general, texts))}.values())
    courses = [course_of(brush, one, animals, CHOICE, seeds) for one in tried]
    worth = [(np.ptp(course[:, :, 0].mean(axis=1)) >= ENOUGH, ratio(moved(course), seeds)) for course in courses]
    told = ", ".join(f"{by:.1f} with {' '.join(one.name for one in slider.ranges)}"
                     for slider, (_, by) in zip(tried, worth, strict=True))  # fmt: skip
    print(f"ratio on other seeds: {told}", file=sys.stderr, flush=True)
    return tried[worth.index(max(worth))]


def _slider(brush, name, *table):
    return next(one for one in macros_of(brush, *table) if one.slider == name)


def measured(values):
    """Return what the table says of the slider order, from (positions, seeds, measures)."""
    far = moved(values)
    return {
        "polarization": [round(float(one), 2) for one in values[:, :, 0].mean(axis=1)],
        "milling": [round(float(one), 2) for one in values[:, :, 1].mean(axis=1)],
        "moves": {one: round(float(by), 1) for one, by in zip(MEASURES, far, strict=True)},
        "ratio": [round(float(one), 1) for one in (ratio(far, values.shape[1]), *interval(values))],
    }


def keep(brush, slider, entry):
    """Write what was measured of a slider, and its own ranges, to the table of the sliders."""
    measured_sliders.cache_clear()  # another search may have written meanwhile
    table = measured_sliders()
    if slider.ranges != _slider(brush, slider.slider, {}).ranges:
        entry = entry | {"ranges": [list(part) for part in slider.ranges]}
    table.setdefault(slider.slider, {})[brush.name] = entry
    text = ",\n".join(
        f'  "{one}": {{\n' + ",\n".join(f'    "{b}": {json.dumps(table[one][b])}' for b in sorted(table[one])) + "\n  }"
        for one in sorted(table)
    )
    TABLE.write_text(f"{{\n{text}\n}}\n")
    measured_sliders.cache_clear()


def effects(brushes, animals, seeds, write):
    """Print what sliders do to the measures that they are named after, and write it to the table."""
    print("| brush | slider | measure | at 0 | own | at 1 | moves, deviations between seeds | as named |")
    print("|---|---|---|---|---|---|---|---|")
    for name in brushes:
        brush = shipped().get(name)
        named, birds, times = EFFECTS, animals, (SECONDS, SETTLED)
        if brush.model in FORMATIONS:
            named, birds, times = EFFECTS | IN_FORMATION, SKEIN, (FLIGHT, FORMED)
        sliders = [one for one in macros_of(brush) if one.slider in named]
        ends = [brush, *(slider.turned(brush, place) for slider in sliders for place in (0.0, 1.0))]
        wanted = tuple(dict.fromkeys(measure for measure, _ in named.values()))
        values = runs_of(ends, birds, FRESH, seeds, *times, measures=wanted)
        for k, slider in enumerate(sliders):
            measure, sign = named[slider.slider]
            column = wanted.index(measure)
            found = values[1 + 2 * k : 3 + 2 * k, :, column : column + 1]
            own, (low, high), by = values[0, :, column].mean(), found.mean(axis=(1, 2)), float(moved(found)[0])
            words = "hardly acts" if by < SURE else "yes" if sign * (high - low) > 0 else "the other way"
            if write:
                course = [float(f"{one:.3g}") for one in (low, own, high)]
                keep(brush, slider, {measure: course, "moves": {measure: round(by, 1)}})
            print(
                f"| {name} | {slider.slider} | {measure} | {low:.3g} | {own:.3g} | {high:.3g} | {by:.1f} | {words} |",
                flush=True,
            )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("brushes", nargs="*", metavar="BRUSH", help="default: all brushes that have the slider")
    parser.add_argument("--slider", default="order")
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--animals", type=int, default=50)
    parser.add_argument("--general", action="store_true", help="write the result of the general rule")
    parser.add_argument("--write", action="store_true", help="write the result to the table")
    parser.add_argument("--effects", action="store_true", help="measure the other sliders")
    parser.add_argument("--ranges", nargs="+", default=[], metavar="NAME=LOW:HIGH[:times][:OVER]", help="of one brush")
    options = parser.parse_args()
    if options.effects:
        return effects(options.brushes or shipped().names(), options.animals, options.seeds, options.write)
    if options.ranges and len(options.brushes) != 1:
        parser.error("--ranges needs the name of one brush")
    known = with_slider(options.slider)
    if wrong := [name for name in options.brushes if name not in known]:
        parser.error(f"no slider {options.slider!r} has {', '.join(wrong)}; {', '.join(known) or 'no brush'} has it")
    print(f"| brush | initial position | polarization at {', '.join(f'{place:g}' for place in PLACES)} | "
          f"{' | '.join(MEASURES)} | polarization / next largest |")  # fmt: skip
    print("|---" * (len(MEASURES) + 4) + "|")
    for name in options.brushes or known:
        brush = shipped().get(name)
        if options.ranges:
            slider = settle(brush, options.slider, options.seeds, options.animals, options.ranges)
        else:
            slider = _slider(brush, options.slider, *([{}] if options.general else []))
        values = course_of(brush, slider, options.animals, FRESH, options.seeds)
        if options.ranges or options.general or options.write:
            keep(brush, slider, measured(values))
        far, ends = moved(values), interval(values)
        course = ", ".join(f"{value:.2f}" for value in values[:, :, 0].mean(axis=1))
        print(f"| {name} | {slider.value(brush):.2f} | {course} | {' | '.join(f'{one:.1f}' for one in far)} | "
              f"{ratio(far, options.seeds):.1f} ({ends[0]:.1f} to {ends[1]:.1f}) |", flush=True)  # fmt: skip


if __name__ == "__main__":
    main()
