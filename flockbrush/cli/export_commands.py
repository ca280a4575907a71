"""Implementation of ``flockbrush export``."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from flockbrush.cli.edit_commands import applied, told_of
from flockbrush.cli.level_commands import opened, stepping, use_threads, warn_if_unlike
from flockbrush.engine.recording import resume
from flockbrush.output.export import Exports, check_exports
from flockbrush.runs import run as running
from flockbrush.runs import terminal
from flockbrush.runs.compile_ahead import compiling_ahead
from flockbrush.runs.edit_file import edits_of
from flockbrush.runs.terminal import print_json, print_line


def export_recording(path, outputs, fps, thread_count, options, json, edited=True):
    """Write a recording in other file formats, with the edits stored beside it."""
    check_exports(outputs, [path], options=options)
    run = opened(path)
    use_threads(thread_count)
    with ExitStack() as stack:
        interrupts = stack.enter_context(terminal.Interrupts())
        stack.enter_context(compiling_ahead(path))
        file = edits_of(path) if edited else None
        simulation = running.rebuild(run)
        resume(run, simulation.world)
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
    if json:
        print_json({"recording": str(path), "exports": [str(output) for output in outputs], "ticks": run.last_tick})
    else:
        for output in outputs:
            print_line(f"wrote {output}")
