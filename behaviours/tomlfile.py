"""TOML files whose values know their lines: `tomllib` reads the values, a small scanner finds the lines."""

from __future__ import annotations

import bisect
import dataclasses
import math
import os
import re
import tomllib
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

from flockbrush.engine import limits
from flockbrush.engine.problems import Problem, ProblemsError, did_you_mean

Key = tuple[str | int, ...]


@dataclasses.dataclass(frozen=True)
class TomlFile:
    """The values of a TOML file and the line of each."""

    name: str  # the file as the user named it
    data: dict[str, Any]  # the document, as `tomllib` gives it
    lines: dict[Key, int]  # line of each table, key and array element, by its path from the top

    def line(self, key: Key) -> int:
        """Line of a key, or of the nearest table around it when the key is not in the file."""
        while key and key not in self.lines:
            key = key[:-1]
        return self.lines.get(key, 1)

    def problem(self, key: Key, message: str) -> Problem:
        """A problem with the value at ``key``."""
        return Problem(self.name, self.line(key), key_text(key) or None, message)

    def unknown_names(self, key: Key, table: Iterable[str], names: Collection[str]) -> list[Problem]:
        """Problems with the names of a table that are not among these."""
        unknown = [name for name in table if name not in names]
        return [self.problem((*key, name), f"unknown name{did_you_mean(name, names)}") for name in unknown]


def is_number(value: object) -> bool:
    """Whether a value of a TOML file is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def key_text(key: Key) -> str:
    """A key as a person would write it: ``speed.by_density[2]``."""
    text = ""
    for part in key:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += ("." if text else "") + _shortened(part if _BARE.fullmatch(part) else repr(part))
    return text


def _shortened(text: str, most: int = 60) -> str:
    return text if len(text) <= most else text[: most - 3] + "..."


def read_bytes(path: str | os.PathLike, limit: int = limits.TOML_BYTES) -> bytes:
    """The bytes of a plain file of at most ``limit`` bytes.

    Raises
    ------
    ProblemsError
        When there is no such file, or it is a directory, a device, too large or may not be read.
    """
    check_plain(path, limit)
    try:
        with open(path, "rb") as file:
            data = file.read(limit + 1)
    except OSError as error:
        refusal = f"cannot be read: {error.strerror or error}"
    else:
        if len(data) <= limit:
            return data
        refusal = _too_large(limit)
    raise ProblemsError([Problem(str(path), None, None, refusal)])


def check_plain(path: str | os.PathLike, limit: int):
    """ProblemsError unless this is a plain file of at most ``limit`` bytes."""
    try:
        refusal = _refusal(Path(path), limit)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        refusal = f"cannot be read: {getattr(error, 'strerror', None) or error}"
    if refusal:
        raise ProblemsError([Problem(str(path), None, None, refusal)])


def _refusal(path: Path, limit: int) -> str | None:
    if not path.exists():
        return "there is no such file"
    if path.is_dir():
        return "is a folder, not a file"
    if not path.is_file():
        return "is not a regular file"  # a pipe would wait for ever
    return _too_large(limit) if path.stat().st_size > limit else None


def _too_large(limit):
    return f"is larger than {limit:,} bytes, the maximum for this kind of file"


def parse_toml(data: bytes, name: str, limit: int = limits.TOML_BYTES) -> TomlFile:
    """Read TOML 1.0.

    A byte-order mark before UTF-8 is forgiven (Windows editors write one).

    Parameters
    ----------
    data : bytes
        At most ``limit`` bytes.
    name : str
        The file's name for messages.

    Raises
    ------
    ProblemsError
        With the line of the mistake.
    """
    if len(data) > limit:
        raise ProblemsError([Problem(name, None, None, _too_large(limit))])
    text = _text(data, name)
    lines = _Scanner(text, name).lines()
    try:
        return TomlFile(name, tomllib.loads(text), lines)
    except tomllib.TOMLDecodeError as error:
        raise ProblemsError([_syntax(error, text, name)]) from None
    except ValueError as error:  # a number of thousands of digits, the 31st of February
        why = "a number has thousands of digits" if "digits" in str(error) else str(error)
        raise ProblemsError([Problem(name, None, None, f"a value is out of bounds: {why}")]) from None
    except RecursionError:
        raise ProblemsError([Problem(name, None, None, "is nested too deeply")]) from None


def _text(data: bytes, name: str) -> str:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise ProblemsError([Problem(name, 1, None, "is UTF-16; save it as UTF-8")])
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        message = f"byte 0x{data[error.start]:02x} is not UTF-8; save the file as UTF-8"
        raise ProblemsError([Problem(name, line, None, message)]) from None


_AT = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)$")


def _syntax(error: tomllib.TOMLDecodeError, text: str, name: str) -> Problem:
    message = str(error)
    at = _AT.search(message)
    line, column = (int(at[1]), int(at[2])) if at and at[1] else (text.rstrip("\n").count("\n") + 1, None)
    place = f" at column {column}" if column else " at the end of the file"
    return Problem(name, line, None, f"is not TOML{place}: {_shortened(_AT.sub('', message), 200)}")


_BARE = re.compile(r"[A-Za-z0-9_-]+")
_BLANK = re.compile(r"(?:[ \t\n]++|#[^\n]*+)*+")  # white space, ends of lines and comments
_SPACE = re.compile(r"[ \t]*+")
_KEY = re.compile(r"""[A-Za-z0-9_-]++|"(?:[^"\\\n]++|\\.)*+"|'[^'\n]*+'""")
_STRING = re.compile(
    r'''"""(?:[^"\\]++|\\.|"(?!""))*+"{3,5}+|"(?:[^"\\\n]++|\\.)*+"'''
    r"""|'''(?:[^']++|'(?!''))*+'{3,5}+|'[^'\n]*+'""",
    re.DOTALL,
)
_SCALAR = re.compile(r"[^,\]}#\n]++")


class _Stop(Exception):
    """Here the text is not TOML any more; `tomllib` says why."""


class _Scanner:
    """Walks the text of a TOML document and notes where each key stands."""

    def __init__(self, text: str, name: str):
        self.text, self.name, self.at = text, name, 0
        self.found: dict[Key, int] = {}
        self.counts: dict[Key, int] = {}  # tables so far in each array of tables
        self.ends = [match.start() for match in re.finditer("\n", text)]

    def lines(self) -> dict[Key, int]:
        try:
            self.document()
        except _Stop:
            pass
        return self.found

    def document(self):
        table: Key = ()
        while True:
            self.skip(_BLANK)
            if self.at >= len(self.text):
                return
            if self.text[self.at] == "[":
                table = self.header()
            else:
                self.pair(table, depth=0)

    def header(self) -> Key:
        start, many = self.at, self.text.startswith("[[", self.at)
        self.at += 2 if many else 1
        parts = self.dotted_key()
        self.expect("]]" if many else "]")
        table: Key = ()
        for i, part in enumerate(parts):
            table += (part,)
            self.note(table, start)
            last = i == len(parts) - 1
            if last and many:
                self.counts[table] = self.counts.get(table, 0) + 1
            if table in self.counts:
                table += (self.counts[table] - 1,)
                self.note(table, start)
        return table

    def pair(self, table: Key, depth: int):
        start = self.at
        for part in self.dotted_key():
            table += (part,)
            self.note(table, start)
        self.expect("=")
        self.skip(_SPACE)
        self.value(table, depth)

    def dotted_key(self) -> list[str]:
        parts: list[str] = []
        while True:
            self.skip(_SPACE)
            if len(parts) >= limits.TOML_DEPTH:
                self.too_deep()
            parts.append(_unquoted(self.take(_KEY)))
            self.skip(_SPACE)
            if not self.text.startswith(".", self.at):
                return parts
            self.at += 1

    def value(self, key: Key, depth: int):
        if depth > limits.TOML_DEPTH:
            self.too_deep()
        first = self.text[self.at : self.at + 1]
        if first == "[":
            self.items("]", lambda i: self.element(key + (i,), depth + 1))
        elif first == "{":
            self.items("}", lambda i: self.pair(key, depth + 1))
        else:
            self.take(_STRING if first in ("'", '"') else _SCALAR)

    def items(self, close: str, item):
        self.at += 1
        for i in range(len(self.text)):
            self.skip(_BLANK)
            if self.text.startswith(close, self.at):
                break
            item(i)
            self.skip(_BLANK)
            if not self.text.startswith(",", self.at):
                break
            self.at += 1
        self.expect(close)

    def element(self, key: Key, depth: int):
        self.note(key, self.at)
        self.value(key, depth)

    def note(self, key: Key, position: int):
        if len(key) > limits.TOML_DEPTH:
            self.too_deep()
        self.found.setdefault(key, bisect.bisect_left(self.ends, position) + 1)

    def skip(self, pattern: re.Pattern):
        match = pattern.match(self.text, self.at)
        self.at = match.end() if match else self.at

    def take(self, pattern: re.Pattern) -> str:
        match = pattern.match(self.text, self.at)
        if not match:
            raise _Stop
        self.at = match.end()
        return match[0]

    def expect(self, token: str):
        self.skip(_SPACE)
        if not self.text.startswith(token, self.at):
            raise _Stop
        self.at += len(token)

    def too_deep(self):
        line = bisect.bisect_left(self.ends, self.at) + 1
        raise ProblemsError([Problem(self.name, line, None, f"is nested more than {limits.TOML_DEPTH} deep")])


def _unquoted(key: str) -> str:
    if key[0] not in "'\"":
        return key
    if "\\" not in key:
        return key[1:-1]
    try:
        return tomllib.loads(f"key = {key}")["key"]
    except ValueError:
        raise _Stop from None
