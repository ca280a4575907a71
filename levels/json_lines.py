"""JSON that remembers where everything was: each object is a dict with the line it began on."""

from __future__ import annotations

import json
import math
import re
from bisect import bisect_right
from json.decoder import scanstring  # type: ignore[attr-defined]

_SPACE = re.compile(r"[ \t\n\r]*")
_NUMBER = re.compile(r"-?(?:0|[1-9]\d*)(\.\d+)?([eE][-+]?\d+)?")
_NUMBERS = re.compile(r"\[[\d\s,]*\]")  # tile data: let the C decoder have it
_HUGE = re.compile(r"\d{40}")
_WORDS = {"true": True, "false": False, "null": None}
_MAX_DIGITS = 40
_MAX_VALUES = 1_000_000  # outside of tile data; a level with all it may have stays below


class Node(dict):
    """A JSON object with the line its brace is on, 1 the first."""

    __slots__ = ("line",)


class JsonError(ValueError):
    """Not JSON; `line` says where."""

    def __init__(self, message, line):
        super().__init__(message)
        self.line = line


def parse(data: bytes, max_depth=64) -> object:
    """The document with every object a `Node`.

    Raises
    ------
    JsonError
        Not UTF-8, not JSON, a name twice in one object, NaN or infinity, or nested deeper than `max_depth`.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise JsonError("this is not UTF-8 text", data.count(b"\n", 0, error.start) + 1) from None
    return _Parser(text, max_depth).document()


class _Parser:
    def __init__(self, text, max_depth):
        self.text = text
        self.max_depth = max_depth
        self.values = 0
        self.starts = [m.end() for m in re.finditer("\n", text)]

    def fail(self, at, message):
        raise JsonError(message, self.line(at))

    def line(self, at):
        return bisect_right(self.starts, at) + 1

    def skip(self, at):
        return _SPACE.match(self.text, at).end()

    def document(self):
        value, at = self.value(self.skip(0), 0)
        at = self.skip(at)
        if at != len(self.text):
            self.fail(at, f"not valid JSON: {self.text[at]!r} after the end of the document")
        return value

    def value(self, at, depth):
        c = self.text[at : at + 1]
        self.values += 1
        if self.values > _MAX_VALUES:
            self.fail(at, f"there are more than {_MAX_VALUES} values in this file")
        if depth > self.max_depth:
            self.fail(at, f"nested deeper than {self.max_depth} levels")
        if c == "{":
            return self.object(at, depth)
        if c == "[":
            return self.array(at, depth)
        if c == '"':
            return self.string(at)
        return self.scalar(at)

    def scalar(self, at):
        m = _NUMBER.match(self.text, at)
        if m:
            return self.number(m, at), m.end()
        for word, value in _WORDS.items():
            if self.text.startswith(word, at):
                return value, at + len(word)
        for word in ("NaN", "Infinity", "-Infinity", "nan", "inf"):
            if self.text.startswith(word, at):
                self.fail(at, f"{word} is not a number here; write a finite one")
        found = repr(self.text[at]) if at < len(self.text) else "the end of the file"
        self.fail(at, f"not valid JSON: expected a value, found {found}")

    def number(self, m, at):
        if len(m[0]) > _MAX_DIGITS:
            self.fail(at, f"the number {m[0][:12]}... has too many digits")
        value = float(m[0]) if m[1] or m[2] else int(m[0])
        if not math.isfinite(value):
            self.fail(at, f"the number {m[0]} is too large")
        return value

    def string(self, at):
        try:
            value, end = scanstring(self.text, at + 1, True)
            value.isascii() or value.encode()
        except json.JSONDecodeError as error:
            self.fail(error.pos, f"not valid JSON: {error.msg[0].lower()}{error.msg[1:]}")
        except UnicodeEncodeError:
            self.fail(at, "half a character (a lone surrogate) in a text")
        return value, end

    def array(self, at, depth):
        m = _NUMBERS.match(self.text, at)
        if m and not _HUGE.search(m[0]):
            try:
                return json.loads(m[0]), m.end()
            except ValueError:
                pass  # the slow way says where and why
        values = []
        at = self.skip(at + 1)
        if self.text.startswith("]", at):
            return values, at + 1
        while True:
            value, at = self.value(at, depth + 1)
            values.append(value)
            at, more = self.comma(at, "]")
            if not more:
                return values, at

    def object(self, at, depth):
        node = Node()
        node.line = self.line(at)
        at = self.skip(at + 1)
        if self.text.startswith("}", at):
            return node, at + 1
        while True:
            at = self.member(node, at, depth)
            at, more = self.comma(at, "}")
            if not more:
                return node, at

    def member(self, node, at, depth):
        if not self.text.startswith('"', at):
            self.fail(at, "not valid JSON: expected a name in double quotes")
        name, end = self.string(at)
        if name in node:
            self.fail(at, f"{name!r} is given twice in one object")
        end = self.skip(end)
        if not self.text.startswith(":", end):
            self.fail(end, f"not valid JSON: expected ':' after {name!r}")
        node[name], end = self.value(self.skip(end + 1), depth + 1)
        return end

    def comma(self, at, close):
        at = self.skip(at)
        c = self.text[at : at + 1]
        if c == close:
            return at + 1, False
        if c != ",":
            self.fail(at, f"not valid JSON: expected ',' or '{close}'" + ("" if c else ", found the end of the file"))
        return self.skip(at + 1), True
