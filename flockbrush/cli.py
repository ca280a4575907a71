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
from flockbrush import cli_learning, terminal
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
formation_app = typer.Typer(
    help="Birds in line formations: find them, learn from them, fly them.", no_args_is_help=True
)
app.add_typer(level_app, name="level")
app.add_typer(brush_app, name="brush")
app.add_typer(formation_app, name="formation")

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


class View(str, enum.Enum):
    """From where pictures show the herd."""

    plan = "plan"
    space = "space"


class LiftMethod(str, enum.Enum):
    """How depths are found."""

    smooth = "smooth"
    cobyla = "cobyla"


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
ViewOption = Annotated[View, typer.Option(help="Of pictures and videos: from straight above, or going with the herd.")]
Azimuth = Annotated[
    float, typer.Option(min=-360, max=360, metavar="DEG", help="In space: where one looks; 0 is east, 90 north.")
]
Elevation = Annotated[
    float | None, typer.Option(min=0, max=90, metavar="DEG", help="In space: how high above the herd one is.")
]
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
    clip: Annotated[
        Path | None, typer.Option(metavar="CLIP", help="Mark things in a film instead; 'sky': sketch a flock.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where what is marked in the film goes; here unless told.")
    ] = None,
    tracks: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Birds of the film, as track writes them.")
    ] = None,
    camera: Annotated[Path | None, typer.Option(metavar="FILE", help="TOML: the camera that filmed, for lift.")] = None,
    mode: Annotated[
        str | None, typer.Option(metavar="NAME", help="Of the film: look, landmarks, paint, body, birds or sketch.")
    ] = None,
):
    """Open a window in which a running herd is painted, tuned and directed; or, with --clip, one over a film.

    A table instead of a level (.csv) is shown in space: a flight as `lift` and `export` write it, or, with --camera,
    the tracks of birds, lifted.
    """
    if clip is not None:
        from flockbrush.play.start_clip import mark_clip

        return mark_clip(clip, out, tracks, camera, mode, None if theme is None else theme.value, size, frames)
    if str(level).lower().endswith(".csv"):
        from flockbrush.play.start_lift import show_flight

        return show_flight(level, camera, None if theme is None else theme.value, size, frames)
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
    view: ViewOption = View.plan,
    azimuth: Azimuth = 90.0,
    elevation: Elevation = None,
    usd_mode: UsdOption = UsdMode.instancer,
    json: Json = False,
):
    """Run a level without a window: 30 seconds unless told."""
    from flockbrush.commands import Job, run_level

    if ticks is not None and seconds is not None:
        raise typer.BadParameter("give --ticks or --seconds, not both", param_hint="--ticks")
    looks = {"theme": theme.value, "view": view.value, "azimuth": azimuth, "elevation": elevation}
    options = {**looks, "usd_mode": usd_mode.value}
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
    view: ViewOption = View.plan,
    azimuth: Azimuth = 90.0,
    elevation: Elevation = None,
    usd_mode: UsdOption = UsdMode.instancer,
    json: Json = False,
):
    """Write a recording as a video, a picture, a table or a scene."""
    from flockbrush.commands import export_recording

    looks = {"theme": theme.value, "view": view.value, "azimuth": azimuth, "elevation": elevation}
    export_recording(recording, to, fps, threads, {**looks, "usd_mode": usd_mode.value}, json)


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
def track(
    clip: Annotated[Path, typer.Argument(metavar="CLIP", help="A film of birds against the sky.")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="Where the tracks go: frame, id, x, y in pixels.")],
    seed_points: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Birds to begin with: frame, id, x, y.")
    ] = None,
    correct: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Who is really where: frame, id, x, y; followed on from there.")
    ] = None,
    reach: Annotated[
        float | None, typer.Option(min=1, metavar="PX", help="How far from the foretold place a bird may turn up.")
    ] = None,
    json: Json = False,
):
    """Follow the birds of a film: one id each, through crossings and gaps."""
    from flockbrush.track import track_clip

    return track_clip(clip, out, seed_points, correct, reach, json)


@app.command()
def lift(
    tracks: Annotated[Path, typer.Argument(metavar="TRACKS", help="A table with frame, id, x, y in pixels.")],
    camera: Annotated[Path, typer.Option(metavar="FILE", help="TOML: width, height, horizontal_fov_deg, fps, ...")],
    out: Annotated[Path, typer.Option(metavar="FILE", help="Where the flight goes, a CSV in metres.")],
    lambda_t: Annotated[float, typer.Option(min=0, help="Weight of smooth paths.")] = 1.0,
    lambda_f: Annotated[float, typer.Option(min=0, help="Weight of flying as one.")] = 1.0,
    evenness: Annotated[float, typer.Option(min=0, help="Weight of the flock's speed being even.")] = 1.0,
    separation: Annotated[float, typer.Option(min=0, max=1, help="Weight of keeping apart, for looks.")] = 0.0,
    separation_distance: Annotated[float, typer.Option(min=0, metavar="M", help="Nearer birds are too close.")] = 1.2,
    near: Annotated[float | None, typer.Option(metavar="M", help="Instead of the camera's.")] = None,
    far: Annotated[float | None, typer.Option(metavar="M", help="Instead of the camera's.")] = None,
    method: Annotated[
        LiftMethod, typer.Option(help="One global solve, or the thesis' own descent.")
    ] = LiftMethod.smooth,
    brush: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also a formation brush, from the birds of one frame.")
    ] = None,
    frame: Annotated[int | None, typer.Option(metavar="N", help="That frame; the middle one unless told.")] = None,
    wingspan: Annotated[float | None, typer.Option(metavar="M", help="Of the birds; guessed unless told.")] = None,
    json: Json = False,
):
    """Lift a flock from one camera into space: tracks in pixels become a flight in metres."""
    from flockbrush.lift import lift_tracks

    wishes = dict(smoothness=lambda_t, flock=lambda_f, evenness=evenness)
    wishes |= dict(separation=separation, separation_distance=separation_distance)
    made = (brush, frame, wingspan) if brush is not None else None
    lift_tracks(tracks, camera, out, method.value, near, far, json, made, **wishes)


@app.command()
def sweep(
    file: Annotated[Path, typer.Argument(metavar="SWEEP", help="A .sweep.toml file, or the name of a shipped one.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where rows, summary and plots go.")],
    jobs: Annotated[
        int | None, typer.Option(min=1, max=1024, metavar="N", help="So many processes; one for each core unless told.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with what DIR has; failed runs are done again.")
    ] = False,
    cluster: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="The scheduler of a Dask cluster, such as tcp://host:8786.")
    ] = None,
    theme: ThemeOption = Theme.light,
    json: Json = False,
):
    """Run something many times: every combination of parameters with every seed, a row for each run.

    A run that was done is never lost: stop it, kill it, and go on with --resume.
    The exit code is 1 when a run failed, or when what the file expects did not come.
    """
    from flockbrush.sweep import run_sweep

    if jobs is not None and cluster is not None:
        raise typer.BadParameter("give --jobs or --cluster, not both", param_hint="--jobs")
    run_sweep(file, out, jobs, resume, cluster, json, theme.value)


cli_learning.register(app)


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


# formations ----------------------------------------------------------------------------------


@formation_app.command("detect")
def formation_detect(
    files: Annotated[
        list[Path], typer.Argument(metavar="IMAGES|CLIP...", help="Pictures, or a video, of a plain sky.")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="MARKS.csv", help="Where the marks go.")],
    every: Annotated[int, typer.Option(min=1, metavar="K", help="One frame of so many of a video.")] = 1,
    json: Json = False,
):
    """Find birds on a plain sky, follow them from frame to frame, and write where they are."""
    from flockbrush.formation import detect

    detect(files, out, every, json)


@formation_app.command("mark")
def formation_mark(
    files: Annotated[
        list[Path], typer.Argument(metavar="IMAGES|CLIP...", help="Pictures, or a video, of a plain sky.")
    ],
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="MARKS.csv", help="Where the marks go; those it has are taken up."),
    ] = None,
    every: Annotated[int, typer.Option(min=1, metavar="K", help="One frame of so many of a video.")] = 1,
    theme: Annotated[Theme | None, typer.Option(help="As last time unless told.")] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Of the window, pixels.")] = "1280x720",
    frames: Annotated[int | None, typer.Option(min=0, metavar="N", help="Close after so many frames.")] = None,
):
    """Correct by clicks where birds are, frame by frame, and see the formation they make."""
    from flockbrush.play.start_marking import mark_birds

    return mark_birds(files, out, every, None if theme is None else theme.value, size, frames)


@formation_app.command("extract")
def formation_extract(
    marks: Annotated[
        Path, typer.Argument(metavar="MARKS.csv", help="Columns frame, bird and x_px, y_px (or x_b, y_b in wingspans).")
    ],
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="X.json", help="Where the formation goes.")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="PNG", help="Draw birds, leader, outliers and curve.")] = None,
    heading: Annotated[
        str, typer.Option(metavar="WAY", help="The way they fly: up, down, left, right, degrees, or auto for a V.")
    ] = "up",
    wingspan: Annotated[float | None, typer.Option(metavar="PX", help="One wingspan in pixels.")] = None,
    samples: Annotated[
        int | None, typer.Option(min=1, max=10**6, metavar="K", help="RANSAC with so many samples, instead of all.")
    ] = None,
    json: Json = False,
):
    """See which formation marked birds fly in: spacing, leader, curve, outliers, frame by frame."""
    from flockbrush.formation import extract_formation

    extract_formation(marks, out, plot, heading, wingspan, samples, json)


class Shape(str, enum.Enum):
    """Shapes of the textbook."""

    V = "V"
    U = "U"
    J = "J"
    line = "line"


@formation_app.command("initiate")
def formation_initiate(
    shape: Annotated[list[Shape] | None, typer.Option(help="Which shape; may be given again. All unless told.")] = None,
    birds: Annotated[
        list[int] | None,
        typer.Option(
            min=2, max=300, metavar="N", help="How many birds; may be given again. 9, 14, 16, 28, 41 unless told."
        ),
    ] = None,
    runs: Annotated[int, typer.Option(min=1, max=10_000, metavar="K", help="Flocks of each.")] = 20,
    seed: Annotated[int, typer.Option(min=0, max=2**31, metavar="K", help="Of the first flock.")] = 2000,
    ablate: Annotated[
        bool, typer.Option("--ablate", help="Leave out each rule in turn, and all that are not the paper's.")
    ] = (False),
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="CSV", help="Where the table goes.")] = None,
    json: Json = False,
):
    """Let scattered birds find into a formation, many times, and count who did and how soon."""
    from flockbrush.formation import initiation

    initiation([s.value for s in shape or Shape], birds or [9, 14, 16, 28, 41], runs, seed, ablate, out, json)


@formation_app.command("brush")
def formation_brush(
    formation: Annotated[Path, typer.Argument(metavar="X.json", help="Made by extract.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="NAME.brush.toml", help="Where the brush goes.")],
    like: Annotated[str, typer.Option(metavar="BRUSH", help="Speed, body and wingspan of this brush.")] = "geese",
):
    """Make a brush of a formation: its shape, slope, spacing and how alive it is."""
    from flockbrush.formation import make_brush

    make_brush(formation, out, like)


@formation_app.command("film")
def formation_film(
    level: LevelName,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="MP4", help="Where the film goes; .png: its last frame.")],
    seconds: Annotated[
        float, typer.Option(min=0.1, max=3600, metavar="S", help="How long, in simulated seconds.")
    ] = 60.0,
    seed: Seed = None,
    theme: ThemeOption = Theme.light,
):
    """Film a flock from close by: wings beat, the leader is yellow, and colours say what each bird saves."""
    from flockbrush.formation import film_level

    film_level(level, out, seconds, seed, theme.value)


class KeyShapes(str, enum.Enum):
    """How key shapes are solved."""

    proximal = "proximal"
    levenberg_marquardt = "levenberg-marquardt"


@formation_app.command("fly")
def formation_fly(
    formation: Annotated[Path, typer.Argument(metavar="X.json", help="Made by extract.")],
    birds: Annotated[
        int | None, typer.Option(min=2, max=500, metavar="N", help="As many as marked unless told.")
    ] = None,
    frames: Annotated[int, typer.Option(min=1, max=10**6, metavar="F", help="How long.")] = 250,
    fps: Annotated[float, typer.Option(min=0.1, max=1000, metavar="F", help="Frames per second.")] = 25.0,
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, metavar="K", help="Of chance.")] = 0,
    left: Annotated[int | None, typer.Option(min=0, metavar="K", help="So many birds left of the leader.")] = None,
    exchange: Annotated[bool, typer.Option("--exchange", help="Exchange left and right.")] = False,
    method: Annotated[KeyShapes, typer.Option(help="The paper's method, or the one that always has an answer.")] = (
        KeyShapes.proximal
    ),
    epsilon: Annotated[float, typer.Option(min=0, max=1, help="How far savings may leave the example's range.")] = 0.1,
    out: Annotated[Path | None, typer.Option("-o", "--out", metavar="CSV", help="Where the positions go.")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="PNG", help="Draw six moments.")] = None,
    json: Json = False,
):
    """Fly a formation steadily with any number of birds, and say what the flight kept to."""
    from flockbrush.formation import fly

    fly(formation, birds, frames, fps, seed, left, exchange, method.value, epsilon, out, plot, json)


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
