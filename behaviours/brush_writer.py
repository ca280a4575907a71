"""Brushes to files: TOML that reads back the same, with units and ranges beside the numbers."""

from __future__ import annotations

import collections
import datetime
import re
import textwrap
from typing import TYPE_CHECKING, Any

from flockbrush.behaviours.validation import meaning
from pydantic import BaseModel

if TYPE_CHECKING:
    from flockbrush.behaviours.brush import Brush

WIDTH = 100  # characters a line of text


def brush_to_toml(brush: Brush) -> str:
    """The text of a brush's file.

    All values are written, also those left at their default: a later default does not change a saved brush.
    Comments come from the descriptions, units and bounds of the model's parameters.

    Returns
    -------
    str
        TOML; `load_brush` makes an equal brush of it.
    """
    top = {name: getattr(brush, name) for name in ("title", "description", "model", "colour", "transition")}
    if brush.made_for:
        top["made_for"] = brush.made_for
    parts = [
        "# BL: body lengths.  Numbers may be changed; the comments say what each does.",
        'schema = "flockbrush.brush/1"',
        *_lines(type(brush), top),
        *_table("parameters", brush.params),
        *_table("speed", brush.speed),
        *(_table("body", brush.body) if brush.has_own_body or not brush.made_for else ()),
        *_table("vision", brush.vision),
        *(line for name, params in brush.drives.items() for line in _table(f"drives.{name}", params)),
        *_table("provenance", brush.provenance),
    ]
    return "\n".join(parts) + "\n"


def _table(name: str, model: BaseModel) -> list[str]:
    values = {field: getattr(model, field) for field in type(model).model_fields}
    tables = {field: value for field, value in values.items() if isinstance(value, dict)}
    plain = {field: value for field, value in values.items() if value is not None and field not in tables}
    lines = ["", f"[{name}]", *_lines(type(model), plain)]
    for field, table in tables.items():
        if table:
            lines += ["", f"[{name}.{field}]", *(f"{_key(key)} = {toml_value(value)}" for key, value in table.items())]
    return lines


def _lines(model: type[BaseModel], values: dict[str, Any]) -> list[str]:
    """A line for each value, with a comment unless the value is text, which speaks for itself."""
    lines, last = [], None
    stems = collections.Counter(name.split("_")[0] for name in values)
    for name, value in values.items():
        stem = name.split("_")[0]
        if last not in (None, stem) and max(stems[stem], stems[last]) > 2:  # weight, radial, angular of one force
            lines.append("")
        last = stem
        line = f"{name} = {toml_value(value)}"
        comment = "" if isinstance(value, str) and " " in value else _comment(model, name)
        lines.append(f"{line}  # {comment}" if comment else line)
    return lines


def _comment(model: type[BaseModel], name: str) -> str:
    return "".join(character for character in meaning(model.model_fields[name]) if character.isprintable())


def _key(key: str) -> str:
    return key if re.fullmatch("[A-Za-z0-9_-]+", key) else _text(key)


def toml_value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _long_text(value) if "\n" in value or len(value) > WIDTH else _text(value)
    if isinstance(value, datetime.date):
        return value.isoformat()
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(map(toml_value, value))}]"
    return repr(value)


def _text(text: str) -> str:
    return f'"{_escaped(text, quote=True)}"'


def _long_text(text: str) -> str:
    """Text of several lines; a backslash at the end of a line joins it to the next."""
    lines = [_wrapped(line) for line in text.split("\n")]
    return '"""\n' + re.sub(r'"(?=""|\Z)', r'\\"', "\n".join(lines)) + '"""'


def _wrapped(line: str) -> str:
    if re.search(r"^\s|\s\s|\s$|[^\S ]", line):  # only single spaces survive wrapping
        return _escaped(line)
    pieces = textwrap.wrap(line, WIDTH - 2, break_long_words=False, break_on_hyphens=False)
    return " \\\n".join(_escaped(piece) for piece in pieces)


_ESCAPES = {"\\": "\\\\", "\n": "\\n", "\t": "\\t"}


def _escaped(text: str, quote: bool = False) -> str:
    escapes = {**_ESCAPES, '"': '\\"'} if quote else _ESCAPES
    return "".join(escapes.get(c) or (c if c.isprintable() else _code(c)) for c in text)


def _code(character: str) -> str:
    code = ord(character)
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"
