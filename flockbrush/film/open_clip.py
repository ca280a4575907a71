"""Clips and tracks named by a user: observed, split in two, and their pictures read again for the report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from flockbrush.engine.files import refused
from flockbrush.film.clip_reader import open_clip
from flockbrush.film.looking import Looking
from flockbrush.film.observations import CannotObserve, Evidence
from flockbrush.film.observe import observe
from flockbrush.film.track_evidence import RADIUS, drawn_tracks, evidence_of_tracks
from flockbrush.film.track_files import Trajectories, is_tracks, read_trajectories
from flockbrush.runs.terminal import progress, say

FEWEST = 8  # frames of a clip of which a part is held out


def look_at(clip, how: Looking, show=None, quiet=False) -> Evidence:
    """Observe a clip, with a progress bar unless ``quiet``; ``show`` is called with every frame, for drawing.

    Raises
    ------
    CannotObserve
        With the name of the clip and what was seen.
    """
    name = Path(clip).name
    if is_tracks(clip):
        return _look_at_tracks(clip, how, show)
    if any(value is not None for value in (how.unit, how.fps, how.arena, how.body_length_m)):
        options = "--unit, --fps, --body-length-m and --arena"
        raise refused(clip, f"is a video or picture: {options} can only be used with tracks")
    with progress(f"measuring {name}", 0 if quiet else 100) as bar:

        def report(text, done, total):
            bar(100 * done / max(total, 1), f"{name}: {text}")

        return observe(
            clip, frames=how.frames, landmarks=how.landmarks, body_colour=how.body_colour,
            body_length_px=how.body_length_px, grid=how.grid, obstacles=how.obstacles, regions=how.regions,
            say=report, show=show,
        )  # fmt: skip


def read_tracks_of(path, how: Looking) -> tuple[Trajectories, float]:
    """(tracks, one body length in their unit), of the selected frames.

    Raises
    ------
    ProblemsError
        When the file cannot be read, or the body length is not given.
    """
    tracks = read_trajectories(path, how.unit, how.fps)
    if how.frames is not None:
        tracks = tracks.part(*how.frames)
        if not len(tracks):
            raise CannotObserve(str(path), f"has no frames {how.frames[0]} to {how.frames[1]}")
    if tracks.unit == "px":
        if how.body_length_px is None:
            raise refused(path, "is in pixels: give the body length with --body-length-px")
        return tracks, how.body_length_px
    if how.body_length_px not in (None, how.body_length_m):
        unit = "m: give the body length with --body-length-m" if tracks.unit == "m" else "body lengths"
        raise refused(path, f"--body-length-px can only be used with tracks in pixels, and this is in {unit}")
    return tracks, 1.0 if tracks.unit == "bl" else how.body_length_m or tracks.body_length or how.usual_length_m


def _look_at_tracks(path, how, show):
    options = {
        "--obstacles": how.obstacles, "--regions": how.regions, "--landmark": how.landmarks,
        "--body-colour": how.body_colour != "auto", "--preview": show is not None,
    }  # fmt: skip
    for option, given in options.items():
        if given:
            raise refused(path, f"is a file of tracks: {option} can only be used with videos and pictures")
    tracks, length = read_tracks_of(path, how)
    arena = how.arena
    if arena is not None and how.frames is not None:  # a wall stays where it is: all frames of the file tell it
        arena = arena.around(read_tracks_of(path, replace(how, frames=None))[0], RADIUS * length)
    evidence = evidence_of_tracks(tracks, length, how.grid, arena)
    if tracks.unit == "m" and how.body_length_m is None:
        source = "assumed" if tracks.body_length is None else "stated"
        told = {"assumed": "assumed to be {:.3g} m", "stated": "{:.3g} m, the median of those that the file states"}
        evidence.notes.append(f"one body length is {told[source].format(length)} (set --body-length-m)")
        evidence = replace(evidence, length_source=source)
    return evidence


def tell_notes(clip, evidence: Evidence):
    """Print the notes on the observation of a clip."""
    for note in evidence.notes:
        say(f"{clip}: {note}")


def training_part(clip, how: Looking, share: float, at_end: bool) -> Evidence | None:
    """The training part of `looked_apart` for a film of which nothing is known yet; None if it cannot be divided."""
    film = open_clip(clip, how.frames)
    cut = _cut(len(film.numbers), share)
    if film.still or not cut:
        return None
    numbers = film.numbers[-cut:] if at_end else film.numbers[:cut]
    return _look_at_training(clip, how, int(numbers[0]), int(numbers[-1]), quiet=True)


def _cut(total, share):
    """Frames of a training part; 0 if there are too few."""
    cut = round(share * total)
    return 0 if share >= 1 or total < FEWEST or min(cut, total - cut) < 2 else cut


def _turned(how: Looking, rotate) -> bool:
    return rotate and not (how.obstacles or how.regions or how.landmarks)


def training_begun(clip, how: Looking, share: float, rotate, helpers) -> list:
    """Observations of the training parts of a film by `Helpers`, for `looked_apart`; none for tracks."""
    if is_tracks(clip) or helpers.jobs == 1:
        return []
    ends = (False, True) if _turned(how, rotate) else (False,)
    return [helpers.later(training_part, clip, how, share, at_end) for at_end in ends]


def looked_apart(
    clip, how: Looking, whole: Evidence, share: float, rotate=False, begun: Sequence = (),
) -> list[tuple[Evidence, Evidence]]:  # fmt: skip
    """[(training part, held-out part)]; empty if there are too few frames.

    The first ``share`` of the frames are observed again as if the clip ended there, so that the training part
    (camera, colours, size and tracks of the animals) depends on no frame that is held out.  The frames held out keep
    their observations of the whole clip, in the body lengths of the training part.

    Parameters
    ----------
    rotate : bool
        Give the last ``share`` besides, with the frames before it held out.  Not where masks or landmarks belong to
        frames of the clip.
    begun : sequence of Later
        The same training parts, if they are being observed already.

    Raises
    ------
    CannotObserve
        When the first part alone does not tell enough.
    """
    total = len(whole.fields)
    cut = _cut(total, share)
    if whole.still or not cut:
        return []
    parts = [_apart(clip, how, whole, slice(0, cut), slice(cut, total), *begun[:1])]
    if _turned(how, rotate):
        try:
            parts.append(_apart(clip, how, whole, slice(total - cut, total), slice(0, total - cut), *begun[1:]))
        except CannotObserve as error:
            say(f"tested on one part only: {error}")
    return parts


def _apart(clip, how, whole, chosen, held_out, begun=None):
    """(some frames, observed as if there were no others; the others, in the same body lengths)."""
    first, last = (int(whole.fields.frames[row]) for row in (chosen.start, chosen.stop - 1))
    training = _look_at_training(clip, how, first, last) if begun is None else begun.result()
    held = whole.part(held_out)
    return training, held.in_lengths_of(training.clip_body_px * held.clip_body_px / whole.part(chosen).clip_body_px)


def _look_at_training(clip, how, first, last, quiet=False):
    marks = tuple(mark for mark in how.landmarks if first <= _frame_of(mark) <= last)
    if how.landmarks and not marks:
        raise CannotObserve(
            Path(clip).name,
            f"frames {first} to {last} have no landmark, but they are used without the other frames: draw one "
            "there too",
        )
    return look_at(clip, replace(how, frames=(first, last), landmarks=marks), quiet=quiet)


def _frame_of(mark):
    return mark.frame if hasattr(mark, "frame") else mark[0]


def pictures_of(clip, evidence: Evidence, chosen) -> tuple[dict[int, np.ndarray], float]:
    """({t: frame (BGR)}, pixels read for one of the clip's) of some frames of an evidence."""
    if evidence.from_tracks:
        return {t: drawn_tracks(evidence, t) for t in chosen}, 1.0
    numbers = evidence.fields.frames
    film = open_clip(clip, None if evidence.still else (int(numbers.min()), int(numbers.max())))
    place = {int(number): k for k, number in enumerate(film.numbers)}
    frame_of_time = {t: place[int(numbers[t])] for t in chosen if int(numbers[t]) in place}
    read = dict(film.read(frame_of_time.values()))
    return {t: read[k] for t, k in frame_of_time.items()}, film.scale


def moving_pictures(clip, evidence: Evidence) -> tuple[Iterator[tuple[int, np.ndarray]], float]:
    """((t, frame (BGR)) of all frames of an evidence one after the other, pixels read for one of the clip's)."""
    if evidence.from_tracks:
        return ((t, drawn_tracks(evidence, t)) for t in range(len(evidence.fields))), 1.0
    numbers = evidence.fields.frames
    film = open_clip(clip, (int(numbers[0]), int(numbers[-1])))
    place = {int(number): t for t, number in enumerate(numbers)}
    frames = ((place.get(int(film.numbers[k])), frame) for k, frame in film.read())
    return ((t, frame) for t, frame in frames if t is not None), film.scale


def facts_of(clip) -> dict[str, object]:
    """A description of a file; empty if it cannot be opened."""
    if is_tracks(clip):
        return {"tracks": str(clip)}
    try:
        film = open_clip(clip)
    except CannotObserve:
        return {}
    wide, tall = film.full
    facts: dict[str, object] = {"clip": str(clip), "SHA-256": film.sha256, "size": f"{wide} x {tall} pixels"}
    if not film.still:
        facts["frames"] = f"{film.numbers[0]} to {film.numbers[-1]} at {film.fps:g} per second"
    return facts | {"pictures": {"first frame": next(picture for _, picture in film.read([0]))}}
