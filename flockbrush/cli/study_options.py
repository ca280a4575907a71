"""Options of the commands ``flockbrush measure`` and ``flockbrush sweep``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from flockbrush.cli.shared_options import (
    Json,
    ThemeName,
    ThemeOption,
    Threads,
    TrackOptions,
    WorkOptions,
    argument,
    given_options,
    grouped,
    option,
    refuse_unused,
)


def is_tracks(path):
    """Whether this is a file of tracks, by its name, or a folder of them."""
    from flockbrush.film import track_files

    return track_files.is_tracks(Path(path))


@grouped
def measure(
    recording: Annotated[Path, argument("FILE", "Recording (.flock), table of an export, or tracks; see --unit.")],
    plot: Annotated[
        Path | None, option("FILE", "Chart of the measures over time to write (.png, .svg or .pdf).")
    ] = None,
    every: Annotated[float, option("S", "Time between two samples, s.", min=0.03125, max=3600)] = 1.0,
    threads: Threads = None,
    tracks: TrackOptions = TrackOptions(),  # noqa: B008  its fields become the options
    json: Json = False,
):
    """Measure a recording or tracks: order, milling, speed, spread, and crossings of counting lines."""
    if is_tracks(recording):
        from flockbrush.cli.measure_tracks import measure_tracks

        return measure_tracks(recording, tracks.read(), plot, every, json)
    from flockbrush.cli.measure import measure_recording

    refuse_unused("a recording", given_options(tracks))
    measure_recording(recording, plot, every, threads, json)


@grouped
def sweep(
    file: Annotated[Path, argument("SWEEP", "Sweep: a .sweep.toml file, or the name of a shipped sweep.")],
    out: Annotated[Path, option("DIR", "Folder for the rows, the summary and the plots.")],
    work: WorkOptions = WorkOptions(),  # noqa: B008  its fields become the options
    resume: Annotated[bool, option("--resume", "Continue the sweep in --out; failed runs are repeated.")] = False,
    theme: ThemeOption = ThemeName.light,
    json: Json = False,
):
    """Run every combination of parameters with every seed; write one row per run.

    If the sweep is stopped or killed, finished runs are kept, and --resume continues.
    The exit code is 1 if a run failed or an expectation in the file was not met.
    """
    from flockbrush.cli.sweep_commands import run_sweep

    run_sweep(file, out, *work.read(), resume, json, theme.value)
