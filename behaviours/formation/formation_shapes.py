"""What is known of a formation: its curve, its birds, frame by frame; and the file it is kept in."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from flockbrush.behaviours.tomlfile import read_bytes
from flockbrush.engine import limits
from flockbrush.engine.file_formats import format_error
from flockbrush.engine.problems import Problem, ProblemsError

SCHEMA = "flockbrush.formation/1"
MODELS = {"line": 2, "v": 3, "parabola": 3}  # curves and how many numbers each has
FARTHEST = 1e4  # wingspans from the leader, and numbers of a curve
KINDS = ("V", "line", "U", "J", "none")


@dataclass(frozen=True)
class Curve:
    """Where birds stand: y in wingspans ahead of the leader, as a function of x to its right.

    ``line``: c + b x.  ``v``: c - l max(-x, 0) - r max(x, 0).  ``parabola``: c + b x + a x².
    """

    model: str
    numbers: tuple[float, ...]  # (c, b), (c, l, r) or (c, b, a)

    def y(self, x):
        """Ordinates at ``x``."""
        columns = basis(self.model, x)
        return sum(columns[..., k] * number for k, number in enumerate(self.numbers))  # no BLAS: same bits everywhere

    def slope(self, x):
        """dy/dx at ``x``."""
        return slopes(self.model, x) @ np.array(self.numbers)

    def mirrored(self) -> Curve:
        """Left and right exchanged."""
        c, b, *more = self.numbers
        return Curve(self.model, (c, more[0], b) if self.model == "v" else (c, -b, *more))

    def scaled(self, factor: float) -> Curve:
        """The similar curve, ``factor`` times as large."""
        if self.model != "parabola":
            return self
        c, b, a = self.numbers
        return Curve(self.model, (c * factor, b, a / factor))


TEXTBOOK = {
    "V": (Curve("v", (0.0, 0.8, 0.8)), 0.5),
    "U": (Curve("parabola", (0.0, 0.0, -0.05)), 0.5),
    "J": (Curve("parabola", (0.0, 0.0, -0.03)), 0.2),
    "line": (Curve("line", (0.0, -0.8)), 0.0),
}  # curve, and the share of birds on the left


def textbook(kind: str, birds: int):
    """A shape as it is drawn in books: (x, y), wingspans, the leader at the origin, birds from left to right."""
    curve, share = TEXTBOOK[kind]
    x = 1.25 * (np.arange(birds) - int(share * birds))
    return x, curve.y(x)


def basis(model: str, x):
    """Columns whose sum, weighted by a curve's numbers, is y, (n, p)."""
    x = np.asarray(x, float)
    one = np.ones_like(x)
    if model == "v":
        return np.stack([one, -np.maximum(-x, 0.0), -np.maximum(x, 0.0)], axis=-1)
    return np.stack([one, x] if model == "line" else [one, x, x * x], axis=-1)


def slopes(model: str, x):
    """Derivatives of the columns of `basis`, (n, p)."""
    x = np.asarray(x, float)
    zero, one = np.zeros_like(x), np.ones_like(x)
    if model == "v":
        return np.stack([zero, np.where(x < 0, 1.0, 0.0), np.where(x > 0, -1.0, 0.0)], axis=-1)
    return np.stack([zero, one] if model == "line" else [zero, one, 2.0 * x], axis=-1)


@dataclass(frozen=True)
class FrameShape:
    """One frame of a movie as section 4 of the paper sees it.  Birds stand in order from left to right."""

    frame: str
    birds: tuple[str, ...]  # names, from left to right
    x: tuple[float, ...]  # wingspans to the right of the leader
    y: tuple[float, ...]  # wingspans ahead of the leader
    leader: int  # which of them leads
    kind: str  # one of KINDS
    why: str  # what speaks for the kind, or against any
    curve: Curve | None
    outliers: tuple[int, ...]  # which birds the curve does not explain
    spacing: tuple[float, float]  # μ_xf and σ_xf, wingspans
    deviation: tuple[float, float]  # μ_yf and σ_yf of the others about the curve, wingspans

    @property
    def roles(self) -> dict[str, str]:
        """Special roles by bird: leader, outlier, straggler (in line, but far from everybody)."""
        roles = {self.birds[k]: "straggler" for k in self.stragglers}
        roles |= {self.birds[k]: "outlier" for k in self.outliers}
        roles[self.birds[self.leader]] = "leader"
        return roles

    @property
    def stragglers(self) -> tuple[int, ...]:
        """Who is farther from the nearest bird than twice the usual, and yet near the curve."""
        if len(self.x) < 4:
            return ()
        x, y = np.array(self.x), np.array(self.y)
        apart = np.hypot(x[:, None] - x, y[:, None] - y) + np.diag(np.full(len(x), np.inf))
        alone = apart.min(axis=1) > 2.0 * np.median(apart.min(axis=1))
        return tuple(k for k in np.flatnonzero(alone).tolist() if k not in (*self.outliers, self.leader))


@dataclass(frozen=True)
class Formation:
    """An example movie, extracted: what steady flight learns from."""

    name: str
    frames: tuple[FrameShape, ...]
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def usable(self) -> tuple[FrameShape, ...]:
        """The frames that have a curve."""
        return tuple(frame for frame in self.frames if frame.curve is not None)

    def kinds(self) -> dict[str, int]:
        """How many frames there are of each kind."""
        return {kind: n for kind in KINDS if (n := sum(f.kind == kind for f in self.frames))}


def to_json(formation: Formation) -> str:
    """The text of a ``.formation.json`` file."""
    frames = [asdict(frame) for frame in formation.frames]
    document = {
        "schema": SCHEMA, "name": formation.name, "unit": "wingspans, +y the way they fly, leader at the origin",
        "provenance": formation.provenance, "frames": frames,
    }  # fmt: skip
    return json.dumps(_rounded(document), indent=1, ensure_ascii=False) + "\n"


def _rounded(value):
    if isinstance(value, float):
        return round(value, 6)
    if isinstance(value, dict):
        return {key: _rounded(part) for key, part in value.items()}
    return [_rounded(part) for part in value] if isinstance(value, (list, tuple)) else value


def load_formation(path: str | os.PathLike) -> Formation:
    """Read a formation file.

    Raises
    ------
    ProblemsError
        With everything that is wrong, each with its frame.
    """
    name = str(path)
    data = read_bytes(path, limits.FORMATION_BYTES)
    try:
        document = json.loads(data.decode())
    except UnicodeDecodeError:
        raise ProblemsError([Problem(name, None, None, "is not UTF-8 text")]) from None
    except (ValueError, RecursionError) as error:
        line = getattr(error, "lineno", None)
        raise ProblemsError([Problem(name, line, None, f"is not JSON: {getattr(error, 'msg', error)}")]) from None
    return read_formation(document, name)


def read_formation(document: Any, name: str) -> Formation:
    """A formation from the parsed document of its file."""
    given = document.get("schema") if isinstance(document, dict) else type(document).__name__
    if wrong := format_error(given, SCHEMA):
        raise ProblemsError([Problem(name, None, "schema", wrong)])
    problems: list[Problem] = []
    frames = []
    given = document.get("frames")
    if not isinstance(given, list) or not given:
        raise ProblemsError([Problem(name, None, "frames", "must be a list of at least one frame")])
    for k, frame in enumerate(given):
        try:
            frames.append(_frame(frame))
        except (KeyError, TypeError, ValueError, IndexError) as error:
            reason = f"lacks {error}" if isinstance(error, KeyError) else str(error)
            problems.append(Problem(name, None, f"frames[{k}]", reason))
    provenance = document.get("provenance", {})
    if not isinstance(provenance, dict):
        problems.append(Problem(name, None, "provenance", "must be a table of names and values"))
    if len({len(frame.birds) for frame in frames}) > 1:
        problems.append(Problem(name, None, "frames", "all must have the same number of birds"))
    if problems:
        raise ProblemsError(problems)
    return Formation(str(document.get("name", "")), tuple(frames), provenance)


def _frame(raw) -> FrameShape:
    names, leader, outliers = raw["birds"], raw["leader"], raw["outliers"]
    if not (
        isinstance(names, list) and 0 < len(names) <= limits.FORMATION_BIRDS and len(set(map(str, names))) == len(names)
    ):
        raise ValueError(f"birds must be 1 to {limits.FORMATION_BIRDS:,} different names")
    n = len(names)
    x, y = _numbers(raw["x"], "x", n), _numbers(raw["y"], "y", n)
    if any(right < left for left, right in zip(x, x[1:], strict=False)):
        raise ValueError("x must be ascending: birds are ordered from left to right")
    if raw["kind"] not in KINDS:
        raise ValueError(f"kind must be one of {', '.join(KINDS)}, got {str(raw['kind'])[:40]!r}")
    if not all(type(k) is int and 0 <= k < n for k in (leader, *_list(outliers, "outliers"))):
        raise ValueError(f"leader and outliers are places from 0 to {n - 1}")
    return FrameShape(
        str(raw["frame"]), tuple(map(str, names)), x, y, leader, raw["kind"], str(raw["why"]), _curve(raw["curve"]),
        tuple(outliers), _spread(raw["spacing"], "spacing", 0.0), _spread(raw["deviation"], "deviation", -FARTHEST),
    )  # fmt: skip


def _curve(raw) -> Curve | None:
    if raw is None:
        return None
    if raw["model"] not in MODELS:
        raise ValueError(f"curve.model must be one of {', '.join(MODELS)}, got {str(raw['model'])[:40]!r}")
    return Curve(raw["model"], _numbers(raw["numbers"], f"numbers of a {raw['model']}", MODELS[raw["model"]]))


def _spread(raw, name, least) -> tuple[float, float]:
    """(mean, deviation)."""
    mean, deviation = _numbers(raw, name, 2)
    if mean < least or deviation < 0:
        raise ValueError(f"{name} must be [mean, deviation], not below {least:g} and 0 wingspans, got {raw}")
    return mean, deviation


def _numbers(raw, name, count) -> tuple[float, ...]:
    if len(_list(raw, name)) != count or not all(type(v) in (int, float) and abs(v) <= FARTHEST for v in raw):
        raise ValueError(f"{name} must be {count} numbers, at most {FARTHEST:g} away from 0")
    return tuple(map(float, raw))


def _list(raw, name):
    if not isinstance(raw, list):
        raise ValueError(f"{name} must be a list, got {type(raw).__name__}")
    return raw
