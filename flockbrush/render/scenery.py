"""A level as it is now: what commands have painted, put down and moved while the world runs, ready to be drawn."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from flockbrush.systems.landscape import NATIVE, Landscape
from flockbrush.systems.life import Nursery
from flockbrush.systems.palette import Palette

_FAINT = 0.4  # weight of what is painted in a level that has no painted layer yet


class Scenery:
    """A running world's place, as a `Painter` takes levels: it is looked at anew every time, and keeps nothing."""

    def __init__(self, simulation):
        self.simulation, self.level = simulation, simulation.level
        self.name, self.boundary = self.level.name, self.level.boundary
        self.width, self.height, self.cell = self.level.width, self.level.height, self.level.cell
        self.height_map, self.factor, self.art = self.level.height_map, self.level.factor, self.level.art
        self._painted = [raster.copy() for raster in self.land.painted.rasters()]
        self._things = self._all_things()

    @property
    def land(self) -> Landscape:
        """Everything about the place that animals feel."""
        return self.simulation.world.resource(Landscape)

    # what is painted ---------------------------------------------------------------

    @property
    def brush_layers(self):
        """What is painted by hand in one layer, and above it the layers that say whom they bind; zones lie above."""
        names = self.simulation.world.resource(Palette).names
        weight = max((layer.weight for layer in self.level.brush_layers), default=_FAINT)
        painted = SimpleNamespace(name="brush", weight=weight, assets=names, index=self.land.painted.brush)
        return [painted, *(layer for layer in self.level.brush_layers if layer.weight > 0.0 and not layer.plain)]

    @property
    def brush_colours(self):
        """Colours of all brushes of the world, by name."""
        return {brush.name: brush.colour for brush in self.simulation.world.resource(Palette).brushes}

    @property
    def cap(self):
        """Painted caps, m/s; infinite for none."""
        return SimpleNamespace(cell=self.land.cell, values=self.land.painted.cap)

    @property
    def terrain(self):
        """Kinds of ground."""
        kinds, land = self.land.kinds, self.land
        index = _Grounds(land.painted.ground, land.native.kind)
        return SimpleNamespace(
            index=index, names=[k.name for k in kinds], colours=[k.colour for k in kinds], walkable=land.walkable,
            speed_factor=land.native.factor, cost=land.cost, blocks_view=land.blind,
        )  # fmt: skip

    @property
    def painted_ground(self):
        """(ny, nx) bool: cells whose ground was painted while the world runs."""
        return self.land.painted.ground != NATIVE

    # what stands there --------------------------------------------------------------

    @property
    def obstacles(self):
        """Those that there are now."""
        return self.land.obstacles

    @property
    def guides(self):
        """Arrows that leaders follow."""
        return self.land.guides

    @property
    def goals(self):
        """Where the way leads."""
        return self.land.goals

    @property
    def exits(self):
        """Where animals leave."""
        return self.land.exits

    @property
    def zones(self):
        """What applies to animals only while they are inside."""
        return self.land.marks.zones

    @property
    def lines(self):
        """Lines whose crossings are counted."""
        return self.land.marks.lines

    @property
    def areas(self):
        """Areas in which animals are counted."""
        return self.land.marks.areas

    @property
    def spawns(self):
        """Where animals come into the world."""
        return self.simulation.world.resource(Nursery).spawns

    # what has changed ---------------------------------------------------------------

    def changes(self):
        """[box] of the ground that differs from the last call: (west, south, east, north) in metres, or "all"."""
        boxes = [self._changed(k, raster) for k, raster in enumerate(self.land.painted.rasters())]
        before, self._things = self._things, self._all_things()
        return [box for box in boxes if box] if self._things == before else ["all"]

    def _changed(self, k, raster):
        """The box in which a painted raster differs from what it was, None if it does not."""
        before = self._painted[k]
        if np.array_equal(raster, before):
            return None
        iy, ix = np.nonzero(raster != before)
        self._painted[k] = raster.copy()
        return tuple(float(side * self.cell) for side in (ix.min(), iy.min(), ix.max() + 1, iy.max() + 1))

    def _all_things(self):
        """All that stands there, as one value."""
        land = self.land
        return (
            tuple((b.polygon.tobytes(), b.solid, b.blocks_view, b.on_the_ground) for b in land.obstacles),
            tuple((np.asarray(g.points).tobytes(), g.radius, g.loop) for g in land.guides),
            tuple((g.name, g.xy.tobytes(), g.radius, _bytes(g.polygon)) for g in land.goals),
            tuple((e.name, e.polygon.tobytes()) for e in land.exits),
            tuple((s.name, s.polygon.tobytes()) for s in self.spawns),
            tuple((a.name, a.polygon.tobytes()) for a in land.marks.areas),
            tuple((line.name, line.points.tobytes()) for line in land.marks.lines),
            tuple((z.name, z.polygon.tobytes(), z.brush, z.max_speed, z.factor) for z in land.marks.zones),
            tuple(self.brush_colours.items()),
        )


class BareScenery(Scenery):
    """The same without what only a designer sees: painted brushes and caps, guides, goals, exits, areas, spawns."""

    brush_layers = guides = goals = exits = spawns = zones = lines = areas = ()  # type: ignore[assignment]
    cap = None  # type: ignore[assignment]


def _bytes(polygon):
    return None if polygon is None else polygon.tobytes()


class _Grounds:
    """Which kind of ground is where, [iy, ix]: as painted, else as the level was read; only for what is asked."""

    def __init__(self, painted, native):
        self.painted, self.native, self.shape = painted, native, painted.shape

    def __getitem__(self, part):
        painted = self.painted[part]
        return np.where(painted == NATIVE, self.native[part], painted)
