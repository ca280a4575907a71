"""JSON that remembers where everything was: each object is a dict with the line it began on.

The standard library's decoder reads; it is handed scanners for objects and arrays that note lines and keep limits.
"""

from __future__ import annotations

import json
import math
import re
from json.decoder import JSONArray, JSONObject  # type: ignore[attr-defined]
from json.scanner import py_make_scanner  # type: ignore[attr-defined]

from flockbrush.engine import limits

_NUMBERS = re.compile(r"[\d\s,]*\]")  # the rest of tile data: let the C decoder have it
_HUGE = re.compile(r"\d{40}")
_SHARED = tuple(range(limits.TILES + 1))  # tile ids: one object each, however often they are painted


class Node(dict):
    """A JSON object with the line its brace is on, 1 the first."""

    __slots__ = ("line",)


class JsonError(ValueError):
    """Not JSON; `line` says where."""

    def __init__(self, message, line):
        super().__init__(message)
        self.line = line


def parse(data: bytes, max_depth=limits.JSON_DEPTH) -> object:
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
    try:
        return _Decoder(max_depth).decode(text)
    except json.JSONDecodeError as error:
        token = repr(text[error.pos]) if error.pos < len(text) else "the end of the file"
        reason = error.msg[0].lower() + error.msg[1:].removesuffix(" at")
        raise JsonError(f"not valid JSON: {reason}, found {token}", error.lineno) from None
    except _Refused as error:
        raise JsonError(error.message, text.count("\n", 0, error.at) + 1) from None


class _Refused(Exception):
    """JSON that we do not take, with its position."""

    def __init__(self, message, at=0):
        self.message, self.at = message, at


class _Decoder(json.JSONDecoder):
    """Counts values and depth on the way through a document."""

    def __init__(self, max_depth):
        super().__init__(parse_float=_number, parse_int=_number, parse_constant=_constant)
        self.parse_object, self.parse_array = self._object, self._array
        self._scan = py_make_scanner(self)
        self.scan_once = self._value
        self.max_depth, self.depth, self.values = max_depth, 0, 0
        self._counted = 0, 1  # line 1 begins at position 0

    def _value(self, text, at):
        self.values += 1
        if self.values > limits.JSON_VALUES:
            raise _Refused(f"there are more than {limits.JSON_VALUES.text} in this file", at)
        if self.depth > self.max_depth:
            raise _Refused(f"nested deeper than {self.max_depth} levels", at)
        self.depth += 1
        try:
            value, end = self._scan(text, at)
        except _Refused as error:
            raise _Refused(error.message, error.at or at) from None
        self.depth -= 1
        if isinstance(value, str):
            _encodable(value, at)
        return value, end

    def _object(self, text_and_at, strict, _scan, hook, pairs_hook, memo):
        text, at = text_and_at
        line = self._line(text, at)
        pairs, end = JSONObject(text_and_at, strict, self._value, None, list, memo)
        node = Node(pairs)
        node.line = line
        for name in node:
            _encodable(name, at)
        if len(node) < len(pairs):
            names = [name for name, _ in pairs]
            first = {name: k for k, name in reversed(list(enumerate(names)))}
            name = next(name for k, name in enumerate(names) if first[name] < k)
            written = [m.start() for m in re.compile(re.escape(json.dumps(name)) + r"\s*:").finditer(text, at, end)]
            raise _Refused(f"{name!r} is given twice in one object", written[-1] if written else at)
        return node, end

    def _array(self, text_and_at, _scan):
        text, at = text_and_at
        rest = _NUMBERS.match(text, at)
        if rest and not _HUGE.search(rest[0]):
            if rest[0].count(",") >= limits.LAYER_CELLS:
                raise _Refused(f"a list of more than {limits.LAYER_CELLS:,} numbers", at)
            try:
                return [_SHARED[v] if v < len(_SHARED) else v for v in json.loads("[" + rest[0])], rest.end()
            except ValueError:
                pass  # the slow way says where and why
        return JSONArray(text_and_at, self._value)

    def _line(self, text, at):
        before, line = self._counted
        self._counted = at, line + text.count("\n", before, at)
        return self._counted[1]


def _number(digits):
    if len(digits) > limits.JSON_DIGITS:
        raise _Refused(f"the number {digits[:12]}... has too many digits")
    value = int(digits) if digits.lstrip("-").isdigit() else float(digits)
    if not math.isfinite(value):
        raise _Refused(f"the number {digits} is too large")
    return value


def _constant(word):
    raise _Refused(f"{word} is not allowed; write a finite number")


def _encodable(text, at):
    try:
        text.isascii() or text.encode()
    except UnicodeEncodeError:
        raise _Refused("incomplete character (a lone surrogate) in a string", at) from None
