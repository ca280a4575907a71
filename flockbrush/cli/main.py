"""The command ``flockbrush``.

Only what every command needs is imported here: ``flockbrush --help`` must not wait for numba.
"""

from __future__ import annotations

import enum
import inspect
import sys
from pathlib import Path
from typing import Annotated

import typer

import flockbrush
from flockbrush.cli import learning_commands as cli_learning
from flockbrush.cli.brush_options import brush_app
from flockbrush.cli.edit_options import edit
from flockbrush.cli.export_options import WithExports, WithExportTable, chosen
from flockbrush.cli.film_options import lift, track
from flockbrush.cli.formation_options import formation_app
from flockbrush.cli.level_options import level_app
from flockbrush.cli.program_options import program_app
from flockbrush.cli.shared_options import (
    Agents,
    Events,
    Fps,
    Json,
    LevelName,
    PaletteName,
    PaletteOption,
    RecordingPath,
    ReportFolder,
    Seconds,
    Seed,
    ThemeName,
    ThemeOption,
    Threads,
    TrackFps,
    TrackMetres,
    TrackPixels,
    TrackUnit,
)
from flockbrush.cli.study_options import is_tracks, measure, sweep
from flockbrush.engine.plain_text import plain
from flockbrush.runs import streams, terminal
from flockbrush.runs.terminal import INTERRUPTED, PIPE, print_line, say

app = typer.Typer(
    name="flockbrush",
    help="Simulate herds and flocks that behaviour brushes control: play, run, record and replay levels.",
    epilog="Start with:  flockbrush demo   and:  flockbrush level init my-levels",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.add_typer(level_app, name="level")
app.add_typer(brush_app, name="brush")
app.add_typer(formation_app, name="formation")
app.add_typer(program_app, name="program")

RUN_SECONDS = 30.0  # s of a run when nobody says


def _version(wanted: bool):
    if wanted:
        print_line(f"flockbrush {flockbrush.__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
):
    pass


# running -------------------------------------------------------------------------------


@app.command()
def demo(
    out: Annotated[Path, typer.Option(metavar="FILE", help="Video file to write (.mp4).")] = Path("demo.mp4"),
    seconds: Annotated[float, typer.Option(min=0, metavar="S", help="Duration, simulated seconds.")] = RUN_SECONDS,
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Recording to write, for replay.")] = None,
    threads: Threads = None,
    theme: ThemeOption = ThemeName.light,
    palette: PaletteOption = PaletteName.own,
):
    """Simulate a flock of sheep in a pasture with obstacles, write demo.mp4 and print measures."""
    from flockbrush.cli.commands import RunRequest, run_level

    if out.suffix.lower() != ".mp4":
        raise typer.BadParameter(
            f"the demo is a video: its name must end in .mp4, got {str(out)!r}", param_hint="--out"
        )
    run_level(
        RunRequest(
            "sheep-pasture",
            seconds=seconds,
            record=record,
            exports=[out],
            threads=threads,
            options={"theme": theme.value, "palette": palette.value},
        )
    )


@app.command()
def play(
    level: LevelName = "meadow",
    brush: Annotated[str | None, typer.Option(metavar="NAME", help="Name of the brush selected at the start.")] = None,
    seed: Seed = None,
    agents: Agents = None,
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Recording to write, for replay.")] = None,
    theme: Annotated[
        ThemeName | None, typer.Option(help="Colours of the window; default: those of the last session.")
    ] = None,
    palette: Annotated[
        PaletteName | None, typer.Option(help="Colours of brushes; default: those of the last session.")
    ] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Window size, pixels.")] = "1280x720",
    text_size: Annotated[
        float | None,
        typer.Option(
            "--text-size", min=50, max=300, metavar="PERCENT", help="Size of text and buttons, percent; 100 is normal."
        ),
    ] = None,
    frames: Annotated[
        int | None, typer.Option(min=0, metavar="N", help="Close the window after N drawn frames.")
    ] = None,
    clip: Annotated[
        Path | None,
        typer.Option(
            metavar="CLIP", help="Open a clip to mark instead of a level; 'sky' opens an empty sky to sketch a flock."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the marks of --clip; default: the current folder.")
    ] = None,
    tracks: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Tracks of the birds in the clip, as written by `flockbrush track`."),
    ] = None,
    camera: Annotated[
        Path | None, typer.Option(metavar="FILE", help="TOML file of the camera that filmed the clip or the tracks.")
    ] = None,
    mode: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Mode to open the clip in: look, landmarks, paint, body, birds or sketch."),
    ] = None,
    unit: TrackUnit = None,
    fps: TrackFps = None,
    body_length_m: TrackMetres = None,
    body_length_px: TrackPixels = None,
):
    """Open the playground: paint, tune and direct a running herd; with --clip, mark a clip.

    LEVEL can also be a recording (.flock), which is replayed, branched and edited; or a file of tracks, which is
    shown in 3D: a flight written by `lift` or `export`; tracks of birds in pixels with --camera, which are lifted;
    otherwise animals on the ground.
    """
    if clip is not None:
        from flockbrush.studio.start_clip import mark_clip

        return mark_clip(clip, out, tracks, camera, mode, None if theme is None else theme.value, size, frames)
    if is_tracks(level):
        from flockbrush.film.open_clip import Looking
        from flockbrush.studio.start_lift import show_flight

        look = Looking(
            unit=cli_learning.unit_of(unit), fps=fps, body_length_m=body_length_m, body_length_px=body_length_px
        )
        return show_flight(level, camera, None if theme is None else theme.value, size, frames, look)
    from flockbrush.studio.start import StartOptions, play_level

    wishes = StartOptions(
        level,
        brush,
        seed,
        agents,
        record,
        None if theme is None else theme.value,
        None if palette is None else palette.value,
        size,
        frames,
        text_size,
    )
    return play_level(wishes)


@app.command(cls=WithExports)
def run(
    context: typer.Context,
    level: LevelName,
    ticks: Annotated[int | None, typer.Option(min=0, metavar="N", help="Duration, ticks of 1/32 s.")] = None,
    seconds: Seconds = None,
    seed: Seed = None,
    agents: Agents = None,
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Recording to write, for replay.")] = None,
    export: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="File to write (formats: flockbrush export --help); may be repeated."),
    ] = None,
    event: Events = None,
    brush: Annotated[
        str | None, typer.Option(metavar="NAME", help="Brush of all spawned animals: a name or a .brush.toml file.")
    ] = None,
    fps: Fps = None,
    threads: Threads = None,
    keyframes: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Ticks between snapshots of the recording; default: 320, or fewer for many animals.",
        ),
    ] = None,
    synctest: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Determinism test: simulate every tick twice, from a snapshot every N ticks, and compare.",
        ),
    ] = None,
    report: ReportFolder = None,
    json: Json = False,
):
    """Run a level without a window, for 30 simulated seconds by default."""
    from flockbrush.cli.commands import RunRequest, run_level

    if ticks is not None and seconds is not None:
        raise typer.BadParameter("give --ticks or --seconds, not both", param_hint="--ticks")
    if report is not None and synctest is None:
        raise typer.BadParameter("can only be used with --synctest", param_hint="--report")
    if keyframes is not None and record is None:
        raise typer.BadParameter("can only be used with --record", param_hint="--keyframes")
    options = chosen(context, export)
    if seconds is None and ticks is None:
        seconds = RUN_SECONDS
    run_level(
        RunRequest(
            level,
            ticks,
            seconds,
            seed,
            agents,
            record,
            export or [],
            fps,
            threads,
            options,
            json,
            event or [],
            brush=brush,
            keyframes=keyframes,
            synctest=synctest,
            report=report,
        )
    )


@app.command()
def serve(
    level: LevelName,
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="Port to listen on; 0: any free port.")] = 0,
    host: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Address to listen on; the default accepts only this machine.")
    ] = ("127.0.0.1"),
    frame_rate: Annotated[
        float, typer.Option("--fps", min=1, max=60, metavar="F", help="Frames per second sent to each client.")
    ] = 60.0,
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Recording to write, for replay.")] = None,
    seconds: Annotated[
        float | None,
        typer.Option(min=0, metavar="S", help="Stop after S simulated seconds; default: run until Ctrl-C."),
    ] = None,
    seed: Seed = None,
    agents: Agents = None,
    brush: Annotated[
        str | None, typer.Option(metavar="NAME", help="Brush of all spawned animals: a name or a .brush.toml file.")
    ] = None,
    threads: Threads = None,
    json: Json = False,
):
    """Run a level live for other programs, which draw and control it over a WebSocket (live link).

    The address with its token is printed at the start. Anyone who has the address can control the herd. Ctrl-C stops.
    """
    from flockbrush.cli.serve_commands import Service, serve_level

    serve_level(Service(level, host, port, frame_rate, record, seconds, seed, agents, brush, threads, json))


@app.command()
def replay(
    recording: RecordingPath,
    verify: Annotated[
        bool, typer.Option("--verify", help="Compare the state after every tick with the recording.")
    ] = False,
    to_tick: Annotated[int | None, typer.Option(min=0, metavar="N", help="Last tick to replay.")] = None,
    report: ReportFolder = None,
    threads: Threads = None,
    json: Json = False,
):
    """Replay a recording.

    With --verify, every tick is compared. The first tick that differs is reported with the system, the animals and
    the values, and the exit code is 1.
    Without --verify, the replay starts at the nearest snapshot, runs to the last tick (or --to-tick) and prints the
    measures at that tick.
    """
    from flockbrush.cli.replay_commands import replay_recording

    if report is not None and not verify:
        raise typer.BadParameter("can only be used with --verify", param_hint="--report")
    replay_recording(recording, verify, to_tick, threads, json, report)


@app.command(cls=WithExportTable)
def export(
    context: typer.Context,
    recording: RecordingPath,
    to: Annotated[
        list[Path],
        typer.Option("--to", metavar="FILE", help="File to write; may be repeated."),
    ],
    fps: Fps = None,
    edits: Annotated[
        bool, typer.Option("--edits/--no-edits", help="Apply the edits stored beside the recording (flockbrush edit).")
    ] = True,
    threads: Threads = None,
    json: Json = False,
):
    """Write a recording as files for other programs; the file extension selects the format (table below)."""
    from flockbrush.cli.export_commands import export_recording

    export_recording(recording, to, fps, threads, chosen(context, to), json, edits)


app.command("edit")(edit)


app.command("measure")(measure)
app.command("track")(track)
app.command("lift")(lift)
app.command("sweep")(sweep)


cli_learning.register(app)


class FileKind(str, enum.Enum):
    """Files that have a JSON schema."""

    brush = "brush"
    level = "level"
    sweep = "sweep"


@app.command()
def schema(kind: Annotated[FileKind, typer.Argument(metavar="brush|level|sweep", help="File format.")]):
    """Print the JSON schema of a file format. Editors use it to complete names and show units and bounds."""
    from flockbrush.cli.json_schemas import SCHEMAS

    terminal.print_json(SCHEMAS[kind.value]())


@app.command()
def bench(
    agents: Annotated[
        list[int] | None, typer.Option(min=1, metavar="N", help="Number of animals; may be repeated.")
    ] = None,
    large: Annotated[bool, typer.Option("--large", help="Also time 100,000 animals.")] = False,
    ticks: Annotated[
        int, typer.Option(min=2, max=100_000, metavar="N", help="Number of timed ticks, after the warm-up.")
    ] = 60,
    threads: Annotated[
        list[int] | None,
        typer.Option(min=1, max=1024, metavar="N", help="Number of threads; may be repeated. Default: 1 and 2."),
    ] = None,
    json: Json = False,
):
    """Benchmark ticks of a herd: 0.25 animals/m², 10 m view range, exact occlusion."""
    from flockbrush.cli.bench import benchmark

    sizes = agents or [1_000, 10_000] + ([100_000] if large else [])
    benchmark(sizes, ticks, threads or [1, 2], json)


@app.command()
def doctor(json: Json = False):
    """Check the installation: packages, compile cache, threads, Tiled, ffmpeg."""
    from flockbrush.cli.doctor import examine

    examine(json)


@app.command("build-wheel")
def build_wheel(
    out: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder to write the wheel to.")] = Path("dist"),
    level: Annotated[
        list[str] | None,
        typer.Option(metavar="LEVEL", help="Level whose kernels are compiled; may be repeated. Default: meadow."),
    ] = None,
    cpu: Annotated[
        list[str] | None,
        typer.Option(metavar="CPU", help="Target CPU, x86-64-v4 or x86-64-v3; may be repeated. Default: both."),
    ] = None,
):
    """Build a wheel of this checkout that contains compiled kernels."""
    from flockbrush.cli.build_wheel import build
    from flockbrush.engine.shipped_kernels import CPUS

    build(out, level or ["meadow"], cpu or list(CPUS))


def _wrap_help_anew(commands):
    """Take the line breaks of the source out of the paragraphs of help texts: the terminal's width breaks them."""
    for command in commands.registered_commands:
        text = command.help or inspect.getdoc(command.callback) or ""
        command.help = "\n\n".join(" ".join(paragraph.split()) for paragraph in text.split("\n\n"))
    for group in commands.registered_groups:
        _wrap_help_anew(group.typer_instance)


_wrap_help_anew(app)


# the way in ----------------------------------------------------------------------------------


def main(arguments=None):
    """Run the command and end the program with its exit code."""
    streams.prepare()
    terminal.show_advice_plainly()
    sys.exit(called(arguments))


def called(arguments=None) -> int:
    """Run the command and return its exit code: 0 success, 1 a problem was found, 2 wrong usage."""
    try:
        code = _code_of(arguments)
        sys.stdout.flush()
        return code
    except terminal.Stopped:
        return INTERRUPTED
    except (KeyboardInterrupt, typer.Abort):
        say("stopped")
        return INTERRUPTED
    except BrokenPipeError:
        streams.let_go()
        return PIPE
    except OSError as error:
        if error.filename == streams.OUTPUT:
            streams.let_go()
        return terminal.exit_code_of(error)
    except Exception as error:  # noqa: BLE001  the last who can turn it into words
        return _usage(error) if hasattr(error, "exit_code") and hasattr(error, "show") else terminal.exit_code_of(error)


def _code_of(arguments) -> int:
    try:
        code = app(arguments, standalone_mode=False, prog_name="flockbrush")
    except typer.Exit as error:
        return error.exit_code
    if code == INTERRUPTED:  # some versions of typer turn Ctrl-C into this
        say("stopped")
    return code if isinstance(code, int) else 0


def _usage(error) -> int:
    from typer import rich_utils

    if hasattr(error, "message"):
        error.message = plain(error.message)
    rich_utils.rich_format_error(error)
    return error.exit_code
