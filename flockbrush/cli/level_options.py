"""Options of the commands ``flockbrush level ...``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flockbrush.cli.shared_options import (
    Agents,
    LevelName,
    PaletteName,
    PaletteOption,
    Seed,
    ThemeName,
    ThemeOption,
    argument,
    option,
)

level_app = typer.Typer(help="Check, draw and create levels.", no_args_is_help=True)


@level_app.command("check")
def level_check(
    files: Annotated[list[str], argument("FILE...", "Level files, or names of shipped levels.")],
    window: Annotated[bool, option("--window", "Also show the result in a window (F6 in Tiled).")] = False,
):
    """Check levels and print every problem as `file:line: ...`."""
    from flockbrush.cli.level_commands import check_levels

    check_levels(files, window)


@level_app.command("render")
def level_render(
    level: LevelName,
    output: Annotated[Path, option("-o", "--output", "PNG", "Picture to write (.png).")],
    seconds: Annotated[float, option("S", "Time of the picture, simulated seconds after the start.", min=0)] = 0.0,
    seed: Seed = None,
    agents: Agents = None,
    theme: ThemeOption = ThemeName.light,
    palette: PaletteOption = PaletteName.own,
):
    """Draw a level with its animals as a picture."""
    from flockbrush.cli.level_commands import render_level

    render_level(level, output, seconds, seed, agents, theme.value, palette.value)


@level_app.command("init")
def level_init(folder: Annotated[Path, argument("DIR", "Folder to create or update.")]):
    """Create a folder for levels: a Tiled project with the Flockbrush classes, tilesets and an example level."""
    from flockbrush.cli.level_commands import init_levels

    init_levels(folder)


@level_app.command("adopt")
def level_adopt(
    map_file: Annotated[Path, argument("MAP", "Tiled map, .tmx or .tmj; it is not changed.")],
    output: Annotated[
        Path | None, option("-o", "--output", "NEW", "Level to write (.tmj); default: beside the map, with its name.")
    ] = None,
    metres: Annotated[float, option("--metres-per-tile", "M", "Size of a tile, m.", min=0.001, max=1000)] = 1.0,
):
    """Make a level from a Tiled map: add the Flockbrush layers and properties; existing layers are kept."""
    from flockbrush.cli.level_commands import adopt_map

    adopt_map(map_file, output, metres)


@level_app.command("list")
def level_list():
    """List the shipped levels."""
    from flockbrush.cli.level_commands import list_levels

    list_levels()
