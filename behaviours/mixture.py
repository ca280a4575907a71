"""Brushes between two brushes of one model: what paint of part weight gives to an animal.

Without anything measured all numbers go in a straight line from one brush to the other.  A path (``A--B.path.toml``,
`BrushPath`) says for even steps of the behaviour how far along that line the numbers are, and what some of them have
on top: it is measured by ``flockbrush brush morph``.
"""

from __future__ import annotations

import itertools
import re
import zlib
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal

import numpy as np
from flockbrush.behaviours.brush import PATH_SUFFIX, Brush, BrushLibrary, flies_free
from flockbrush.behaviours.file_library import check_schema
from flockbrush.behaviours.spec import Finite, Line, Spec, Text, spec_field
from flockbrush.behaviours.tomlfile import parse_toml
from flockbrush.behaviours.validation import Mistake, bounds, span, validated
from flockbrush.engine.problems import ProblemsError, did_you_mean
from pydantic import BaseModel, Field, model_validator

STEPS = 12  # brushes between two, and one of them
PATH_SCHEMA = "flockbrush.path/1"
_STEP = re.compile(r"([A-Za-z0-9_-]+)--([A-Za-z0-9_-]+)--[1-9][0-9]*of[0-9]+")
ROUNDED = 1e-5  # of a number: path files have six digits
Share = Annotated[Finite, Field(ge=0, le=1)]
Digest = Annotated[str, Field(pattern="^([0-9a-f]{64})?$")]


class BrushPath(Spec):
    """How the numbers go from one brush to another so that the behaviour changes evenly."""

    start: Line = spec_field(..., "the brush at 0")
    end: Line = spec_field(..., "the brush at 1")
    start_sha256: Digest = spec_field("", "SHA-256 of the file of the brush at 0 that was measured")
    end_sha256: Digest = spec_field("", "SHA-256 of the file of the brush at 1 that was measured")
    along: tuple[Share, ...] = spec_field(
        ..., "position of the parameters on the straight line, at even steps from 0 to 1", min_length=2, max_length=65
    )
    detour: dict[Line, tuple[Finite, ...]] = spec_field({}, "offsets that are added to a parameter at the same steps")
    begin: Literal["random", "aligned", "mill"] = spec_field("random", "start of the measured herds")
    seconds: Finite = spec_field(20.0, "duration of the measured runs, s", gt=0)
    even: bool = spec_field(True, "true if the measured behaviour changes evenly; false: it jumps")
    bistable: bool = spec_field(
        False, "true if herds behaved differently at the same step in both directions of a sweep"
    )
    measured: Text = spec_field("", "command and table")

    @model_validator(mode="after")
    def _goes_on(self):
        if self.along[0] != 0.0 or self.along[-1] != 1.0 or any(b < a for a, b in itertools.pairwise(self.along)):
            raise ValueError("'along' must rise from 0 to 1")
        for name, values in self.detour.items():
            if len(values) != len(self.along) or values[0] or values[-1]:
                raise ValueError(f"detour.{name} must have {len(self.along)} numbers, 0 at both ends")
        return self

    def at(self, share: float) -> tuple[float, dict[str, float]]:
        """How far along the line at a share of the way, 0 to 1, and what is added to parameters."""
        steps = np.linspace(0.0, 1.0, len(self.along))
        extra = {name: float(np.interp(share, steps, values)) for name, values in self.detour.items()}
        return float(np.interp(share, steps, self.along)), extra

    def reversed(self) -> BrushPath:
        """The same way back."""
        back = {name: values[::-1] for name, values in self.detour.items()}
        update = {"start": self.end, "end": self.start, "along": tuple(1.0 - x for x in self.along[::-1])}
        update |= {"start_sha256": self.end_sha256, "end_sha256": self.start_sha256}
        return self.model_copy(update={**update, "detour": back})

    def replaced(self, brushes: Iterable[Brush]) -> list[str]:
        """Names of those of its brushes that are not what was measured, as far as the path says what that was."""
        measured = {self.start: self.start_sha256, self.end: self.end_sha256}
        return [brush.name for brush in brushes if measured[brush.name] not in ("", brush.sha256)]


def load_path(source: bytes, file: str, brushes: Iterable[Brush] = ()) -> BrushPath:
    """Read a path.

    Parameters
    ----------
    file : str
        ``A--B.path.toml``, from A to B or from B to A.
    brushes : iterable of Brush, optional
        The two it leads between: with these its detours are checked.

    Raises
    ------
    ProblemsError
        With what is wrong with the file.
    """
    toml = parse_toml(source, file)
    path, mistakes = validated(BrushPath, check_schema(toml, PATH_SCHEMA))
    if path is not None:
        mistakes = _misnamed(path, file) or _misfits(path, {brush.name: brush for brush in brushes})
    if path is None or mistakes:
        raise ProblemsError([toml.problem(where, message) for where, message in mistakes])
    return path


def _misnamed(path: BrushPath, file: str) -> list[Mistake]:
    """What is wrong with the ends of a path whose file tells others."""
    base = re.split(r"[/\\]", file)[-1]
    names = [f"{one}--{two}{PATH_SUFFIX}" for one, two in ((path.start, path.end), (path.end, path.start))]
    if base in names:
        return []
    right = base.startswith(f"{path.start}--") or base.endswith(f"--{path.start}{PATH_SUFFIX}")
    message = f"the file of a path from {path.start!r} to {path.end!r} must be {names[0]} or {names[1]}, got {base!r}"
    return [(("end",) if right else ("start",), message)]


def _misfits(path: BrushPath, brushes: Mapping[str, Brush]) -> list[Mistake]:
    """What is wrong with the detours of a path: what else may be out of bounds where a brush was replaced."""
    start, end = brushes.get(path.start), brushes.get(path.end)
    if start is None or end is None or not can_mix(start, end):
        return []
    fields = type(start.params).model_fields
    known = path.start_sha256 and path.end_sha256  # else a brush may have been changed since
    mistakes: list[Mistake] = []
    numbers = [name for name in fields if _are_numbers(getattr(start.params, name), getattr(end.params, name))]
    for name, values in path.detour.items():
        if name not in numbers:
            of = f"model {start.model!r} has no {'number' if name in fields else 'parameter'} of this name"
            mistakes.append((("detour", name), of + did_you_mean(name, numbers)))
            continue
        a, b, limits = getattr(start.params, name), getattr(end.params, name), bounds(fields[name])
        for k, (share, extra) in enumerate(zip(path.along, values, strict=True)):
            value = a + share * (b - a) + extra
            beyond = abs(value - limits.nearest(value)) > ROUNDED * (abs(a) + abs(b) + abs(extra))
            if beyond and known and not path.replaced((start, end)):
                message = f"makes {name} {value:g} at step {k}/{len(values) - 1}; it must be {span(fields[name])}"
                mistakes.append((("detour", name, k), message))
    return mistakes


def path_between(library: BrushLibrary, start: str, end: str) -> BrushPath | None:
    """The measured path from one brush to another, if there is one and they can be mixed; ProblemsError."""
    found = library.path_between(start, end) if hasattr(library, "path_between") else None
    if found is None:
        return None
    (file, source), brushes = found, (library.get(start), library.get(end))
    if not can_mix(*brushes):
        return None
    path = load_path(source, str(file), brushes)
    return path if path.start == start else path.reversed()


def paths_in(files: Mapping[str, str]) -> dict[tuple[str, str], BrushPath]:
    """The paths in some files, {name: text}, both ways; of two files for one way that which is named so."""
    paths: dict[tuple[str, str], BrushPath] = {}
    for file, text in files.items():
        path = load_path(text.encode(), file)
        for way in (path, path.reversed()):
            if file == f"{way.start}--{way.end}{PATH_SUFFIX}":
                paths[way.start, way.end] = way
            else:
                paths.setdefault((way.start, way.end), way)
    return paths


def path_to_toml(path: BrushPath) -> str:
    """The text of a path's file."""

    def numbers(values):
        return "[" + ", ".join(f"{value:.6g}" for value in values) + "]"

    lines = [f'schema = "{PATH_SCHEMA}"', f'start = "{path.start}"', f'end = "{path.end}"']
    lines += [
        *(f'{name} = "{digest}"' for name in ("start_sha256", "end_sha256") if (digest := getattr(path, name))),
        f'begin = "{path.begin}"',
        f"seconds = {path.seconds:g}",
        f"even = {str(path.even).lower()}",
        f"bistable = {str(path.bistable).lower()}",
        f"along = {numbers(path.along)}",
        f'measured = """\n{path.measured}"""',
    ]
    if path.detour:
        lines += ["", "[detour]", *(f"{name} = {numbers(values)}" for name, values in path.detour.items())]
    return "\n".join(lines) + "\n"


def can_mix(start: Brush, end: Brush) -> bool:
    """Whether there are brushes between two: of one model, in one medium."""
    return start.model == end.model and flies_free(start) == flies_free(end)


def mixed(start: Brush, end: Brush, share: float, path: BrushPath | None = None, name: str = "") -> Brush:
    """The brush at a share of the way from one to another.

    Numbers are mixed; what is no number (who is guided, whom sight takes) changes half-way.  The body stays that of
    the first.

    Parameters
    ----------
    share : float
        0 to 1.
    path : BrushPath, optional
        A straight line without it.
    """
    along, extra = (share, {}) if path is None else path.at(share)
    blend = start.model_copy(
        update={
            "name": name or start.name,
            "title": f"{share:.0%} of the way from {start.name} to {end.name}",
            "params": _between(start.params, end.params, along, extra),
            "speed": _between(start.speed, end.speed, along, {}),
            "vision": _between(start.vision, end.vision, along, {}),
            "drives": _drives_between(start.drives, end.drives, along),
            "transition": _number(start.transition, end.transition, along),
            "colour": _colour(start.colour, end.colour, share),
        }
    )
    return blend


def _number(a, b, share):
    return float(a + share * (b - a)) if a != b else float(a)


def _are_numbers(*values: Any) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def _between(a: BaseModel, b: BaseModel, share: float, extra: dict[str, float]) -> Any:
    """Parameters between two of one kind and what a detour adds, each within its bounds."""
    values = {}
    for name, field in type(a).model_fields.items():
        one, two = getattr(a, name), getattr(b, name)
        if _are_numbers(one, two):
            value = bounds(field).nearest(_number(one, two, share) + extra.get(name, 0.0))
            values[name] = round(value) if isinstance(one, int) and isinstance(two, int) else value
        else:
            values[name] = one if share < 0.5 else two
    params, mistakes = validated(type(a), values)
    if params is None:
        raise ValueError("; ".join(f"{'.'.join(map(str, where))}: {message}" for where, message in mistakes))
    return params


def _drives_between(a: dict, b: dict, share: float) -> dict:
    """Drives of both; one that only one of them has grows or fades with its strength."""
    out = {}
    for name in [*a, *(name for name in b if name not in a)]:
        if name in a and name in b:
            out[name] = _between(a[name], b[name], share, {})
        else:
            only, weight = (a[name], 1.0 - share) if name in a else (b[name], share)
            out[name] = only.model_copy(update={"strength": only.strength * weight})
    return out


def _colour(a: str, b: str, share: float) -> str:
    one, two = (np.array([int(c[k : k + 2], 16) for k in (1, 3, 5)]) for c in (a, b))
    return "#" + "".join(f"{int(v):02x}" for v in np.rint(one + share * (two - one)))


def step_name(start: str, end: str, step: int) -> str:
    """The name of the brush at a step of `STEPS` between two."""
    name = f"{start}--{end}--{step}of{STEPS}"
    if len(name) > 64:  # names end there
        name = f"{start[:20]}--{end[:20]}-{zlib.crc32(name.encode()):08x}--{step}of{STEPS}"
    return name


def is_step(name: str) -> bool:
    """Whether a name may be one of `step_name`."""
    return _STEP.fullmatch(name) is not None


def steps_between(start: Brush, end: Brush, path: BrushPath | None = None) -> list[Brush]:
    """The brushes at steps 1 to ``STEPS - 1``."""
    return [mixed(start, end, k / STEPS, path, step_name(start.name, end.name, k)) for k in range(1, STEPS)]
