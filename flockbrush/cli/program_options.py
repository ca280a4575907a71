"""Options of the commands ``flockbrush program ...``."""

from __future__ import annotations

from typing import Annotated

import typer

from flockbrush.cli.shared_options import Events, Json, argument, option

program_app = typer.Typer(
    help="List, show, check and test programs: states of animals and the triggers between them.", no_args_is_help=True
)


ProgramName = Annotated[str, argument("NAME", "Program: a name or a .program.toml file.")]


@program_app.command("list")
def program_list(json: Json = False):
    """List the shipped programs."""
    from flockbrush.cli.program_cli import list_programs

    list_programs(json)


@program_app.command("show")
def program_show(name: ProgramName, json: Json = False):
    """Show the states and triggers of a program."""
    from flockbrush.cli.program_cli import show_program

    show_program(name, json)


@program_app.command("check")
def program_check(files: Annotated[list[str], argument("FILE...", "Program files, or names of shipped programs.")]):
    """Check programs and print every problem as `file:line: ...`."""
    from flockbrush.cli.program_cli import check_programs

    check_programs(files)


@program_app.command("test")
def program_test(
    name: ProgramName,
    animals: Annotated[int, option("N", "Number of animals that follow the program.", min=1, max=100_000)] = 100,
    seconds: Annotated[float, option("S", "Duration, simulated seconds.", min=0, max=3600)] = 60.0,
    seed: Annotated[int, option("K", "Random seed.", min=0, max=2**31 - 1)] = 0,
    species: Annotated[str, option("NAME", "Species of the animals; default: sheep, if able.")] = "",
    intruder: Annotated[
        str, option("SPECIES:BRUSH", "Animal that arrives after 5 s, 40 m west of the herd, such as wolf:wolf-hunt.")
    ] = "",
    event: Events = None,
    json: Json = False,
):
    """Run a program on a plane; print the number of animals in each state and the transitions."""
    from flockbrush.cli.program_cli import test_program

    test_program(name, animals, seconds, seed, species, intruder, event, json)
