"""Clips as a person names them: looked at, cut in two, and their pictures read again for the report."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from behaviours.learning.clip import open_clip
from behaviours.learning.evidence import CannotObserve, Evidence, halves
from behaviours.learning.observe import observe
from flockbrush.files import refused
from flockbrush.terminal import progress, say

FEWEST = 8  # frames of a clip of which a part is held out


@dataclass(frozen=True)
class Looking:
    """How a clip is to be looked at; what nobody says is found in the clip."""

    frames: tuple[int, int] | None = None
    landmarks: tuple = ()
    body_colour: str | tuple[int, int, int] = "auto"
    body_length_px: float | None = None
    grid: int = 30
    obstacles: Path | None = None
    regions: Path | None = None


def needs_torch():
    """Refuse, in plain words, what cannot be done without torch."""
    if importlib.util.find_spec("torch") is None:
        raise refused("flockbrush", 'learning needs torch, which is not installed: pip install "flockbrush[learn]"')


def look_at(clip, how: Looking, show=None) -> Evidence:
    """What a clip tells, with a bar that moves; ``show`` is given every frame to be drawn.

    Raises
    ------
    CannotObserve
        In the words of the clip, with what was seen.
    """
    name = Path(clip).name
    with progress(f"looking at {name}", 100) as bar:

        def told(text, done, total):
            bar(100 * done / max(total, 1), f"{name}: {text}")

        return observe(
            clip,
            frames=how.frames,
            landmarks=how.landmarks,
            body_colour=how.body_colour,
            body_length_px=how.body_length_px,
            grid=how.grid,
            obstacles=how.obstacles,
            regions=how.regions,
            say=told,
            **({} if show is None else {"show": show}),
        )


def tell_notes(clip, evidence: Evidence):
    """Tell a person what there is to know of how a clip was seen."""
    for note in evidence.notes:
        say(f"{clip}: {note}")


def parted(evidence: Evidence, share: float) -> tuple[Evidence, Evidence | None]:
    """(what is learned from, what is held out): all of it and nothing, where there are too few frames."""
    total = len(evidence.fields)
    if evidence.still or share >= 1 or total < FEWEST or min(round(share * total), total - round(share * total)) < 2:
        return evidence, None
    return halves(evidence, share)


def pictures_of(clip, evidence: Evidence, chosen) -> tuple[dict[int, np.ndarray], float]:
    """({t: frame (BGR)}, pixels read for one of the clip's) of some frames of an evidence."""
    numbers = evidence.fields.frames
    film = open_clip(clip, None if evidence.still else (int(numbers.min()), int(numbers.max())))
    place = {int(number): k for k, number in enumerate(film.numbers)}
    wanted = {t: place[int(numbers[t])] for t in chosen if int(numbers[t]) in place}
    read = dict(film.read(wanted.values()))
    return {t: read[k] for t, k in wanted.items()}, film.scale


def facts_of(clip) -> dict[str, object]:
    """What a file is, in words: nothing where it cannot be opened."""
    try:
        film = open_clip(clip)
    except CannotObserve:
        return {}
    wide, tall = film.full
    facts: dict[str, object] = {"clip": str(clip), "SHA-256": film.sha256, "size": f"{wide} x {tall} pixels"}
    if not film.still:
        facts["frames"] = f"{film.numbers[0]} to {film.numbers[-1]} at {film.fps:g} a second"
    return facts | {"pictures": {"first frame": next(picture for _, picture in film.read([0]))}}


__all__ = ["CannotObserve", "Looking", "facts_of", "look_at", "needs_torch", "parted", "pictures_of", "tell_notes"]
