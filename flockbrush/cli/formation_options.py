"""How ``flockbrush formation`` is called."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from flockbrush.cli.shared_options import Json, LevelName, Seed, ThemeName, ThemeOption, grouped

formation_app = typer.Typer(help="Line formations of birds: detect, extract and fly them.", no_args_is_help=True)


@formation_app.command("detect")
def formation_detect(
    files: Annotated[
        list[Path], typer.Argument(metavar="IMAGES|CLIP...", help="Pictures or a video of birds on a plain sky.")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="MARKS.csv", help="Table of marked birds to write.")],
    every: Annotated[int, typer.Option(min=1, metavar="K", help="Use every N-th frame of a video.")] = 1,
    json: Json = False,
):
    """Find birds on a plain sky, follow them from frame to frame, and write where they are."""
    from flockbrush.cli.formation_commands import detect

    detect(files, out, every, json)


@formation_app.command("mark")
def formation_mark(
    files: Annotated[
        list[Path], typer.Argument(metavar="IMAGES|CLIP...", help="Pictures or a video of birds on a plain sky.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", metavar="MARKS.csv", help="Table of marked birds to write; existing marks in it are loaded."
        ),
    ] = None,
    every: Annotated[int, typer.Option(min=1, metavar="K", help="Use every N-th frame of a video.")] = 1,
    theme: Annotated[ThemeName | None, typer.Option(help="Colours; default: as in the last session.")] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Size of the window in pixels.")] = "1280x720",
    frames: Annotated[int | None, typer.Option(min=0, metavar="N", help="Close after this number of frames.")] = None,
):
    """Correct the positions of detected birds by clicks, frame by frame, and see their formation."""
    from flockbrush.studio.start_marking import mark_birds

    return mark_birds(files, out, every, None if theme is None else theme.value, size, frames)


@formation_app.command("extract")
def formation_extract(
    marks: Annotated[
        Path,
        typer.Argument(
            metavar="MARKS.csv", help="Table with the columns frame, bird and x_px, y_px (or x_b, y_b in wingspans)."
        ),
    ],
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="X.json", help="Formation file to write.")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Picture to write, with birds, leader, outliers and curve.")
    ] = None,
    heading: Annotated[
        str | None,
        typer.Option(
            metavar="WAY",
            help="Heading: up, down, left, right, degrees, or auto: the way their shape tells. Default: auto for marks "
            "in pixels, up for marks in wingspans.",
        ),
    ] = None,
    wingspan: Annotated[float | None, typer.Option(metavar="PX", help="Wingspan in pixels.")] = None,
    samples: Annotated[
        int | None, typer.Option(min=1, max=10**6, metavar="K", help="Number of RANSAC samples; default: all samples.")
    ] = None,
    json: Json = False,
):
    """Extract the formation of marked birds: spacing, leader, curve, outliers, frame by frame."""
    from flockbrush.cli.formation_commands import extract_formation

    extract_formation(marks, out, plot, heading, wingspan, samples, json)


class ShapeName(str, enum.Enum):
    """Shapes of the textbook."""

    V = "V"
    U = "U"
    J = "J"
    line = "line"


@formation_app.command("initiate")
def formation_initiate(
    shape: Annotated[list[ShapeName] | None, typer.Option(help="Shape; may be repeated. Default: all.")] = None,
    birds: Annotated[
        list[int] | None,
        typer.Option(min=2, max=300, metavar="N", help="Number of birds; may be repeated. Default: 9, 14, 16, 28, 41."),
    ] = None,
    runs: Annotated[
        int, typer.Option(min=1, max=10_000, metavar="K", help="Number of flocks of each shape and size.")
    ] = 20,
    seed: Annotated[int, typer.Option(min=0, max=2**31, metavar="K", help="Random seed of the first flock.")] = 2000,
    ablate: Annotated[
        bool, typer.Option("--ablate", help="Leave out each rule in turn, and all additions to the paper.")
    ] = (False),
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="CSV", help="Table to write.")] = None,
    json: Json = False,
):
    """Let scattered birds form up many times; count the converged flocks and their times."""
    from flockbrush.cli.formation_commands import initiation

    initiation([s.value for s in shape or ShapeName], birds or [9, 14, 16, 28, 41], runs, seed, ablate, out, json)


@formation_app.command("brush")
def formation_brush(
    formation: Annotated[Path, typer.Argument(metavar="X.json", help="Formation file made by extract.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="NAME.brush.toml", help="Brush file to write.")],
    like: Annotated[
        str, typer.Option(metavar="BRUSH", help="Brush whose speed, body and wingspan are used.")
    ] = "geese",
):
    """Make a brush of a formation: its shape, slope, spacing and deviation."""
    from flockbrush.cli.formation_commands import make_brush

    make_brush(formation, out, like)


@formation_app.command("film")
def formation_film(
    level: LevelName,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="MP4", help="Video to write; .png: its last frame.")],
    seconds: Annotated[
        float, typer.Option(min=0.1, max=3600, metavar="S", help="Duration in simulated seconds.")
    ] = 60.0,
    seed: Seed = None,
    theme: ThemeOption = ThemeName.light,
):
    """Film a flock from close by, with beating wings; the leader is yellow, colours show the power each bird saves."""
    from flockbrush.cli.formation_commands import film_level

    film_level(level, out, seconds, seed, theme.value)


class KeyShapes(str, enum.Enum):
    """How key shapes are solved."""

    proximal = "proximal"
    levenberg_marquardt = "levenberg-marquardt"


@dataclass
class FlightOptions:
    """A flight of a formation, as a person asked for it."""

    birds: Annotated[
        int | None, typer.Option(min=2, max=500, metavar="N", help="Number of birds; default: as many as marked.")
    ] = None
    frames: Annotated[int, typer.Option(min=1, max=10**6, metavar="F", help="Number of frames.")] = 250
    fps: Annotated[float, typer.Option(min=0.1, max=1000, metavar="F", help="Frames per second.")] = 25.0
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, metavar="K", help="Random seed.")] = 0
    left: Annotated[int | None, typer.Option(min=0, metavar="K", help="Number of birds left of the leader.")] = None
    exchange: Annotated[bool, typer.Option("--exchange", help="Exchange left and right.")] = False
    method: Annotated[
        KeyShapes, typer.Option(help="levenberg-marquardt: the paper's method; proximal: always has a solution.")
    ] = KeyShapes.proximal
    epsilon: Annotated[
        float, typer.Option(min=0, max=1, help="Largest deviation of the savings from the range of the example.")
    ] = 0.1
    lateral: Annotated[
        bool, typer.Option(help="Lateral distances change as in the example; with --no-lateral they are constant.")
    ] = True


@formation_app.command("fly")
@grouped
def formation_fly(
    formation: Annotated[Path, typer.Argument(metavar="X.json", help="Formation file made by extract.")],
    flight: FlightOptions = FlightOptions(),  # noqa: B008  its fields become the options
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="CSV", help="Trajectory to write.")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Picture to write, with six moments of the flight.")
    ] = None,
    json: Json = False,
):
    """Fly a formation with any number of birds, and report whether the flight kept its ranges."""
    from flockbrush.cli.formation_commands import fly

    fly(formation, flight, out, plot, json)
