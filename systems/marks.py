"""What a designer draws on the ground that stops nobody: zones, lines and areas that count, keys of the script.

The `Landscape` keeps them as they are now.  Zones lie above all paint: `MapMarks.lay` composes what they say of the
ground when a level is built, and again whenever a zone has changed.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np
from flockbrush.components.level_things import FAR
from flockbrush.systems.binding import Sheets, with_zones
from flockbrush.systems.terrain import compose_brushes, compose_caps, rasterise_polygon

BRUSHES_OWN = -1.0  # of `Landscape.transition`: the brush's own time
NO_LIMIT = FAR  # m; a height that a level says for none


@dataclass(frozen=True)
class PaintBounds:
    """Whom paint binds, and how much.

    Those its brush is made for, in the medium of its brush, unless it says otherwise.
    """

    species: tuple[str, ...] = ()  # names and tags; empty: those the brush is made for
    medium: str = "brush"  # brush | ground | air | any
    z_min: float = -np.inf  # m above the ground
    z_max: float = np.inf  # m above the ground
    blend: str = "cover"  # cover: all the way | mix: part of the way to its brush | share: a share of the animals
    edge: float = 0.0  # m from the border inwards over which it grows to full weight, unless it covers
    strength: float = 1.0  # of a zone: its weight

    @property
    def covers(self):
        """Whether whom it binds takes its brush altogether."""
        return self.blend == "cover"

    @classmethod
    def of(cls, properties):
        """From the properties of a zone or a layer by name, as a level says them."""
        species = tuple(word.strip() for word in properties["species"].split(",") if word.strip())
        low = -math.inf if properties["z_min"] <= -NO_LIMIT else properties["z_min"]
        high = math.inf if properties["z_max"] >= NO_LIMIT else properties["z_max"]
        if "strength" not in properties:  # of a layer
            return cls(species, properties["medium"], low, high, properties["blend"], properties["edge"])
        strength, edge = properties["strength"], properties["edge"]
        blend = "share" if properties["share"] else "mix" if strength < 1.0 or edge > 0.0 else "cover"
        return cls(species, properties["medium"], low, high, blend, edge, strength)


@dataclass
class Zone:
    """Applies to an animal only while it is inside."""

    id: int
    name: str
    polygon: np.ndarray
    brush: str | None
    max_speed: float  # m/s, inf for none
    factor: float  # multiplies speed
    blend: float  # s
    event: str = ""  # raised when somebody comes in
    event_reach: float = 0.0  # m from there; 0: it alone hears it; below 0: all do
    bounds: PaintBounds = PaintBounds()  # species that its brush binds

    @classmethod
    def of(cls, number, name, polygon, properties):
        """From the properties of a zone by name, as a level says them."""
        own = (
            properties["factor"],
            properties["blend"],
            properties["event"],
            properties["event_reach"],
            PaintBounds.of(properties),
        )
        return cls(number, name, polygon, properties["brush"] or None, properties["max_speed"] or math.inf, *own)

    def properties(self):
        """Its properties by name, as a level says them."""
        bounds = self.bounds
        return {
            "brush": self.brush or "", "max_speed": self.max_speed if math.isfinite(self.max_speed) else 0.0,
            "factor": self.factor, "blend": self.blend, "event": self.event, "event_reach": self.event_reach,
            "species": ", ".join(bounds.species), "medium": bounds.medium, "z_min": max(bounds.z_min, -NO_LIMIT),
            "z_max": min(bounds.z_max, NO_LIMIT), "strength": bounds.strength, "edge": bounds.edge,
            "share": bounds.blend == "share",
        }  # fmt: skip


@dataclass
class Line:
    """Crossings of this line are counted."""

    id: int
    name: str
    points: np.ndarray


@dataclass
class Area:
    """Density is measured in here."""

    id: int
    name: str
    polygon: np.ndarray


@dataclass
class Key:
    """A command of the level's script: at this time, do this."""

    id: int
    name: str
    at: float  # s
    command: str
    args: dict[str, Any]
    xy: np.ndarray  # (2,) m, where the object stands
    line: int | None = None  # of the file


@dataclass
class Above:
    """What zones say, above all paint."""

    brush: np.ndarray  # (ny, nx) int32, -1 where no zone gives a brush
    cap: np.ndarray  # (ny, nx) m/s
    factor: np.ndarray  # (ny, nx) of zones and of painted factors: multiplies the ground's own


KINDS = {"zones": Zone, "lines": Line, "areas": Area, "keys": Key}


@dataclass
class MapMarks:
    """Zones, lines, areas and keys as they are now, and what zones are laid over."""

    zones: list[Zone] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    areas: list[Area] = field(default_factory=list)
    keys: list[Key] = field(default_factory=list)  # as the level has them; what is still to come waits in `Commands`
    names: list[str] = field(default_factory=list)  # the brushes of the `Palette`, in the order of their index
    layers: Sheets = field(default_factory=Sheets)  # those of the level's layers, without its zones
    factor: np.ndarray | None = None  # (ny, nx) or None; painted speed factors

    def __post_init__(self):
        for kind in KINDS:
            setattr(self, kind, list(getattr(self, kind)))
        self._read = self._plain()

    def lay(self, land):
        """Compose what zones say of the ground, and lay it over what is painted."""
        shape, cell, wraps = land.brush.shape, land.cell, land.wrap is not None
        caps = compose_caps(shape, cell, None, self.factor, None, self.zones, wraps)
        covering = [zone for zone in self.zones if zone.bounds.covers]
        brush = compose_brushes([], covering, shape, cell, self.names, wraps)
        land.above = Above(brush, caps[..., 1].copy(), caps[..., 0].copy())
        land.transition[:] = BRUSHES_OWN
        for zone in self.zones:
            if zone.brush:
                land.transition[rasterise_polygon(zone.polygon, shape, cell, wraps)] = zone.blend
        land.sheets = with_zones(self.layers, self.zones, self.names, shape, cell, wraps)
        land.lay_above()

    # regions -----------------------------------------------------------------------

    def regions(self):
        """{name: its polygons} of zones and areas: what programs ask about."""
        polygons: dict[str, list[np.ndarray]] = {}
        for thing in (*self.zones, *self.areas):
            if thing.name:
                polygons.setdefault(thing.name, []).append(thing.polygon)
        return polygons

    # state -------------------------------------------------------------------------

    def state(self):
        """What differs from the level that was read, as JSON takes it; None while nothing does."""
        now = self._plain()
        return None if now == self._read else {"names": self.names, **json.loads(now)}

    def set_state(self, state, land):
        """Take back what `state` gave."""
        before, state = self._plain(), state or json.loads(self._read)
        self.names = state.get("names", self.names)
        for kind, cls in KINDS.items():
            setattr(self, kind, [_thing(cls, values) for values in state[kind]])
        if self._plain() != before:
            self.lay(land)

    def _plain(self):
        return json.dumps({kind: [_values(thing) for thing in getattr(self, kind)] for kind in KINDS}, sort_keys=True)


def _values(thing):
    """The fields of a dataclass as JSON takes them."""
    values = {f.name: getattr(thing, f.name) for f in fields(thing) if f.name != "line"}
    return {
        name: value.tolist() if isinstance(value, np.ndarray) else _values(value) if is_dataclass(value) else value
        for name, value in values.items()
    }


def _thing(cls, values):
    """What `_values` told."""
    arrays = ("polygon", "points", "xy")
    arguments = {name: np.array(value, float) if name in arrays else value for name, value in values.items()}
    if "bounds" in arguments:
        arguments["bounds"] = PaintBounds(**{**arguments["bounds"], "species": tuple(arguments["bounds"]["species"])})
    return cls(**arguments)
