"""Options of the commands ``flockbrush formation ...``."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from flockbrush.cli.shared_options import (
    Frames,
    Json,
    LevelName,
    Seed,
    ThemeName,
    ThemeOption,
    WindowSize,
    WindowTheme,
    argument,
    grouped,
    option,
)

Pictures = Annotated[list[Path], argument("IMAGES|CLIP...", "Pictures or a video of birds on a plain sky.")]
Every = Annotated[int, option("K", "Use every K-th frame of a video.", min=1)]
FormationFile = Annotated[Path, argument("X.json", "Formation file made by extract.")]

formation_app = typer.Typer(help="Detect, extract and fly line formations of birds.", no_args_is_help=True)


@formation_app.command("detect")
def formation_detect(
    files: Pictures,
    out: Annotated[Path, option("-o", "--out", "MARKS.csv", "Table of marked birds to write.")],
    every: Every = 1,
    json: Json = False,
):
    """Detect birds on a plain sky, track them from frame to frame, and write their positions."""
    from flockbrush.cli.formation_commands import detect

    detect(files, out, every, json)


@formation_app.command("mark")
def formation_mark(
    files: Pictures,
    out: Annotated[
        Path | None,
        option("-o", "--out", "MARKS.csv", "Table of marked birds to write; existing marks are loaded first."),
    ] = None,
    every: Every = 1,
    theme: WindowTheme = None,
    size: WindowSize = "1280x720",
    frames: Frames = None,
):
    """Open a window to correct detected birds by clicks, frame by frame; it shows their formation."""
    from flockbrush.studio.start_marking import mark_birds

    return mark_birds(files, out, every, None if theme is None else theme.value, size, frames)


@formation_app.command("extract")
def formation_extract(
    marks: Annotated[
        Path, argument("MARKS.csv", "Table with the columns frame, bird and x_px, y_px (or x_b, y_b in wingspans).")
    ],
    out: Annotated[Path | None, option("-o", "--out", "X.json", "Formation file to write.")] = None,
    plot: Annotated[Path | None, option("PNG", "Picture to write, with birds, leader, outliers and curve.")] = None,
    heading: Annotated[
        str | None,
        option(
            "WAY",
            "Heading of the birds: up, down, left, right, degrees, or auto (estimated from the shape). "
            "Default: auto for marks in pixels, up for marks in wingspans.",
        ),
    ] = None,
    wingspan: Annotated[float | None, option("PX", "Wingspan, pixels.")] = None,
    samples: Annotated[
        int | None, option("K", "Number of RANSAC samples; default: all samples.", min=1, max=10**6)
    ] = None,
    json: Json = False,
):
    """Extract the formation of marked birds in each frame: spacing, leader, curve and outliers."""
    from flockbrush.cli.formation_commands import extract_formation

    extract_formation(marks, out, plot, heading, wingspan, samples, json)


ShapeName = enum.Enum("ShapeName", {"V": "V", "U": "U", "J": "J", "line": "line"}, type=str)  # of textbooks


@formation_app.command("initiate")
def formation_initiate(
    shape: Annotated[list[ShapeName] | None, option("Shape; may be repeated. Default: all.")] = None,
    birds: Annotated[
        list[int] | None, option("N", "Number of birds; may be repeated. Default: 9, 14, 16, 28, 41.", min=2, max=300)
    ] = None,
    runs: Annotated[int, option("K", "Number of flocks of each shape and size.", min=1, max=10_000)] = 20,
    seed: Annotated[int, option("K", "Random seed of the first flock.", min=0, max=2**31)] = 2000,
    ablate: Annotated[
        bool, option("--ablate", "Also test without each rule, one at a time, and without all additions to the paper.")
    ] = (False),
    out: Annotated[Path | None, option("-o", "--out", "CSV", "Table to write.")] = None,
    json: Json = False,
):
    """Simulate how scattered birds form up, many times; print how many flocks converge and how fast."""
    from flockbrush.cli.formation_commands import initiation

    initiation([s.value for s in shape or ShapeName], birds or [9, 14, 16, 28, 41], runs, seed, ablate, out, json)


@formation_app.command("brush")
def formation_brush(
    formation: FormationFile,
    out: Annotated[Path, option("-o", "--out", "NAME.brush.toml", "Brush file to write.")],
    like: Annotated[str, option("BRUSH", "Brush to take speed, body and wingspan from.")] = "geese",
):
    """Make a brush with the shape, slope, spacing and deviation of a formation."""
    from flockbrush.cli.formation_commands import make_brush

    make_brush(formation, out, like)


@formation_app.command("film")
def formation_film(
    level: LevelName,
    out: Annotated[Path, option("-o", "--out", "MP4", "Video to write (.mp4), or a picture of the last frame (.png).")],
    seconds: Annotated[float, option("S", "Duration, simulated seconds.", min=0.1, max=3600)] = 60.0,
    seed: Seed = None,
    theme: ThemeOption = ThemeName.light,
):
    """Make a close-up video of a flock. The leader is yellow; colours show the power that each bird saves."""
    from flockbrush.cli.formation_commands import film_level

    film_level(level, out, seconds, seed, theme.value)


# solver of key shapes
KeyShapes = enum.Enum("KeyShapes", {"proximal": "proximal", "marquardt": "levenberg-marquardt"}, type=str)


@dataclass
class FlightOptions:
    """A flight of a formation, by its options."""

    birds: Annotated[
        int | None, option("N", "Number of birds; default: the number of marked birds.", min=2, max=500)
    ] = None
    frames: Annotated[int, option("F", "Number of frames.", min=1, max=10**6)] = 250
    fps: Annotated[float, option("F", "Frames per second.", min=0.1, max=1000)] = 25.0
    seed: Annotated[int, option("K", "Random seed.", min=0, max=2**63 - 1)] = 0
    left: Annotated[int | None, option("K", "Number of birds left of the leader.", min=0)] = None
    exchange: Annotated[bool, option("--exchange", "Exchange the left and the right side.")] = False
    method: Annotated[
        KeyShapes, option("Solver: levenberg-marquardt (the paper's) or proximal (always finds a solution).")
    ] = KeyShapes.proximal
    epsilon: Annotated[
        float, option("E", "Largest deviation of the savings from the range in the example.", min=0, max=1)
    ] = 0.1
    lateral: Annotated[
        bool, option("Lateral distances vary as in the example; with --no-lateral they are constant.")
    ] = True


@formation_app.command("fly")
@grouped
def formation_fly(
    formation: FormationFile,
    flight: FlightOptions = FlightOptions(),  # noqa: B008  its fields become the options
    out: Annotated[Path | None, option("-o", "--out", "CSV", "Trajectory to write.")] = None,
    plot: Annotated[Path | None, option("PNG", "Picture to write, with six frames of the flight.")] = None,
    json: Json = False,
):
    """Fly a formation with any number of birds, and report whether spacing and savings stay within their ranges."""
    from flockbrush.cli.formation_commands import fly

    fly(formation, flight, out, plot, json)
