"""The command ``flockbrush replay``."""

from __future__ import annotations

from pathlib import Path

import typer

from flockbrush.cli.level_commands import differing, measures_table, opened, stepping, use_threads, warn_if_unlike
from flockbrush.cli.show_desync import show_build, show_desync
from flockbrush.engine.parallel import threads
from flockbrush.engine.recording import RecordingError, first_difference, state_hash
from flockbrush.runs import run as running
from flockbrush.runs import terminal
from flockbrush.runs.compile_ahead import compiling_ahead
from flockbrush.runs.desync import HERE, THERE, check_folder, investigate, write_report
from flockbrush.runs.terminal import print_json, print_line, show


def replay_recording(path, verify, to_tick, thread_count, json, folder=None):
    """Replay a recording; with `verify`, compare every tick."""
    if folder is not None:
        check_folder(folder)
    run = opened(path)
    end = run.last_tick if to_tick is None else to_tick
    if end > run.last_tick:
        raise RecordingError(f"{path}: the recording ends at tick {run.last_tick}; tick {to_tick} is not in it")
    use_threads(thread_count)
    difference = desync = None
    with terminal.Interrupts() as interrupts, compiling_ahead(path):
        simulation = running.rebuild(run)
        watch = running.Stopwatch(simulation)
        with stepping(Path(path).name, simulation, end, interrupts) as stepped:
            if verify:
                if not run.hashes:
                    raise RecordingError(f"{run.path}: the recording has no state sums to compare with")
                difference = first_difference(run, simulation.world, watch.tick, end, stepped)
            else:
                running.go_to(run, simulation, end, stepped)
                warn_if_unlike(run, simulation)
        report = _report(run, simulation)
        if verify:
            compared = sum(tick <= simulation.clock.tick for tick in run.hashes)
            states = simulation.clock.tick - min(run.hashes) + 1
            report |= {"verified": difference is None, "compared": compared, "states": states}
            report["seconds_per_tick"] = watch.per_tick()
            report["first_difference"] = None if difference is None else vars(difference)
        if difference is not None:
            desync = investigate(run, difference, simulation, lambda: running.rebuild(run))
            report |= {"build": differing(run), "desync": desync.as_json()}
    written = []
    if desync is not None and folder is not None:
        written = write_report(folder, simulation.world, desync, report)
    if json:
        print_json(report | ({"files": [str(file) for file in written]} if written else {}))
    elif difference is not None:
        print_line(f"{path}: {difference}")
        show_build(report["build"])
        show_desync(desync, (THERE, HERE), written)
    else:
        _show_replay(report, verify)
    if difference is not None:
        raise typer.Exit(terminal.PROBLEM)


def _report(run, simulation):
    return {
        "recording": str(run.path),
        "level": simulation.level.name,
        "seed": simulation.origin["seed"],
        "tick": simulation.clock.tick,
        "agents": len(simulation.agents),
        "threads": threads(),
        "truncated": run.truncated,
        "hash": state_hash(simulation.world),
        "measures": simulation.measures(),
    }


def _show_replay(report, verify):
    if verify:
        compared, states, until = report["compared"], report["states"], f"up to tick {report['tick']:,}"
        some = f"{compared:,} states {until}"
        if compared < states:  # no hash was kept of the others
            some = f"all {compared:,} of {states:,} states {until} that were recorded are"
        print_line(f"{report['recording']}: {some} identical, bit for bit")
    else:
        title = f"{report['level']}: {report['agents']:,} animals after tick {report['tick']:,}"
        show(measures_table(report["measures"], title))
        print_line(f"state {report['hash']}")
