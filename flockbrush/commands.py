"""What the commands of the command line do; `flockbrush.cli` says how they are called."""

from __future__ import annotations

import math
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import typer

from behaviours.problems import ProblemsError
from engine.parallel import set_threads, threads
from engine.recording import RecordingError, first_difference, open_recording, resume, state_hash
from flockbrush import run as running
from flockbrush import terminal
from flockbrush.export import Exports, check_exports
from flockbrush.terminal import Stopped, number, print_json, say, show, table

MOST_TICKS = 10**9


@dataclass
class Job:
    """A run as the person asked for it."""

    level: str
    ticks: int | None = None
    seconds: float | None = None
    seed: int | None = None
    agents: int | None = None
    record: Path | None = None
    exports: list[Path] = field(default_factory=list)
    fps: float | None = None
    threads: int | None = None
    options: dict = field(default_factory=dict)
    json: bool = False


# run ---------------------------------------------------------------------------------


def run_level(job: Job):
    """Run a level, write what was asked for, print what came of it."""
    path = running.find_level(job.level)
    check_exports(job.exports, [path], [job.record] if job.record else [])
    use_threads(job.threads)
    with terminal.Interrupts() as interrupts, terminal.compiling():
        simulation = running.start(job.level, job.seed, job.agents)
        ticks = ticks_of(job, simulation.clock.dt)
        watch, writing = running.Stopwatch(simulation), bool(job.record or job.exports)
        with (
            _recorder(job.record, simulation) as recorder,
            Exports(job.exports, simulation, job.fps, **job.options) as exports,
        ):
            exports.take()
            with stepping(simulation.level.name, simulation, ticks, interrupts, writing) as stepped:
                while simulation.clock.tick < ticks:
                    watch.tick()
                    if recorder:
                        recorder.take()
                    exports.take()
                    stepped()
    report = _report(job, simulation, watch)
    print_json(report) if job.json else _show_run(report)


def ticks_of(job, dt):
    """How many ticks a job asks for; typer.BadParameter for what is no length of time."""
    if job.ticks is not None:
        ticks, hint = job.ticks, "--ticks"
    else:
        if not math.isfinite(job.seconds):
            raise typer.BadParameter(f"must be a finite number of seconds, got {job.seconds}", param_hint="--seconds")
        ticks, hint = round(job.seconds / dt), "--seconds"
    if ticks > MOST_TICKS:
        raise typer.BadParameter(f"that is {ticks:,} ticks; there can be {MOST_TICKS:,}", param_hint=hint)
    return ticks


def use_threads(count):
    """Use so many threads, where the person said."""
    if count is not None:
        set_threads(count)


@contextmanager
def _recorder(path, simulation):
    """A recorder that is closed in good order when the run ends or is stopped."""
    if path is None:
        yield None
        return
    recorder = running.record(path, simulation)
    try:
        yield recorder
    except Stopped:
        recorder.close()
        raise
    except BaseException:
        recorder.recording.abandon()
        raise
    recorder.close()


@contextmanager
def stepping(text, simulation, ticks, interrupts, writing=False):
    """A function to call after every tick: it moves the bar, and ends the run when somebody asked."""
    told = "; what was written is complete up to there" if writing else ""
    with terminal.progress(text, ticks) as bar:

        def stepped(*_):
            tick = simulation.clock.tick
            interrupts.gently()
            bar(tick)
            if interrupts.asked:
                say(f"stopped after tick {tick}{told}")
            interrupts.check()

        yield stepped


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
        "recording": str(job.record) if job.record else None,
        "exports": [str(path) for path in job.exports],
        "versions": running.versions(),
        "peak_memory_mib": running.peak_memory(),
    }


def _show_run(report):
    tick = report["seconds_per_tick"]
    title = f"{report['level']}: {report['agents']:,} animals after {report['seconds']:g} s"
    show(_measures_table(report["measures"], title))
    pace = f"{1e3 * tick['median']:.2f} ms a tick (median)" if tick["median"] == tick["median"] else "no tick timed"
    lines = [f"{pace}, seed {report['seed']}, state {report['hash']}"]
    lines += [f"wrote {path}" for path in report["exports"]]
    if report["recording"]:
        lines.append(f"wrote {report['recording']}; verify it: flockbrush replay {report['recording']} --verify")
    print("\n".join(lines))


MEANINGS = {
    "animals": "how many there are",
    "polarization": "0 each its own way, 1 all the same way",
    "milling": "0 none, 1 all turn about the centre",
    "rotation": "the same, counter-clockwise positive",
    "speed_mean": "m/s",
    "speed_std": "m/s",
    "nnd": "m to the nearest neighbour, mean",
    "group_spread": "m from the centroid, root mean square",
    "elongation": "0 round, 1 a line",
    "aspect_ratio": "extent across / along the way they go",
    "largest_part": "share of the largest part that hangs together",
    "density": "animals per m² of their hull",
    "leads": "birds in nobody's upwash (V rules)",
    "groups": "sets of birds that no upwash connects",
    "segments": "straight lines of birds",
    "distance": "wingspans to the nearest line, mean",
}


def _measures_table(measures, title=None):
    made = table("measure", "value", "meaning", title=title, right=("value",))
    for name, value in measures.items():
        made.add_row(name, number(value), MEANINGS.get(name, ""))
    return made


# recordings ------------------------------------------------------------------------------


def opened(path):
    """A recording, with what is odd about it said."""
    run = open_recording(path)
    if run.notice:
        say(run.notice)
    differing = run.differing_packages()
    if differing:
        say(f"{path}: recorded with {', '.join(differing)}: the last bits may differ")
    return run


def replay_recording(path, verify, to_tick, thread_count, json):
    """Live a recording again, compared or not."""
    run = opened(path)
    end = run.last_tick if to_tick is None else to_tick
    if end > run.last_tick:
        raise RecordingError(f"{path}: the recording ends with tick {run.last_tick}; there is no tick {to_tick}")
    use_threads(thread_count)
    with terminal.Interrupts() as interrupts, terminal.compiling():
        simulation = running.rebuild(run)
        watch = running.Stopwatch(simulation)
        with stepping(Path(path).name, simulation, end, interrupts) as stepped:
            if verify:
                difference = _compare(run, simulation, watch, end, stepped)
            else:
                difference = None
                running.go_to(run, simulation, end, stepped)
    report = {
        "recording": str(path),
        "level": simulation.level.name,
        "seed": simulation.origin["seed"],
        "tick": simulation.clock.tick,
        "agents": len(simulation.agents),
        "threads": threads(),
        "truncated": run.truncated,
        "hash": state_hash(simulation.world),
        "measures": simulation.measures(),
    }
    if verify:
        compared = sum(tick <= simulation.clock.tick for tick in run.hashes)
        report |= {"verified": difference is None, "compared": compared, "seconds_per_tick": watch.per_tick()}
        report["first_difference"] = None if difference is None else vars(difference)
    if json:
        print_json(report)
    else:
        _show_replay(report, difference, verify)
    if difference is not None:
        raise typer.Exit(terminal.PROBLEM)


def _compare(run, simulation, watch, end, stepped):
    if not run.hashes:
        raise RecordingError(f"{run.path}: the recording holds no state to compare with")
    resume(run, simulation.world)
    return first_difference(run, simulation.world, watch.tick, end, stepped)


def _show_replay(report, difference, verify):
    if difference is not None:
        print(f"{report['recording']}: {difference}")
    elif verify:
        print(
            f"{report['recording']}: the same, bit for bit: {report['compared']:,} states up to tick {report['tick']:,}"
        )
    else:
        title = f"{report['level']}: {report['agents']:,} animals after tick {report['tick']:,}"
        show(_measures_table(report["measures"], title))
        print(f"state {report['hash']}")


def export_recording(path, outputs, fps, thread_count, options, json):
    """Write a recording as other files."""
    check_exports(outputs, [path])
    run = opened(path)
    use_threads(thread_count)
    with terminal.Interrupts() as interrupts, terminal.compiling():
        simulation = running.rebuild(run)
        resume(run, simulation.world)
        with (
            Exports(outputs, simulation, fps, **options) as exports,
            stepping(Path(path).name, simulation, run.last_tick, interrupts, True) as stepped,
        ):
            exports.take()
            while simulation.clock.tick < run.last_tick:
                simulation.tick()
                exports.take()
                stepped()
    if json:
        print_json({"recording": str(path), "exports": [str(output) for output in outputs], "ticks": run.last_tick})
    else:
        for output in outputs:
            print(f"wrote {output}")


# levels ---------------------------------------------------------------------------------


def check_levels(files):
    """Print everything that is wrong with levels, as a compiler would."""
    from levels.build import build

    bad = False
    for name in files:
        try:
            level, library = running.open_level(name)
            build(level, library=library).close()
        except ProblemsError as error:
            bad = True
            print(error)
            continue
        print(f"{level.path}: ok: {level.width:g} x {level.height:g} m, {level.agents:,} animals")
    if bad:
        raise typer.Exit(terminal.PROBLEM)


def render_level(name, output, seconds, seed, agents, theme):
    """Draw a level, at its start or later."""
    check_png(output, [running.find_level(name)])
    job = Job(name, seconds=seconds)
    with terminal.Interrupts() as interrupts, terminal.compiling():
        simulation = running.start(name, seed, agents)
        ticks = ticks_of(job, simulation.clock.dt)
        with (
            Exports([output], simulation, theme=theme) as exports,
            stepping(simulation.level.name, simulation, ticks, interrupts, True) as stepped,
        ):
            exports.take()
            while simulation.clock.tick < ticks:
                simulation.tick()
                exports.take()
                stepped()
    print(f"wrote {output}")


def check_png(output, inputs=(), hint="-o"):
    """Make sure that a picture can be written."""
    if Path(output).suffix.lower() != ".png":
        raise typer.BadParameter(f"the name of a picture ends in .png, got {str(output)!r}", param_hint=hint)
    check_exports([output], inputs)


def init_levels(folder):
    """Begin a folder for levels, with the brushes of its own folder ``brushes`` besides the shipped ones."""
    from behaviours.brush import BrushLibrary, shipped
    from levels.tiled import init

    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(20, "this is a file; name a folder", str(folder))
    own = [path for path in (folder / "brushes",) if path.is_dir()]
    for path in init(folder, BrushLibrary([*own, *shipped().folders])):
        print(f"wrote {path}")
    print(f"open {folder / 'flockbrush.tiled-project'} in Tiled: F5 plays the level that is open, F6 checks it")


def list_levels():
    """The shipped levels with what stands in their files."""
    from levels.reader import read_level

    made = table("level", "size, m", "animals", "boundary", "brushes", right=("animals",))
    for name in running.shipped_levels():
        level = read_level(running.SHIPPED / f"{name}.tmj")
        brushes = dict.fromkeys(spawn.brush for spawn in level.spawns)
        brushes |= dict.fromkeys(asset for layer in level.brush_layers for asset in layer.assets)
        size = f"{level.width:g} x {level.height:g}"
        made.add_row(name, size, f"{level.agents:,}", level.boundary, ", ".join(brushes))
    show(made)


# brushes ---------------------------------------------------------------------------------


def find_brush(name):
    """A brush by its name, or from a file."""
    from behaviours.brush import SUFFIX, load_brush, shipped

    if Path(name).name != name or name.endswith(SUFFIX) or Path(name).suffix:
        return load_brush(Path(name))
    return shipped().get(name)


def list_brushes(json):
    """The shipped brushes, a line each."""
    from behaviours.brush import shipped

    library = shipped()
    brushes = [library.get(name) for name in library.names()]
    if json:
        print_json([_in_short(brush) for brush in brushes])
        return
    made = table("", "brush", "model", "speed, BL/s", "numbers", "what they do", right=("speed, BL/s",))
    for brush in brushes:
        swatch = f"[{brush.colour}]██[/]"
        first = (brush.title or brush.description).strip().split("\n")[0]
        made.add_row(swatch, brush.name, brush.model, number(brush.speed.mean), brush.provenance.kind, first)
    show(made)


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
    """Everything a brush says."""
    brush = find_brush(name)
    if json:
        print_json({"schema": "flockbrush.brush/1", "sha256": brush.sha256} | brush.model_dump(mode="json"))
        return
    from rich.markup import escape

    show(f"[{brush.colour}]██[/] [bold]{escape(brush.title or brush.name)}[/]   {brush.name}, model {brush.model}")
    if brush.description:
        show(escape(brush.description.strip()))
    parts = {"parameters": brush.params, "speed": brush.speed, "body": brush.body, "vision": brush.vision}
    made = table("", "value", "unit", "meaning", right=("value",))
    for title, part in parts.items():
        made.add_row(f"[bold]{title}[/]", "", "", "")
        for key, info in type(part).model_fields.items():
            unit = (info.json_schema_extra or {}).get("unit", "")
            made.add_row(f"  {key}", escape(_value(getattr(part, key))), unit, escape(info.description or ""))
    show(made)
    told = {key: value for key, value in brush.provenance.model_dump().items() if value not in (None, "", {})}
    show("[bold]where the numbers come from[/]")
    figures = told.pop("report", {})
    for key, value in told.items():
        show(escape(f"  {key}: {_value(value)}"))
    if figures:
        made = table("figures of the report", "value", right=("value",))
        for figure, value in figures.items():
            made.add_row(escape(figure), number(value))
        show(made)
    print(f"sha256 {brush.sha256}")


def _value(value):
    if isinstance(value, dict):
        return ", ".join(f"{key} {_value(entry)}" for key, entry in value.items())
    if isinstance(value, tuple):
        return ", ".join(_value(entry) for entry in value) or "-"
    return number(value) if isinstance(value, float) else str(value).strip()


def check_brushes(files):
    """Print everything that is wrong with brushes, as a compiler would."""
    bad = False
    for name in files:
        try:
            brush = find_brush(name)
        except ProblemsError as error:
            bad = True
            print(error)
            continue
        print(f"{name}: ok: {brush.title or brush.name}, model {brush.model}")
    if bad:
        raise typer.Exit(terminal.PROBLEM)


def preview_brush(name, output, agents, seconds, seed, start, theme):
    """Draw what animals under a brush do on a plain."""
    from flockbrush.preview import preview

    check_png(output)
    brush = find_brush(name)
    ticks_of(Job("", seconds=seconds), 1 / 32)
    with terminal.Interrupts() as interrupts, terminal.compiling():
        preview(brush, output, agents, seconds, seed, start, theme, interrupts)
    print(f"wrote {output}")
