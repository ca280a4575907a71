"""Implementation of ``flockbrush export``: of recordings, and of flights in tables."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from flockbrush.cli.edit_commands import applied, told_of
from flockbrush.cli.level_commands import opened, stepping, use_threads, warn_if_unlike
from flockbrush.engine.files import refused
from flockbrush.lifting.flight_show import Show
from flockbrush.lifting.ground_show import is_flight
from flockbrush.output.export import Exports, check_exports, check_rate
from flockbrush.runs import run as running
from flockbrush.runs import terminal
from flockbrush.runs.compile_ahead import compiling_ahead
from flockbrush.runs.edit_file import edits_of
from flockbrush.runs.terminal import print_json, print_line


def export_flight(path, outputs, fps, options, json):
    """Write the flight of a table (``flockbrush formation fly``, ``flockbrush lift``) in other file formats."""
    if fps is not None:
        raise refused("--fps", "applies to recordings; a flight is exported with the frames of its table")
    show = Show.open(path)
    show.check_exports(outputs, options)
    with terminal.Interrupts():
        for output in outputs:
            show.export(output, **options)
    _tell({"flight": str(path), "frames": len(show)}, outputs, json)


def export_recording(path, outputs, fps, thread_count, options, json, edited=True):
    """Write a recording in other file formats, with the edits stored beside it."""
    if is_flight(path):
        export_flight(path, outputs, fps, options, json)
        return
    check_exports(outputs, [path], options=options)
    run = opened(path)
    use_threads(thread_count)
    with ExitStack() as stack:
        interrupts = stack.enter_context(terminal.Interrupts())
        stack.enter_context(compiling_ahead(path))
        file = edits_of(path) if edited else None
        simulation = running.rebuild(run)
        check_rate(fps, simulation, "--fps")
        edits = applied(file, run, simulation, stack, interrupts)
        source = running.source_of(path) | (told_of(file) if edits else {})
        exports = stack.enter_context(Exports(outputs, simulation, fps, edits, **options, source=source))
        stepped = stack.enter_context(stepping(Path(path).name, simulation, run.last_tick, interrupts, True))
        exports.take()
        while simulation.clock.tick < run.last_tick:
            simulation.tick()
            exports.take()
            stepped()
        warn_if_unlike(run, simulation)
    _tell({"recording": str(path), "ticks": run.last_tick}, outputs, json)


def _tell(about, outputs, json):
    """Print which files were written."""
    if json:
        print_json({**about, "exports": [str(output) for output in outputs]})
    else:
        for output in outputs:
            print_line(f"wrote {output}")
