"""Reading marked birds from a table: columns, unit, the way they fly, and every mistake with its place."""

from __future__ import annotations

import math
import os

import numpy as np
from flockbrush.behaviours.formation.curves import fit
from flockbrush.behaviours.formation.extraction import Marks, fit_with_leader, most_outliers
from flockbrush.behaviours.tables import read_table
from flockbrush.engine import limits
from flockbrush.engine.problems import SHOWN, Problem, ProblemsError, did_you_mean

HEADINGS = {"right": 0.0, "up": 90.0, "left": 180.0, "down": 270.0}  # degrees counter-clockwise from the right
FRAME, BIRD = ("frame", "photo", "image"), ("bird", "id", "track")
COARSE, FINE = 15, 5  # degrees between the ways that are tried
LEVEL = 0.08  # depth over width: a row, whose two sides look alike
UNEQUAL = 4.0  # birds that a radian between the slopes of both arms costs
ROW = 0.5  # birds: a straight row that costs no more than this above the best curve leaves the way open
PIXELS, WINGSPANS = (("x_px", "y_px"), ("x", "y")), (("x_b", "y_b"),)


def read_marks(
    path: str | os.PathLike, heading: str | None = None, wingspan: float | None = None, gaps: bool = False
) -> tuple[Marks, dict]:
    """Marked birds from a CSV.

    Parameters
    ----------
    path : path
        With a header and a row for each bird and frame: ``frame`` (may be left out when there is one), ``bird``,
        and ``x_px``, ``y_px`` (pixels, y downward) or ``x_b``, ``y_b`` (wingspans, y upward).  Other columns are
        left alone, but a ``wingspan_px`` is used.
    heading : str, optional
        The way they fly across the picture: up, down, left, right, degrees counter-clockwise from the right, or
        ``auto``: the one under which their shape is the plainest.  By default, auto for marks in pixels and up for
        marks in wingspans.
    wingspan : float, optional
        Pixels.
    gaps : bool
        Birds may lack in frames.

    Returns
    -------
    Marks
        In wingspans, +y the way they fly; NaN where a bird lacks.
    dict
        Heading and wingspan that were used.

    Raises
    ------
    ProblemsError
        Everything that is wrong, with row and column.
    """
    name = str(path)
    header, rows = _table(path, name)
    at = _columns(header, name)
    frames, birds, xy, spans = _numbers(rows, at, name, header)
    problems = _gaps(frames, birds, rows, name, gaps)
    if problems:
        raise ProblemsError(problems)
    pixels = at["pixels"]
    if pixels and wingspan is None:
        if not spans:
            message = "is in pixels, but the wingspan is not known; add a column wingspan_px or give --wingspan"
            raise ProblemsError([Problem(name, 1, header[at["x"]], message)])
        wingspan = float(np.median(spans))
    if wingspan is not None and not (math.isfinite(wingspan) and wingspan > 0):
        raise ProblemsError([Problem(name, None, "wingspan", f"must be above 0 pixels, got {wingspan}")])
    order = {key: k for k, key in enumerate(dict.fromkeys(frames))}
    bird = {key: k for k, key in enumerate(dict.fromkeys(birds))}
    grid = np.full((len(order), len(bird), 2), np.nan)
    for f, b, point in zip(frames, birds, xy, strict=True):
        grid[order[f], bird[b]] = point
    if pixels and wingspan is not None:
        grid[..., 1] *= -1.0  # pictures count downward
        grid /= wingspan
    estimated = heading == "auto" or (heading is None and pixels)
    turn = guess_heading(grid[0], name) if estimated else _heading(heading or "up", name)
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    x, y = grid[..., 0] * s - grid[..., 1] * c, grid[..., 0] * c + grid[..., 1] * s
    used = {
        "heading_degrees": turn,
        "heading_from": "the shape" if estimated else "the call",
        "wingspan_px": wingspan if pixels else None,
    }
    return Marks(tuple(order), tuple(bird), x, y), used


def _table(path, name):
    table = list(read_table(path, limits.MARKS_BYTES, limits.MARKS_ROWS))
    if not table:
        raise ProblemsError([Problem(name, None, None, "is empty; a header and a row for each bird are needed")])
    if len(table) < 2:
        raise ProblemsError([Problem(name, 1, None, "has a header and no birds")])
    return [cell.strip() for cell in table[0][1]], table[1:]


def _columns(header, name):
    """Which column holds what."""
    lowered = [cell.lower() for cell in header]
    columns = {"pixels": True, "x": -1, "y": -1}
    for pair in (PIXELS[0], *WINGSPANS, PIXELS[1]):  # plain x, y last: beside x_b they are metres
        if pair[0] in lowered and pair[1] in lowered:
            columns.update(x=lowered.index(pair[0]), y=lowered.index(pair[1]), pixels=pair not in WINGSPANS)
            break
    if columns["x"] < 0:
        near = did_you_mean("x_px", header)
        raise ProblemsError([Problem(name, 1, None, f"needs columns x_px and y_px, or x_b and y_b{near}")])
    for key, names in (("frame", FRAME), ("bird", BIRD), ("span", ("wingspan_px",))):
        columns[key] = next((lowered.index(n) for n in names if n in lowered), -1)
    return columns


def _numbers(rows, at, name, header):
    """(frames, birds, points, wingspans) of all rows."""
    problems: list[Problem] = []
    frames, birds, points, spans = [], [], [], []
    first_line: dict[tuple[str, str], int] = {}
    for line, row in rows:
        if len(row) < len(header):
            problems.append(Problem(name, line, None, f"has {len(row)} cells, the header has {len(header)}"))
            continue
        point = [_number(row[at[axis]], name, line, header[at[axis]], problems) for axis in ("x", "y")]
        if at["span"] >= 0 and row[at["span"]].strip():
            span = _number(row[at["span"]], name, line, "wingspan_px", problems)
            if span is not None and span <= 0:
                problems.append(Problem(name, line, "wingspan_px", f"must be above 0, got {span:g}"))
            elif span is not None:
                spans.append(span)
        frame = row[at["frame"]].strip() if at["frame"] >= 0 else "0"
        bird = row[at["bird"]].strip() if at["bird"] >= 0 else str(len(birds))
        if not bird:
            problems.append(Problem(name, line, header[at["bird"]], "has no name"))
        if (frame, bird) in first_line:
            message = f"bird {bird!r} of frame {frame!r} is already in row {first_line[frame, bird]}"
            problems.append(Problem(name, line, header[at["bird"]], message))
        first_line[frame, bird] = line
        frames.append(frame)
        birds.append(bird)
        points.append(point)
    if problems:
        raise ProblemsError(problems)
    return frames, birds, np.array(points, float), spans


def _number(cell, name, line, column, problems):
    try:
        value = float(cell)
    except ValueError:
        problems.append(Problem(name, line, column, f"must be a number, got {cell.strip()[:40]!r}"))
        return None
    if not math.isfinite(value) or abs(value) > 1e7:
        problems.append(Problem(name, line, column, f"must be a finite number, got {cell.strip()[:40]}"))
        return None
    return value


def _gaps(frames, birds, rows, name, may_lack):
    """Frames that have too many birds, or other birds than the first."""
    of: dict[str, list[str]] = {}
    last: dict[str, int] = {}
    for frame, bird, (line, _) in zip(frames, birds, rows, strict=True):
        of.setdefault(frame, []).append(bird)
        last[frame] = line
    first = next(iter(of))
    known = set(of[first])
    most = limits.FORMATION_BIRDS
    problems = [
        Problem(name, last[frame], "bird", f"frame {frame!r} has {len(birds_here):,} birds; there can be {most:,}")
        for frame, birds_here in of.items()
        if len(birds_here) > most
    ]
    for frame, birds_here in () if may_lack else of.items():
        if len(problems) >= SHOWN:
            break
        missing, more = sorted(known - set(birds_here)), sorted(set(birds_here) - known)
        if missing or more:
            parts = [f"lacks {', '.join(missing[:5])}"] * bool(missing) + [f"has also {', '.join(more[:5])}"] * bool(
                more
            )
            first_has = f"frame {first!r} has {len(of[first])}"
            message = f"frame {frame!r} has {len(birds_here)} birds, {first_has}: it {' and '.join(parts)}"
            problems.append(Problem(name, last[frame], "bird", message))
    return problems


def _heading(heading, name):
    if heading in HEADINGS:
        return HEADINGS[heading]
    try:
        turn = float(heading)
    except ValueError:
        turn = math.nan
    if not math.isfinite(turn):
        raise ProblemsError(
            [Problem(name, None, "heading", f"must be up, down, left, right, auto or degrees, got {heading!r}")]
        )
    return turn % 360.0


def guess_heading(points, name="marks"):
    """The way a V, a U or a J flies, degrees counter-clockwise from the right: the one whose curve costs least.

    Arms of equal slope, or a parabola that is level at its leader, speak for a way.

    Raises
    ------
    ProblemsError
        When the birds fly in a straight row or in none of these, which says nothing of the way they fly.
    """
    best = min(_ways(points, np.arange(0, 360, COARSE)), default=None)
    rows = [row.cost for x, y in (points.T, points.T[::-1]) if (row := fit("line", x, y)) is not None]
    if best is None or min(rows, default=math.inf) <= best[0] + ROW:
        message = "cannot be estimated from a straight row or a cluster; give --heading left, or degrees"
        raise ProblemsError([Problem(name, None, "heading", message)])
    fine = best[1] + np.arange(FINE - COARSE, COARSE, FINE)
    return float(min(best, *_ways(points, fine))[1] % 360)


def _ways(points, turns):
    """(cost, degrees) of each way whose cheapest curve opens backward."""
    candidates = []
    for turn in turns:
        c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
        x, y = points[:, 0] * s - points[:, 1] * c, points[:, 0] * c + points[:, 1] * s
        best = fit_with_leader(x, y)
        if best is None or best.seen.curve.model == "line" or (~best.seen.inlier).sum() > most_outliers(len(x)):
            continue
        numbers = np.array(best.seen.curve.numbers[1:])
        on = best.seen.inlier
        depth = np.ptp(best.seen.curve.y((x - x[best.leader])[on]))
        if depth < LEVEL * np.ptp(x[on]):
            continue
        tilt = np.arctan(numbers)
        unequal = abs(tilt[0] - tilt[1]) if best.seen.curve.model == "v" else abs(tilt[0])
        candidates.append((best.cost + UNEQUAL * unequal, float(turn)))
    return candidates
