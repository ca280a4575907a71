"""The brushes of a world, as numbers by index: what the systems look up for every animal."""

from __future__ import annotations

import json
from contextlib import contextmanager

import numpy as np
from flockbrush.behaviours.behaviour import GUIDED, Flight, behaviours
from flockbrush.behaviours.brush import load_brush
from flockbrush.behaviours.brush_tables import SIGHTS
from flockbrush.behaviours.drive import drives_of, drives_of_steered
from flockbrush.behaviours.mixture import STEPS, can_mix, is_step, paths_in, step_name, steps_between
from flockbrush.engine.maths import sincos_


class Palette:
    """Brushes in order of index, and their numbers as arrays.

    Parameters
    ----------
    brushes : iterable of Brush
        `flockbrush.behaviours.brush.Brush` assets.
    over : iterable of str
        Names of those that paint of part weight may give: from every other brush of the same model to these there are
        brushes between, which stand behind in the palette.
    paths : dict, optional
        Measured paths (`flockbrush.behaviours.mixture.BrushPath`) by the names of the two brushes.

    Attributes
    ----------
    mixes : ndarray, (b, b) int32
        The first of the brushes between one and another; -1 where there are none.
    """

    def __init__(self, brushes=(), over=(), paths=None):
        self.brushes = []
        self.index = {}
        self._first = tuple(over), dict(paths or {})  # what the level asked for
        self._brought = {}, {}  # {brush: None} and {file: text of a path} that came later
        self._know()
        for brush in brushes:
            self._put(brush)
        self._mix(self.brushes)
        self._tabulate()  # a world may have no brush at all

    def __len__(self):
        return len(self.brushes)

    def add(self, brush):
        """Index of this brush; one of the same name is replaced, so that whoever has it moves by the new one.

        ValueError, and no change, where there can be no brush between this one and another.
        """
        with self._whole():
            self._put(brush)
            self._mix([brush])
        return self.index[brush.name]

    def _know(self):
        """Look up what is mixed, and on which paths."""
        (over, paths), (later, files) = self._first, self._brought
        self.over, self.paths = (*over, *later), paths_in(files) | paths

    def mix(self, name, files):
        """Have brushes between every other brush and this one, by measured paths too: {file: text}; ValueError."""
        with self._whole():
            later, known = self._brought
            self._brought = later if name in self.over else {**later, name: None}, known | files
            self._know()
            self._mix(self.own)

    @contextmanager
    def _whole(self):
        """Change all of the palette, or nothing where it fails: a model may refuse the numbers between two brushes."""
        before = list(self.brushes), dict(self.index), self._brought
        try:
            yield
        except ValueError:
            self.brushes, self.index, self._brought = before
            self._know()
            raise
        self._tabulate()

    def steps_to(self, name):
        """Index of the first of the brushes between others and this one that `mix` made; None if they are not last."""
        ends = {step_name(start.name, name, k) for start in self.own for k in range(1, STEPS)}
        indices = [k for k, brush in enumerate(self.brushes) if brush.name in ends]
        first = indices[0] if indices else len(self)
        return first if name in self._brought[0] and indices == list(range(first, len(self))) else None

    def unmix(self, name, files):
        """Take back `mix`, of brushes that stand last in the palette (`steps_to`)."""
        self._cut(self.steps_to(name))
        del self._brought[0][name]
        for file in files:
            self._brought[1].pop(file, None)
        self._know()
        self._tabulate()

    def _cut(self, first):
        """Drop the brushes from an index on."""
        for brush in self.brushes[first:]:
            del self.index[brush.name]
        del self.brushes[first:]

    def _put(self, brush):
        if brush.name in self.index:
            self.brushes[self.index[brush.name]] = brush
        else:
            self.index[brush.name] = len(self.brushes)
            self.brushes.append(brush)

    def _mix(self, changed):
        """Make the brushes between these and those that are mixed with others."""
        names = {brush.name for brush in changed}
        for start in self.own if self.over else ():
            for end in self.over:
                known = end in self.index and end != start.name and not names.isdisjoint((start.name, end))
                if known and can_mix(start, self.brushes[self.index[end]]):
                    for brush in steps_between(start, self.brushes[self.index[end]], self.paths.get((start.name, end))):
                        self._put(brush)

    @property
    def own(self):
        """The brushes without those between two."""
        return [brush for brush in self.brushes if not (self.over and is_step(brush.name))]

    @property
    def mixed(self):
        """Names of the brushes that `mix` has mixed with others."""
        return list(self._brought[0])

    @property
    def path_files(self):
        """{file: text} of the measured paths that `mix` was given."""
        return dict(self._brought[1])

    def forget(self, name):
        """Drop the newest brush, which no animal may have."""
        newest = self.own[-1].name
        if newest != name:
            raise ValueError(f"{name} is not the newest brush; that is {newest}")
        self._cut(self.index[name])
        self._mix(self.own)  # brushes between others, that were made after it
        self._tabulate()

    def state(self):
        """The brushes as they are now (see `flockbrush.engine.state`)."""
        rows, (later, files) = [[b.name, b.source.decode()] for b in self.brushes], self._brought
        return json.dumps({"brushes": rows, "mixed": list(later), "paths": files} if later or files else rows).encode()

    def set_state(self, data):
        """Take back what `state` gave."""
        before = {b.name: b for b in self.brushes}
        self.brushes, self.index, saved = [], {}, json.loads(data)
        if isinstance(saved, list):  # nothing was mixed but what the level asked for
            saved = {"brushes": saved, "mixed": [], "paths": {}}
        self._brought = dict.fromkeys(saved["mixed"]), saved["paths"]
        self._know()
        for name, source in saved["brushes"]:
            same = name in before and before[name].source.decode() == source
            self._put(before[name] if same else load_brush(source.encode(), f"{name}.brush.toml"))
        self._tabulate()

    @property
    def names(self):
        return [brush.name for brush in self.brushes]

    def aloft(self, brush):
        """(n,) bool, animals whose brush moves in the air; None if there are none."""
        if not self.flies.any():
            return None
        aloft = self.flies[brush]
        return aloft if aloft.any() else None

    def named(self, name, own=False):
        """Index of the brush of this name, with ``own`` of none between two; LookupError with what there is."""
        if name in self.index and not (own and self.over and is_step(name)):
            return self.index[name]
        raise LookupError(f"this world has no brush {name!r}; it has {', '.join(b.name for b in self.own) or 'none'}")

    def end(self, index):
        """Index of the brush to which the brush at an index leads, one between two; of another one the same index."""
        pairs = np.argwhere((self.mixes >= 0) & (self.mixes <= index) & (index < self.mixes + STEPS - 1))
        return int(pairs[0, 1]) if len(pairs) else index

    def _tabulate(self):
        def column(value):
            return np.array([value(b) for b in self.brushes])

        models = behaviours()
        self.mixes = np.full((len(self.brushes),) * 2, -1, np.int32)
        for start in self.own if self.over else ():
            for end in self.over:
                first = self.index.get(step_name(start.name, end, 1), -1)
                if first >= 0:
                    self.mixes[self.index[start.name], self.index[end]] = first
        self.models = [models[b.model] for b in self.brushes]
        self.by_slot = np.array([m.by_slot for m in self.models], bool)
        self.mean = column(lambda b: b.speed.mean)  # body lengths / s
        self.deviation = column(lambda b: b.speed.deviation)  # body lengths / s
        self.reversion = column(lambda b: b.speed.reversion)  # 1/s
        self.individual = column(lambda b: b.speed.individual)
        self.common = column(lambda b: b.speed.common)  # body lengths / s
        self.common_time = column(lambda b: b.speed.common_time)  # s
        self.stops = column(lambda b: b.speed.stops)  # 1/s
        self.starts = column(lambda b: b.speed.starts)  # 1/s
        self.imitation = column(lambda b: b.speed.imitation)
        self.pauses = any(b.speed.stops > 0.0 for b in self.brushes)
        self.view_range = column(lambda b: b.vision.range)  # body lengths
        self.field_of_view = np.radians(column(lambda b: b.vision.field_of_view))
        self.max_turn = column(lambda b: getattr(b.params, "max_turn", np.inf))  # rad/s
        self.transition = column(lambda b: b.transition)  # s
        self.leader_neighbours = column(lambda b: getattr(b.params, "leader_neighbours", -1))
        self.leader_cone = column(lambda b: _cosine_of_half(getattr(b.params, "leader_cone", 360.0)))
        self.guided = column(lambda b: GUIDED.index(getattr(b.params, "guided", "front"))).astype(np.int64)
        self.guided_share = column(lambda b: getattr(b.params, "guided_share", 0.0))
        self.neighbour_range = column(lambda b: getattr(b.params, "neighbour_range", np.inf))  # body lengths
        self.danger = column(lambda b: models[b.model].danger).astype(np.uint8)
        self.formation = column(lambda b: models[b.model].formation).astype(bool)
        flights = [m.flight_of(b.params) or Flight() for m, b in zip(self.models, self.brushes, strict=True)]
        self.flies = column(lambda b: models[b.model].flight is not None).astype(bool)
        self.flight = np.array(flights, float).reshape(len(flights), len(Flight._fields))  # rows of `Flight`
        looks = [b.drives["avoid_obstacles"].foresight if "avoid_obstacles" in b.drives else 0.0 for b in self.brushes]
        self.foresight = np.array([max(f.foresight, look) for f, look in zip(flights, looks, strict=True)])
        self.grounded = np.array([flight.grounded for flight in flights], bool)
        self.drives = [drives_of(b, models[b.model]) for b in self.brushes]  # in order of priority
        self.drives_steered = [drives_of_steered(b, models[b.model]) for b in self.brushes]
        self.drives_asked = column(lambda b: any(params.strength > 0.0 for params in b.drives.values())).astype(bool)
        self.drives_needed = np.array([bool(model.needs) for model in self.models], bool)
        verbs = {verb for row in self.drives for one, _ in row for verb in one.notices}
        acts = [{*m.has, *(one.name for one, _ in row)} for m, row in zip(self.models, self.drives, strict=True)]
        self.hunts = np.array(["hunt" in names for names in acts], bool)  # whose catch may be fatal
        self.hunting = "hunt" in verbs or bool(self.hunts.any())
        self.following = "follow" in verbs
        self.exact = np.array([flight.exact for flight in flights], bool)  # the model says the velocity
        self.flies_free = self.flies & ~self.grounded  # through the air, and not held to the ground
        self.least_speed = self.flight[:, 0] if len(flights) else np.zeros(0)  # body lengths / s
        self.sight = column(lambda b: SIGHTS.index(b.vision.sight)).astype(np.int64)
        self.neighbours = column(lambda b: b.vision.neighbours).astype(np.int64)
        self.chooses = bool((self.sight > SIGHTS.index("metric")).any())
        self.bodiless = np.isin(self.sight, [SIGHTS.index("metric"), SIGHTS.index("hidden_points")])  # hide no animal
        self.sees_through = column(lambda b: not b.vision.occlusion).astype(np.uint8)
        self.sees_through |= self.bodiless.astype(np.uint8)
        # by_density as one table: rows of (density per square body length, factor), closed on both sides
        rows = [np.array(b.speed.by_density or [(0.0, 1.0)], float) for b in self.brushes]
        self.density_first = np.cumsum([0] + [len(r) for r in rows])
        self.density_table = np.concatenate([np.zeros((0, 2)), *rows])
        self.uses_density = any(b.speed.by_density for b in self.brushes)


def _cosine_of_half(degrees):
    """The cosine of half an angle, the same bits on every machine; -1 from all round."""
    return -1.0 if degrees >= 360.0 else sincos_(np.radians(0.5 * degrees))[1]
