"""Options that several commands have."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated

import typer


class ThemeName(str, enum.Enum):
    """Colours of pictures and videos."""

    light = "light"
    dark = "dark"
    vivid = "vivid"


class PaletteName(str, enum.Enum):
    """Colours of brushes."""

    own = "own"
    okabe_ito = "okabe-ito"
    tol = "tol"


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
    typer.Option(metavar="F", help="Frames per second of exports; each kind has its own (export --help)."),
]
ThemeOption = Annotated[ThemeName, typer.Option(help="Colours of pictures and videos.")]
PaletteOption = Annotated[
    PaletteName, typer.Option(help="Colours of brushes: their own, or some that differ for colour-blind eyes.")
]
