"""Options of the command ``flockbrush edit``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from flockbrush.cli.shared_options import Json, RecordingPath, grouped, option

SEC = {"min": 0.0, "max": 1e6}


@dataclass
class EditJob:
    """The options of ``flockbrush edit``."""

    recording: RecordingPath
    ids: Annotated[str | None, option("IDS", 'Select animals by id, such as "1-40, 52".')] = None
    box: Annotated[str | None, option("W,S,E,N", "Select animals in a box: west, south, east and north edge, m.")] = (
        None
    )
    near: Annotated[str | None, option("X,Y", "Select the animal nearest to a point, m.")] = None
    species: Annotated[str | None, option("NAME", "Select animals of a species.")] = None
    brush: Annotated[str | None, option("NAME", "Select animals that a brush controls.")] = None
    state: Annotated[str | None, option("NAME", "Select animals in a state of their program.")] = None
    time: Annotated[
        float | None, option("--at", "S", "Time at which the animals are selected, s; default: --from.", **SEC)
    ] = None
    delete: Annotated[bool, option("--delete", "Hide the animals.")] = False
    move: Annotated[str | None, option("X,Y[,Z]", "Move the animals by this vector, m.")] = None
    turn: Annotated[
        float | None,
        option("DEG", "Turn the animals about their mean position, degrees counter-clockwise.", min=-36000, max=36000),
    ] = None
    over: Annotated[float | None, option("S", "Time over which a move begins and ends, s.", **SEC)] = None
    retime: Annotated[
        float | None,
        option("TIMES", "Factor of the animals' speed along their paths: 2 is twice as fast.", min=0.01, max=100),
    ] = None
    freeze: Annotated[bool, option("--freeze", "Stop the animals; afterwards they continue from there.")] = False
    delay: Annotated[
        float | None,
        option("S", "Let the animals appear S seconds later, or earlier if S is negative.", min=-1e6, max=1e6),
    ] = None
    look: Annotated[
        list[str] | None,
        option("NAME=VALUE", "Draw the animals with another brush=, species= or size=; may be repeated."),
    ] = None
    start: Annotated[float | None, option("--from", "S", "Time at which the edit begins, s.", **SEC)] = None
    end: Annotated[float | None, option("--until", "S", "Time at which the edit ends, s.", **SEC)] = None
    layer: Annotated[str, option("NAME", "Layer of the edit; it is created if it does not exist.")] = "edits"
    undo: Annotated[bool, option("--undo", "Undo the last edit, of any layer, on or off.")] = False
    redo: Annotated[bool, option("--redo", "Redo the edit that was undone last.")] = False
    on: Annotated[str | None, option("LAYER", "Switch a layer on.")] = None
    off: Annotated[str | None, option("LAYER", "Switch a layer off.")] = None
    remove_layer: Annotated[str | None, option("LAYER", "Remove a layer with its edits.")] = None
    json: Json = False


@grouped
def edit(job: EditJob):
    """Edit a recording after the run: hide, move or change animals in its exports.

    Edits are stored in RECORDING.edits.toml beside the recording. The recording itself is not changed and can still be
    verified. Every export applies the edits. Without an edit, the command lists the layers.
    """
    from flockbrush.cli.edit_commands import edit_recording

    edit_recording(job)
