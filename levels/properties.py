"""Custom properties: from what Tiled wrote to values of the schema's kinds, with every complaint in words."""

from __future__ import annotations

import math
import re

from flockbrush.components.level_things import radians_of
from flockbrush.engine.problems import Problem, did_you_mean
from flockbrush.levels.document_nodes import is_class
from flockbrush.levels.level_class import ObjectClass, Property
from flockbrush.levels.schema import CLASSES, COMPASS

_MAX_PROBLEMS = 1000
_COLOUR = re.compile(r"#(?:[0-9a-fA-F]{2})?([0-9a-fA-F]{6})")
_TRUE_FALSE = {True: "true", False: "false"}


class Report:
    """The problems found so far."""

    def __init__(self):
        self.problems: list[Problem] = []
        self.warnings: list[Problem] = []  # what may be and is rarely meant

    def say(self, file, line, where, message):
        """Add one, unless there are far too many already."""
        if len(self.problems) < _MAX_PROBLEMS:
            self.problems.append(Problem(file, line, where, message))

    def warn(self, file, line, where, message):
        """Add a warning, unless there are far too many already."""
        if len(self.warnings) < _MAX_PROBLEMS:
            self.warnings.append(Problem(file, line, where, f"warning: {message}"))


class FilePlace:
    """Where in which file we are, for problems: a layer, an object, a tile."""

    def __init__(self, report: Report, file: str, line: int | None, where: str = ""):
        self.report, self.file, self.line, self.where = report, file, line, where

    def say(self, message, line=None):
        """A problem here."""
        self.report.say(self.file, line or self.line, self.where, message)

    def warn(self, message, line=None):
        """A warning here."""
        self.report.warn(self.file, line or self.line, self.where, message)

    def at(self, node, where):
        """The same file, at another node."""
        return FilePlace(self.report, self.file, getattr(node, "line", self.line), where)


class Refused(ValueError):
    """The value is wrong; the text says how, after the property's name."""


def shown(value) -> str:
    """A value as a designer knows it, short."""
    if isinstance(value, bool):
        return _TRUE_FALSE[value]
    if isinstance(value, str):
        return f"the text {value[:40]!r}{'...' if len(value) > 40 else ''}"
    if isinstance(value, int | float):
        return f"{value:g}" if isinstance(value, float) else str(value)
    return "nothing" if value is None else "a list" if isinstance(value, list) else "an object"


def is_number(value) -> bool:
    """A finite number, and not a bool."""
    return type(value) in (int, float) and math.isfinite(value)


class Values(dict):
    """The properties of one thing: every one of its class, with the defaults of those left out."""

    __slots__ = ("given", "lines", "others", "wrong")

    def __init__(self, cls: ObjectClass):
        super().__init__((p.name, convert(p, p.default)) for p in cls.properties)
        self.given: set[str] = set()
        self.wrong: set[str] = set()  # given, but refused
        self.others: dict = {}  # of an open class
        self.lines: dict[str, int] = {}


def read_properties(node, cls: ObjectClass, place: FilePlace) -> Values:
    """The properties of `node` as class `cls`; problems are reported to `place`, wrong values become the default."""
    values = Values(cls)
    for entry, name, value in _flat(node, cls, place):
        line = getattr(entry, "line", place.line) or 1
        if name in values.given or name in values.others:
            place.say(f"property {name!r} is given twice", line)
            continue
        values.lines[name] = line
        p = cls.property(name)
        if p is None:
            _other(values, cls, name, value, place, line)
            continue
        values.given.add(name)
        try:
            values[name] = convert(p, value)
        except Refused as error:
            values.wrong.add(name)
            place.say(f"{name} {error}", line)
    for p in cls.properties:
        if p.required and p.name not in values.given:
            place.say(f"{p.name} is missing{_hint(p)}")
    return values


def _hint(p):
    if p.kind == "brush":
        return "; name a brush asset"
    other = "; to make a level of another map: flockbrush level adopt FILE"
    return f"; a Flockbrush level has '{p.default}'{other}" if p.name == "schema" else ""


def _other(values, cls, name, value, place, line):
    if cls.open:
        values.others[name] = value
    else:
        known = [p.name for p in cls.properties]
        place.say(f"{cls.name} has no property {name[:60]!r}{did_you_mean(name, known)}", line)


def _flat(node, cls, place):
    """(entry, name, value) of each property; a class value of our class counts as its members."""
    entries = node.get("properties", [])
    if not isinstance(entries, list):
        place.say("'properties' must be a list")
        return
    for entry in entries:
        if not isinstance(entry, dict) or not isinstance(entry.get("name"), str) or "value" not in entry:
            place.say("each of the 'properties' must have a name and a value", getattr(entry, "line", None))
        elif isinstance(entry["value"], dict) and is_class(entry, cls):
            yield from ((entry, name, value) for name, value in entry["value"].items())
        else:
            yield entry, entry["name"], entry["value"]


# ---------------------------------------------------------------- kinds


def convert(p: Property, value):
    """The value in our units; Refused."""
    return _KINDS[p.kind](p, value)


def _number(p, value):
    if not is_number(value):
        text = "; make the property a float" if isinstance(value, str) else ""
        raise Refused(f"must be a number{_of(p)}, got {shown(value)}{text}")
    return _bounded(p, float(value))


def _of(p):
    return f" ({p.unit})" if p.unit else ""


def _int(p, value):
    if not is_number(value) or value != int(value):
        text = "; make the property an int" if isinstance(value, str) else ""
        raise Refused(f"must be a whole number, got {shown(value)}{text}")
    return _bounded(p, int(value))


def _bounded(p, value):
    for broken, words in (
        (p.low is not None and value < p.low, f"at least {p.low:g}" if p.low is not None else ""),
        (p.above is not None and value <= p.above, f"more than {p.above}"),
        (p.high is not None and value > p.high, f"at most {p.high:.10g}" if p.high is not None else ""),
    ):
        if broken:
            raise Refused(f"must be {words}{' ' + p.unit if p.unit else ''}, got {shown(value)}")
    return value


def _bool(p, value):
    if type(value) is not bool:
        raise Refused(f"must be true or false, got {shown(value)}; make the property a bool")
    return value


def _text(p, value):
    if not isinstance(value, str):
        raise Refused(f"must be a string, got {shown(value)}")
    if len(value) > p.longest:
        raise Refused(f"must have at most {p.longest} characters, got {len(value)}")
    return value


def _colour(p, value):
    match = _COLOUR.fullmatch(value) if isinstance(value, str) else None
    if not match:
        raise Refused(f"must be a colour such as #7aa04a, got {shown(value)}")
    return "#" + match[1].lower()


def _enum(p, value):
    if not isinstance(value, str):
        raise Refused(f"must be one of {', '.join(p.values)}, got {shown(value)}")
    if value not in p.values:
        raise Refused(f"must be one of {', '.join(p.values)}, got {value[:40]!r}{_near(value, p.values)}")
    return value


def _near(value, values):
    near = did_you_mean(value, values)
    return near if "did you mean" in near else ""


def _heading(p, value):
    """Radians counter-clockwise from east, or None for each its own."""
    if isinstance(value, str):
        word = value.strip().lower()
        if word == "random":
            return None
        if word in COMPASS:
            return radians_of(COMPASS[word])
        try:
            value = float(word)
        except ValueError:
            raise Refused(
                f"must be random, a compass point or degrees counter-clockwise from east, got {shown(value)}"
                f"{_near(word, [*COMPASS, 'random'])}"
            ) from None
    if not is_number(value) or abs(value) > 36000:
        raise Refused(f"must be random, a compass point or degrees counter-clockwise from east, got {shown(value)}")
    return radians_of(value)


def _goal(p, value):
    """A goal's name, or the id of its object, which the reader turns into its name."""
    return value if type(value) is int else _text(p, value)


_KINDS = {
    "number": _number,
    "int": _int,
    "bool": _bool,
    "text": _text,
    "colour": _colour,
    "enum": _enum,
    "heading": _heading,
    "brush": _text,
    "program": _text,
    "goal": _goal,
}

assert all(p.kind in _KINDS for c in CLASSES.values() for p in c.properties)
