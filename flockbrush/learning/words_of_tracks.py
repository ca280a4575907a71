"""Texts about a clip reworded for tracks, which are read, fitted and judged as clips are."""

from __future__ import annotations

import re
from collections.abc import Callable

from flockbrush.film.observations import Evidence

Words = Callable[[str], str]
_CLIP = r"(?<![\w./-])clip(?![\w/-]|\.\w)"  # no part of an option or of the name of a file
_VERBS = {"was": "were", "is": "are", "does": "do", "has": "have"}
_OF_TRACKS = [
    (r"\bstabilised clip\b", "tracks"),
    (r"\b(one|each) clip\b", r"\1 file of tracks"),
    (_CLIP.replace("clip", "clips"), "files of tracks"),
    (r"\bclip (constrain|contain|show|determine)s\b", r"clip \1"),
    *((rf"\bclip {one}\b", f"clip {many}") for one, many in _VERBS.items()),
    (r"\bclip's\b", "tracks'"),
    (r"\b([Tt])his clip\b", r"\1hese tracks"),
    (r"\ba clip\b", "tracks"),
    (_CLIP, "tracks"),
    (_CLIP.replace("clip", "Clip"), "Tracks"),
]


def of_tracks(text: str) -> str:
    """A text about a clip, about tracks.

    >>> of_tracks("The clip was too short: 5 clips, and this clip constrains none of clip.csv.")
    'The tracks were too short: 5 files of tracks, and these tracks constrain none of clip.csv.'
    >>> of_tracks("This clip does not determine it, before the clip's end, in clips/clips.csv.")
    "These tracks do not determine it, before the tracks' end, in clips/clips.csv."
    """
    for pattern, words in _OF_TRACKS:
        text = re.sub(pattern, words, text)
    return text


def words_for(evidence: Evidence) -> Words:
    """What turns texts about a clip into those about what was observed."""
    return of_tracks if evidence.from_tracks else str
