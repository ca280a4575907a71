"""Text from outside (names of files, headers, titles) as it may be shown: nothing in it moves a terminal's cursor."""

from __future__ import annotations

import re

_CONTROLS = "\x00-\x08\x0b-\x1f\x7f-\x9f"  # C0 without tab and line feed, DEL, C1
_DIRECTIONS = "\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"  # these reorder letters, or end a line
_UNSAFE = re.compile(f"[{_CONTROLS}{_DIRECTIONS}]")


def plain(text) -> str:
    r"""The text with control characters spelled as Python does, such as ``\x1b``; tabs and line feeds stay."""
    return _UNSAFE.sub(lambda match: _spelled(match.group()), str(text))


def one_line(text) -> str:
    r"""As `plain`, with line feeds spelled too: a name cannot look like two lines."""
    return plain(text).replace("\n", r"\n").replace("\t", r"\t")


def plain_json(text) -> str:
    r"""JSON with the same characters escaped as ``\u001b``: another text for the same data."""
    return _UNSAFE.sub(lambda match: f"\\u{ord(match.group()):04x}", text)


def _spelled(character):
    code = ord(character)
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"
