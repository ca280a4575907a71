"""Copies of the animals at one time, and interpolation between two ticks."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from flockbrush.components import (
    Airborne,
    Body,
    BrushBinding,
    Heading,
    Position,
    ReferenceBird,
    Role,
    Species,
    Velocity,
)
from flockbrush.engine.seam import short_way
from flockbrush.runs.catalogue import LABELS, catalogue_of
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList


@dataclass(frozen=True)
class Moment:
    """Copies of what leaves us: one row for each animal, in order of id."""

    time: float  # seconds since the start
    ids: np.ndarray  # (n,) int64
    # xyz, velocity, forward: (n, 3); metres, metres per second, unit vectors
    xyz: np.ndarray
    velocity: np.ndarray
    forward: np.ndarray
    # length, radius: (n,); metres
    length: np.ndarray
    radius: np.ndarray
    # species, brush: (n,) int; indices into `words_of`, as those of labels are
    species: np.ndarray
    brush: np.ndarray
    leader: np.ndarray  # (n,) bool
    reference: np.ndarray  # (n,) int64; id of the animal it keeps its place by, 0 for none
    up: np.ndarray | None = None  # (n, 3), optional; unit vector out of the back: where it leans, the animal banks
    # str to (n,) int; group, family and state (`flockbrush.runs.catalogue.LABELS`); empty where none were asked for
    labels: dict[str, np.ndarray] = field(default_factory=dict)

    def __len__(self):
        return len(self.ids)


_SOON = 1e-9  # s; rounding of times that are not whole ticks
_COLUMNS = {
    "xyz": Position.xyz,
    "velocity": Velocity.xyz,
    "forward": Heading.forward,
    "length": Body.length,
    "radius": Body.radius,
    "species": Species.index,
    "brush": BrushBinding.brush,
    "leader": Role.leader,
    "reference": ReferenceBird.entity,
    "up": Airborne.up,
}


def words_of(simulation) -> dict[str, list[str]]:
    """{column: names by index} of species, brush and labels that a run has had so far."""
    return catalogue_of(simulation.world).words


def borne(simulation, moment: Moment) -> list[str]:
    """The labels of a moment of which some animal bears a name that is not empty."""
    words = words_of(simulation)
    return [name for name, codes in moment.labels.items() if any(words[name][k] for k in set(codes.tolist()))]


def moment_of(simulation, labels=LABELS) -> Moment:
    """The animals as they are now, with these of `LABELS`; groups take as long to find as a tick or longer."""
    agents = simulation.agents
    columns = {name: agents[column].copy() for name, column in _COLUMNS.items()}
    columns["leader"] = columns["leader"].astype(bool)
    catalogue = catalogue_of(simulation.world, labels)
    for name in ("species", "brush"):
        columns[name] = catalogue.codes(name, columns[name])
    codes = {name: catalogue.codes(name, LABELS[name].codes(simulation.world)) for name in labels}
    return Moment(simulation.clock.now, agents.ids.copy(), **columns, labels=codes)


def between(before: Moment, after: Moment, time, wrap=None) -> Moment:
    """The animals at a time between two moments, those of ``after``; one that is new there is where it was born.

    Parameters
    ----------
    time : float
        Seconds, from ``before.time`` to ``after.time``.
    wrap : (width, height), optional
        Of a periodic map, metres: who crossed the seam takes the short way.
    """
    share = (time - before.time) / (after.time - before.time)
    if share >= 1:
        return after
    both: slice | np.ndarray = slice(None)  # when nobody was born or died, nothing need be picked
    rows: slice | np.ndarray = slice(None)
    if not np.array_equal(before.ids, after.ids):
        rows_before = np.searchsorted(before.ids, after.ids)
        rows_before[rows_before == len(before.ids)] = 0
        both = before.ids[rows_before] == after.ids if len(before.ids) else np.zeros(len(after.ids), bool)
        rows = rows_before[both]
    xyz, velocity, forward = after.xyz.copy(), after.velocity.copy(), after.forward.copy()
    way = after.xyz[both] - before.xyz[rows]
    way[:, :2] = short_way(way[:, :2], wrap)
    way *= 1 - share
    xyz[both] -= way
    if wrap is not None:
        xyz[:, :2] %= wrap
    for column, was in ((velocity, before.velocity), (forward, before.forward)):
        change = was[rows] - column[both]
        change *= 1 - share
        column[both] += change
    x, y, z = forward.T
    size = np.sqrt(x * x + y * y + z * z)
    faint = size <= 1e-9  # they turn about
    forward /= np.maximum(size, 1e-9)[:, None]
    if faint.any():
        forward[faint] = after.forward[faint]
    return replace(
        after, time=time, xyz=xyz, velocity=velocity, forward=forward, up=_leaning(before, after, both, rows, share)
    )


def _leaning(before, after, both, rows, share):
    """How animals bank a share of the way from one moment to the next."""
    if before.up is None or after.up is None:
        return after.up
    up = after.up.copy()
    up[both] += (1 - share) * (before.up[rows] - up[both])
    size = np.sqrt((up**2).sum(1))
    return np.where(size[:, None] > 1e-9, up / np.maximum(size, 1e-9)[:, None], after.up)


class Sampler:
    """Moments at a steady rate, whatever the length of a tick.

    Parameters
    ----------
    fps : float
        Moments per second.  A rate that divides the ticks per second gives the very states of the simulation.
    labels : iterable of str
        Which of `LABELS` moments bear (`words_of`).
    """

    def __init__(self, simulation, fps, labels=LABELS):
        self.simulation, self.fps, self.labels = simulation, float(fps), labels
        self.wrap = simulation.world.resource(Landscape).wrap
        self.taken = 0
        self._first = simulation.clock.now
        self._last: Moment | None = None

    def due(self):
        """The moments that have come since the last call: call it at the start and after every tick."""
        now = self.simulation.clock.now
        if self._time() > now + _SOON and self._exact():
            return
        current = moment_of(self.simulation, self.labels)
        while (time := self._time()) <= now + _SOON:
            exact = self._last is None or time >= now - _SOON
            yield current if exact else between(self._last, current, time, self.wrap)
            self.taken += 1
        self._last = current

    def _time(self):
        return self._first + self.taken / self.fps

    def _exact(self):
        """Whether every moment falls on a tick: then the ticks between need not be kept."""
        ticks = 1 / self.simulation.clock.dt / self.fps
        return ticks == round(ticks)


def names_of(simulation):
    """(species, brushes): names by the index that they have in the world now."""
    return list(simulation.world.resource(SpeciesList).names), simulation.world.resource(Palette).names
