"""Options of the commands that run a level: play, run and serve."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from flockbrush.cli.shared_options import (
    Agents,
    Events,
    Fps,
    Json,
    LevelName,
    PaletteName,
    ReportFolder,
    Seconds,
    Seed,
    ThemeName,
    Threads,
)


@dataclass
class PlayOptions:
    """How the playground is opened."""

    level: LevelName = "meadow"
    brush: Annotated[str | None, typer.Option(metavar="NAME", help="Brush selected at the start.")] = None
    seed: Seed = None
    agents: Agents = None
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Recording to write, for replay.")] = None
    theme: Annotated[ThemeName | None, typer.Option(help="Colours; default: as in the last session.")] = None
    palette: Annotated[
        PaletteName | None, typer.Option(help="Colours of brushes; default: as in the last session.")
    ] = None
    size: Annotated[str, typer.Option(metavar="WxH", help="Size of the window in pixels.")] = "1280x720"
    text_size: Annotated[
        float | None,
        typer.Option(
            "--text-size", min=50, max=300, metavar="PERCENT", help="Size of text and buttons; 100 is normal."
        ),
    ] = None
    frames: Annotated[int | None, typer.Option(min=0, metavar="N", help="Close after this number of frames.")] = None


@dataclass
class MarkOptions:
    """A film to be marked, and what is known of it."""

    clip: Annotated[
        Path | None, typer.Option(metavar="CLIP", help="Open a film to mark instead of a level; 'sky': sketch a flock.")
    ] = None
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the marks; default: the current folder.")
    ] = None
    tracks: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Tracks of the birds in the film, as written by track.")
    ] = None
    camera: Annotated[Path | None, typer.Option(metavar="FILE", help="TOML file of the film's camera, for lift.")] = (
        None
    )
    mode: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="What to do with the film: look, landmarks, paint, body, birds or sketch."),
    ] = None


@dataclass
class RunRequest:
    """A run as the person asked for it."""

    level: LevelName
    ticks: Annotated[int | None, typer.Option(min=0, metavar="N", help="Duration in ticks of 1/32 s.")] = None
    seconds: Seconds = None
    seed: Seed = None
    agents: Agents = None
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Recording to write, for replay.")] = None
    export: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="File to write (kinds: flockbrush export --help); may be repeated."),
    ] = None
    event: Events = None
    brush: Annotated[
        str | None, typer.Option(metavar="NAME", help="Brush for all spawned animals, a name or a .brush.toml file.")
    ] = None
    fps: Fps = None
    threads: Threads = None
    keyframes: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Ticks between snapshots of the recording; default: 320, or fewer for many animals.",
        ),
    ] = None
    synctest: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Simulate every tick twice, from a snapshot every N ticks, and compare."),
    ] = None
    report: ReportFolder = None
    json: Json = False


@dataclass
class ServeOptions:
    """A live link as the person asked for it."""

    level: LevelName
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="0: any free port.")] = 0
    host: Annotated[str, typer.Option(metavar="ADDRESS", help="Who may connect; default: this machine alone.")] = (
        "127.0.0.1"
    )
    frame_rate: Annotated[
        float, typer.Option("--fps", min=1, max=60, metavar="F", help="Frames per second to each client.")
    ] = 60.0
    record: Annotated[Path | None, typer.Option(metavar="FILE", help="Keep a recording, for replay.")] = None
    seconds: Annotated[
        float | None, typer.Option(min=0, metavar="S", help="End after so many simulated seconds; default: Ctrl-C.")
    ] = None
    seed: Seed = None
    agents: Agents = None
    brush: Annotated[
        str | None, typer.Option(metavar="NAME", help="For all animals of spawns, by name or as a .brush.toml file.")
    ] = None
    threads: Threads = None
    json: Json = False
