"""The command ``flockbrush``.

Only what every command needs is imported here: ``flockbrush --help`` must not wait for numba.
"""

from __future__ import annotations

import atexit
import enum
import functools
import gc
import inspect
import sys
from pathlib import Path
from typing import Annotated

import typer

import flockbrush
from flockbrush.cli.brush_options import brush_app
from flockbrush.cli.edit_options import edit
from flockbrush.cli.export_options import WithExports, WithExportTable, chosen
from flockbrush.cli.film_options import lift, track
from flockbrush.cli.formation_options import formation_app
from flockbrush.cli.learning_commands import learn, measure_fields, reenact, relation
from flockbrush.cli.level_options import level_app
from flockbrush.cli.program_options import program_app
from flockbrush.cli.run_options import MarkOptions, PlayOptions, RunRequest, ServeOptions
from flockbrush.cli.shared_options import (
    Fps,
    Json,
    PaletteName,
    PaletteOption,
    RecordFile,
    RecordingPath,
    ReportFolder,
    ThemeName,
    ThemeOption,
    Threads,
    TrackOptions,
    argument,
    given_options,
    grouped,
    option,
    refuse_unused,
    wrong,
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
        bool, option("--version", "Print the version and exit.", callback=_version, is_eager=True)
    ] = False,
):
    pass


# running -------------------------------------------------------------------------------


@app.command()
def demo(
    out: Annotated[Path, option("FILE", "Video file to write (.mp4).")] = Path("demo.mp4"),
    seconds: Annotated[float, option("S", "Duration, simulated seconds.", min=0)] = RUN_SECONDS,
    record: RecordFile = None,
    threads: Threads = None,
    theme: ThemeOption = ThemeName.light,
    palette: PaletteOption = PaletteName.own,
):
    """Simulate a flock of sheep in a pasture with obstacles, write demo.mp4 and print measures."""
    from flockbrush.cli.level_commands import run_level

    if out.suffix.lower() != ".mp4":
        raise wrong("--out", f"the demo is a video: its name must end in .mp4, got {str(out)!r}")
    request = RunRequest("sheep-pasture", seconds=seconds, record=record, export=[out], threads=threads)
    run_level(request, {"theme": theme.value, "palette": palette.value})


@app.command()
@grouped
def play(
    start: PlayOptions = PlayOptions(),  # noqa: B008  its fields become the options
    film: MarkOptions = MarkOptions(),  # noqa: B008
    tracks: TrackOptions = TrackOptions(),  # noqa: B008
):
    """Open the playground: paint, tune and direct a running herd; with --clip, mark a clip.

    LEVEL can also be a recording (.flock), which is replayed, branched and edited; or a file of tracks, which is
    shown in 3D: a flight written by `lift` or `export`; tracks of birds in pixels with --camera, which are lifted;
    otherwise animals on the ground.
    """
    theme = None if start.theme is None else start.theme.value
    if film.clip is not None:
        from flockbrush.studio.start_clip import mark_clip

        refuse_unused("a clip", given_options(start, "level", "theme", "size", "frames"), given_options(tracks))
        return mark_clip(**vars(film), theme=theme, size=start.size, frames=start.frames)
    if is_tracks(start.level):
        from flockbrush.studio.start_lift import show_flight

        refuse_unused("tracks", given_options(start, "level", "theme", "size", "frames"), given_options(film, "camera"))
        return show_flight(start.level, film.camera, theme, start.size, start.frames, tracks.read())
    from flockbrush.studio.start import StartOptions, play_level

    refuse_unused("a level or a recording", given_options(film), given_options(tracks))
    palette = None if start.palette is None else start.palette.value
    return play_level(StartOptions(**vars(start) | {"theme": theme, "palette": palette}))


@app.command(cls=WithExports)
@grouped
def run(context: typer.Context, request: RunRequest):
    """Run a level without a window, for 30 simulated seconds by default."""
    from flockbrush.cli.level_commands import run_level

    if request.ticks is not None and request.seconds is not None:
        raise wrong("--ticks", "give --ticks or --seconds, not both")
    if request.report is not None and request.synctest is None:
        raise wrong("--report", "can only be used with --synctest")
    if request.fps is not None and not request.export:
        raise wrong("--fps", "can only be used with --export")
    if request.keyframes is not None and request.record is None:
        raise wrong("--keyframes", "can only be used with --record")
    if request.seconds is None and request.ticks is None:
        request.seconds = RUN_SECONDS
    run_level(request, chosen(context, request.export))


@app.command()
@grouped
def serve(service: ServeOptions):
    """Run a level live for other programs, which draw and control it over a WebSocket (live link).

    The address with its token is printed at the start. Anyone who has the address can control the herd. Ctrl-C stops.
    """
    from flockbrush.cli.serve_commands import serve_level

    serve_level(service)


@app.command()
def replay(
    recording: RecordingPath,
    verify: Annotated[bool, option("--verify", "Compare the state after every tick with the recording.")] = False,
    to_tick: Annotated[int | None, option("N", "Last tick to replay.", min=0)] = None,
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
        raise wrong("--report", "can only be used with --verify")
    replay_recording(recording, verify, to_tick, threads, json, report)


@app.command(cls=WithExportTable)
def export(
    context: typer.Context,
    recording: RecordingPath,
    to: Annotated[list[Path], option("--to", "FILE", "File to write; may be repeated.")],
    fps: Fps = None,
    edits: Annotated[
        bool, option("--edits/--no-edits", "Apply the edits stored beside the recording (flockbrush edit).")
    ] = True,
    threads: Threads = None,
    json: Json = False,
):
    """Write a recording as files for other programs; the file extension selects the format (table below).

    A flight in space (a .csv that `formation fly` or `lift` made) can be written as .csv, .parquet, .usda or .usdc.
    """
    from flockbrush.cli.export_commands import export_recording

    export_recording(recording, to, fps, threads, chosen(context, to), json, edits)


for command in (edit, measure, track, lift, sweep, learn, reenact, relation):
    app.command()(command)
app.command("fields")(measure_fields)


FileKind = enum.Enum("FileKind", {"brush": "brush", "level": "level", "sweep": "sweep"}, type=str)  # with a schema


@app.command()
def schema(kind: Annotated[FileKind, argument("brush|level|sweep", "File format.")]):
    """Print the JSON schema of a file format. Editors use it to complete names and show units and bounds."""
    from flockbrush.cli.json_schemas import SCHEMAS

    terminal.print_json(SCHEMAS[kind.value]())


@app.command()
def bench(
    agents: Annotated[list[int] | None, option("N", "Number of animals; may be repeated.", min=1)] = None,
    large: Annotated[bool, option("--large", "Also time 100,000 animals.")] = False,
    ticks: Annotated[int, option("N", "Number of timed ticks, after the warm-up.", min=2, max=100_000)] = 60,
    threads: Annotated[
        list[int] | None, option("N", "Number of threads; may be repeated. Default: 1 and 2.", min=1, max=1024)
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
    out: Annotated[Path, argument("FOLDER", "Folder to write the wheel to.")] = Path("dist"),
    level: Annotated[
        list[str] | None, option("LEVEL", "Level whose kernels are compiled; may be repeated. Default: meadow.")
    ] = None,
    cpu: Annotated[
        list[str] | None, option("CPU", "Target CPU, x86-64-v4 or x86-64-v3; may be repeated. Default: both.")
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
    atexit.register(gc.freeze)  # or Python looks for cycles among all that numba made, for .4 s
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


@functools.cache
def _commands():
    """All commands with their options, for any number of calls: typer would look through all signatures at each."""
    return typer.main.get_command(app)


def _code_of(arguments) -> int:
    try:
        code = _commands()(arguments, standalone_mode=False, prog_name="flockbrush")
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
