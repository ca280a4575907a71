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
    RecordFile,
    ReportFolder,
    Seconds,
    Seed,
    ThemeName,
    Threads,
)
from flockbrush.film.looking import MODES


@dataclass
class PlayOptions:
    """The options of the playground."""

    level: LevelName = "meadow"
    brush: Annotated[str | None, typer.Option(metavar="NAME", help="Name of the brush selected at the start.")] = None
    seed: Seed = None
    agents: Agents = None
    record: RecordFile = None
    theme: Annotated[
        ThemeName | None, typer.Option(help="Colours of the window; default: those of the last session.")
    ] = None
    palette: Annotated[
        PaletteName | None, typer.Option(help="Colours of brushes; default: those of the last session.")
    ] = None
    size: Annotated[str, typer.Option(metavar="WxH", help="Window size, pixels.")] = "1280x720"
    text_size: Annotated[
        float | None,
        typer.Option(
            "--text-size", min=50, max=300, metavar="PERCENT", help="Size of text and buttons, percent; 100 is normal."
        ),
    ] = None
    frames: Annotated[int | None, typer.Option(min=0, metavar="N", help="Close the window after N drawn frames.")] = (
        None
    )


@dataclass
class MarkOptions:
    """The clip to mark, and its known facts."""

    clip: Annotated[
        Path | None,
        typer.Option(
            metavar="CLIP", help="Open a clip to mark instead of a level; 'sky' opens an empty sky to sketch a flock."
        ),
    ] = None
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder for the marks of --clip; default: the current folder.")
    ] = None
    tracks: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Tracks of the birds in the clip, as written by `flockbrush track`."),
    ] = None
    camera: Annotated[
        Path | None, typer.Option(metavar="FILE", help="TOML file of the camera that filmed the clip or the tracks.")
    ] = None
    mode: Annotated[
        str | None,
        typer.Option(metavar="NAME", help=f"Mode to open the clip in: {', '.join(MODES[:-1])} or {MODES[-1]}."),
    ] = None


@dataclass
class RunRequest:
    """The options of a run."""

    level: LevelName
    ticks: Annotated[int | None, typer.Option(min=0, metavar="N", help="Duration, ticks of 1/32 s.")] = None
    seconds: Seconds = None
    seed: Seed = None
    agents: Agents = None
    record: RecordFile = None
    export: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="File to write (formats: flockbrush export --help); may be repeated."),
    ] = None
    event: Events = None
    brush: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Brush of all spawned animals, in place of their brushes and programs: a name or a .brush.toml file.",
        ),
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
        typer.Option(
            min=1,
            metavar="N",
            help="Determinism test: simulate every tick twice, from a snapshot every N ticks, and compare.",
        ),
    ] = None
    report: ReportFolder = None
    json: Json = False


@dataclass
class ServeOptions:
    """The options of a live link."""

    level: LevelName
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="Port to listen on; 0: any free port.")] = 0
    host: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Address to listen on; the default accepts only this machine.")
    ] = "127.0.0.1"
    frame_rate: Annotated[
        float, typer.Option("--fps", min=1, max=60, metavar="F", help="Frames per second sent to each client.")
    ] = 60.0
    record: RecordFile = None
    seconds: Annotated[
        float | None,
        typer.Option(min=0, metavar="S", help="Stop after S simulated seconds; default: run until Ctrl-C."),
    ] = None
    seed: Seed = None
    agents: Agents = None
    brush: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Brush of all spawned animals, in place of their brushes and programs: a name or a .brush.toml file.",
        ),
    ] = None
    threads: Threads = None
    json: Json = False
