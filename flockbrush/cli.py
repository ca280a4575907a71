"""The command ``flockbrush``.

Only what every command needs is imported here: ``flockbrush --help`` must not wait for numba.
"""

from __future__ import annotations

import enum
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

import flockbrush
from flockbrush import terminal
from flockbrush.terminal import INTERRUPTED, PIPE, say

app = typer.Typer(
    name="flockbrush",
    help="Paint how a herd behaves, and watch it walk: levels from the Tiled editor, run, recorded, replayed.",
    epilog="Start with:  flockbrush demo   and:  flockbrush level init my-levels",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
level_app = typer.Typer(help="Check, draw and begin levels.", no_args_is_help=True)
brush_app = typer.Typer(help="Look at brushes: models of behaviour with their numbers.", no_args_is_help=True)
app.add_typer(level_app, name="level")
app.add_typer(brush_app, name="brush")

RUN_SECONDS = 30.0  # s of a run when nobody says


class Theme(str, enum.Enum):
    """Colours of pictures and videos."""

    light = "light"
    dark = "dark"


class UsdMode(str, enum.Enum):
    """How animals stand in a USD scene."""

    instancer = "instancer"
    xforms = "xforms"


class Start(str, enum.Enum):
    """How a herd stands at first."""

    scatter = "scatter"
    grid = "grid"
    ring = "ring"
    line = "line"


LevelName = Annotated[str, typer.Argument(metavar="LEVEL", help="A .tmj file, or the name of a shipped level.")]
RecordingPath = Annotated[Path, typer.Argument(metavar="RECORDING", help="A file made with --record.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")]
Seconds = Annotated[float | None, typer.Option(min=0, metavar="S", help="How long, in simulated seconds.")]
Seed = Annotated[int | None, typer.Option(min=0, max=2**63 - 1, metavar="K", help="Instead of the level's own.")]
Agents = Annotated[
    int | None,
    typer.Option(min=1, metavar="N", help="So many animals instead of the level's counts, at the same density."),
]
Threads = Annotated[
    int | None, typer.Option(min=1, max=1024, metavar="N", help="At most so many threads; the result is the same.")
]
Fps = Annotated[
    float | None,
    typer.Option(metavar="F", help="Frames per second of exports; every tick (32) unless told, 24 for USD."),
]
ThemeOption = Annotated[Theme, typer.Option(help="Colours of pictures and videos.")]
UsdOption = Annotated[UsdMode, typer.Option(help="xforms: one prim for each animal, for Maya.")]


def _version(wanted: bool):
    if wanted:
        print(f"flockbrush {flockbrush.__version__}")
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
    out: Annotated[Path, typer.Option(metavar="FILE", help="Where the video goes.")] = Path("demo.mp4"),
    seconds: Annotated[float, typer.Option(min=0, metavar="S", help="How long, in simulated seconds.")] = RUN_SECONDS,
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Also keep a recording.")] = None,
    threads: Threads = None,
    theme: ThemeOption = Theme.light,
):
    """Sheep walk through a pasture full of things in the way: writes demo.mp4, prints what was measured."""
    from flockbrush.commands import Job, run_level

    if out.suffix.lower() != ".mp4":
        raise typer.BadParameter(f"the demo is a video; its name ends in .mp4, got {str(out)!r}", param_hint="--out")
    run_level(
        Job(
            "sheep-pasture",
            seconds=seconds,
            record=record,
            exports=[out],
            threads=threads,
            options={"theme": theme.value},
        )
    )


@app.command()
def play(
    level: LevelName = "meadow",
    brush: Annotated[str | None, typer.Option(metavar="NAME", help="The brush in hand at first.")] = None,
    seed: Seed = None,
    agents: Agents = None,
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Keep a recording, for replay.")] = None,
    theme: Annotated[Theme | None, typer.Option(help="As last time unless told.")] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Of the window, pixels.")] = "1280x720",
    frames: Annotated[int | None, typer.Option(min=0, metavar="N", help="Close after so many frames.")] = None,
):
    """Open a window in which a running herd is painted, tuned and directed."""
    from flockbrush.play.start import Wishes, play_level

    wishes = Wishes(level, brush, seed, agents, record, None if theme is None else theme.value, size, frames)
    return play_level(wishes)


@app.command()
def run(
    level: LevelName,
    ticks: Annotated[int | None, typer.Option(min=0, metavar="N", help="How long, in ticks of 1/32 s.")] = None,
    seconds: Seconds = None,
    seed: Seed = None,
    agents: Agents = None,
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Keep a recording, for replay.")] = None,
    export: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="Write .mp4, .png, .csv, .parquet or .usdc; may be given again."),
    ] = None,
    fps: Fps = None,
    threads: Threads = None,
    theme: ThemeOption = Theme.light,
    usd_mode: UsdOption = UsdMode.instancer,
    json: Json = False,
):
    """Run a level without a window: 30 seconds unless told."""
    from flockbrush.commands import Job, run_level

    if ticks is not None and seconds is not None:
        raise typer.BadParameter("give --ticks or --seconds, not both", param_hint="--ticks")
    options = {"theme": theme.value, "usd_mode": usd_mode.value}
    if seconds is None and ticks is None:
        seconds = RUN_SECONDS
    run_level(Job(level, ticks, seconds, seed, agents, record, export or [], fps, threads, options, json))


@app.command()
def replay(
    recording: RecordingPath,
    verify: Annotated[bool, typer.Option("--verify", help="Compare every tick with the recording.")] = False,
    to_tick: Annotated[int | None, typer.Option(min=0, metavar="N", help="Stop there.")] = None,
    threads: Threads = None,
    json: Json = False,
):
    """Live a recording again.

    With --verify every tick is compared; the first that differs is named, and the exit code is 1.
    Without, it goes to the last tick or to --to-tick by the shortest way, and prints what is measured there.
    """
    from flockbrush.commands import replay_recording

    replay_recording(recording, verify, to_tick, threads, json)


@app.command()
def export(
    recording: RecordingPath,
    to: Annotated[
        list[Path],
        typer.Option("--to", metavar="FILE", help="Write .mp4, .png, .csv, .parquet or .usdc; may be given again."),
    ],
    fps: Fps = None,
    threads: Threads = None,
    theme: ThemeOption = Theme.light,
    usd_mode: UsdOption = UsdMode.instancer,
    json: Json = False,
):
    """Write a recording as a video, a picture, a table or a scene."""
    from flockbrush.commands import export_recording

    export_recording(recording, to, fps, threads, {"theme": theme.value, "usd_mode": usd_mode.value}, json)


@app.command()
def measure(
    recording: RecordingPath,
    plot: Annotated[Path | None, typer.Option(metavar="PNG", help="Draw the measures over time.")] = None,
    every: Annotated[
        float, typer.Option(min=0.03125, max=3600, metavar="S", help="Seconds between two moments.")
    ] = 1.0,
    threads: Threads = None,
    json: Json = False,
):
    """Measure a recording: order, milling, speed, spread and what crosses the lines of the level."""
    from flockbrush.measure import measure_recording

    measure_recording(recording, plot, every, threads, json)


@app.command()
def bench(
    agents: Annotated[
        list[int] | None, typer.Option(min=1, metavar="N", help="How many animals; may be given again.")
    ] = None,
    large: Annotated[bool, typer.Option("--large", help="100,000 animals too.")] = False,
    ticks: Annotated[int, typer.Option(min=2, max=100_000, metavar="N", help="Ticks timed, after a warm-up.")] = 60,
    threads: Annotated[
        list[int] | None,
        typer.Option(min=1, max=1024, metavar="N", help="Threads; may be given again. 1 and 2 unless told."),
    ] = None,
    json: Json = False,
):
    """Time the ticks: a herd with one animal on 4 m² that sees 10 m far, exact occlusion."""
    from flockbrush.bench import benchmark

    sizes = agents or [1_000, 10_000] + ([100_000] if large else [])
    benchmark(sizes, ticks, threads or [1, 2], json)


@app.command()
def doctor(json: Json = False):
    """See whether everything is in its place: packages, compile cache, threads, Tiled, ffmpeg."""
    from flockbrush.doctor import examine

    examine(json)


# levels ----------------------------------------------------------------------------------


@level_app.command("check")
def level_check(files: Annotated[list[str], typer.Argument(metavar="FILE...", help="Levels; shipped names will do.")]):
    """Read levels and print everything that is wrong with them, one `file:line: ...` a line."""
    from flockbrush.commands import check_levels

    check_levels(files)


@level_app.command("render")
def level_render(
    level: LevelName,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PNG", help="Where the picture goes.")],
    seconds: Annotated[float, typer.Option(min=0, metavar="S", help="Let the animals walk so long first.")] = 0.0,
    seed: Seed = None,
    agents: Agents = None,
    theme: ThemeOption = Theme.light,
):
    """Draw a level with its animals."""
    from flockbrush.commands import render_level

    render_level(level, output, seconds, seed, agents, theme.value)


@level_app.command("init")
def level_init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new folder, or one to bring up to date.")],
):
    """Begin a folder for levels: a Tiled project with our classes, tilesets and a first level."""
    from flockbrush.commands import init_levels

    init_levels(folder)


@level_app.command("list")
def level_list():
    """The levels that come with Flockbrush."""
    from flockbrush.commands import list_levels

    list_levels()


# brushes -----------------------------------------------------------------------------------


@brush_app.command("list")
def brush_list(json: Json = False):
    """The brushes that come with Flockbrush."""
    from flockbrush.commands import list_brushes

    list_brushes(json)


@brush_app.command("show")
def brush_show(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A brush, or a .brush.toml file.")], json: Json = False
):
    """Everything a brush says: its numbers with units, and where they are from."""
    from flockbrush.commands import show_brush

    show_brush(name, json)


@brush_app.command("check")
def brush_check(files: Annotated[list[str], typer.Argument(metavar="FILE...", help="Brushes; shipped names will do.")]):
    """Read brushes and print everything that is wrong with them, one `file:line: ...` a line."""
    from flockbrush.commands import check_brushes

    check_brushes(files)


@brush_app.command("preview")
def brush_preview(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A brush, or a .brush.toml file.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PNG", help="Where the picture goes.")],
    agents: Annotated[int, typer.Option(min=1, max=100_000, metavar="N", help="How many animals.")] = 200,
    seconds: Annotated[float, typer.Option(min=0, max=3600, metavar="S", help="How long.")] = 30.0,
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, metavar="K", help="Of chance.")] = 0,
    start: Annotated[Start, typer.Option(help="How the herd stands at first.")] = Start.scatter,
    theme: ThemeOption = Theme.light,
):
    """Draw what animals under a brush do on a plain: at the start, half-way, at the end."""
    from flockbrush.commands import preview_brush

    preview_brush(name, output, agents, seconds, seed, start.value, theme.value)


# the way in ----------------------------------------------------------------------------------


def main(arguments=None):
    """Run the command and end the program with its exit code."""
    sys.exit(called(arguments))


def called(arguments=None) -> int:
    """Run the command; 0 when all is well, 1 when a problem was found, 2 when it was called wrongly."""
    try:
        code = app(arguments, standalone_mode=False, prog_name="flockbrush")
        sys.stdout.flush()
        if code == INTERRUPTED:  # some versions of typer turn Ctrl-C into this
            say("stopped")
        return code if isinstance(code, int) else 0
    except typer.Exit as error:
        return error.exit_code
    except terminal.Stopped:
        return INTERRUPTED
    except (KeyboardInterrupt, typer.Abort):
        say("stopped")
        return INTERRUPTED
    except BrokenPipeError:
        _close_pipe()
        return PIPE
    except Exception as error:  # noqa: BLE001  the last who can turn it into words
        return _usage(error) if hasattr(error, "exit_code") and hasattr(error, "show") else terminal.exit_code_of(error)


def _usage(error) -> int:
    from typer import rich_utils

    rich_utils.rich_format_error(error)
    return error.exit_code


def _close_pipe():
    """Nobody reads any more: keep Python from complaining about it at the end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
