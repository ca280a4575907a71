"""The command ``flockbrush measure`` for tracks: the same measures for tracked animals."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flockbrush.cli.level_commands import check_plot
from flockbrush.cli.measure import as_series, series_as_json, show_series
from flockbrush.engine.files import sha256_of
from flockbrush.film.observations import CannotObserve, Evidence
from flockbrush.film.open_clip import Looking, look_at
from flockbrush.output.run_table import RunTable, read_run_table
from flockbrush.runs import terminal
from flockbrush.systems.measures import herd_measures


def series_of_tracks(evidence: Evidence, every: float) -> dict[str, list]:
    """The measures over time, {"time" and each measure: values}.

    Lengths are metres where the tracks are in metres, else body lengths.

    Parameters
    ----------
    evidence : Evidence
        Of `flockbrush.film.track_evidence.evidence_of_tracks`.
    every : float
        Seconds between two moments; the last frame is measured too.

    Raises
    ------
    CannotObserve
        When no two animals are there together.
    """
    sightings, fps = evidence.sightings, evidence.fps
    assert sightings is not None  # tracks are of single animals
    length = evidence.body_length_px if evidence.length_unit == "m" else 1.0
    last = len(evidence.fields) - 1
    frames = frames_every(last, every, fps)
    headed = np.isin(sightings.track, sightings.track[np.isfinite(sightings.turn)])  # others never moved
    headings, velocities, moments = sightings.forward * headed[:, None], _velocities(sightings, fps), []
    for t in frames:
        rows = sightings.of(t)
        if rows.stop - rows.start < 2:
            continue
        xyz, velocity, forward = (
            np.pad(part[rows], ((0, 0), (0, 1))) for part in (sightings.xy * length, velocities * length, headings)
        )
        moments.append({"time": evidence.start + t / fps, **herd_measures(xyz, velocity, forward, length)})
    if not moments:
        raise CannotObserve(evidence.name, "has no two animals in the same frame, of those that are measured")
    return as_series(moments)


def frames_every(last: int, every: float, fps: float) -> list[int]:
    """The frames nearest to every so many seconds, and the last one."""
    return np.unique([*np.round(np.arange(0.0, last, max(every * fps, 1.0))).astype(int), last]).tolist()


def _velocities(sightings, fps):
    """(m, 2) BL/s: central differences of the paths, one-sided at their ends; 0 for a single sight."""
    order = np.lexsort((sightings.frame, sightings.track))
    step = np.diff(sightings.xy[order], axis=0) * fps
    together = (np.diff(sightings.track[order]) == 0) & (np.diff(sightings.frame[order]) == 1)
    found, count = np.zeros((len(order), 2)), np.zeros((len(order), 1))
    for shift in (slice(1, None), slice(None, -1)):
        found[shift] += np.where(together[:, None], step, 0.0)
        count[shift, 0] += together
    out = np.empty_like(found)
    out[order] = found / np.maximum(count, 1.0)
    return out


def series_of_table(table: RunTable, every: float) -> dict[str, list]:
    """The measures of the table of a run over time, at the times at which `measure` takes those of its recording."""
    frames = frames_every(len(table) - 1, every, table.about.fps)
    return as_series([{"time": table.time(frame), **table.measures(table.rows(frame))} for frame in frames])


def measure_tracks(path, looking: Looking, plot=None, every=1.0, as_json=False):
    """Measure a file of tracks, print the measures and draw them.

    The table of a run is measured as its recording, unless options say how to look at it.

    Raises
    ------
    ProblemsError
        When the file cannot be read.
    """
    if plot is not None:
        check_plot(plot, [path])
    with terminal.Interrupts(), terminal.compiling():
        table = read_run_table(path) if looking == Looking() else None
        about, series, parts = _of_tracks(path, looking, every) if table is None else _of_table(path, table, every)
    name, unit = Path(path).name, about["unit"]
    if plot is not None:
        from flockbrush.output.figures import draw_series

        draw_series(plot, series, f"{name}, lengths in {unit}", unit)
    if as_json:
        terminal.print_json({"tracks": str(path), **about, **series_as_json(series, parts, plot)})
        return
    for note in about["notes"]:
        terminal.say(f"{path}: {note}")
    seconds = series["time"][-1] - series["time"][0]
    show_series(f"{name}: {len(series['time'])} moments of {seconds:g} s, lengths in {unit}", series, plot, unit)


def _of_tracks(path, looking, every):
    """(notes, measures over time, {}) of smoothed tracks."""
    evidence = look_at(path, looking)
    about = {
        "sha256": evidence.sha256, "fps": evidence.fps,
        "unit": "m" if evidence.length_unit == "m" else "body lengths",
        "animals": 0 if evidence.sightings is None else len(np.unique(evidence.sightings.track)),
        "notes": evidence.notes,
    }  # fmt: skip
    return about, series_of_tracks(evidence, every), {}


def _of_table(path, table, every):
    """The same of the table of a run, with the parts of its last frame."""
    notes = []
    if table.empty:
        beside = f"remove {Path(path).name}.json and " if Path(f"{path}.json").is_file() else ""
        notes.append(
            f"{table.empty} of {len(table)} frames have no animals, and count as such; if rows were taken out of the "
            f"table, {beside}give --unit m"
        )
    about = {
        "sha256": sha256_of(path), "fps": table.about.fps, "unit": "m",
        "animals": len(np.unique(table.numbers["id"])), "notes": notes,
    }  # fmt: skip
    parts = table.parts() | {"states": table.states(), "transitions": table.transitions()}
    return about, series_of_table(table, every), parts
