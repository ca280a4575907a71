"""The command ``flockbrush``.

Only what every command needs is imported here: ``flockbrush --help`` must not wait for numba.
"""

from __future__ import annotations

import enum
import sys
from pathlib import Path
from typing import Annotated

import typer

import flockbrush
from flockbrush.cli import learning_commands as cli_learning
from flockbrush.cli.edit_options import edit
from flockbrush.cli.export_options import WithExports, WithExportTable, chosen
from flockbrush.engine.plain_text import plain
from flockbrush.runs import streams, terminal
from flockbrush.runs.terminal import INTERRUPTED, PIPE, print_line, say

app = typer.Typer(
    name="flockbrush",
    help="Simulate herds and flocks that follow behaviour brushes: play, run, record and replay levels.",
    epilog="Start with:  flockbrush demo   and:  flockbrush level init my-levels",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
level_app = typer.Typer(help="Check, draw and create levels.", no_args_is_help=True)
brush_app = typer.Typer(
    help="List, show and preview brushes: models of behaviour with their parameters.", no_args_is_help=True
)
formation_app = typer.Typer(help="Line formations of birds: detect, extract and fly them.", no_args_is_help=True)
app.add_typer(level_app, name="level")
app.add_typer(brush_app, name="brush")
app.add_typer(formation_app, name="formation")
program_app = typer.Typer(help="Programs: states of animals and the triggers between them.", no_args_is_help=True)
app.add_typer(program_app, name="program")

RUN_SECONDS = 30.0  # s of a run when nobody says


class ThemeName(str, enum.Enum):
    """Colours of pictures and videos."""

    light = "light"
    dark = "dark"


class StartLayout(str, enum.Enum):
    """How a herd stands at first."""

    scatter = "scatter"
    grid = "grid"
    ring = "ring"
    line = "line"


class LiftMethod(str, enum.Enum):
    """How depths are found."""

    smooth = "smooth"
    cobyla = "cobyla"


LevelName = Annotated[str, typer.Argument(metavar="LEVEL", help="A .tmj file, or the name of a shipped level.")]
TrackUnit = Annotated[str | None, typer.Option("--unit", metavar="m|px|bl", help="Of tracks that do not say it.")]
TrackFps = Annotated[
    float | None, typer.Option("--fps", min=0.001, max=10_000, metavar="F", help="Of tracks without times.")
]
TrackMetres = Annotated[
    float | None, typer.Option(min=0.001, max=50, metavar="M", help="Of tracks: nose to tail, metres.")
]
TrackPixels = Annotated[
    float | None, typer.Option(min=0.01, max=2000, metavar="L", help="Of tracks: nose to tail, pixels.")
]
RecordingPath = Annotated[Path, typer.Argument(metavar="RECORDING", help="A file made with --record.")]
Events = Annotated[
    list[str] | None,
    typer.Option(
        metavar="S:NAME",
        help="An event for programs at S seconds: 2.5:alarm, or 2.5:alarm@X,Y,RADIUS; may be repeated.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of a table.")]
Seconds = Annotated[float | None, typer.Option(min=0, metavar="S", help="Duration in simulated seconds.")]
Seed = Annotated[
    int | None, typer.Option(min=0, max=2**63 - 1, metavar="K", help="Random seed, instead of the level's own.")
]
Agents = Annotated[
    int | None,
    typer.Option(min=1, metavar="N", help="Number of animals instead of the level's counts, at the same density."),
]
Threads = Annotated[
    int | None,
    typer.Option(min=1, max=1024, metavar="N", help="Largest number of threads; the result does not depend on it."),
]
ReportFolder = Annotated[
    Path | None, typer.Option("--report", metavar="DIR", help="Folder for both states when two runs differ.")
]
Fps = Annotated[
    float | None,
    typer.Option(metavar="F", help="Frames per second of exports; default: every tick (32), 24 for USD."),
]
ThemeOption = Annotated[ThemeName, typer.Option(help="Colours of pictures and videos.")]


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
    out: Annotated[Path, typer.Option(metavar="FILE", help="Video file to write.")] = Path("demo.mp4"),
    seconds: Annotated[float, typer.Option(min=0, metavar="S", help="Duration in simulated seconds.")] = RUN_SECONDS,
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Recording to write.")] = None,
    threads: Threads = None,
    theme: ThemeOption = ThemeName.light,
):
    """Run a flock of sheep through a pasture with obstacles; write demo.mp4 and print measures."""
    from flockbrush.cli.commands import RunRequest, run_level

    if out.suffix.lower() != ".mp4":
        raise typer.BadParameter(f"the demo is a video; its name ends in .mp4, got {str(out)!r}", param_hint="--out")
    run_level(
        RunRequest(
            "sheep-pasture",
            seconds=seconds,
            record=record,
            exports=[out],
            threads=threads,
            options={"theme": theme.value},
        )
    )


def _is_tracks(path):
    """Whether a name is that of a file of tracks."""
    from flockbrush.film.track_files import ENDINGS

    return Path(path).suffix.lower() in ENDINGS


@app.command()
def play(
    level: LevelName = "meadow",
    brush: Annotated[str | None, typer.Option(metavar="NAME", help="Brush selected at the start.")] = None,
    seed: Seed = None,
    agents: Agents = None,
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Recording to write, for replay.")] = None,
    theme: Annotated[ThemeName | None, typer.Option(help="Colours; default: as in the last session.")] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Size of the window in pixels.")] = "1280x720",
    text_size: Annotated[
        float | None,
        typer.Option(
            "--text-size", min=50, max=300, metavar="PERCENT", help="Size of text and buttons; 100 is normal."
        ),
    ] = None,
    frames: Annotated[int | None, typer.Option(min=0, metavar="N", help="Close after this number of frames.")] = None,
    clip: Annotated[
        Path | None, typer.Option(metavar="CLIP", help="Open a film to mark instead of a level; 'sky': sketch a flock.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the marks; default: the current folder.")
    ] = None,
    tracks: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Tracks of the birds in the film, as written by track.")
    ] = None,
    camera: Annotated[
        Path | None, typer.Option(metavar="FILE", help="TOML file of the film's camera, for lift.")
    ] = None,
    mode: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="What to do with the film: look, landmarks, paint, body, birds or sketch."),
    ] = None,
    unit: TrackUnit = None,
    fps: TrackFps = None,
    body_length_m: TrackMetres = None,
    body_length_px: TrackPixels = None,
):
    """Open the playground: paint, tune and direct a running herd; with --clip, mark a film.

    A file of tracks instead of a level is shown in space: a flight as `lift` and `export` write it, with --camera the
    tracks of birds, lifted, else animals on the ground.
    """
    if clip is not None:
        from flockbrush.studio.start_clip import mark_clip

        return mark_clip(clip, out, tracks, camera, mode, None if theme is None else theme.value, size, frames)
    if _is_tracks(level):
        from flockbrush.film.open_clip import Looking
        from flockbrush.studio.start_lift import show_flight

        look = Looking(
            unit=cli_learning.unit_of(unit), fps=fps, body_length_m=body_length_m, body_length_px=body_length_px
        )
        return show_flight(level, camera, None if theme is None else theme.value, size, frames, look)
    from flockbrush.studio.start import StartOptions, play_level

    wishes = StartOptions(
        level, brush, seed, agents, record, None if theme is None else theme.value, size, frames, text_size
    )
    return play_level(wishes)


@app.command(cls=WithExports)
def run(
    context: typer.Context,
    level: LevelName,
    ticks: Annotated[int | None, typer.Option(min=0, metavar="N", help="Duration in ticks of 1/32 s.")] = None,
    seconds: Seconds = None,
    seed: Seed = None,
    agents: Agents = None,
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Recording to write, for replay.")] = None,
    export: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="File to write (kinds: flockbrush export --help); may be repeated."),
    ] = None,
    event: Events = None,
    brush: Annotated[
        str | None, typer.Option(metavar="NAME", help="Brush for all spawned animals, a name or a .brush.toml file.")
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
        typer.Option(min=1, metavar="N", help="Simulate every tick twice, from a snapshot every N ticks, and compare."),
    ] = None,
    report: ReportFolder = None,
    json: Json = False,
):
    """Run a level without a window, for 30 seconds by default."""
    from flockbrush.cli.commands import RunRequest, run_level

    if ticks is not None and seconds is not None:
        raise typer.BadParameter("give --ticks or --seconds, not both", param_hint="--ticks")
    if report is not None and synctest is None:
        raise typer.BadParameter("goes with --synctest", param_hint="--report")
    if keyframes is not None and record is None:
        raise typer.BadParameter("goes with --record", param_hint="--keyframes")
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
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="0: any free port.")] = 0,
    host: Annotated[str, typer.Option(metavar="ADDRESS", help="Who may connect; default: this machine alone.")] = (
        "127.0.0.1"
    ),
    frame_rate: Annotated[
        float, typer.Option("--fps", min=1, max=60, metavar="F", help="Frames per second to each client.")
    ] = 60.0,
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Keep a recording, for replay.")] = None,
    seconds: Annotated[
        float | None, typer.Option(min=0, metavar="S", help="End after so many simulated seconds; default: Ctrl-C.")
    ] = None,
    seed: Seed = None,
    agents: Agents = None,
    brush: Annotated[
        str | None, typer.Option(metavar="NAME", help="For all animals of spawns, by name or as a .brush.toml file.")
    ] = None,
    threads: Threads = None,
    json: Json = False,
):
    """Run a level live for other programs, which draw and steer it over a WebSocket (live link).

    The address with its token is printed at the start: who has it can steer the herd. Ctrl-C ends.
    """
    from flockbrush.cli.serve_commands import Service, serve_level

    serve_level(Service(level, host, port, frame_rate, record, seconds, seed, agents, brush, threads, json))


@app.command()
def replay(
    recording: RecordingPath,
    verify: Annotated[bool, typer.Option("--verify", help="Compare every tick with the recording.")] = False,
    to_tick: Annotated[int | None, typer.Option(min=0, metavar="N", help="Last tick to replay.")] = None,
    report: ReportFolder = None,
    threads: Threads = None,
    json: Json = False,
):
    """Replay a recording.

    With --verify every tick is compared; the first that differs is reported with system, animals and values,
    and the exit code is 1.
    Without --verify it goes to the last tick, or to --to-tick, from the nearest snapshot, and prints measures there.
    """
    from flockbrush.cli.replay_commands import replay_recording

    if report is not None and not verify:
        raise typer.BadParameter("goes with --verify", param_hint="--report")
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
        bool, typer.Option("--edits/--no-edits", help="Apply the edits beside the recording (flockbrush edit).")
    ] = True,
    threads: Threads = None,
    json: Json = False,
):
    """Write a recording as a file that other programs open; the ending of the name says which (table below)."""
    from flockbrush.cli.export_commands import export_recording

    export_recording(recording, to, fps, threads, chosen(context, to), json, edits)


app.command("edit")(edit)


@app.command()
def measure(
    recording: RecordingPath,
    plot: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Picture to write, with the measures over time.")
    ] = None,
    every: Annotated[
        float, typer.Option(min=0.03125, max=3600, metavar="S", help="Seconds between two samples.")
    ] = 1.0,
    threads: Threads = None,
    unit: TrackUnit = None,
    fps: TrackFps = None,
    body_length_m: TrackMetres = None,
    body_length_px: TrackPixels = None,
    json: Json = False,
):
    """Measure a recording or tracks: order, milling, speed, spread and what crosses the lines of the level."""
    if _is_tracks(recording):
        from flockbrush.cli.measure_tracks import measure_tracks
        from flockbrush.film.open_clip import Looking

        look = Looking(
            unit=cli_learning.unit_of(unit), fps=fps, body_length_m=body_length_m, body_length_px=body_length_px
        )
        return measure_tracks(recording, look, plot, every, json)
    from flockbrush.cli.measure import measure_recording

    measure_recording(recording, plot, every, threads, json)


@app.command()
def track(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A film of birds against the sky.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="Table of tracks to write: frame, id, x, y in pixels.")],
    seed_points: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Table of known birds to start from: frame, id, x, y.")
    ] = None,
    correct: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Table of corrected positions: frame, id, x, y; tracking continues from them."
        ),
    ] = None,
    reach: Annotated[
        float | None,
        typer.Option(
            min=1, metavar="PX", help="Largest distance between the predicted and the found position of a bird."
        ),
    ] = None,
    json: Json = False,
):
    """Track the birds of a film, one id each, through crossings and gaps."""
    from flockbrush.film.track_clip import track_clip

    return track_clip(clip, out, seed_points, correct, reach, json)


@app.command()
def lift(
    tracks: Annotated[Path, typer.Argument(metavar="TRACKS", help="Table of tracks: frame, id, x, y in pixels.")],
    camera: Annotated[Path, typer.Option(metavar="FILE", help="TOML: width, height, horizontal_fov_deg, fps, ...")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="Trajectory to write, a CSV in metres.")],
    lambda_t: Annotated[float, typer.Option(min=0, help="Weight of smooth paths.")] = 1.0,
    lambda_f: Annotated[float, typer.Option(min=0, help="Weight of similar velocities.")] = 1.0,
    evenness: Annotated[float, typer.Option(min=0, help="Weight of a constant speed of the flock.")] = 1.0,
    separation: Annotated[
        float, typer.Option(min=0, max=1, help="Weight of separation between birds, for looks.")
    ] = 0.0,
    separation_distance: Annotated[
        float, typer.Option(min=0, metavar="M", help="Distance below which birds are too close.")
    ] = 1.2,
    near: Annotated[
        float | None, typer.Option(metavar="M", help="Distance in metres, instead of the camera file's.")
    ] = None,
    far: Annotated[
        float | None, typer.Option(metavar="M", help="Distance in metres, instead of the camera file's.")
    ] = None,
    method: Annotated[
        LiftMethod, typer.Option(help="smooth: one global solution; cobyla: Lin's descent.")
    ] = LiftMethod.smooth,
    brush: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Formation brush to write too, from the birds of one frame.")
    ] = None,
    frame: Annotated[int | None, typer.Option(metavar="N", help="Frame number; default: the middle one.")] = None,
    wingspan: Annotated[
        float | None, typer.Option(metavar="M", help="Heading of the birds; default: estimated.")
    ] = None,
    json: Json = False,
):
    """Lift a flock from one camera into space: tracks in pixels become a flight in metres."""
    from flockbrush.cli.lift_commands import lift_tracks

    wishes = dict(smoothness=lambda_t, flock=lambda_f, evenness=evenness)
    wishes |= dict(separation=separation, separation_distance=separation_distance)
    made = (brush, frame, wingspan) if brush is not None else None
    lift_tracks(tracks, camera, out, method.value, near, far, json, made, **wishes)


@app.command()
def sweep(
    file: Annotated[Path, typer.Argument(metavar="SWEEP", help="A .sweep.toml file, or the name of a shipped one.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for rows, summary and plots.")],
    jobs: Annotated[
        int | None, typer.Option(min=1, max=1024, metavar="N", help="Number of processes; default: one per core.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the sweep in DIR; failed runs are repeated.")
    ] = False,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Address of the scheduler of a Dask cluster, such as tcp://host:8786."),
    ] = None,
    tls_ca: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Certificate that signed those of the cluster (tls://).")
    ] = None,
    tls_cert: Annotated[Path | None, typer.Option(metavar="FILE", help="Own certificate for the cluster.")] = None,
    tls_key: Annotated[Path | None, typer.Option(metavar="FILE", help="Key of the own certificate.")] = None,
    theme: ThemeOption = ThemeName.light,
    json: Json = False,
):
    """Run every combination of parameters with every seed; write one row per run.

    Finished runs are kept when the sweep is stopped or killed; --resume continues.
    The exit code is 1 when a run failed or an expectation of the file was missed.
    """
    from flockbrush.cli.sweep_commands import run_sweep
    from flockbrush.studies.sweep import Tls

    if jobs is not None and cluster is not None:
        raise typer.BadParameter("give --jobs or --cluster, not both", param_hint="--jobs")
    tls = Tls(tls_ca, tls_cert, tls_key)
    if cluster is None and tls != Tls():
        raise typer.BadParameter("these files are for --cluster tls://HOST:PORT", param_hint="--tls-ca")
    run_sweep(file, out, jobs, resume, cluster, json, theme.value, tls)


cli_learning.register(app)


class FileKind(str, enum.Enum):
    """Files that have a JSON schema."""

    brush = "brush"
    level = "level"
    sweep = "sweep"


@app.command()
def schema(kind: Annotated[FileKind, typer.Argument(metavar="brush|level|sweep", help="Kind of file.")]):
    """Print the JSON schema of a file format, for editors that complete names and show units and bounds."""
    from flockbrush.cli.json_schemas import SCHEMAS

    terminal.print_json(SCHEMAS[kind.value]())


@app.command()
def bench(
    agents: Annotated[
        list[int] | None, typer.Option(min=1, metavar="N", help="Number of animals; may be repeated.")
    ] = None,
    large: Annotated[bool, typer.Option("--large", help="Include 100,000 animals.")] = False,
    ticks: Annotated[
        int, typer.Option(min=2, max=100_000, metavar="N", help="Number of ticks to time, after a warm-up.")
    ] = 60,
    threads: Annotated[
        list[int] | None,
        typer.Option(min=1, max=1024, metavar="N", help="Number of threads; may be repeated. Default: 1 and 2."),
    ] = None,
    json: Json = False,
):
    """Time the ticks of a herd: 0.25 animals/m², 10 m view range, exact occlusion."""
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
    out: Annotated[Path, typer.Argument(metavar="FOLDER", help="Where the wheel is written.")] = Path("dist"),
    level: Annotated[
        list[str] | None,
        typer.Option(metavar="LEVEL", help="Whose kernels are compiled; may be repeated; default: meadow."),
    ] = None,
    cpu: Annotated[
        list[str] | None,
        typer.Option(metavar="CPU", help="x86-64-v4 or x86-64-v3; may be repeated; default: both."),
    ] = None,
):
    """Build a wheel of this checkout that brings its kernels compiled."""
    from flockbrush.cli.build_wheel import build
    from flockbrush.engine.shipped_kernels import CPUS

    build(out, level or ["meadow"], cpu or list(CPUS))


# levels ----------------------------------------------------------------------------------


@level_app.command("check")
def level_check(
    files: Annotated[list[str], typer.Argument(metavar="FILE...", help="Level files, or names of shipped levels.")],
    window: Annotated[bool, typer.Option("--window", help="Also show the result in a window (F6 in Tiled).")] = False,
):
    """Check levels and print every problem as `file:line: ...`."""
    from flockbrush.cli.commands import check_levels

    check_levels(files, window)


@level_app.command("render")
def level_render(
    level: LevelName,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PNG", help="Picture to write.")],
    seconds: Annotated[
        float, typer.Option(min=0, metavar="S", help="Simulated seconds before the picture is drawn.")
    ] = 0.0,
    seed: Seed = None,
    agents: Agents = None,
    theme: ThemeOption = ThemeName.light,
):
    """Draw a level with its animals."""
    from flockbrush.cli.commands import render_level

    render_level(level, output, seconds, seed, agents, theme.value)


@level_app.command("init")
def level_init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to create or to update.")],
):
    """Create a folder for levels: a Tiled project with the Flockbrush classes, tilesets and a first level."""
    from flockbrush.cli.commands import init_levels

    init_levels(folder)


@level_app.command("adopt")
def level_adopt(
    map_file: Annotated[Path, typer.Argument(metavar="MAP", help="A .tmx or .tmj map of Tiled; it is only read.")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="NEW", help="The level, .tmj; default: beside the map, with its name."),
    ] = None,
    metres: Annotated[
        float, typer.Option("--metres-per-tile", min=0.001, max=1000, metavar="M", help="Size of a tile on the ground.")
    ] = 1.0,
):
    """Make a level of a map that you have: our layers, schema and properties are added, yours stay as they are."""
    from flockbrush.cli.commands import adopt_map

    adopt_map(map_file, output, metres)


@level_app.command("list")
def level_list():
    """The levels that come with Flockbrush."""
    from flockbrush.cli.commands import list_levels

    list_levels()


# brushes -----------------------------------------------------------------------------------


@brush_app.command("list")
def brush_list(json: Json = False):
    """The brushes that come with Flockbrush."""
    from flockbrush.cli.commands import list_brushes

    list_brushes(json)


@brush_app.command("show")
def brush_show(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A brush, or a .brush.toml file.")], json: Json = False
):
    """Show a brush: its parameters with units, and their origin."""
    from flockbrush.cli.commands import show_brush

    show_brush(name, json)


@brush_app.command("check")
def brush_check(
    files: Annotated[
        list[str],
        typer.Argument(metavar="FILE...", help="Brush files, paths between brushes, or names of shipped brushes."),
    ],
):
    """Check brushes and print every problem as `file:line: ...`."""
    from flockbrush.cli.commands import check_brushes

    check_brushes(files)


@brush_app.command("convert")
def brush_convert(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Brush files with a [body] table.")],
    species: Annotated[
        str, typer.Option(metavar="NAME", help="Species that the brushes are made for, whatever their body.")
    ] = "",
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FOLDER", help="File or folder to write, instead of changing the files."
        ),
    ] = None,
):
    """Convert brushes with `[body]` to a species: `made_for`, and a species file where none fits."""
    from flockbrush.cli.brush_conversion import convert_brushes

    convert_brushes(files, species, output)


@brush_app.command("morph")
def brush_morph(
    start: Annotated[str, typer.Argument(metavar="A", help="The brush to start from: a name or a .brush.toml file.")],
    end: Annotated[str, typer.Argument(metavar="B", help="The brush to go to, of the same model.")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="File to write; default: A--B.path.toml, in this folder."),
    ] = None,
    animals: Annotated[int, typer.Option(min=3, max=100_000, metavar="N", help="Animals of each herd.")] = 100,
    seeds: Annotated[int, typer.Option(min=2, max=1000, metavar="N", help="Herds measured at each step.")] = 3,
    steps: Annotated[int, typer.Option(min=2, max=64, metavar="N", help="Steps of the path.")] = 8,
    seconds: Annotated[
        float, typer.Option(min=1, max=3600, metavar="S", help="Simulated seconds of each herd.")
    ] = 20.0,
    wander: Annotated[
        float,
        typer.Option(min=0, max=10, metavar="W", help="Random turning added half-way (rad/√s), none at the ends."),
    ] = 0.0,
):
    """Measure a path between two brushes along which behaviour changes evenly, beside the straight line.

    Sweeps a herd there and back and says when the pair is bistable. Paint of part weight follows the path when it lies
    in a folder `brushes` beside the level. About a minute with the defaults.
    """
    from flockbrush.cli.morph_commands import Trial, morph_brushes

    morph_brushes(start, end, output, Trial(animals, seeds, steps, seconds), wander)


@brush_app.command("preview")
def brush_preview(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A brush, or a .brush.toml file.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="PNG", help="Picture to write.")],
    agents: Annotated[int, typer.Option(min=1, max=100_000, metavar="N", help="Number of animals.")] = 200,
    seconds: Annotated[float, typer.Option(min=0, max=3600, metavar="S", help="Duration in simulated seconds.")] = 30.0,
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, metavar="K", help="Random seed.")] = 0,
    start: Annotated[StartLayout, typer.Option(help="Arrangement of the animals at the start.")] = StartLayout.scatter,
    theme: ThemeOption = ThemeName.light,
):
    """Draw animals under a brush on a plane: at the start, half-way and at the end."""
    from flockbrush.cli.commands import preview_brush

    preview_brush(name, output, agents, seconds, seed, start.value, theme.value)


# programs ------------------------------------------------------------------------------------

ProgramName = Annotated[str, typer.Argument(metavar="NAME", help="A program, or a .program.toml file.")]


@program_app.command("list")
def program_list(json: Json = False):
    """The programs that come with Flockbrush."""
    from flockbrush.cli.program_commands import list_programs

    list_programs(json)


@program_app.command("show")
def program_show(name: ProgramName, json: Json = False):
    """Show a program: its states and triggers."""
    from flockbrush.cli.program_commands import show_program

    show_program(name, json)


@program_app.command("check")
def program_check(
    files: Annotated[list[str], typer.Argument(metavar="FILE...", help="Program files, or names of shipped programs.")],
):
    """Check programs and print every problem as `file:line: ...`."""
    from flockbrush.cli.program_commands import check_programs

    check_programs(files)


@program_app.command("test")
def program_test(
    name: ProgramName,
    animals: Annotated[
        int, typer.Option(min=1, max=100_000, metavar="N", help="Number of animals that follow the program.")
    ] = 100,
    seconds: Annotated[float, typer.Option(min=0, max=3600, metavar="S", help="Duration in simulated seconds.")] = 60.0,
    seed: Annotated[int, typer.Option(min=0, max=2**31 - 1, metavar="K", help="Random seed.")] = 0,
    species: Annotated[str, typer.Option(metavar="NAME", help="Species of the animals.")] = "sheep",
    intruder: Annotated[
        str,
        typer.Option(
            metavar="SPECIES:BRUSH",
            help="An animal that arrives after 5 s from 40 m away, as SPECIES:BRUSH, for example wolf:wolf-hunt.",
        ),
    ] = "",
    event: Events = None,
    json: Json = False,
):
    """Run a program on a plane; print the share of animals in each state and the transitions."""
    from flockbrush.cli.program_commands import test_program

    test_program(name, animals, seconds, seed, species, intruder, event, json)


# formations ----------------------------------------------------------------------------------


@formation_app.command("detect")
def formation_detect(
    files: Annotated[
        list[Path], typer.Argument(metavar="IMAGES|CLIP...", help="Pictures or a video of birds on a plain sky.")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="MARKS.csv", help="Table of marked birds to write.")],
    every: Annotated[int, typer.Option(min=1, metavar="K", help="Use every N-th frame of a video.")] = 1,
    json: Json = False,
):
    """Find birds on a plain sky, follow them from frame to frame, and write where they are."""
    from flockbrush.cli.formation_commands import detect

    detect(files, out, every, json)


@formation_app.command("mark")
def formation_mark(
    files: Annotated[
        list[Path], typer.Argument(metavar="IMAGES|CLIP...", help="Pictures or a video of birds on a plain sky.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", metavar="MARKS.csv", help="Table of marked birds to write; existing marks in it are loaded."
        ),
    ] = None,
    every: Annotated[int, typer.Option(min=1, metavar="K", help="Use every N-th frame of a video.")] = 1,
    theme: Annotated[ThemeName | None, typer.Option(help="Colours; default: as in the last session.")] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Size of the window in pixels.")] = "1280x720",
    frames: Annotated[int | None, typer.Option(min=0, metavar="N", help="Close after this number of frames.")] = None,
):
    """Correct the positions of detected birds by clicks, frame by frame, and see their formation."""
    from flockbrush.studio.start_marking import mark_birds

    return mark_birds(files, out, every, None if theme is None else theme.value, size, frames)


@formation_app.command("extract")
def formation_extract(
    marks: Annotated[
        Path,
        typer.Argument(
            metavar="MARKS.csv", help="Table with the columns frame, bird and x_px, y_px (or x_b, y_b in wingspans)."
        ),
    ],
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="X.json", help="Formation file to write.")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Picture to write, with birds, leader, outliers and curve.")
    ] = None,
    heading: Annotated[
        str, typer.Option(metavar="WAY", help="Heading: up, down, left, right, degrees, or auto for a V.")
    ] = "up",
    wingspan: Annotated[float | None, typer.Option(metavar="PX", help="Wingspan in pixels.")] = None,
    samples: Annotated[
        int | None, typer.Option(min=1, max=10**6, metavar="K", help="Number of RANSAC samples; default: all samples.")
    ] = None,
    json: Json = False,
):
    """Extract the formation of marked birds: spacing, leader, curve, outliers, frame by frame."""
    from flockbrush.cli.formation_commands import extract_formation

    extract_formation(marks, out, plot, heading, wingspan, samples, json)


class ShapeName(str, enum.Enum):
    """Shapes of the textbook."""

    V = "V"
    U = "U"
    J = "J"
    line = "line"


@formation_app.command("initiate")
def formation_initiate(
    shape: Annotated[list[ShapeName] | None, typer.Option(help="Shape; may be repeated. Default: all.")] = None,
    birds: Annotated[
        list[int] | None,
        typer.Option(min=2, max=300, metavar="N", help="Number of birds; may be repeated. Default: 9, 14, 16, 28, 41."),
    ] = None,
    runs: Annotated[
        int, typer.Option(min=1, max=10_000, metavar="K", help="Number of flocks of each shape and size.")
    ] = 20,
    seed: Annotated[int, typer.Option(min=0, max=2**31, metavar="K", help="Random seed of the first flock.")] = 2000,
    ablate: Annotated[
        bool, typer.Option("--ablate", help="Leave out each rule in turn, and all additions to the paper.")
    ] = (False),
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="CSV", help="Table to write.")] = None,
    json: Json = False,
):
    """Let scattered birds form up many times; count the converged flocks and their times."""
    from flockbrush.cli.formation_commands import initiation

    initiation([s.value for s in shape or ShapeName], birds or [9, 14, 16, 28, 41], runs, seed, ablate, out, json)


@formation_app.command("brush")
def formation_brush(
    formation: Annotated[Path, typer.Argument(metavar="X.json", help="Formation file made by extract.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="NAME.brush.toml", help="Brush file to write.")],
    like: Annotated[
        str, typer.Option(metavar="BRUSH", help="Brush whose speed, body and wingspan are used.")
    ] = "geese",
):
    """Make a brush of a formation: its shape, slope, spacing and deviation."""
    from flockbrush.cli.formation_commands import make_brush

    make_brush(formation, out, like)


@formation_app.command("film")
def formation_film(
    level: LevelName,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="MP4", help="Video to write; .png: its last frame.")],
    seconds: Annotated[
        float, typer.Option(min=0.1, max=3600, metavar="S", help="Duration in simulated seconds.")
    ] = 60.0,
    seed: Seed = None,
    theme: ThemeOption = ThemeName.light,
):
    """Film a flock from close by, with beating wings; the leader is yellow, colours show the power each bird saves."""
    from flockbrush.cli.formation_commands import film_level

    film_level(level, out, seconds, seed, theme.value)


class KeyShapes(str, enum.Enum):
    """How key shapes are solved."""

    proximal = "proximal"
    levenberg_marquardt = "levenberg-marquardt"


@formation_app.command("fly")
def formation_fly(
    formation: Annotated[Path, typer.Argument(metavar="X.json", help="Formation file made by extract.")],
    birds: Annotated[
        int | None, typer.Option(min=2, max=500, metavar="N", help="Number of birds; default: as many as marked.")
    ] = None,
    frames: Annotated[int, typer.Option(min=1, max=10**6, metavar="F", help="Number of frames.")] = 250,
    fps: Annotated[float, typer.Option(min=0.1, max=1000, metavar="F", help="Frames per second.")] = 25.0,
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, metavar="K", help="Random seed.")] = 0,
    left: Annotated[int | None, typer.Option(min=0, metavar="K", help="Number of birds left of the leader.")] = None,
    exchange: Annotated[bool, typer.Option("--exchange", help="Exchange left and right.")] = False,
    method: Annotated[
        KeyShapes, typer.Option(help="levenberg-marquardt: the paper's method; proximal: always has a solution.")
    ] = (KeyShapes.proximal),
    epsilon: Annotated[
        float, typer.Option(min=0, max=1, help="Largest deviation of the savings from the range of the example.")
    ] = 0.1,
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="CSV", help="Trajectory to write.")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Picture to write, with six moments of the flight.")
    ] = None,
    json: Json = False,
):
    """Fly a formation with any number of birds, and report whether the flight kept its ranges."""
    from flockbrush.cli.formation_commands import fly

    fly(formation, birds, frames, fps, seed, left, exchange, method.value, epsilon, out, plot, json)


# the way in ----------------------------------------------------------------------------------


def main(arguments=None):
    """Run the command and end the program with its exit code."""
    streams.prepare()
    terminal.show_advice_plainly()
    sys.exit(called(arguments))


def called(arguments=None) -> int:
    """Run the command; 0 when all is well, 1 when a problem was found, 2 when it was called wrongly."""
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
