"""Implementation of ``flockbrush edit``, and how exports apply the edits stored beside a recording."""

from __future__ import annotations

import shlex
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flockbrush.cli.level_commands import opened, stepping, warn_if_unlike
from flockbrush.engine.files import refused, sha256_of
from flockbrush.runs import run as running
from flockbrush.runs import terminal
from flockbrush.runs.edit_file import EditFile, edits_of, ids_of, ids_text, sentence_of
from flockbrush.runs.recording_selection import Selection, chosen
from flockbrush.runs.run_edits import ALWAYS, IN_TIME, Edit, EditedMoments, Past, needs_past
from flockbrush.runs.snapshots import moment_of, words_of
from flockbrush.runs.terminal import print_json, print_line, say, show, table
from flockbrush.systems.landscape import Landscape

if TYPE_CHECKING:
    from flockbrush.cli.edit_options import EditJob

KINDS = "--delete, --move, --turn, --retime, --freeze, --delay or --look"
LOOKS = ("brush", "species", "size")


def edit_recording(job: EditJob):
    """Add one edit, undo, redo, change a layer, or list the edits."""
    run = opened(job.recording)
    file = edits_of(job.recording)
    kind = _kind(job)
    if kind is not None:
        edit = _edit(job, kind, run, file)
        if not job.layer.strip():
            raise refused("--layer", f"a layer must have a name, got {job.layer!r}")
        try:
            file.add(edit, job.layer)
        except ValueError as error:
            raise refused(f"--{edit.kind}", str(error)) from None
        sentence = f"{job.layer}: {sentence_of(edit)}"
    else:
        sentence = _managed(job, file)
    if sentence is not None:
        file.save()
    if job.json:
        print_json(_report(job, file))
        return
    if sentence is not None:
        print_line(sentence)
        export = shlex.join(["flockbrush", "export", str(job.recording)])
        print_line(f"wrote {file.path}; {export} applies it. The recording is not changed")
        return
    _show(file)


def _kind(job):
    """The kind of the requested edit, or None; ProblemsError if there are several."""
    requested = {
        "delete": job.delete, "move": job.move is not None or job.turn is not None, "retime": job.retime is not None,
        "freeze": job.freeze, "delay": job.delay is not None, "look": bool(job.look),
    }  # fmt: skip
    kinds = [kind for kind, is_requested in requested.items() if is_requested]
    others = [job.undo, job.redo, job.on is not None, job.off is not None, job.remove_layer is not None]
    if len(kinds) + sum(others) > 1:
        raise refused(job.recording, f"only one edit at a time: give one of {KINDS}")
    if not kinds and _selection(job):
        raise refused(job.recording, f"no edit for the selected animals: add {KINDS}")
    return kinds[0] if kinds else None


def _selection(job):
    box = None if job.box is None else tuple(_numbers("--box", job.box, (4,)))
    if box is not None and not (box[0] < box[2] and box[1] < box[3]):
        raise refused(
            "--box", f"must be WEST,SOUTH,EAST,NORTH in metres with WEST < EAST and SOUTH < NORTH, got {job.box}"
        )
    try:
        ids = () if job.ids is None else ids_of(job.ids)
    except ValueError as error:
        raise refused("--ids", str(error)) from None
    near = None if job.near is None else tuple(_numbers("--near", job.near, (2,)))
    return Selection(ids, box, near, job.species or "", job.brush or "", job.state or "")


def _edit(job, kind, run, file) -> Edit:
    """The requested edit, with the ids of the animals that are selected as the edits so far show them."""
    _check_uses(job, kind)
    looks = _looks(job)
    start, end = job.start or 0.0, ALWAYS if job.end is None else job.end
    selection = _selection(job)
    if not selection:
        raise refused(job.recording, "no animals are selected: add --ids, --box, --near, --species, --brush or --state")
    time = start if job.time is None else job.time
    simulation = running.rebuild(run)
    tick = round(time / simulation.clock.dt)
    if tick > run.last_tick:
        last = run.last_tick * simulation.clock.dt
        raise refused(job.recording, f"the recording ends at {last:g} s; animals cannot be selected at {time:g} s")
    with ExitStack() as stack:
        with terminal.compiling():
            running.go_to(run, simulation, tick)
            warn_if_unlike(run, simulation)
        interrupts = stack.enter_context(terminal.Interrupts())
        wanted = [Edit("look", (), **looks)] if looks else []  # of nobody yet: what it names may come later in the run
        edits = _edited_moments([*file.edits(), *wanted], run, simulation, stack, interrupts)
        moment, words = edits.at(moment_of(simulation)), words_of(simulation)
    try:
        ids = chosen(selection, moment, words)
    except ValueError as error:
        raise refused(job.recording, str(error)) from None
    if not len(ids):
        hint = "--at S selects at another time"
        raise refused(job.recording, f"no animal is selected at {time:g} s by {selection}; {hint}")
    edit = Edit(kind, tuple(ids.tolist()), start, end, because=f"{selection} at {time:g} s")
    if kind == "move":
        middle = moment.xyz[np.isin(moment.ids, ids), :2].mean(axis=0)
        by = [*_numbers("--move", job.move or "0,0", (2, 3)), 0.0][:3]
        about = (round(float(middle[0]), 3), round(float(middle[1]), 3))
        edit = replace(
            edit, by=tuple(by), turn=job.turn or 0.0, over=job.over or 0.0, about=about if job.turn else (0.0, 0.0)
        )
    for name in ("brush", "species"):
        if looks.get(name, "") not in ("", *words[name]):
            raise refused("--look", f"there is no {name} {looks[name]!r} in this run; it has {', '.join(words[name])}")
    values = {"retime": {"speed": job.retime}, "delay": {"seconds": job.delay}}.get(kind, {})
    return replace(edit, **values, **looks)


def _check_uses(job, kind):
    """Raise ProblemsError for options that this kind of edit does not have."""
    if kind != "move" and job.over is not None:
        raise refused(
            "--over", "can only be used with --move or --turn: the seconds over which the move begins and ends"
        )
    if kind == "delay" and (job.start is not None or job.end is not None):
        raise refused(
            "--delay", "applies to the whole run, without --from and --until; to stop animals for a while use --freeze"
        )
    if job.start is not None and job.end is not None and job.end <= job.start:
        raise refused("--until", f"must be later than --from {job.start:g}, got {job.end:g}")


def _looks(job):
    """{"brush", "species" or "size": value} of --look."""
    values: dict = {}
    for text in job.look or []:
        name, mark, value = text.partition("=")
        if name not in LOOKS or not mark:
            raise refused("--look", f"must be brush=NAME, species=NAME or size=FACTOR, got {text!r}")
        if name == "size":
            try:
                values[name] = float(value)
            except ValueError:
                values[name] = np.nan
            if not 0.01 <= values[name] <= 100:
                raise refused("--look size", f"must be a number from 0.01 to 100, got {value!r}")
        else:
            values[name] = value
    return values


def _numbers(option, text, counts):
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(np.isfinite(numbers)) or max(map(abs, numbers)) > 1e6:
        many = " or ".join(map(str, counts))
        raise refused(option, f"must be {many} numbers from -1e6 to 1e6, separated by commas, got {text!r}")
    return numbers


def _managed(job, file: EditFile):
    """Undo, redo, or change a layer; returns the text to print, or None if none of these was requested."""
    if job.undo or job.redo:
        edit = file.undo() if job.undo else file.redo()
        if edit is None:
            raise refused(file.path, f"there is nothing to {'undo' if job.undo else 'redo'}")
        layer = (file.undone if job.undo else file.done)[-1].layer
        return f"{'undid' if job.undo else 'redid'}: {layer}: {sentence_of(edit)}"
    for name, word in ((job.on, "on"), (job.off, "off"), (job.remove_layer, "removed")):
        if name is None:
            continue
        layer = file.layer(name)
        if layer is None:
            known = ", ".join(one.name for one in file.layers) or "none"
            raise refused(file.path, f"no layer {name!r}; layers: {known}")
        if word == "removed":
            file.remove(name)
        else:
            layer.on = word == "on"
        return f"layer {name}: {word}"
    return None


def _report(job, file):
    layers = []
    for layer in file.layers:
        edits = [vars(e) | {"ids": ids_text(e.ids), "end": None if e.end == ALWAYS else e.end} for e in layer.edits]
        layers.append({"name": layer.name, "on": layer.on, "edits": edits})
    return {"recording": str(job.recording), "file": str(file.path), "layers": layers, "undone": len(file.undone)}


def _show(file):
    if not file.layers:
        print_line(f"{file.path}: no edits")
        return
    rows = (
        (layer.name, "yes" if layer.on else "no", sentence_of(edit), edit.because)
        for layer in file.layers for edit in layer.edits
    )  # fmt: skip
    show(table("layer", "on", "edit", "selected by", rows=rows, title=str(file.path)))


# exports ---------------------------------------------------------------------------------


def applied(file: EditFile | None, run, simulation, stack, interrupts) -> EditedMoments | None:
    """The edited moments of a recording, for exports; None if no layer is on.

    Edits that show what is later make one pass over the recording before the exports begin (`needs_past`).
    """
    edits = [] if file is None else file.edits()
    if file is None or not edits:
        return None
    layers = sum(bool(layer.on and layer.edits) for layer in file.layers)
    say(f"{file.path}: applied {len(edits)} edit{'s' * (len(edits) > 1)} of {layers} layer{'s' * (layers > 1)} "
        "(--no-edits leaves them out)")  # fmt: skip
    return _edited_moments(edits, run, simulation, stack, interrupts)


def _edited_moments(edits, run, simulation, stack, interrupts) -> EditedMoments:
    """The moments of a recording with edits, some of which make one pass over the recording here."""
    late = [animal for edit in edits if edit.kind in IN_TIME for animal in edit.ids]
    past = None
    if needs_past(edits, simulation):
        past = Past(late, simulation.world.resource(Landscape).wrap)
        stack.callback(past.close)
        other = running.rebuild(run)
        with stepping("edits", other, run.last_tick, interrupts) as stepped:
            past.watch(other, run.last_tick, stepped)
    return EditedMoments(simulation, edits, past)


def told_of(file: EditFile) -> dict[str, str]:
    """Title, value pairs about the edits, for the HTML page."""
    return {"edits": file.path.name, "edits SHA-256": sha256_of(file.path)}
