"""Implementation of the commands for runs, levels and brushes; their options are in `flockbrush.cli.main`."""

from __future__ import annotations

import math
import shlex
import shutil
from contextlib import contextmanager, suppress
from pathlib import Path

import typer

from flockbrush.cli.program_cli import submit_events
from flockbrush.cli.run_options import RunRequest
from flockbrush.cli.shared_options import wrong
from flockbrush.cli.show_desync import show_desync
from flockbrush.engine import limits
from flockbrush.engine.commands import CommandError
from flockbrush.engine.parallel import set_threads, threads
from flockbrush.engine.plugins import PluginError
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import open_recording, state_hash
from flockbrush.output.export import Exports, check_exports, check_rate
from flockbrush.runs import run as running
from flockbrush.runs import terminal
from flockbrush.runs.builds import build_of_run, differences
from flockbrush.runs.compile_ahead import compiling_ahead
from flockbrush.runs.desync import check_folder, write_report
from flockbrush.runs.synctest import AGAIN, FIRST, OutOfSync, SyncTest
from flockbrush.runs.terminal import Stopped, any_refused, number, print_json, print_line, say, show, styled, table

# run ---------------------------------------------------------------------------------


def run_level(job: RunRequest, options):
    """Run a level, write the requested files with the options of the exporters, and print the report."""
    exported = job.export or []
    path = running.find_level(job.level)
    if job.report is not None:
        check_folder(job.report)
    check_exports(exported, [path], [job.record] if job.record else [], options)
    use_threads(job.threads)
    begin = job.level, job.seed, job.agents, job.brush
    with terminal.Interrupts() as interrupts, compiling_ahead(*begin):
        simulation = running.start(*begin)
        check_rate(job.fps, simulation, "--fps")
        ticks = ticks_of(job, simulation.clock.dt)
        submit_events(simulation, job.event or [], ticks)
        watch, writing = running.Stopwatch(simulation), bool(job.record or exported)
        if job.record:
            tell_size(job.record, running.recording_size(simulation, ticks, job.keyframes))
        with Exports(exported, simulation, job.fps, **options) as exports:
            exports.take()  # what is wrong with an export is known before a recording takes the place of an earlier one
            with (
                recorder_of(job.record, simulation, job.keyframes) as recorder,
                stepping(simulation.level.name, simulation, ticks, interrupts, writing) as stepped,
            ):
                tick = _step(job, watch, ticks, interrupts.check)
                while simulation.clock.tick < ticks:
                    try:
                        tick()
                    except OutOfSync as error:
                        _out_of_sync(job, simulation, error)
                    if recorder:
                        recorder.take()
                    exports.take()
                    stepped()
    report = _report(job, simulation, watch)
    if job.synctest:
        report["synctest"] = {"every": job.synctest, "ticks": ticks}
    print_json(report) if job.json else _show_run(report)


def _out_of_sync(job, simulation, error):
    """Print how the two simulations of a tick differ, and end the command."""
    facts = {"level": simulation.level.name, "seed": simulation.origin["seed"], "synctest": job.synctest}
    written = []
    if job.report is not None:
        written = write_report(job.report, simulation.world, error.report, facts)
    if job.json:
        files = {"files": [str(file) for file in written]} if written else {}
        print_json(facts | {"desync": error.report.as_json()} | files)
    else:
        print_line(f"{facts['level']}: {error}")
        show_desync(error.report, (FIRST, AGAIN), written)
    raise typer.Exit(terminal.PROBLEM)


def _step(job, watch, ticks, look):
    """The function that runs one tick: once, or twice with a comparison (--synctest)."""
    if not job.synctest:
        return watch.tick
    return SyncTest(watch.simulation, job.synctest, ticks, watch.tick, look).tick


def ticks_of(job, dt):
    """Number of ticks of a job; typer.BadParameter if its duration is invalid."""
    if job.ticks is not None:
        ticks, hint = job.ticks, "--ticks"
    else:
        if not math.isfinite(job.seconds):
            raise wrong("--seconds", f"must be a finite number of seconds, got {job.seconds}")
        ticks, hint = job.seconds / dt, "--seconds"
    if ticks > limits.TICKS:
        raise wrong(hint, f"too long: a run can have at most {limits.TICKS:,} ticks")
    return round(ticks)


def use_threads(count):
    """Set the number of threads, unless it is None."""
    if count is not None:
        set_threads(count)


LARGE = 50 << 20  # bytes of a recording that are worth a word beforehand


def tell_size(path, size):
    """Print the expected size of a recording if it is large or the disk has too little free space."""
    with suppress(OSError):
        free = shutil.disk_usage(Path(path).parent).free
        if size > free:
            say(f"{path}: the recording will need about {_mb(size)}, but the disk has only {_mb(free)} free")
            return
    if size > LARGE:
        say(f"{path}: the recording will need about {_mb(size)}")


def _mb(size):
    return f"{size / 1e6:,.0f} MB" if size >= 1e7 else f"{size / 1e6:.2g} MB"


@contextmanager
def recorder_of(path, simulation, keyframes=None):
    """Context manager: a recorder that is closed when the run ends, is stopped or something in it fails."""
    if path is None:
        yield None
        return
    recorder = running.record(path, simulation, keyframes)
    if recorder.recording.earlier is not None:
        say(f"{path}: the recording that was there is kept as {recorder.recording.earlier.name}")
    try:
        yield recorder
    except (CommandError, PluginError):
        recorder.close(in_tick=True)
        raise
    except Stopped:
        recorder.close()
        raise
    except BaseException:
        recorder.abandon()
        raise
    recorder.close()


@contextmanager
def stepping(text, simulation, ticks, interrupts, writing=False):
    """Context manager: a function to call after every tick, which moves the progress bar and handles Ctrl-C."""
    note = "; the written files are complete up to this tick" if writing else ""
    with terminal.progress(text, ticks) as bar:

        def stepped(*_):
            interrupts.gently()
            bar(simulation.clock.tick)
            interrupts.check()

        try:
            yield stepped
        except Stopped:
            say(f"stopped after tick {simulation.clock.tick}{note}")
            raise
        except (CommandError, PluginError) as error:
            if writing and not getattr(error, "source", ""):
                say(f"stopped after tick {simulation.clock.tick}{note}")
            raise


def _report(job, simulation, watch):
    return {
        "level": simulation.level.name,
        "seed": simulation.origin["seed"],
        "ticks": simulation.clock.tick,
        "seconds": simulation.clock.now,
        "agents": len(simulation.agents),
        "threads": threads(),
        "seconds_per_tick": watch.per_tick(),
        "startup_seconds": watch.startup,
        "systems": watch.systems(),
        "hash": state_hash(simulation.world),
        "measures": simulation.measures(),
        **simulation.parts(),
        "states": simulation.states(),
        "transitions": simulation.transitions(),
        "recording": str(job.record) if job.record else None,
        "exports": [str(path) for path in job.export or []],
        "versions": running.versions(),
        "peak_memory_mib": running.peak_memory(),
    }


def _show_run(report):
    tick = report["seconds_per_tick"]
    title = f"{report['level']}: {report['agents']:,} animals after {report['seconds']:g} s"
    show(measures_table(report["measures"], title))
    for program, state_counts in report["states"].items():
        say_states = ", ".join(f"{state} {count:,}" for state, count in state_counts.items())
        print_line(f"{program}: {say_states}")
    pace = f"{1e3 * tick['median']:.2f} ms per tick (median)" if tick["median"] == tick["median"] else "no tick timed"
    lines = [f"{pace}, seed {report['seed']}, state {report['hash']}"]
    if "synctest" in report:
        lines.append(f"{report['ticks']:,} ticks simulated twice: identical, bit for bit")
    lines += [f"wrote {path}" for path in report["exports"]]
    if report["recording"]:
        lines.append(wrote_recording(report["recording"]))
    print_line("\n".join(lines))


def wrote_recording(path):
    """The line about a recording that was written, with the command that verifies it."""
    return f"wrote {path}; verify it: {shlex.join(['flockbrush', 'replay', str(path), '--verify'])}"


def meaning_of(name: str, unit: str = "m") -> str:
    """Meaning of a measure with its unit, lengths being in another one than metres, for tables on the terminal."""
    from flockbrush.runs.v_measures import MEANINGS
    from flockbrush.systems.measures import measures

    known = measures().get(name)
    if known is None:
        return MEANINGS.get(name, "")
    return known.meaning + (f", {known.unit_in(unit)}" if known.unit else "")


def measures_table(measures, title=None):
    rows = ((name, value, meaning_of(name)) for name, value in measures.items())
    return table("measure", "value", "meaning", rows=rows, title=title, right=("value",))


# recordings ------------------------------------------------------------------------------


def opened(path):
    """Open a recording and print its warnings."""
    run = open_recording(path)
    if run.notice:
        say(run.notice)
    changed = differing(run)
    for what in ("code", "libraries") if "build" in run.header else ("libraries",):
        if what in changed:
            say(f"{path}: recorded with {changed[what]}: results may differ")
    return run


def warn_if_unlike(run, simulation):
    """Print a warning if a replay has come to another state than was recorded."""
    if unlike := running.unlike_recorded(run, simulation):
        say(unlike)


def differing(run):
    """Differences between the build that made a recording and this build (`flockbrush.runs.builds.differences`)."""
    build = run.header.get("build")
    recorded = {**(build if isinstance(build, dict) else {}), "packages": run.header.get("packages")}
    return differences(recorded, build_of_run(), {"flockbrush"})


# levels ---------------------------------------------------------------------------------


def check_levels(files, window=False):
    """Print every problem of some levels, one line each; also in a window if asked."""
    from flockbrush.levels.build import build

    lines = []

    def check(name):
        level, library = running.open_level(name)
        build(level, library=library).close()
        lines.extend(map(str, level.warnings))
        lines.append(f"{level.path}: ok: {level.width:g} x {level.height:g} m, {level.agents:,} animals")

    bad = any_refused(files, check, lambda error: lines.append(str(error)))
    for line in lines:
        print_line(line)
    if window:
        from flockbrush.studio.message import show_message

        show_message("Problems in the level" if bad else "No problems in the level", "\n".join(lines), bad)
    if bad:
        raise typer.Exit(terminal.PROBLEM)


def render_level(name, output, seconds, seed, agents, theme, palette):
    """Draw a level at its start, or after some simulated seconds."""
    check_png(output, [running.find_level(name)])
    job = RunRequest(name, seconds=seconds)
    with terminal.Interrupts() as interrupts, compiling_ahead(name, seed, agents):
        simulation = running.start(name, seed, agents)
        ticks = ticks_of(job, simulation.clock.dt)
        with (
            Exports([output], simulation, theme=theme, palette=palette) as exports,
            stepping(simulation.level.name, simulation, ticks, interrupts, True) as stepped,
        ):
            exports.take()
            while simulation.clock.tick < ticks:
                simulation.tick()
                exports.take()
                stepped()
    print_line(f"wrote {output}")


def check_png(output, inputs=()):
    """Raise an error if a PNG cannot be written to this path."""
    if Path(output).suffix.lower() != ".png":
        raise wrong("-o", f"the name of a picture must end in .png, got {str(output)!r}")
    check_exports([output], inputs)


def check_plot(plot, inputs):
    """Raise an error if a chart cannot be drawn and written to this path."""
    from flockbrush.engine.files import output_problems
    from flockbrush.output.figures import FORMATS, drawing_problems

    if Path(plot).suffix.lower() not in FORMATS:
        endings = ", ".join(FORMATS)
        raise wrong("--plot", f"the name of a chart must end in one of {endings}; got {str(plot)!r}")
    problems = drawing_problems(plot) or output_problems([plot], inputs)
    if problems:
        raise ProblemsError(problems)


def init_levels(folder):
    """Create a folder for levels; its project offers the brushes in its folder ``brushes`` and the shipped ones."""
    from flockbrush.behaviours.brush import BrushLibrary, shipped
    from flockbrush.levels.tiled import init

    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(20, "this is a file; give a folder", str(folder))
    own = [path for path in (folder / "brushes",) if path.is_dir()]
    for path in init(folder, BrushLibrary([*own, *shipped().folders])):
        print_line(f"wrote {path}")
    print_line(f"open {folder / 'flockbrush.tiled-project'} in Tiled; there F5 plays the open level and F6 checks it")


def adopt_map(source, output, metres_per_tile):
    """Write a level made from an existing Tiled map."""
    from flockbrush.levels.adopt import adopt

    adoption = adopt(source, output, metres_per_tile)
    print_line(f"wrote {adoption.write()}; {source} was not changed")
    for rule in adoption.rules:
        print_line(f"  ground_rules: {rule}")
    for warning in adoption.level.warnings:
        print_line(warning)
    walkable = 1.0 if adoption.level.terrain is None else adoption.level.terrain.walkable.mean()
    print_line(
        f"{adoption.level.width:g} x {adoption.level.height:g} m, {100 * walkable:.0f} % walkable, "
        f"{adoption.level.agents:,} animals; set the meaning of tiles in the map property ground_rules"
    )


def list_levels():
    """Print a table of the shipped levels."""
    from flockbrush.levels.reader import read_level

    levels_table = table("level", "size, m", "animals", "boundary", "brushes", right=("animals",))
    for name in running.shipped_levels():
        level = read_level(running.SHIPPED / f"{name}.tmj")
        brushes = dict.fromkeys(spawn.brush for spawn in level.spawns)
        brushes |= dict.fromkeys(asset for layer in level.brush_layers for asset in layer.assets)
        size = f"{level.width:g} x {level.height:g}"
        levels_table.add_row(name, size, f"{level.agents:,}", level.boundary, ", ".join(brushes))
    show(levels_table)


# brushes ---------------------------------------------------------------------------------


def find_brush(name):
    """The brush of this name, or from this file."""
    from flockbrush.behaviours.brush import SUFFIX, load_brush, shipped

    if Path(name).name != name or name.endswith(SUFFIX) or Path(name).suffix:
        return load_brush(Path(name))
    return shipped().get(name)


def list_brushes(json):
    """Print a table of the shipped brushes, or a JSON list."""
    from flockbrush.behaviours.brush import shipped

    library = shipped()
    brushes = [library.get(name) for name in library.names()]
    if json:
        print_json([_in_short(brush) for brush in brushes])
        return
    brushes_table = table("", "brush", "model", "speed, BL/s", "numbers", "what they do", right=("speed, BL/s",))
    for brush in brushes:
        swatch = styled("[{}]██[/]", brush.colour)
        first = (brush.title or brush.description).strip().split("\n")[0]
        brushes_table.add_row(swatch, brush.name, brush.model, number(brush.speed.mean), brush.provenance.kind, first)
    show(brushes_table)


def _in_short(brush):
    return {
        "name": brush.name,
        "title": brush.title,
        "model": brush.model,
        "colour": brush.colour,
        "provenance": brush.provenance.kind,
        "sha256": brush.sha256,
    }


def show_brush(name, json):
    """Print a brush: parameters, units, meanings and provenance."""
    brush = find_brush(name)
    if json:
        print_json({"schema": "flockbrush.brush/1", "sha256": brush.sha256} | brush.model_dump(mode="json"))
        return
    head = brush.colour, brush.title or brush.name, brush.name, brush.model
    show(styled("[{}]██[/] [bold]{}[/]   {}, model {}", *head))
    if brush.description:
        show(brush.description.strip())
    parts = {"parameters": brush.params, "speed": brush.speed, "body": brush.body, "vision": brush.vision}
    parts |= {f"drive {name}": params for name, params in brush.drives.items()}
    parameters_table = table("", "value", "unit", "meaning", right=("value",))
    for title, part in parts.items():
        parameters_table.add_row(styled("[bold]{}[/]", title), "", "", "")
        for key, info in type(part).model_fields.items():
            unit = (info.json_schema_extra or {}).get("unit", "")
            parameters_table.add_row(f"  {key}", _value(getattr(part, key)), unit, info.description or "")
    show(parameters_table)
    provenance = {key: value for key, value in brush.provenance.model_dump().items() if value not in (None, "", {})}
    show(styled("[bold]where the numbers come from[/]"))
    figures = provenance.pop("report", {})
    for key, value in provenance.items():
        show(f"  {key}: {_value(value)}")
    if figures:
        show(table("learning report", "value", rows=figures.items(), right=("value",)))
    print_line(f"sha256 {brush.sha256}")


def _value(value):
    if isinstance(value, dict):
        return ", ".join(f"{key} {_value(entry)}" for key, entry in value.items())
    if isinstance(value, tuple):
        return ", ".join(_value(entry) for entry in value) or "-"
    return number(value) if isinstance(value, float) else str(value).strip()


def preview_brush(name, output, agents, seconds, seed, start, theme, palette):
    """Draw animals under a brush on an endless plane."""
    from flockbrush.behaviours.brush import default_body
    from flockbrush.levels.libraries import library_for_file
    from flockbrush.output.preview import preview
    from flockbrush.render.style import theme_of

    check_png(output)
    brush = find_brush(name)
    if not brush.has_own_body:
        body = default_body(brush.made_for, library_for_file(name).species)
        brush = brush.model_copy(update={"body": body})
    ticks_of(RunRequest("", seconds=seconds), 1 / 32)
    with terminal.Interrupts(), terminal.compiling():
        preview(brush, output, agents, seconds, seed, start, theme_of(theme, palette))
    print_line(f"wrote {output}")
