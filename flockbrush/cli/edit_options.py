"""Options of the command ``flockbrush edit``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from flockbrush.cli.shared_options import grouped

SEC = {"min": 0.0, "max": 1e6, "metavar": "S"}


@dataclass
class EditJob:
    """The options of ``flockbrush edit``."""

    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording: a file made with --record.")]
    ids: Annotated[str | None, typer.Option(metavar="IDS", help='Select animals by id, such as "1-40, 52".')] = None
    box: Annotated[
        str | None,
        typer.Option(metavar="W,S,E,N", help="Select animals in a box: west, south, east and north edge, m."),
    ] = None
    near: Annotated[str | None, typer.Option(metavar="X,Y", help="Select the animal nearest to a point, m.")] = None
    species: Annotated[str | None, typer.Option(metavar="NAME", help="Select animals of a species.")] = None
    brush: Annotated[str | None, typer.Option(metavar="NAME", help="Select animals that a brush controls.")] = None
    state: Annotated[str | None, typer.Option(metavar="NAME", help="Select animals in a state of their program.")] = (
        None
    )
    time: Annotated[
        float | None, typer.Option("--at", help="Time at which the animals are selected, s; default: --from.", **SEC)
    ] = None
    delete: Annotated[bool, typer.Option("--delete", help="Hide the animals.")] = False
    move: Annotated[str | None, typer.Option(metavar="X,Y[,Z]", help="Move the animals by this vector, m.")] = None
    turn: Annotated[
        float | None,
        typer.Option(
            min=-36000,
            max=36000,
            metavar="DEG",
            help="Turn the animals about their mean position, degrees counter-clockwise.",
        ),
    ] = None
    over: Annotated[float | None, typer.Option(help="Time over which a move begins and ends, s.", **SEC)] = None
    retime: Annotated[
        float | None,
        typer.Option(
            min=0.01,
            max=100,
            metavar="TIMES",
            help="Factor of the animals' speed along their paths: 2 is twice as fast.",
        ),
    ] = None
    freeze: Annotated[bool, typer.Option("--freeze", help="Stop the animals; afterwards they continue from there.")] = (
        False
    )
    delay: Annotated[
        float | None,
        typer.Option(
            min=-1e6, max=1e6, metavar="S", help="Let the animals appear S seconds later, or earlier if S is negative."
        ),
    ] = None
    look: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE", help="Draw the animals with another brush=, species= or size=; may be repeated."
        ),
    ] = None
    start: Annotated[float | None, typer.Option("--from", help="Time at which the edit begins, s.", **SEC)] = None
    end: Annotated[float | None, typer.Option("--until", help="Time at which the edit ends, s.", **SEC)] = None
    layer: Annotated[
        str, typer.Option(metavar="NAME", help="Layer of the edit; it is created if it does not exist.")
    ] = "edits"
    undo: Annotated[bool, typer.Option("--undo", help="Undo the last edit, of any layer, on or off.")] = False
    redo: Annotated[bool, typer.Option("--redo", help="Redo the edit that was undone last.")] = False
    on: Annotated[str | None, typer.Option(metavar="LAYER", help="Switch a layer on.")] = None
    off: Annotated[str | None, typer.Option(metavar="LAYER", help="Switch a layer off.")] = None
    remove_layer: Annotated[str | None, typer.Option(metavar="LAYER", help="Remove a layer with its edits.")] = None
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")] = False


@grouped
def edit(job: EditJob):
    """Edit a recording after the run: hide, move or change animals in its exports.

    Edits are stored in RECORDING.edits.toml beside the recording. The recording itself is not changed and can still be
    verified. Every export applies the edits. Without an edit, the command lists the layers.
    """
    from flockbrush.cli.edit_commands import edit_recording

    edit_recording(job)
