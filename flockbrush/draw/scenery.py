"""A level as it is now: what commands have painted, put down and moved while the world runs, ready to be drawn."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from systems.landscape import Landscape
from systems.palette import Palette
from systems.terrain import NO_BRUSH, rasterise_polygon

_FREE, _NO_ZONE = np.inf, -2
_FAINT = 0.4  # weight of what is painted in a level that has no painted layer yet


class Scenery:
    """A running world's place, as a `Painter` takes levels: it is looked at anew every time, and keeps nothing.

    What applies in zones is left out of the painted brushes and caps: zones are drawn by their outlines.

    Parameters
    ----------
    simulation : Simulation
    """

    def __init__(self, simulation):
        self.simulation, self.level = simulation, simulation.level
        self.name, self.boundary = self.level.name, self.level.boundary
        self.width, self.height, self.cell = self.level.width, self.level.height, self.level.cell
        self.height_map, self.factor = self.level.height_map, self.level.factor
        self._zone_brush, self._zone_cap = self._of_zones()
        self._seen = self._copies()

    def __getattr__(self, name):
        if name in ("lines", "areas", "zones"):  # nobody changes these while the world runs
            return getattr(self.level, name)
        raise AttributeError(f"a scenery has no {name!r}")

    @property
    def land(self) -> Landscape:
        return self.simulation.world.resource(Landscape)

    # what is painted ---------------------------------------------------------------

    @property
    def brush_layers(self):
        """One layer, whose cells are those that act."""
        names = self.simulation.world.resource(Palette).names
        weight = max((layer.weight for layer in self.level.brush_layers), default=_FAINT)
        index = _Masked(self.land.brush, self._zone_brush, NO_BRUSH)
        return [SimpleNamespace(name="brush", weight=weight, assets=names, index=index)]

    @property
    def brush_colours(self):
        """Colours of all brushes of the world, by name."""
        return {brush.name: brush.colour for brush in self.simulation.world.resource(Palette).brushes}

    @property
    def cap(self):
        """Caps, m/s; infinite for none."""
        return SimpleNamespace(cell=self.land.cell, values=_Masked(self.land.surface[..., 1], self._zone_cap, _FREE))

    @property
    def terrain(self):
        """Kinds of ground."""
        return self.level.terrain

    def _of_zones(self):
        """What the zones alone make of brush and cap; values that nothing equals where there is no zone."""
        land, names = self.land, self.simulation.world.resource(Palette).names
        brush, cap = np.full(land.brush.shape, _NO_ZONE, np.int32), np.full(land.brush.shape, np.nan)
        for zone in self.level.zones:
            inside = rasterise_polygon(zone.polygon, brush.shape, land.cell)
            if zone.brush in names:
                brush[inside] = names.index(zone.brush)
            if np.isfinite(zone.max_speed):
                cap[inside] = np.fmin(cap[inside], zone.max_speed)
        return brush, cap

    # what stands there --------------------------------------------------------------

    @property
    def obstacles(self):
        """Those on the ground as they are now, and those of the level that hang above it."""
        return [*self.land.barriers, *(o for o in self.level.obstacles if o.z_min > 0)]

    @property
    def guides(self):
        return self.land.guides

    @property
    def goals(self):
        return self.land.goals

    @property
    def exits(self):
        """Where animals leave, named as in the level."""
        names = {exit_.polygon.tobytes(): exit_.name for exit_ in self.level.exits}
        return [SimpleNamespace(polygon=p, name=names.get(p.tobytes(), "")) for p in self.land.exits]

    @property
    def spawns(self):
        return self.level.spawns

    # what has changed ---------------------------------------------------------------

    def changes(self):
        """[box] of the ground that differs from the last call: (west, south, east, north) in metres, or "all"."""
        before, self._seen = self._seen, self._copies(self._seen)
        (painted, things), (was_painted, were_things) = self._seen, before
        if things != were_things:
            return ["all"]
        boxes = []
        for now, was in zip(painted, was_painted, strict=True):
            if now is not was:
                iy, ix = np.nonzero(now != was)
                low, high = (ix.min(), iy.min()), (ix.max() + 1, iy.max() + 1)
                boxes.append(tuple(float(side * self.cell) for side in (*low, *high)))
        return boxes

    def _copies(self, known=None):
        """Copies of the painted rasters (those already known where nothing differs), and all things as one value."""
        painted = self._rasters()
        if known is None:
            return [raster.copy() for raster in painted], self._things()
        kept = [old if np.array_equal(old, new) else new.copy() for old, new in zip(known[0], painted, strict=True)]
        return kept, self._things()

    def _rasters(self):
        return [self.land.brush, np.ascontiguousarray(self.land.surface[..., 1])]

    def _things(self):
        land = self.land
        return (
            tuple((b.polygon.tobytes(), b.solid, b.blocks_view) for b in land.barriers),
            tuple((np.asarray(g.points).tobytes(), g.radius, g.loop) for g in land.guides),
            tuple((g.name, g.xy.tobytes(), g.radius, g.polygon is not None) for g in land.goals),
            tuple(p.tobytes() for p in land.exits),
        )


class _Masked:
    """A raster [iy, ix] without the cells that are as another one says; only what is asked for is looked at."""

    def __init__(self, values, without, blank):
        self.values, self.without, self.blank, self.shape = values, without, blank, values.shape

    def __getitem__(self, part):
        values = self.values[part]
        return np.where(values == self.without[part], self.blank, values)

    def __array__(self, dtype=None, copy=None):
        whole = self[:]
        return whole if dtype is None else whole.astype(dtype)
