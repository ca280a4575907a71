"""Track birds in a video of the sky, and write their positions as a table."""

from __future__ import annotations

import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flockbrush.engine.files import claimed, refused, write_text
from flockbrush.film.media import FilmReader
from flockbrush.film.track_table import evened, unevenness
from flockbrush.film.tracking import Tracker
from flockbrush.film.tracks import Tracks, read_marks
from flockbrush.runs.terminal import INTERRUPTED, print_json, progress, say, show, table


def track_clip(clip, out, seed_points=None, correct=None, reach=None, as_json=False) -> int:
    """Track the birds of a video, write ``frame,id,x,y`` (px) and return the exit code.

    Parameters
    ----------
    clip, out : path
    seed_points, correct : path, optional
        Tables with ``frame,id,x,y``: birds marked by hand, and corrections of tracks.
    reach : float, optional
        Largest distance of a bird from its predicted position in the next frame, px.
    as_json : bool

    Raises
    ------
    ProblemsError
        When the video cannot be read or shows no birds.
    """
    inputs = [path for path in (clip, seed_points, correct) if path is not None]
    with claimed([out], inputs):
        return _track(clip, out, seed_points, correct, reach, as_json)


def _track(clip, out, seed_points, correct, reach, as_json):
    """What `track_clip` does while the tracks are locked."""
    seeds, corrections = (read_marks(path) if path else {} for path in (seed_points, correct))
    tracker = Tracker(seeds, corrections, reach)
    begin = time.perf_counter()
    seen = _follow(clip, tracker)
    frames, stopped = len(seen.times), seen.stopped
    try:
        tracks = tracker.tracks()
    except ValueError as error:
        if stopped:
            say(f"stopped after {frames} frames, too few to track a bird; nothing was written")
            return INTERRUPTED
        hint = "birds must be small, and darker or lighter than the sky"
        some = f"{frames} frame{'s' * (frames != 1)}"
        raise refused(clip, seen.damage or f"{error} in {some}; {hint}") from None
    notes = [seen.damage] if seen.damage else []
    if uneven := unevenness(seen.times):
        tracks.times = np.array(seen.times[tracks.first :][: len(tracks.px)])
        notes.append(f"{uneven}: the table has their times, and flockbrush lift refuses it; {evened(seen.times)}")
    kept = stopped and Path(out).exists()  # a part of a film replaces no earlier tracks
    if not kept:
        write_text(Path(out), table_of(tracks))
    seconds = time.perf_counter() - begin
    for path, marks, begun in ((seed_points, seeds, ()), (correct, corrections, tracker.begun)):
        notes += _unused(path, marks, seen, tracks, begun)
    if stopped:
        told = f"{out} is still the earlier file" if kept else "the tracks up to there are kept"
        notes.append(f"stopped after {frames} frames; {told}")
    _tell(None if kept else str(out), tracks, seen, seconds, notes, as_json)
    return INTERRUPTED if stopped else 0


def _unused(path, marks, film, tracks, begun):
    """Notes about what a person marked where the film has nothing: no frame, picture or bird."""
    frames, (wide, high) = film.frames, film.size
    late = sorted(frame for frame in marks if not 0 <= frame < frames)
    if late:
        yield f"{path}: frame {late[0]} is not in the clip, which has frames 0 to {frames - 1}; {len(late)} ignored"
    untracked = {}
    for frame in sorted(set(marks) - set(late)):
        for bird, x, y, *gone in marks[frame]:
            if not (0 <= x <= wide and 0 <= y <= high):
                yield f"{path}: bird {bird} in frame {frame} is outside the {wide} x {high} picture"
            elif any(gone):
                continue
            elif bird not in tracks.ids:
                untracked.setdefault(bird, frame)
            elif frame and (frame, bird) in begun:
                yield f"{path}: there was no bird {bird} before frame {frame}, where it is corrected; it begins there"
    for bird, frame in untracked.items():
        yield f"{path}: bird {bird} of frame {frame} could not be tracked through three frames; it is left out"


class _Followed(NamedTuple):
    """How a film was gone through."""

    times: list[float]  # s, of the frames that were taken, those that could not be decoded too
    lost: int  # of these, how many could not be decoded
    stopped: bool  # whether somebody stopped it
    frames: int  # of the film
    size: tuple[int, int]
    damage: str


def _follow(clip, tracker):
    times: list[float] = []
    with FilmReader(clip) as film:
        stopped = _steps(film, tracker, times)
        frames = max(len(times), film.length) if stopped else len(times)
        lost = sum(number < len(times) for number in film.lost)
        return _Followed(times, lost, stopped, frames, film.size, "" if stopped else film.damage)


def _steps(film, tracker, times):
    """Track the birds of all frames and set their times; whether tracking was stopped."""
    with progress("tracking birds", film.length) as bar:
        try:
            while (image := film.read()) is not None:
                for time_lost in film.gap:  # the birds fly on
                    tracker.take([])
                    times.append(time_lost)
                tracker.step(image)
                times.append(film.time)
                bar(len(times))
        except KeyboardInterrupt:  # what was followed so far is worth keeping
            return True
    return False


def table_of(tracks: Tracks) -> str:
    """Tracks as a table with ``frame,id,x,y``, and with ``time``, s, where that is known."""
    times = tracks.times if tracks.times is not None and np.isfinite(tracks.times).any() else None
    rows = ["frame,id,x,y" + (",time" if times is not None else "")]
    for f in range(len(tracks.px)):
        when = "" if times is None else f",{times[f]:.6f}"
        for n in np.flatnonzero(tracks.seen[f]):
            x, y = tracks.px[f, n]
            rows.append(f"{tracks.first + f},{tracks.ids[n]},{x:.3f},{y:.3f}{when}")
    return "\n".join(rows) + "\n"


def _tell(out, tracks, film, seconds, notes, as_json):
    frames = len(film.times)
    sights = tracks.seen.sum(0)
    alive = tracks.alive.sum(0)
    whole = int((alive >= 0.95 * len(tracks.px)).sum())
    facts = {
        "birds": len(tracks.ids),
        "frames": frames,
        "frames_lost": film.lost,
        "whole": whole,
        "in_gaps": int((alive - sights).sum()),
        "seconds": seconds,
        "stopped": film.stopped,
        "notes": notes,
        "file": out,
    }
    if as_json:
        print_json(facts)
        return
    rows = (
        ("tracks", facts["birds"]),
        ("frames", frames),
        ("tracks over almost all frames", whole),
        ("missing detections within tracks", facts["in_gaps"]),
        ("processing time per frame, ms", 1e3 * seconds / max(frames, 1)),
    )
    show(table("what", "value", rows=rows, right=("value",)))
    for note in notes:
        say(f"note: {note}")
    if whole < len(tracks.ids):
        say("incomplete tracks are birds that entered, left or were lost; correct them with --correct FILE")
    if out is not None:
        say(f"wrote {out}")
