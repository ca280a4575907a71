"""The brushes of a world, as numbers by index: what the systems look up for every animal."""

from __future__ import annotations

import json

import numpy as np

from behaviours.behaviour import Flight, behaviours
from behaviours.brush import load_brush
from engine.maths import sincos_


class Palette:
    """Brushes in order of index, and their numbers as arrays.

    Parameters
    ----------
    brushes : iterable of Brush
        `behaviours.brush.Brush` assets.
    """

    def __init__(self, brushes=()):
        self.brushes = []
        self.index = {}
        self._tabulate()  # a world may have no brush at all
        for brush in brushes:
            self.add(brush)

    def __len__(self):
        return len(self.brushes)

    def add(self, brush):
        """Index of this brush; one of the same name is replaced, so that whoever has it moves by the new one."""
        if brush.name in self.index:
            self.brushes[self.index[brush.name]] = brush
        else:
            self.index[brush.name] = len(self.brushes)
            self.brushes.append(brush)
        self._tabulate()
        return self.index[brush.name]

    def forget(self, name):
        """Drop the newest brush again; whoever has it would be lost, so nobody may."""
        if self.brushes[-1].name != name:
            raise ValueError(f"{name} is not the newest brush; that is {self.brushes[-1].name}")
        del self.index[name]
        self.brushes.pop()
        self._tabulate()

    def state(self):
        """The brushes as they are now (see `engine.state`)."""
        return json.dumps([[b.name, b.source.decode()] for b in self.brushes]).encode()

    def set_state(self, data):
        """Take back what `state` gave."""
        before = {b.name: b for b in self.brushes}
        self.brushes, self.index = [], {}
        self._tabulate()
        for name, source in json.loads(data):
            same = name in before and before[name].source.decode() == source
            self.add(before[name] if same else load_brush(source.encode(), f"{name}.brush.toml"))

    @property
    def names(self):
        return [brush.name for brush in self.brushes]

    def aloft(self, brush):
        """(n,) bool, whose brush moves in the air; None when nobody's does."""
        if not self.flies.any():
            return None
        aloft = self.flies[brush]
        return aloft if aloft.any() else None

    def named(self, name):
        """Index of the brush of this name; LookupError with what there is."""
        try:
            return self.index[name]
        except KeyError:
            raise LookupError(f"this world has no brush {name!r}; it has {', '.join(self.index) or 'none'}") from None

    def _tabulate(self):
        def column(value):
            return np.array([value(b) for b in self.brushes])

        models = behaviours()
        self.models = [models[b.model] for b in self.brushes]
        self.mean = column(lambda b: b.speed.mean)  # body lengths / s
        self.deviation = column(lambda b: b.speed.deviation)  # body lengths / s
        self.reversion = column(lambda b: b.speed.reversion)  # 1/s
        self.view_range = column(lambda b: b.vision.range)  # body lengths
        self.field_of_view = np.radians(column(lambda b: b.vision.field_of_view))
        self.max_turn = column(lambda b: getattr(b.params, "max_turn", np.inf))  # rad/s
        self.transition = column(lambda b: b.transition)  # s
        self.leader_neighbours = column(lambda b: getattr(b.params, "leader_neighbours", -1))
        self.leader_cone = column(lambda b: _cosine_of_half(getattr(b.params, "leader_cone", 360.0)))
        self.neighbour_range = column(lambda b: getattr(b.params, "neighbour_range", np.inf))  # body lengths
        self.hidden_points = any(model.hidden_points for model in self.models)
        self.danger = column(lambda b: models[b.model].danger).astype(np.uint8)
        self.formation = column(lambda b: models[b.model].formation).astype(bool)
        flights = [
            Flight() if m.flight is None else m.flight(b.params) for m, b in zip(self.models, self.brushes, strict=True)
        ]
        self.flies = column(lambda b: models[b.model].flight is not None).astype(bool)
        self.flight = np.array(flights, float).reshape(len(flights), len(Flight._fields))  # rows of `Flight`
        self.foresight = np.array([flight.foresight for flight in flights])
        self.grounded = np.array([flight.grounded for flight in flights], bool)
        self.sees_through = column(lambda b: not b.vision.occlusion).astype(np.uint8)
        # by_density as one table: rows of (density per square body length, factor), closed on both sides
        rows = [np.array(b.speed.by_density or [(0.0, 1.0)], float) for b in self.brushes]
        self.density_first = np.cumsum([0] + [len(r) for r in rows])
        self.density_table = np.concatenate([np.zeros((0, 2)), *rows])
        self.uses_density = any(b.speed.by_density for b in self.brushes)


def _cosine_of_half(degrees):
    """The cosine of half an angle, the same bits on every machine; -1 from all round."""
    return -1.0 if degrees >= 360.0 else sincos_(np.radians(0.5 * degrees))[1]
