"""What is said of a clip, in words for what it was: tracks are read, fitted and judged as clips are."""

from __future__ import annotations

import re
from collections.abc import Callable

from flockbrush.film.observations import Evidence

Words = Callable[[str], str]
_CLIP = r"(?<![\w./-])clip(?![\w-]|\.\w)"  # no part of an option or of the name of a file
_OF_TRACKS = [
    (r"\bstabilised clip\b", "tracks"),
    (r"\b(one|each) clip\b", r"\1 file of tracks"),
    (r"\bclips\b", "files of tracks"),
    (r"\bclip (constrain|contain|show)s\b", r"clip \1"),
    (r"\bclip was\b", "clip were"),
    (r"\b([Tt])his clip\b", r"\1hese tracks"),
    (r"\ba clip\b", "tracks"),
    (_CLIP, "tracks"),
    (_CLIP.replace("clip", "Clip"), "Tracks"),
]


def of_tracks(text: str) -> str:
    """A text about a clip, about tracks.

    >>> of_tracks("The clip was too short: 5 clips, and this clip constrains none of clip.csv.")
    'The tracks were too short: 5 files of tracks, and these tracks constrain none of clip.csv.'
    """
    for pattern, words in _OF_TRACKS:
        text = re.sub(pattern, words, text)
    return text


def words_for(evidence: Evidence) -> Words:
    """What turns texts about a clip into those about what was observed."""
    return of_tracks if evidence.from_tracks else str
