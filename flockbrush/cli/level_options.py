"""Options of the commands ``flockbrush level ...``."""

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
    from flockbrush.cli.level_commands import check_levels

    check_levels(files, window)


@level_app.command("render")
def level_render(
    level: LevelName,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PNG", help="Picture to write (.png).")],
    seconds: Annotated[
        float, typer.Option(min=0, metavar="S", help="Time of the picture, simulated seconds after the start.")
    ] = 0.0,
    seed: Seed = None,
    agents: Agents = None,
    theme: ThemeOption = ThemeName.light,
    palette: PaletteOption = PaletteName.own,
):
    """Draw a level with its animals as a picture."""
    from flockbrush.cli.level_commands import render_level

    render_level(level, output, seconds, seed, agents, theme.value, palette.value)


@level_app.command("init")
def level_init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to create or update.")],
):
    """Create a folder for levels: a Tiled project with the Flockbrush classes, tilesets and an example level."""
    from flockbrush.cli.level_commands import init_levels

    init_levels(folder)


@level_app.command("adopt")
def level_adopt(
    map_file: Annotated[Path, typer.Argument(metavar="MAP", help="Tiled map, .tmx or .tmj; it is not changed.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="NEW", help="Level to write (.tmj); default: beside the map, with its name."
        ),
    ] = None,
    metres: Annotated[
        float, typer.Option("--metres-per-tile", min=0.001, max=1000, metavar="M", help="Size of a tile, m.")
    ] = 1.0,
):
    """Make a level from a Tiled map: add the Flockbrush layers and properties; existing layers are kept."""
    from flockbrush.cli.level_commands import adopt_map

    adopt_map(map_file, output, metres)


@level_app.command("list")
def level_list():
    """List the shipped levels."""
    from flockbrush.cli.level_commands import list_levels

    list_levels()
