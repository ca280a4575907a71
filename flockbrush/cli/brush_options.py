"""Options of the commands ``flockbrush brush ...``."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated

import typer

from flockbrush.cli.shared_options import Json, PaletteName, PaletteOption, ThemeName, ThemeOption, argument, option

brush_app = typer.Typer(
    help="List, show and preview brushes: models of behaviour with their parameters.", no_args_is_help=True
)


# how the herds of a path begin
FirstHeadings = enum.Enum("FirstHeadings", {"random": "random", "aligned": "aligned", "mill": "mill"}, type=str)
# arrangement of a herd at the start
StartLayout = enum.Enum("StartLayout", {"scatter": "scatter", "grid": "grid", "ring": "ring", "line": "line"}, type=str)


@brush_app.command("list")
def brush_list(json: Json = False):
    """List the shipped brushes."""
    from flockbrush.cli.level_commands import list_brushes

    list_brushes(json)


@brush_app.command("show")
def brush_show(name: Annotated[str, argument("NAME", "Brush: a name or a .brush.toml file.")], json: Json = False):
    """Show the parameters of a brush with their units, and where the values come from."""
    from flockbrush.cli.level_commands import show_brush

    show_brush(name, json)


@brush_app.command("check")
def brush_check(
    files: Annotated[list[str], argument("FILE...", "Brush files, .path.toml files, or names of shipped brushes.")],
):
    """Check brushes and print every problem as `file:line: ...`."""
    from flockbrush.cli.brush_checks import check_brushes

    check_brushes(files)


@brush_app.command("convert")
def brush_convert(
    files: Annotated[list[Path], argument("FILE...", "Brush files with a `body` table.")],
    species: Annotated[str, option("NAME", "Species to write in made_for; default: the species whose body fits.")] = "",
    output: Annotated[
        Path | None,
        option("-o", "--output", "FOLDER", "Folder for the converted files; default: the files are changed in place."),
    ] = None,
):
    """Convert brushes with a `body` table to `made_for`; write a species file if no species has that body."""
    from flockbrush.cli.convert_brushes import convert_brushes

    convert_brushes(files, species, output)


@brush_app.command("morph")
def brush_morph(
    start: Annotated[str, argument("A", "First brush: a name or a .brush.toml file.")],
    end: Annotated[str, argument("B", "Second brush, of the same model.")],
    output: Annotated[
        Path | None,
        option(
            "-o", "--output", "FILE", "Path file to write: A--B.path.toml in any folder; default: in the current one."
        ),
    ] = None,
    animals: Annotated[
        list[int] | None,
        option(
            "N",
            "Number of animals in each herd; default: 100. Repeat it for several sizes: steps are placed where "
            "any of them changes.",
            min=3,
            max=100_000,
        ),
    ] = None,
    seeds: Annotated[
        int, option("N", "Number of herds measured at each step; of larger herds fewer.", min=2, max=1000)
    ] = 3,
    steps: Annotated[
        int | None, option("N", "Number of steps of the path; default: those that paint takes.", min=2, max=64)
    ] = None,
    seconds: Annotated[float, option("S", "Duration of each herd, simulated seconds.", min=1, max=3600)] = 20.0,
    wander: Annotated[
        float, option("W", "Random turning added along the path, rad/√s; zero at both ends.", min=0, max=10)
    ] = 0.0,
    first: Annotated[
        list[str] | None,
        option(
            "NAME", "Parameters whose names begin so change in the first half of the path, all others in the second."
        ),
    ] = None,
    begin: Annotated[
        FirstHeadings, option("Start of the herds: random headings, a common heading, or a turning disc.")
    ] = FirstHeadings.random,
):
    """Measure a path between two brushes along which behaviour changes evenly; compare it with the straight line.

    If the path is uneven, herds are swept from A to B and back, and the report says whether the pair is bistable. Paint
    with partial weight follows the path if its file is in a folder `brushes` beside the level. Takes a minute or two
    with the defaults.
    """
    from flockbrush.cli.morph_commands import morph_brushes
    from flockbrush.studies.morph import Route, trials_of

    trials = trials_of(animals or [100], seeds, steps, seconds, begin.value)
    morph_brushes(start, end, output, trials, Route(wander, tuple(first or ())))


@brush_app.command("preview")
def brush_preview(
    name: Annotated[str, argument("NAME", "Brush: a name or a .brush.toml file.")],
    output: Annotated[Path, option("-o", "--output", "PNG", "Picture to write (.png).")],
    agents: Annotated[int, option("N", "Number of animals.", min=1, max=100_000)] = 200,
    seconds: Annotated[float, option("S", "Duration, simulated seconds.", min=0, max=3600)] = 30.0,
    seed: Annotated[int, option("K", "Random seed.", min=0, max=2**63 - 1)] = 0,
    start: Annotated[StartLayout, option("Arrangement of the animals at the start.")] = StartLayout.scatter,
    theme: ThemeOption = ThemeName.light,
    palette: PaletteOption = PaletteName.own,
):
    """Draw animals under a brush on a plane: at the start, in the middle and at the end of the run."""
    from flockbrush.cli.level_commands import preview_brush

    preview_brush(name, output, agents, seconds, seed, start.value, theme.value, palette.value)
