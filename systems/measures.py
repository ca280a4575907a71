"""What a herd looks like in numbers, with the field's names.

Each function takes plain arrays and returns a number or an array; NaN where a
measure has no meaning (no animals, nobody moving).

References
----------
.. [1] Gong et al. 2025, Herds from video, section 7.1.2 (eqs. 12 and 13).
.. [2] Couzin, Krause, James, Ruxton & Franks 2002, Collective memory and spatial sorting in animal groups.
   Journal of Theoretical Biology 218(1), 1-11.
"""

from __future__ import annotations

import numbers
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
import scipy  # its parts are imported when they are used first, which takes a third of a start
from flockbrush.engine.plugins import blaming, load_entry_points


def _unit(vectors):
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, size, out=np.zeros_like(vectors, float), where=size > 0)


def compute_polarization(direction):
    """|mean unit direction|, 0 to 1 (eq. 12 of [1]_); ``direction`` (n, 2 or 3)."""
    if not len(direction):
        return np.nan
    return float(np.linalg.norm(_unit(np.asarray(direction, float)).mean(0)))


def compute_rotation(xy, direction, centre=None):
    """Mean of r̂ x û about the centroid, or another centre: signed, counter-clockwise positive, -1 to 1."""
    if not len(xy):
        return np.nan
    r = _unit(np.asarray(xy, float)[:, :2] - (np.mean(xy, 0)[:2] if centre is None else centre))
    u = _unit(np.asarray(direction, float)[:, :2])
    return float((r[:, 0] * u[:, 1] - r[:, 1] * u[:, 0]).mean())


def compute_milling(xy, direction, centre=None):
    """|mean(r̂ x û)|, 0 to 1: the angular momentum of eq. 13 of [1]_, about `centre`, by default the centroid."""
    return abs(compute_rotation(xy, direction, centre))


def compute_unwrapped(xy, wrap):
    """Positions on a wrapped map (width, height) as one piece: everybody where it is nearest to the herd's middle.

    The middle is the circular mean, so a herd on a seam keeps its shape; one that fills the map has none.
    """
    xy = np.asarray(xy, float)[:, :2]
    if wrap is None or not len(xy):
        return xy
    angle = 2 * np.pi * xy / wrap
    middle = np.arctan2(np.sin(angle).mean(0), np.cos(angle).mean(0)) / (2 * np.pi) * wrap
    return middle + np.mod(xy - middle + np.divide(wrap, 2), wrap) - np.divide(wrap, 2)


def compute_nnd(xy, wrap=None):
    """(n,) distance of each animal to its nearest neighbour, m."""
    xy = np.asarray(xy, float)
    if len(xy) < 2:
        return np.full(len(xy), np.nan)
    return _tree(xy, wrap).query(_folded(xy, wrap), k=2)[0][:, 1]


def compute_group_spread(xy):
    """Root mean square distance to the centroid, m."""
    xy = np.asarray(xy, float)
    return float(np.sqrt(((xy - xy.mean(0)) ** 2).sum(1).mean())) if len(xy) else np.nan


def compute_elongation(xy):
    """1 - minor / major standard deviation: 0 round, 1 a line."""
    if len(xy) < 3:
        return np.nan
    minor, major = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(np.asarray(xy, float)[:, :2].T)), 0))
    return float(1 - minor / major) if major > 0 else np.nan


def compute_aspect_ratio(xy, direction):
    """Extent across over extent along the mean heading (section 7.1.2 of [1]_): file 0, rank large."""
    mean = np.asarray(direction, float)[:, :2].mean(0) if len(xy) else np.zeros(2)
    size = np.linalg.norm(mean)
    if len(xy) < 2 or size < 1e-9:
        return np.nan
    along = mean / size
    xy = np.asarray(xy, float)[:, :2]
    length = np.ptp(xy @ along)
    return float(np.ptp(xy @ (-along[1], along[0])) / length) if length > 0 else np.nan


def compute_largest_part(xy, link, wrap=None):
    """Share of the animals in the largest part that hangs together by links of at most ``link`` metres."""
    n = len(xy)
    if n == 0:
        return np.nan
    pairs = _tree(np.asarray(xy, float), wrap).query_pairs(link, output_type="ndarray")
    graph = scipy.sparse.coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (n, n))
    return float(np.bincount(scipy.sparse.csgraph.connected_components(graph, directed=False)[1]).max() / n)


def compute_density(xy):
    """Animals per square metre of their convex hull; NaN for fewer than three, or in a line."""
    if len(xy) < 3:
        return np.nan
    try:
        return float(len(xy) / scipy.spatial.ConvexHull(np.asarray(xy, float)[:, :2]).volume)
    except scipy.spatial.QhullError:
        return np.nan


def compute_speed(velocity):
    """(n,) m/s."""
    return np.linalg.norm(np.asarray(velocity, float), axis=1)


def compute_turning_angle(before, after):
    """(n,) signed angle between two headings, rad, counter-clockwise positive."""
    b, a = np.asarray(before, float), np.asarray(after, float)
    return np.arctan2(b[:, 0] * a[:, 1] - b[:, 1] * a[:, 0], (b[:, :2] * a[:, :2]).sum(1))


def compute_nn_bearing(xy, forward):
    """(n,) bearing of the nearest neighbour, rad, counter-clockwise from the own heading."""
    xy, f = np.asarray(xy, float)[:, :2], np.asarray(forward, float)
    if len(xy) < 2:
        return np.full(len(xy), np.nan)
    off = xy[scipy.spatial.cKDTree(xy).query(xy, k=2)[1][:, 1]] - xy
    return np.arctan2(f[:, 0] * off[:, 1] - f[:, 1] * off[:, 0], f[:, 0] * off[:, 0] + f[:, 1] * off[:, 1])


def compute_neighbour_map(xy, forward, reach, bins=21):
    """Mean density of others about an animal that faces up, (bins, bins) per m²: the radial density histogram.

    Row 0 is behind; the map spans ``-reach`` to ``reach`` metres both ways.
    """
    xy, f = np.asarray(xy, float)[:, :2], np.asarray(forward, float)
    edges = np.linspace(-reach, reach, bins + 1)
    if len(xy) < 2:
        return np.zeros((bins, bins))
    pairs = scipy.spatial.cKDTree(xy).query_pairs(reach * np.sqrt(2), output_type="ndarray")
    i, j = np.concatenate([pairs, pairs[:, ::-1]]).T
    off = xy[j] - xy[i]
    ahead = (off * f[i, :2]).sum(1)
    right = off[:, 0] * f[i, 1] - off[:, 1] * f[i, 0]
    counts = np.histogram2d(ahead, right, [edges, edges])[0]
    return counts / len(xy) / (edges[1] - edges[0]) ** 2


def compute_crossings(before, after, points):
    """How many animals crossed a line (k, 2) between two moments: (to its left, to its right)."""
    before, after = np.asarray(before, float)[:, :2], np.asarray(after, float)[:, :2]
    left = right = 0
    for a, b in zip(points[:-1], points[1:], strict=True):

        def side(p, a=a, b=b):
            return (b[0] - a[0]) * (p[:, 1] - a[1]) - (b[1] - a[1]) * (p[:, 0] - a[0])

        def along(p, q, x):
            return (q[:, 0] - p[:, 0]) * (x[1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (x[0] - p[:, 0])

        was, now = side(before) >= 0, side(after) >= 0
        between = (along(before, after, a) >= 0) != (along(before, after, b) >= 0)
        left += int((~was & now & between).sum())
        right += int((was & ~now & between).sum())
    return left, right


# measures by name ------------------------------------------------------------------


class HerdMoment(NamedTuple):
    """A herd at one moment, as measures get it."""

    xyz: np.ndarray  # (n, 3) m
    xy: np.ndarray  # (n, 2) m, of a herd across the edge of a wrapped map in one piece
    velocity: np.ndarray  # (n, 3) m/s
    forward: np.ndarray  # (n, 3) unit headings; zero: unknown, as of a tracked animal that never moved
    body_length: float  # m, mean
    wrap: tuple[float, float] | None  # m, width and height of a wrapped map
    flies: bool = False  # somebody is in the air: distances are three-dimensional

    @property
    def headed(self):
        """(n,) bool: whose heading is known."""
        return self.forward.any(1)

    @property
    def places(self):
        """(n, 2) or, of what flies, (n, 3) m, in one piece on a wrapped map."""
        return np.column_stack([self.xy, self.xyz[:, 2]]) if self.flies else self.xy


@dataclass(frozen=True)
class Measure:
    """A number that says something of a herd, and what people must know of it."""

    name: str
    compute: Callable[[HerdMoment], float]
    meaning: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    plotted: bool = False
    title: str = ""  # in plots

    def unit_in(self, length: str) -> str:
        """Its unit where lengths are in another one than metres, as "body lengths"."""
        return (
            self.unit
            if length == "m"
            else re.sub(r"\bm(?=\b|²)", "BL" if length == "body lengths" else length, self.unit)
        )

    def axis(self, length: str = "m") -> str:
        """What an axis of plots says: the measure spelled out, and its unit, lengths being in this one."""
        words = self.title or self.name.replace("_", " ")
        return f"{words}, {self.unit_in(length)}" if self.unit else words


_registry: dict[str, Measure] = {}


def measure(name, unit="", meaning="", low=None, high=None, plotted=False, title=""):
    """Register ``function(herd: HerdMoment) -> float`` as a measure.

    The command line, `Simulation.measures`, sweeps, plots and the documentation know it from then on.

    Parameters
    ----------
    unit : str
        Such as "m/s"; empty for pure numbers.
    meaning : str
        A few words; those of the function's docstring when left out.
    low, high : float, optional
        Bounds that hold for every herd: the axis of plots.
    plotted : bool
        Whether `flockbrush measure --plot` draws it.
    title : str
        What plots call it; the name unless given.

    Raises
    ------
    ValueError
        When another module has a measure of this name.
    """

    if callable(name):
        raise TypeError(f'write @measure("{name.__name__}", unit=...), with the name of the measure')

    def register(function):
        known = _registry.get(name)
        if known is not None and known.compute.__module__ != function.__module__:
            raise ValueError(f"measure {name!r} is already in {known.compute.__module__}")
        words = meaning or (function.__doc__ or "").strip().split("\n")[0].rstrip(".")
        _registry[name] = Measure(name, function, words, unit, low, high, plotted, title)
        return function

    return register


@cache
def _load_measures_of_others():
    load_entry_points("flockbrush.measures")


def measures() -> dict[str, Measure]:
    """All measures by name, ours first; modules under the entry point group ``flockbrush.measures`` add theirs."""
    _load_measures_of_others()
    return dict(_registry)


def herd_measures(xyz, velocity, forward, body_length, wrap=None, flies=False):
    """The measures of one moment by name; what `flockbrush measure` prints.

    Parameters
    ----------
    xyz, velocity, forward : ndarray (n, 3)
    body_length : float
        Metres; parts hang together by links of four body lengths.
    wrap : (float, float), optional
        Width and height of a wrapped map, metres.
    flies : bool
        Somebody is in the air: distances are measured in space, not in plan.
    """
    herd = HerdMoment(xyz, compute_unwrapped(xyz, wrap), velocity, forward, body_length, wrap, flies)
    return {name: _value(known, herd) for name, known in measures().items()}


def _value(known, herd):
    """The measure as a number of Python: files, tables and means take these."""
    with blaming("measure", known.name, known.compute.__module__):
        value = known.compute(herd)
        if np.ndim(value) != 0 or not isinstance(value, (numbers.Real, np.generic, np.ndarray)):
            raise TypeError(f"measure {known.name!r} must return a number, got {type(value).__name__}")
    return value.item() if isinstance(value, (np.generic, np.ndarray)) else value


@measure("animals", meaning="number of animals", low=0)
def _animals(herd):
    return len(herd.xyz)


@measure("polarization", meaning="0: headings in all directions, 1: all the same", low=0, high=1, plotted=True)
def _polarization(herd):
    return compute_polarization(herd.forward[herd.headed])


@measure("milling", meaning="0: no rotation, 1: all rotate about the centroid", low=0, high=1, plotted=True)
def _milling(herd):
    return abs(_rotation(herd))


@measure("rotation", meaning="milling with a sign, positive counter-clockwise", low=-1, high=1)
def _rotation(herd):
    centre = herd.xy.mean(0) if len(herd.xy) else None
    return compute_rotation(herd.xy[herd.headed], herd.forward[herd.headed], centre)


@measure("speed_mean", "m/s", "mean speed", low=0, plotted=True)
def _speed_mean(herd):
    return float(compute_speed(herd.velocity).mean()) if len(herd.xyz) else np.nan


@measure("speed_std", "m/s", "standard deviation of the speeds", low=0)
def _speed_std(herd):
    return float(compute_speed(herd.velocity).std()) if len(herd.xyz) else np.nan


@measure(
    "nnd", "m", "mean distance to the nearest neighbour", low=0, plotted=True, title="nearest neighbour distance"
)  # fmt: skip
def _nnd(herd):
    return float(np.mean(compute_nnd(herd.places, herd.wrap))) if len(herd.xyz) > 1 else np.nan


@measure("group_spread", "m", "root mean square distance from the centroid", low=0, plotted=True)
def _group_spread(herd):
    return compute_group_spread(herd.places)


@measure("elongation", meaning="0: round, 1: a line", low=0, high=1)
def _elongation(herd):
    return compute_elongation(herd.xy)


@measure("aspect_ratio", meaning="extent across the direction of motion / along it", low=0)
def _aspect_ratio(herd):
    return compute_aspect_ratio(herd.xy, herd.forward)


@measure("largest_part", meaning="share of animals in the largest group", low=0, high=1, plotted=True)
def _largest_part(herd):
    return compute_largest_part(herd.places, 4 * herd.body_length, herd.wrap)


@measure("density", "1/m²", "number of animals / area of their convex hull", low=0)
def _density(herd):
    return compute_density(herd.xy)


def _folded(places, wrap):
    if wrap is None:
        return places
    return np.column_stack([np.mod(places[:, :2], wrap), places[:, 2:]])


def _tree(xy, wrap):
    box = None if wrap is None else (*wrap, *(0.0,) * (np.shape(xy)[1] - 2))  # height has no seam
    return scipy.spatial.cKDTree(_folded(xy, wrap), boxsize=box)
