"""How ``flockbrush edit`` is called."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from flockbrush.cli.shared_options import grouped

SEC = {"min": 0.0, "max": 1e6, "metavar": "S"}


@dataclass
class EditJob:
    """An edit, or work on its file, as the person asked for it."""

    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="A file made with --record.")]
    ids: Annotated[str | None, typer.Option(metavar="IDS", help='Choose animals by id: "1-40, 52".')] = None
    box: Annotated[str | None, typer.Option(metavar="W,S,E,N", help="Choose animals in a box, m.")] = None
    near: Annotated[str | None, typer.Option(metavar="X,Y", help="Choose the animal nearest to a point, m.")] = None
    species: Annotated[str | None, typer.Option(metavar="NAME", help="Choose animals of a species.")] = None
    brush: Annotated[str | None, typer.Option(metavar="NAME", help="Choose animals under a brush.")] = None
    state: Annotated[str | None, typer.Option(metavar="NAME", help="Choose animals in a state.")] = None
    time: Annotated[
        float | None, typer.Option("--at", help="Second at which they are chosen; default: --from.", **SEC)
    ] = None
    delete: Annotated[bool, typer.Option("--delete", help="Leave them out.")] = False
    move: Annotated[str | None, typer.Option(metavar="X,Y[,Z]", help="Move them, m.")] = None
    turn: Annotated[
        float | None, typer.Option(min=-36000, max=36000, metavar="DEG", help="Turn them about their middle.")
    ] = None
    over: Annotated[float | None, typer.Option(help="Seconds in which a move comes and goes.", **SEC)] = None
    retime: Annotated[
        float | None, typer.Option(min=0.01, max=100, metavar="TIMES", help="Speed of their time: 2 is twice as fast.")
    ] = None
    freeze: Annotated[bool, typer.Option("--freeze", help="Let them stand; afterwards they go on from there.")] = False
    delay: Annotated[
        float | None, typer.Option(min=-1e6, max=1e6, metavar="S", help="Let them come later, or earlier below 0.")
    ] = None
    look: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="Draw them with brush=, species= or size=; may be repeated."),
    ] = None
    start: Annotated[float | None, typer.Option("--from", help="Second at which the edit begins.", **SEC)] = None
    end: Annotated[float | None, typer.Option("--until", help="Second at which the edit ends.", **SEC)] = None
    layer: Annotated[str, typer.Option(metavar="NAME", help="Layer of the edit; made where there is none.")] = "edits"
    undo: Annotated[bool, typer.Option("--undo", help="Take back the last edit.")] = False
    redo: Annotated[bool, typer.Option("--redo", help="Make the edit again that was taken back last.")] = False
    on: Annotated[str | None, typer.Option(metavar="LAYER", help="Switch a layer on.")] = None
    off: Annotated[str | None, typer.Option(metavar="LAYER", help="Switch a layer off.")] = None
    remove_layer: Annotated[str | None, typer.Option(metavar="LAYER", help="Remove a layer with its edits.")] = None
    json: Annotated[bool, typer.Option("--json", help="Print a report as JSON.")] = False


@grouped
def edit(job: EditJob):
    """Edit a recording after the run: what its exports show of some animals.

    Edits lie in RECORDING.edits.toml beside the recording, which stays as it is and still verifies. Every export
    applies them. Without an edit the layers are listed.
    """
    from flockbrush.cli.edit_commands import edit_recording

    edit_recording(job)
