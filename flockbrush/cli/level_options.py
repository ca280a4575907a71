"""How ``flockbrush level`` is called."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flockbrush.cli.shared_options import Agents, LevelName, PaletteName, PaletteOption, Seed, ThemeName, ThemeOption

level_app = typer.Typer(help="Check, draw and create levels.", no_args_is_help=True)


@level_app.command("check")
def level_check(
    files: Annotated[list[str], typer.Argument(metavar="FILE...", help="Level files, or names of shipped levels.")],
    window: Annotated[bool, typer.Option("--window", help="Also show the result in a window (F6 in Tiled).")] = False,
):
    """Check levels and print every problem as `file:line: ...`."""
    from flockbrush.cli.commands import check_levels

    check_levels(files, window)


@level_app.command("render")
def level_render(
    level: LevelName,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PNG", help="Picture to write.")],
    seconds: Annotated[
        float, typer.Option(min=0, metavar="S", help="Simulated seconds before the picture is drawn.")
    ] = 0.0,
    seed: Seed = None,
    agents: Agents = None,
    theme: ThemeOption = ThemeName.light,
    palette: PaletteOption = PaletteName.own,
):
    """Draw a level with its animals."""
    from flockbrush.cli.commands import render_level

    render_level(level, output, seconds, seed, agents, theme.value, palette.value)


@level_app.command("init")
def level_init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to create or to update.")],
):
    """Create a folder for levels: a Tiled project with the Flockbrush classes, tilesets and a first level."""
    from flockbrush.cli.commands import init_levels

    init_levels(folder)


@level_app.command("adopt")
def level_adopt(
    map_file: Annotated[Path, typer.Argument(metavar="MAP", help="A .tmx or .tmj map of Tiled; it is only read.")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="NEW", help="The level, .tmj; default: beside the map, with its name."),
    ] = None,
    metres: Annotated[
        float, typer.Option("--metres-per-tile", min=0.001, max=1000, metavar="M", help="Size of a tile on the ground.")
    ] = 1.0,
):
    """Make a level of a map that you have: our layers, schema and properties are added, yours stay as they are."""
    from flockbrush.cli.commands import adopt_map

    adopt_map(map_file, output, metres)


@level_app.command("list")
def level_list():
    """The levels that come with Flockbrush."""
    from flockbrush.cli.commands import list_levels

    list_levels()
