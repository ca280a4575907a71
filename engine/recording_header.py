"""The header of a recording: what may stand in it, and what is wrong with one."""

from __future__ import annotations

import math
from pathlib import PurePosixPath

from flockbrush.engine import limits
from flockbrush.engine.noise import LARGEST_SEED

_DIGITS = frozenset("0123456789abcdef")


def header_error(header) -> str | None:
    """What is wrong with the header of a recording, with what would be right; None when it is sound.

    Keys that are not known pass: another version may have written them.
    """
    if not isinstance(header, dict):
        return f"it must be an object, got {_shown(header)}"
    missing = [name for name in ("seed", "dt", "assets") if name not in header]
    if missing:
        return f"it has no {' and no '.join(missing)}"
    for name, (fits, right) in _SCHEMA.items():
        if name in header and not fits(header[name]):
            return f"{name} must be {right}, got {_shown(header[name])}"
    if sum(entry["bytes"] for entry in header["assets"].values()) > limits.RECORDING_ASSETS_BYTES:
        return f"it lists files of more than {limits.RECORDING_ASSETS_BYTES.text}"
    return None


def is_plain(name) -> bool:
    """Whether this is a path that stays below the folder it is put into, on every system."""
    if not isinstance(name, str) or not 0 < len(name) <= 1000 or set(name) & set("\0\\:"):
        return False
    path = PurePosixPath(name)
    return not path.is_absolute() and ".." not in path.parts


def _whole(low, high):
    return lambda value: type(value) is int and low <= value <= high


def _texts(value):
    return isinstance(value, dict) and all(isinstance(text, str) and len(text) <= 1000 for text in value.values())


def _assets(value):
    return isinstance(value, dict) and all(is_plain(name) and _asset(entry) for name, entry in value.items())


def _asset(entry):
    if not isinstance(entry, dict) or type(entry.get("bytes")) is not int or entry["bytes"] < 0:
        return False
    digest = entry.get("sha256")
    return isinstance(digest, str) and len(digest) == 64 and set(digest) <= _DIGITS


def _step(value):
    return type(value) in (int, float) and math.isfinite(value) and 0 < value <= 3600


def _text(value):
    return isinstance(value, str) and len(value) <= 1000


_SCHEMA = {
    "seed": (_whole(0, LARGEST_SEED), f"a whole number from 0 to {LARGEST_SEED}"),
    "dt": (_step, "above 0 and at most 3600 s"),
    "agents": (
        lambda value: value is None or _whole(1, limits.ANIMALS)(value),
        f"a whole number from 1 to {limits.ANIMALS:,}, or null",
    ),
    "level": (is_plain, "a relative path inside one folder"),
    "flockbrush": (_text, "a string"),
    "packages": (_texts, "a table of strings"),
    "assets": (_assets, "a table of files with their sha256 and bytes"),
}


def _shown(value):
    text = repr(value) if isinstance(value, (str, int, float, bool, type(None))) else type(value).__name__
    return text if len(text) <= 60 else text[:57] + "..."
