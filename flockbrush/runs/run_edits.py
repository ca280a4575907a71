"""Edits of a recorded run, and the edited frames that exports show.

The recording stays as it is.  An edit changes what is drawn and exported of some animals: it deletes, moves, retimes,
freezes or delays them, or gives them another look.  Edits apply one after another: each sees what those before it gave.
"""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass, field, replace

import numpy as np

from flockbrush.runs.catalogue import catalogue_of
from flockbrush.runs.snapshots import Moment, between, moment_of, words_of
from flockbrush.systems.ground_height import heights_of_ground
from flockbrush.systems.landscape import Landscape

KINDS = ("delete", "move", "retime", "freeze", "delay", "look")
IN_TIME = ("retime", "freeze", "delay")
ALWAYS = math.inf
EXACT = 1e-9  # s


@dataclass(frozen=True)
class Edit:
    """One edit of some animals."""

    kind: str  # one of `KINDS`
    ids: tuple[int, ...]  # whom it changes
    # start, end: seconds: from when, and until when
    start: float = 0.0
    end: float = ALWAYS
    by: tuple[float, float, float] = (0.0, 0.0, 0.0)  # (x, y, z); of a move: metres
    turn: float = 0.0  # of a move: degrees counter-clockwise about `about`
    about: tuple[float, float] = (0.0, 0.0)  # (x, y); metres
    over: float = 0.0  # of a move: seconds in which it comes and goes
    speed: float = 1.0  # of a retime: 2 is twice as fast
    seconds: float = 0.0  # of a delay: positive is later
    # brush, species: of a look, empty for no change
    brush: str = ""
    species: str = ""
    size: float = 1.0  # of a look: times as large
    because: str = ""  # how the animals were chosen, for people

    def local(self, time):
        """(time, rate): which second of the run so far is shown at a time, and how fast its time goes."""
        if self.kind == "delay":
            return time - self.seconds, 1.0
        speed = 0.0 if self.kind == "freeze" else self.speed
        if time < self.start:
            return time, 1.0
        if time < self.end:
            return self.start + speed * (time - self.start), speed
        return self.start + speed * (self.end - self.start) + time - self.end, 1.0

    def weight(self, time):
        """(share, change per second) of a move that is in force at a time; 0 to 1."""
        if not self.applies(time):
            return 0.0, 0.0
        up, down = _ramp(time - self.start, self.over), _ramp(self.end - time, self.over)
        return (up[0], up[1]) if up[0] < down[0] else (down[0], -down[1])

    def applies(self, time):
        """Whether it is in force at a time."""
        return self.start - EXACT <= time < self.end - EXACT


@dataclass
class Layer:
    """Edits that are switched on and off together."""

    name: str
    on: bool = True
    edits: list[Edit] = field(default_factory=list)


def _ramp(since, over):
    """(share, change per second) of what comes smoothly within `over` seconds."""
    if since < -EXACT:
        return 0.0, 0.0
    if since >= over:
        return 1.0, 0.0
    share = since / over
    return share * share * (3 - 2 * share), 6 * share * (1 - share) / over


class EditedMoments:
    """The moments of a run with edits applied.

    Parameters
    ----------
    simulation : Simulation
        Whose names and ground they use.
    edits : sequence of Edit
        In their order.
    past : Past, optional
        Needed where `needs_past` says so.
    """

    def __init__(self, simulation, edits, past=None):
        self.simulation, self.edits, self.past = simulation, list(edits), past
        self.land = simulation.world.resource(Landscape)
        if past is not None and past.catalogue is not None:
            simulation.world.insert(past.catalogue)  # it knows what is to come
        self._ids = [np.array(sorted(edit.ids), np.int64) for edit in self.edits]

    def at(self, moment: Moment) -> Moment:
        """The moment as the edits show it; the animals are in order of id."""
        parts = self._sources(moment)
        shown = [self._edited(part, times) for part, times in parts]
        return joined([part for part in shown if len(part)] or [rows_of(moment, np.zeros(0, int))], moment.time)

    def _sources(self, moment):
        """[(animals, time at each edit)]: animals with the same course of time, and their own time in the run."""
        later = [k for k, edit in enumerate(self.edits) if edit.kind in IN_TIME]
        if not later:
            return [(moment, [moment.time] * len(self.edits))]
        changed = np.unique(np.concatenate([self._ids[k] for k in later]))
        plain = ~np.isin(moment.ids, changed)
        sources = [(rows_of(moment, np.flatnonzero(plain)), [moment.time] * len(self.edits))]
        belongs = np.array([np.isin(changed, self._ids[k]) for k in later])  # (edits of time, animals)
        kinds, kind_of = np.unique(belongs, axis=1, return_inverse=True)
        for number, kind in enumerate(kinds.T):
            animals = changed[kind_of.ravel() == number]
            own = {k for k, animals_rows in zip(later, kind, strict=True) if animals_rows}
            times, rate, time = [0.0] * len(self.edits), 1.0, moment.time
            for k in reversed(range(len(self.edits))):
                times[k] = time
                if k in own:
                    time, speed = self.edits[k].local(time)
                    rate *= speed
            source, stands = self.past.at(time)
            animals_rows = rows_of(source, np.flatnonzero(np.isin(source.ids, animals)))
            sources.append((replace(animals_rows, velocity=animals_rows.velocity * (0.0 if stands else rate)), times))
        return sources

    def _edited(self, moment, times):
        for edit, ids, time in zip(self.edits, self._ids, times, strict=True):
            selected = np.isin(moment.ids, ids)
            if not selected.any():
                continue
            if edit.kind == "delete" and edit.applies(time):
                moment = rows_of(moment, np.flatnonzero(~selected))
            elif edit.kind == "move":
                moment = self._moved(moment, edit, selected, *edit.weight(time))
            elif edit.kind == "look" and edit.applies(time):
                moment = self._dressed(moment, edit, selected)
        return moment

    def _moved(self, moment, edit, selected, share, pace):
        if share == 0.0:
            return moment
        angle = math.radians(edit.turn) * share
        turn = np.array([[math.cos(angle), -math.sin(angle), 0], [math.sin(angle), math.cos(angle), 0], [0, 0, 1]])
        pivot, by = np.array([*edit.about, 0.0]), np.asarray(edit.by, float)
        xyz, velocity, forward = moment.xyz.copy(), moment.velocity.copy(), moment.forward.copy()
        before = self._ground(xyz[selected])
        turned = (xyz[selected] - pivot) @ turn.T
        spin = math.radians(edit.turn) * pace
        xyz[selected] = turned + pivot + share * by
        velocity[selected] = (
            velocity[selected] @ turn.T
            + pace * by
            + spin * np.column_stack([-turned[:, 1], turned[:, 0], 0 * turned[:, 0]])
        )
        forward[selected] = forward[selected] @ turn.T
        if self.land.wrap is not None:
            xyz[selected, :2] %= self.land.wrap
        xyz[selected, 2] += self._ground(xyz[selected]) - before
        up = moment.up
        if up is not None:
            up = up.copy()
            up[selected] = up[selected] @ turn.T
        return replace(moment, xyz=xyz, velocity=velocity, forward=forward, up=up)

    def _ground(self, xyz):
        """Height of the ground under points, m."""
        if self.land.relief.shape[:2] == (1, 1):
            return np.zeros(len(xyz))
        return heights_of_ground(self.land.heights, np.ascontiguousarray(xyz))

    def _dressed(self, moment, edit, selected):
        words, changed = words_of(self.simulation), {}
        for name in ("brush", "species"):
            value, codes = getattr(edit, name), getattr(moment, name)
            if value in words[name]:
                changed[name] = np.where(selected, words[name].index(value), codes).astype(codes.dtype)
        if edit.size != 1.0:
            times = np.where(selected, edit.size, 1.0)
            changed |= {"length": moment.length * times, "radius": moment.radius * times}
        return replace(moment, **changed)


def needs_past(edits, simulation) -> bool:
    """Whether edits show animals of other times, or a brush or species that the run has not had so far."""
    words = words_of(simulation)
    return any(
        edit.kind in IN_TIME or any(getattr(edit, name) not in ("", *words[name]) for name in ("brush", "species"))
        for edit in edits
    )


class Past:
    """The animals of a whole run, tick by tick, on disk: moments at any time, also those to come.

    Parameters
    ----------
    ids : sequence of int
        Whom to keep.
    wrap : (width, height), optional
        Of a periodic map, m.
    """

    def __init__(self, ids, wrap=None):
        self.ids, self.wrap = np.unique(np.asarray(ids, np.int64)), wrap
        self.catalogue = None
        self._file = tempfile.TemporaryFile()
        self._times: list[float] = []
        self._kept: list[tuple] = []  # offset in the file, time, columns

    def take(self, simulation):
        """Keep the animals as they are now."""
        self.keep(moment_of(simulation))

    def watch(self, simulation, last_tick, stepped=lambda: None):
        """Keep the animals at every tick of a run, which is simulated to its end; `stepped` is called after each."""
        self.take(simulation)
        while simulation.clock.tick < last_tick:
            simulation.tick()
            self.take(simulation)
            stepped()
        self.catalogue = catalogue_of(simulation.world)

    def keep(self, moment: Moment):
        """Keep the animals of a moment."""
        selected = rows_of(moment, np.flatnonzero(np.isin(moment.ids, self.ids)))
        columns: dict = {name: value for name, value in vars(selected).items() if isinstance(value, np.ndarray)}
        columns |= {(name,): codes for name, codes in selected.labels.items()}
        at, layout = self._file.seek(0, 2), []
        for name, values in columns.items():
            layout.append((name, values.dtype, values.shape))
            self._file.write(np.ascontiguousarray(values).tobytes())
        self._kept.append((at, moment.time, layout))
        self._times.append(moment.time)

    def at(self, time):
        """(moment, whether time stands still there): before the beginning and after the end it does."""
        stands = time < self._times[0] - EXACT or time > self._times[-1] + EXACT
        time = min(max(time, self._times[0]), self._times[-1])
        after = int(np.searchsorted(self._times, time - EXACT))
        frame = self._read(after)
        if after > 0 and self._times[after] > time + EXACT:
            frame = between(self._read(after - 1), frame, time, self.wrap)
        return frame, stands

    def _read(self, k) -> Moment:
        at, time, layout = self._kept[k]
        self._file.seek(at)
        columns, labels = {}, {}
        for name, kind, shape in layout:
            size = int(np.prod(shape)) * kind.itemsize
            values = np.frombuffer(self._file.read(size), kind).reshape(shape).copy()
            if isinstance(name, tuple):
                labels[name[0]] = values
            else:
                columns[name] = values
        return Moment(time, **columns, labels=labels)

    def close(self):
        """Remove the file."""
        self._file.close()


def rows_of(moment: Moment, rows) -> Moment:
    """Some rows of a moment."""
    columns = {name: value[rows] for name, value in vars(moment).items() if isinstance(value, np.ndarray)}
    return replace(moment, **columns, labels={name: codes[rows] for name, codes in moment.labels.items()})


def joined(parts: list[Moment], time) -> Moment:
    """Animals of several moments as one moment, in order of id."""
    ids = np.concatenate([part.ids for part in parts])
    order = np.argsort(ids, kind="stable")
    columns = {
        name: np.concatenate([getattr(part, name) for part in parts])[order]
        for name, value in vars(parts[0]).items()
        if isinstance(value, np.ndarray)
    }
    labels = {name: np.concatenate([part.labels[name] for part in parts])[order] for name in parts[0].labels}
    return replace(parts[0], **columns, time=time, labels=labels)
