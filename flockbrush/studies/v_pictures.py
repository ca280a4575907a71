"""Pictures of flocks that fly by the V rules: sample formations, how one forms, distances over time.

They show what figures 3, 4 and 5(f) of Nathan & Barbosa 2008 show.  Birds fly up the page; the line through a body is
its wings, and dashed lines are the straight lines that the indicators count.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flockbrush.behaviours.v_rules.flights import fly, starts
from flockbrush.behaviours.v_rules.indicators import SHAPES, indicators, leaders_of, lines_of
from flockbrush.engine.files import whole
from flockbrush.output.figures import ChartCurve, CurveChart, drawing_problems, figure_of, write_figure
from flockbrush.render import write_png
from flockbrush.render.canvas import Canvas
from flockbrush.render.drawn_terrain import nice
from flockbrush.render.style import PALETTE, rgb, theme_of
from flockbrush.render.text import shortened
from flockbrush.studies.flock_parameters import FlockParameters

CELL = 430, 330  # pixels of one formation
GAP, HEAD, FOOT = 18, 58, 30
COLUMNS = 4
LARGEST = 26.0  # pixels a wingspan
TRACED = 10  # flocks whose distance is drawn over time


class SampleFormation(NamedTuple):
    """A formation to draw."""

    title: str
    xyz: np.ndarray  # (n, 3) wingspans
    rules: FlockParameters


def draw_formations(path, title, samples, theme="light", same_scale=False):
    """Draw formations side by side.

    Parameters
    ----------
    samples : list of Sample
    same_scale : bool
        One scale for all, and one middle: moments of one flock.
    """
    look = theme_of(theme)
    columns = min(COLUMNS if len(samples) != 6 else 3, max(len(samples), 1))
    rows = max(1, math.ceil(len(samples) / columns))
    size = HEAD + rows * (CELL[1] + GAP), columns * (CELL[0] + GAP) + GAP
    canvas = Canvas(np.full((*size, 3), rgb(look.paper), np.uint8))
    canvas.words(shortened(title, 21, size[1] - 2 * GAP), (GAP, HEAD / 2), 21, look.ink, anchor=(0, 0.5))
    boxes = [_box(sample.xyz) for sample in samples]
    if same_scale and boxes:
        low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
        boxes = [(low, high)] * len(samples)
    for k, (sample, box) in enumerate(zip(samples, boxes, strict=True)):
        corner = GAP + k % columns * (CELL[0] + GAP), HEAD + k // columns * (CELL[1] + GAP)
        _formation(canvas, corner, sample, box, look)
    write_png(path, canvas.image)


def _box(xyz):
    return xyz[:, :2].min(0) - 1.0, xyz[:, :2].max(0) + 1.0


def _formation(canvas, corner, sample, box, look):
    left, top = corner
    room = np.array([CELL[0], CELL[1] - FOOT], float)
    low, high = box
    scale = min(LARGEST, *(room / np.maximum(high - low, 1e-9)))
    middle = np.array([left, top]) + room / 2

    def at(xy):
        return middle + (np.asarray(xy, float)[..., :2] - (low + high) / 2) * (scale, -scale)

    frame = [(left, top), (left + CELL[0], top), (left + CELL[0], top + CELL[1]), (left, top + CELL[1])]
    canvas.line(frame, 1, look.muted, 0.35, closed=True)
    for a, b in lines_of(sample.xyz, sample.rules):
        canvas.line(at(sample.xyz[[a, b]]), 1.3, rgb(PALETTE[0]), 0.7, dash=(5, 4))
    leads = leaders_of(sample.xyz, sample.rules)
    wing = 0.5 * scale
    for centre, lead in zip(at(sample.xyz), leads, strict=True):
        colour = rgb(PALETTE[5]) if lead else look.ink
        canvas.line([centre - (wing, 0), centre + (wing, 0)], max(1.2, 0.06 * scale), colour)
        canvas.disc(centre, max(1.8, 0.13 * scale), colour)
    used = canvas.words(sample.title, (left + 10, top + CELL[1] - FOOT / 2), 15, look.ink, anchor=(0, 0.5))
    spans = nice(60 / scale)
    words = f"{spans:g} wingspan" + ("s" if spans != 1 else "")
    end = left + CELL[0] - 10, top + CELL[1] - FOOT / 2
    canvas.scale_bar(end, spans * scale, words, look, CELL[0] - used - 40, FOOT)


# of a sweep ----------------------------------------------------------------------------------


def draw_sweep(sweep, rows, folder, theme="light") -> list[Path]:
    """All three pictures for the runs of a sweep; flocks are flown again to draw them."""
    fine = [(scenario, row) for scenario, row in rows if row["status"] == "ok" and "shape" in row["measures"]]
    if not fine:
        return []
    folder, written = Path(folder), []

    def picture(name, draw, *arguments, **options):
        with whole(folder / name) as temporary:
            draw(temporary, *arguments, theme=theme, **options)
        written.append(folder / name)

    samples = _one_of_each_shape(sweep, fine)
    if samples:
        picture("formations.png", draw_formations, "Sample formations; lead birds in another colour", samples)
    moments = _moments(
        max((scenario for scenario, _ in fine), key=lambda s: (s.parameters["angle"], -s.parameters["birds"]))
    )
    picture("forming.png", draw_formations, "How one flock forms", moments, same_scale=True)
    scenario = _middle(fine)
    of = [row["seed"] for other, row in fine if other is scenario][:TRACED]
    varied = ", ".join(f"{name} {value}" for name, value in scenario.varied.items())
    panel = CurveChart(f"distance (wingspans), {varied}", "time steps", _traces(scenario, of))
    if not drawing_problems(folder):
        title = f"Mean distance to the nearest line, {len(of)} flocks"
        written.append(folder / "distance_over_time.png")
        write_figure(
            written[-1], figure_of([panel], title, "one line for each flock, from a seed of its own", theme=theme)
        )
    return written


def _flown(parameters, seed, every=0, steps=None):
    spec = FlockParameters(**parameters)
    begin = starts([seed], spec.birds, spec, spec.side, spec.start == "apart")
    return spec, fly(begin, [seed], spec, spec.steps if steps is None else steps, every)


def _one_of_each_shape(sweep, fine):
    """The first flock of each shape, those that settled before those that did not."""
    samples = []
    for shape in SHAPES:
        entries = [entry for entry in fine if entry[1]["measures"]["shape"] == shape]
        if not entries:
            continue
        scenario, row = min(entries, key=lambda e: (-e[1]["measures"].get("stabilised", 0), e[0].parameters["birds"]))
        spec, flights = _flown(scenario.parameters, row["seed"])
        title = f"{shape}: {spec.birds} birds, {spec.angle:g}°, seed {row['seed']}"
        if not flights.settled[0]:
            title += ", not settled"
        samples.append(SampleFormation(title, flights.xyz[0], spec))
    return samples


def _moments(scenario, count=6):
    """One flock from its start to its rest."""
    spec, whole_way = _flown(scenario.parameters, 0)
    last = int(whole_way.steps[0])
    every = max(1, last // (count - 1))
    _, flights = _flown(scenario.parameters, 0, every, every * (count - 1))
    return [SampleFormation(f"after {k * every} steps", xyz, spec) for k, xyz in enumerate(flights.series[0])]


def _middle(fine):
    """The scenario whose distances are drawn over time: of the smallest angle, with the middle number of birds."""
    scenarios = list({id(scenario): scenario for scenario, _ in fine}.values())
    angle = min(scenario.parameters["angle"] for scenario in scenarios)
    scenarios = sorted((s for s in scenarios if s.parameters["angle"] == angle), key=lambda s: s.parameters["birds"])
    return scenarios[len(scenarios) // 2]


def _traces(scenario, seeds):
    curves = []
    for seed in seeds:
        steps = scenario.parameters["steps"]
        every = max(1, steps // 200)
        spec, flights = _flown(scenario.parameters, seed, every)
        distance = indicators(flights.series[0], spec).distance
        curves.append(ChartCurve("", np.arange(len(distance)) * float(every), distance, width=1.0))
    return curves
