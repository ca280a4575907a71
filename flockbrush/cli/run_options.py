"""Options of the commands that run a level: play, run and serve."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from flockbrush.cli.shared_options import (
    Agents,
    BrushOfAll,
    Events,
    Fps,
    Frames,
    Json,
    LevelName,
    PaletteName,
    RecordFile,
    ReportFolder,
    Seconds,
    Seed,
    Threads,
    WindowSize,
    WindowTheme,
    option,
)
from flockbrush.film.looking import MODES


@dataclass
class PlayOptions:
    """The options of the playground."""

    level: LevelName = "meadow"
    brush: Annotated[str | None, option("NAME", "Name of the brush selected at the start.")] = None
    seed: Seed = None
    agents: Agents = None
    record: RecordFile = None
    theme: WindowTheme = None
    palette: Annotated[PaletteName | None, option("Colours of brushes; default: those of the last session.")] = None
    size: WindowSize = "1280x720"
    text_size: Annotated[
        float | None,
        option("--text-size", "PERCENT", "Size of text and buttons, percent; 100 is normal.", min=50, max=300),
    ] = None
    frames: Frames = None


@dataclass
class MarkOptions:
    """The clip to mark, and its known facts."""

    clip: Annotated[
        Path | None,
        option("CLIP", "Open a clip to mark instead of a level; 'sky' opens an empty sky to sketch a flock."),
    ] = None
    out: Annotated[Path | None, option("DIR", "Folder for the marks of --clip; default: the current folder.")] = None
    tracks: Annotated[
        Path | None, option("FILE", "Tracks of the birds in the clip, as written by `flockbrush track`.")
    ] = None
    camera: Annotated[Path | None, option("FILE", "TOML file of the camera that filmed the clip or the tracks.")] = None
    mode: Annotated[
        str | None, option("NAME", f"Mode to open the clip in: {', '.join(MODES[:-1])} or {MODES[-1]}.")
    ] = None


@dataclass
class RunRequest:
    """The options of a run."""

    level: LevelName
    ticks: Annotated[int | None, option("N", "Duration, ticks of 1/32 s.", min=0)] = None
    seconds: Seconds = None
    seed: Seed = None
    agents: Agents = None
    record: RecordFile = None
    export: Annotated[
        list[Path] | None, option("FILE", "File to write (formats: flockbrush export --help); may be repeated.")
    ] = None
    event: Events = None
    brush: BrushOfAll = None
    fps: Fps = None
    threads: Threads = None
    keyframes: Annotated[
        int | None,
        option("N", "Ticks between snapshots of the recording; default: 320, or fewer for many animals.", min=1),
    ] = None
    synctest: Annotated[
        int | None,
        option("N", "Determinism test: simulate every tick twice, from a snapshot every N ticks, and compare.", min=1),
    ] = None
    report: ReportFolder = None
    json: Json = False


@dataclass
class ServeOptions:
    """The options of a live link."""

    level: LevelName
    port: Annotated[int, option("N", "Port to listen on; 0: any free port.", min=0, max=65535)] = 0
    host: Annotated[str, option("ADDRESS", "Address to listen on; the default accepts only this machine.")] = (
        "127.0.0.1"
    )
    frame_rate: Annotated[float, option("--fps", "F", "Frames per second sent to each client.", min=1, max=60)] = 60.0
    record: RecordFile = None
    seconds: Annotated[
        float | None, option("S", "Stop after S simulated seconds; default: run until Ctrl-C.", min=0)
    ] = None
    seed: Seed = None
    agents: Agents = None
    brush: BrushOfAll = None
    threads: Threads = None
    json: Json = False
