"""How ``flockbrush brush`` is called."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated

import typer

from flockbrush.cli.shared_options import Json, PaletteName, PaletteOption, ThemeName, ThemeOption

brush_app = typer.Typer(
    help="List, show and preview brushes: models of behaviour with their parameters.", no_args_is_help=True
)


class FirstHeadings(str, enum.Enum):
    """How the herds of a path begin."""

    RANDOM, ALIGNED, MILL = "random", "aligned", "mill"


class StartLayout(str, enum.Enum):
    """How a herd stands at first."""

    scatter = "scatter"
    grid = "grid"
    ring = "ring"
    line = "line"


@brush_app.command("list")
def brush_list(json: Json = False):
    """The brushes that come with Flockbrush."""
    from flockbrush.cli.commands import list_brushes

    list_brushes(json)


@brush_app.command("show")
def brush_show(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A brush, or a .brush.toml file.")], json: Json = False
):
    """Show a brush: its parameters with units, and their origin."""
    from flockbrush.cli.commands import show_brush

    show_brush(name, json)


@brush_app.command("check")
def brush_check(
    files: Annotated[
        list[str],
        typer.Argument(metavar="FILE...", help="Brush files, paths between brushes, or names of shipped brushes."),
    ],
):
    """Check brushes and print every problem as `file:line: ...`."""
    from flockbrush.cli.commands import check_brushes

    check_brushes(files)


@brush_app.command("convert")
def brush_convert(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Brush files with a [body] table.")],
    species: Annotated[
        str, typer.Option(metavar="NAME", help="Species that the brushes are made for, whatever their body.")
    ] = "",
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FOLDER", help="File or folder to write, instead of changing the files."
        ),
    ] = None,
):
    """Convert brushes with `[body]` to a species: `made_for`, and a species file where none fits."""
    from flockbrush.cli.brush_conversion import convert_brushes

    convert_brushes(files, species, output)


@brush_app.command("morph")
def brush_morph(
    start: Annotated[str, typer.Argument(metavar="A", help="The brush to start from: a name or a .brush.toml file.")],
    end: Annotated[str, typer.Argument(metavar="B", help="The brush to go to, of the same model.")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="File to write; default: A--B.path.toml, in this folder."),
    ] = None,
    animals: Annotated[int, typer.Option(min=3, max=100_000, metavar="N", help="Animals of each herd.")] = 100,
    seeds: Annotated[int, typer.Option(min=2, max=1000, metavar="N", help="Herds measured at each step.")] = 3,
    steps: Annotated[int, typer.Option(min=2, max=64, metavar="N", help="Steps of the path.")] = 8,
    seconds: Annotated[
        float, typer.Option(min=1, max=3600, metavar="S", help="Simulated seconds of each herd.")
    ] = 20.0,
    wander: Annotated[
        float,
        typer.Option(min=0, max=10, metavar="W", help="Random turning added on the way (rad/√s), none at the ends."),
    ] = 0.0,
    begin: Annotated[
        FirstHeadings,
        typer.Option(help="How herds begin: headings at random, or one way, or a disc that turns."),
    ] = FirstHeadings.RANDOM,
):
    """Measure a path between two brushes along which behaviour changes evenly, beside the straight line.

    Sweeps herds there and back and says when the pair is bistable. Paint of part weight follows the path when it lies
    in a folder `brushes` beside the level. About a minute with the defaults.
    """
    from flockbrush.cli.morph_commands import Trial, morph_brushes

    morph_brushes(start, end, output, Trial(animals, seeds, steps, seconds, begin.value), wander)


@brush_app.command("preview")
def brush_preview(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A brush, or a .brush.toml file.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PNG", help="Picture to write.")],
    agents: Annotated[int, typer.Option(min=1, max=100_000, metavar="N", help="Number of animals.")] = 200,
    seconds: Annotated[float, typer.Option(min=0, max=3600, metavar="S", help="Duration in simulated seconds.")] = 30.0,
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, metavar="K", help="Random seed.")] = 0,
    start: Annotated[StartLayout, typer.Option(help="Arrangement of the animals at the start.")] = StartLayout.scatter,
    theme: ThemeOption = ThemeName.light,
    palette: PaletteOption = PaletteName.own,
):
    """Draw animals under a brush on a plane: at the start, half-way and at the end."""
    from flockbrush.cli.commands import preview_brush

    preview_brush(name, output, agents, seconds, seed, start.value, theme.value, palette.value)
