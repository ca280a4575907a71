"""Implementation of ``flockbrush formation ...``: detect birds, extract formations, make flights."""

from __future__ import annotations

import csv
import io
import time
from contextlib import nullcontext
from pathlib import Path

import numpy as np

import flockbrush
from flockbrush.behaviours.formation.extraction import extract
from flockbrush.behaviours.formation.formation_shapes import load_formation, textbook, to_json
from flockbrush.behaviours.formation.marked_birds import read_marks
from flockbrush.behaviours.formation.reaching import FormingRules
from flockbrush.behaviours.formation.steady_flight import Drawing, SteadyFlight
from flockbrush.engine.files import claimed, held, need_ending, output_problems, refused, sha256_of, write_text
from flockbrush.engine.problems import ProblemsError
from flockbrush.film.track_table import about_file
from flockbrush.output.formation_brush import write_brush
from flockbrush.output.trajectory_table import about_table, write_about
from flockbrush.render import write_png
from flockbrush.render.canvas import Canvas
from flockbrush.render.style import PALETTE, rgb, theme_of
from flockbrush.runs.terminal import number, print_json, progress, say, show, table
from flockbrush.systems.initiation import initiate, random_flock, target_of

WINGSPAN, SPEED, HEIGHT = 1.6, 16.0, 50.0  # m, m/s, m: of grey geese, for flights in metres


def detect(paths, out, every, json):
    """Detect birds in pictures or a video and write their positions."""
    from flockbrush.film.birds_in_sky import mark

    need_ending(out, ".csv")
    with claimed([out], paths):
        rows, span, lost = mark(paths, every)
        lines = [
            (frame, bird, f"{patch.x:.1f}", f"{patch.y:.1f}", f"{patch.area:.0f}", f"{span:.1f}")
            for frame, bird, patch in rows
        ]
        _write_table(out, ["frame", "bird", "x_px", "y_px", "area_px", "wingspan_px"], lines)
        for line in lost[:20]:
            say(line)
        frames = len({row[0] for row in rows})
        birds = len(rows) // frames
        if json:
            facts = {"frames": frames, "birds": birds, "wingspan_px": span, "left_out": len(lost), "out": str(out)}
            print_json(facts)
        else:
            say(f"{birds} birds in {frames} frames, wingspan about {span:.1f} pixels: {out}")


def _write_table(out, heads, rows):
    """Write a table as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([heads, *rows])
    write_text(out, text.getvalue())


def extract_formation(marks_path, out, plot, heading, wingspan, samples, json):
    """Extract a formation from marks; write and print it."""
    need_ending(out, ".json")
    need_ending(plot, ".png")
    with claimed([path for path in (out, plot) if path], [marks_path]):
        marks, used = read_marks(marks_path, heading, wingspan)
        provenance = {
            "marks": Path(marks_path).name, "sha256": sha256_of(marks_path), **used,
            "method": "all samples" if samples is None else f"RANSAC, {samples} samples",
            "made_by": f"flockbrush {flockbrush.__version__}",
        }  # fmt: skip
        name = Path(out if out else marks_path).name.split(".")[0]
        formation = extract(marks, name, provenance, samples)
        if out:
            write_text(out, to_json(formation))
        if plot:
            draw_formation(plot, formation)
        if json:
            print_json({"kinds": formation.kinds(), "frames": [_summary(frame) for frame in formation.frames]})
            return
        columns = "frame", "shape", "birds", "leader", "outliers", "stragglers", "spacing", "deviation", "why"
        lines = table(*columns, right=("birds",))
        for frame in formation.frames:
            s = _summary(frame)
            lines.add_row(
                s["frame"], s["kind"], str(s["birds"]), s["leader"],
                " ".join(s["outliers"]) or "-", " ".join(s["stragglers"]) or "-",
                f"{number(frame.spacing[0], 3)} ± {number(frame.spacing[1], 2)}",
                f"{number(frame.deviation[0], 2)} ± {number(frame.deviation[1], 2)}", s["why"],
            )  # fmt: skip
        show(lines)
        if used["heading_from"] == "the shape":
            way = used["heading_degrees"]
            say(f"heading {way:.0f} degrees (0 right, 90 up), estimated from the shape; if it is wrong, give --heading")


def _summary(frame):
    return {
        "frame": frame.frame, "kind": frame.kind, "why": frame.why, "birds": len(frame.birds),
        "leader": frame.birds[frame.leader], "outliers": [frame.birds[k] for k in frame.outliers],
        "stragglers": [frame.birds[k] for k in frame.stragglers],
        "spacing": frame.spacing, "deviation": frame.deviation,
        "curve": None if frame.curve is None else {"model": frame.curve.model, "numbers": frame.curve.numbers},
    }  # fmt: skip


def fly(formation_path, options, out, plot, json):
    """A steady flight of a formation, with `FlightOptions`."""
    fps = options.fps
    need_ending(out, ".csv")
    need_ending(plot, ".png")
    with claimed([*([out, about_file(out)] if out else []), *([plot] if plot else [])], [formation_path]):
        formation = load_formation(formation_path)
        birds = options.birds or len(formation.frames[0].birds)
        began = time.perf_counter()
        drawing = Drawing(epsilon=options.epsilon, method=options.method.value, lateral=options.lateral)
        flight = SteadyFlight(formation, birds, options.seed, options.left, drawing, options.exchange)
        places = flight.frames(options.frames, fps)
        report = flight.report(places, fps) | {"seconds_to_make": time.perf_counter() - began}
        if out:
            lines = []
            for f, place in enumerate(places):
                north = SPEED * f / fps  # m
                for k, (x, y) in enumerate(place):
                    metres = f"{WINGSPAN * x:.4f}", f"{WINGSPAN * y + north:.4f}", f"{HEIGHT:g}"
                    lines.append((f, k, f"{x:.6f}", f"{y:.6f}", f"{f / fps:.6f}", k + 1, *metres))
            _write_table(out, ["frame", "bird", "x_b", "y_b", "time", "id", "x", "y", "z"], lines)
            write_about(out, about_table(fps))
        if plot:
            _draw_flight(plot, places, flight)
        if json:
            print_json(report)
            return
        rows = ((key.replace("_", " "), value) for key, value in report.items())
        show(table("measure", "value", rows=rows, right=("value",)))


def make_brush(formation_path, out, like):
    """Write a brush of a formation."""
    with claimed([out], [formation_path, *([like] if like is not None and Path(like).is_file() else [])]):
        formation = load_formation(formation_path)
        learned = write_brush(formation, out, like, str(formation.provenance.get("marks", formation_path.name)))
    facts = (f"{key} {value if isinstance(value, str) else round(value, 3)}" for key, value in learned.items())
    say(f"{out}: {', '.join(facts)}")


def film_level(level, out, seconds, seed, theme):
    """Write a video of the flock of a level, seen from near by."""
    if out.suffix.lower() not in (".mp4", ".png"):
        raise refused(out, "the name must end in .mp4 (video) or .png (picture)")
    if problems := output_problems([out]):
        raise ProblemsError(problems)
    from flockbrush.output.formation_film import film

    alone = held(out) if out.suffix.lower() == ".png" else nullcontext()  # a film holds its own file
    with alone, progress("filming", int(seconds * 16)) as moved:
        made = film(level, out, seconds, seed, theme=theme, say=moved)
    say(f"{out}: {made['frames']} frames; mean power saved per bird at the end {number(made['saved'], 3)} (sum of g)")


ADDITIONS = {
    "all rules": {},
    "no hidden-point removal": {"hidden_points": False},
    "no separation drive": {"separation": False},
    "any bird may be a reference": {"ahead_only": False},
    "the nearest is the reference, every frame": {"loyal": False},
    "K always positive": {"signed_gain": False},
    "without a reference: straight on": {"homing": False},
    "arms of any length": {"capacity": False},
    "r without limit in eq. 6": {"farthest": float("inf")},
    "no look ahead": {"look_ahead": 0.0},
    "any direction off the track": {"onward": float(np.pi)},
    "not parted in height": {"apart": False},
}
PAPER = {
    "ahead_only": False, "loyal": False, "signed_gain": False, "homing": False, "capacity": False,
    "farthest": float("inf"), "look_ahead": 0.0, "onward": float(np.pi), "apart": False,
}  # fmt: skip


def initiation(kinds, birds, runs, seed, ablate, out, json):
    """Run many initiations from random positions; print the converged flocks, their times and distances."""
    need_ending(out, ".csv")
    with claimed([out] if out else []):
        without = {**ADDITIONS, "the paper alone": PAPER} if ablate else {"all rules": {}}
        rows = []
        with progress("initiation", len(without) * len(kinds) * len(birds)) as moved:
            for name, changes in without.items():
                for kind in kinds:
                    for n in birds:
                        moved(len(rows), f"{kind} of {n}, {name}")
                        cell = _cell(kind, n, runs, seed, FormingRules(**changes))
                        rows.append({"rules": name, "shape": kind, "birds": n, **cell})
        if out:
            _write_table(out, list(rows[0]), [row.values() for row in rows])
        if json:
            print_json({"cells": rows})
            return
        lines = table(*[name.replace("_", " ") for name in rows[0]], right=("birds", "runs", "converged"))
        for row in rows:
            lines.add_row(*[number(value, 3) if isinstance(value, (int, float)) else value for value in row.values()])
        show(lines)


def _cell(kind, birds, runs, seed, rules):
    """One row of the table: a shape, a number of birds, a set of rules."""
    goal = target_of(*textbook(kind, birds))
    flown = [initiate(*random_flock(birds, seed + run), goal, rules) for run in range(runs)]
    frames = [one.frames for one in flown if one.frames >= 0]
    return {
        "runs": runs,
        "converged": len(frames),
        "median_frames": float(np.median(frames)) if frames else float("nan"),
        "slowest": max(frames) if frames else float("nan"),
        "least_distance": min(one.least for one in flown),
        "longest_flock": max(one.longest for one in flown),
    }


# pictures ---------------------------------------------------------------------------------

PANEL, EDGE, SHOWN = 420, 34, 6


def draw_formation(path, formation):
    """Draw up to six frames of a formation: birds, leader, outliers and the curve."""
    frames = formation.frames
    chosen = [frames[k] for k in np.unique(np.linspace(0, len(frames) - 1, SHOWN).round().astype(int))]
    panels = [(_title(frame), np.c_[frame.x, frame.y], frame.leader, frame.outliers, frame.curve) for frame in chosen]
    _draw_panels(path, panels)


def _title(frame):
    return f"{frame.frame}: {frame.kind}" + ("" if frame.curve else f" ({frame.why})")


def _draw_flight(path, places, flight):
    """Draw six frames of a flight; birds that change sides at any time have a ring."""
    chosen = np.unique(np.linspace(0, len(places) - 1, SHOWN).round().astype(int))
    ringed = {bird for crossing in flight.crossings if crossing is not None for bird in crossing.birds.tolist()}
    _draw_panels(path, [(f"frame {k}", places[k], flight.left, ringed, None) for k in chosen])


def _draw_panels(path, panels):
    """Draw panels (title, points, leader, birds with a ring, curve) at one scale, in rows of three."""
    look = theme_of("light")
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    low = np.min([points.min(axis=0) for _, points, *_ in panels], axis=0) - 1.5
    high = np.max([points.max(axis=0) for _, points, *_ in panels], axis=0) + 1.5
    scale = (PANEL - 20) / (high - low).max()
    tall = int((high - low)[1] * scale) + EDGE + 20
    image = np.full((rows * tall + 10, columns * PANEL + 10, 3), rgb(look.paper), np.uint8)
    canvas = Canvas(image)
    for k, (title, points, leader, ringed, curve) in enumerate(panels):
        corner = np.array([k % columns * PANEL + 10, k // columns * tall + EDGE], float)
        canvas.words(title[:60], corner + (0, -EDGE / 2), 17, look.ink, anchor=(0, 0.5))

        def at(xy, corner=corner):
            return corner + (np.asarray(xy) - (low[0], high[1])) * (scale, -scale)

        if curve is not None:
            x = np.linspace(points[:, 0].min() - 0.5, points[:, 0].max() + 0.5, 200)
            canvas.line(at(np.c_[x, curve.y(x)]), 2, rgb(PALETTE[0]), 0.6)
        canvas.line([at((low[0] + 0.5, low[1] + 0.5)), at((low[0] + 1.5, low[1] + 0.5))], 2, look.muted)
        canvas.words("1 wingspan", at((low[0] + 1.7, low[1] + 0.5)), 13, look.muted, anchor=(0, 0.5))
        for bird, xy in enumerate(points):
            _bird(canvas, at(xy), scale, look.leader if bird == leader else look.ink, look.outline)
            if bird in ringed:
                canvas.ring(at(xy), max(8.0, 0.7 * scale), 2, look.predator)
    write_png(path, image)


def _bird(canvas, at, scale, colour, rim):
    """Draw a bird seen from above, one wingspan wide, that flies towards the top of the picture."""
    b = max(scale, 14.0) / 2
    wing = np.array(
        [(-1, 0.35), (-0.5, -0.05), (0, -0.12), (0.5, -0.05), (1, 0.35), (0.45, 0.25), (0, 0.3), (-0.45, 0.25)]
    )
    canvas.area(at + b * wing, colour)
    canvas.line(at + b * wing, 1, rim, 0.7, closed=True)
    canvas.line([at + (0, -0.35 * b), at + (0, 0.55 * b)], max(1.5, 0.16 * b), colour)
