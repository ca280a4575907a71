"""JSON from untrusted files: its size is checked before Python makes objects of it."""

from __future__ import annotations

import json
from pathlib import Path

from flockbrush.engine.limits import JSON_LINE_BYTES, STATE_BYTES, STATE_LINES, STATE_VALUES


def values_in(data: bytes, enough: int = STATE_VALUES) -> int:
    """About how many values JSON holds, without reading it; where it is more than ``enough``, only that it is more."""
    bare = data.replace(b"\\\\", b"").replace(b'\\"', b"")
    quotes = bare.count(b'"')
    if quotes > 4 * enough:
        return quotes // 4
    return 1 + sum(part.count(b",") + part.count(b"[") + part.count(b"{") for part in bare.split(b'"')[::2])


def parsed(data: bytes, values: int = STATE_VALUES):
    """What JSON says, when it holds at most so many values; ValueError otherwise, and when it is no JSON."""
    if values_in(data, values) > values:
        raise ValueError(f"it holds more than {values:,} values")
    try:
        return json.loads(data)
    except RecursionError:
        raise ValueError("its lists are nested too deeply") from None


def read_json(path, limit: int = STATE_BYTES):
    """What a file of JSON says; ValueError when it is too large or no JSON, OSError when it cannot be read."""
    with open(path, "rb") as file:
        data = file.read(limit + 1)
    if len(data) > limit:
        raise ValueError(f"it is larger than {limit // (1 << 20)} MiB")
    return parsed(data)


def json_lines(path):
    """What the whole lines of a file of JSON lines say, one after the other; what follows the last line end is cut off.

    Raises
    ------
    ValueError
        At a line that is no JSON, or too large, or when there are too many.
    OSError
        When the file cannot be read.
    """
    with open(Path(path), "rb") as file:
        for _ in range(STATE_LINES + 1):
            line = file.readline(JSON_LINE_BYTES + 1)
            if len(line) > JSON_LINE_BYTES:
                raise ValueError(f"it has a line of more than {JSON_LINE_BYTES.text}")
            if not line.endswith(b"\n"):
                return
            yield parsed(line)
    raise ValueError(f"it has more than {STATE_LINES.text}")
