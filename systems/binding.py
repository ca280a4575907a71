"""Whom paint binds, and how an animal comes from one medium to another.

Paint lies in sheets: zones and layers that say whom they bind on top, then what has been painted, and below it the
level's own layers one by one.  An animal looks down through them and takes the first brush that binds it: one that is
made for its species (or that the sheet gives to it), that its species can do, in the medium and at the height where the
animal is.

A brush of another medium comes on purpose alone: as the animal's own, from a program, or from paint whose ``medium``
says so.  Who flies then lands first, who walks takes off.  Birds that fly as low as `LOW` let themselves down on
painted ground.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from flockbrush.components.agent import LANDING, SETTLED, TAKING_OFF
from flockbrush.systems.fauna import AIR, PLANE, WATER
from flockbrush.systems.terrain import NO_BRUSH, rasterise_polygon
from numba import njit

LOW = 1.0  # body lengths: who flies no higher may be bound by paint of the ground
TOUCH = 0.25  # body lengths besides the radius: so low a bird stands
CLEAR = 8.0  # body lengths above the ground: so high a bird has taken off
TOUCHDOWN = 0.6  # times the slowest flight: slower than this a bird stands on its feet
BY_BRUSH, ON_GROUND, IN_AIR, ANYWHERE = range(4)  # of `Sheet.medium`
MEDIA = {"brush": BY_BRUSH, "ground": ON_GROUND, "air": IN_AIR, "any": ANYWHERE}


@dataclass
class Sheet:
    """Paint of one kind."""

    brush: np.ndarray  # (ny, nx) int32, -1 unpainted
    species: tuple[str, ...] = ()  # whom it binds; empty: those its brushes are made for
    medium: int = BY_BRUSH
    z_min: float = -np.inf  # m above the ground
    z_max: float = np.inf


@dataclass
class Sheets:
    """The sheets of a level that nobody paints on while it runs, from the top down."""

    above: list[Sheet] = field(default_factory=list)
    below: list[Sheet] = field(default_factory=list)
    _told: tuple = (None, None)

    def packed(self, palette, fauna):
        """(rasters above, rasters below, allowed (sheets, b, s), medium, z_min, z_max), the painted sheet between."""
        about = (tuple(b.made_for for b in palette.brushes), tuple(palette.flies), tuple(fauna.names))
        if self._told[0] != about:
            self._told = about, _packed(self, palette, fauna)
        return self._told[1]


def _packed(sheets, palette, fauna):
    every = [*sheets.above, Sheet(np.zeros((0, 0), np.int32)), *sheets.below]
    allowed = np.array([_allowed(sheet, palette, fauna) for sheet in every], np.uint8)
    shape = next((s.brush.shape for s in every if s.brush.size), (1, 1))
    stacks = [np.array([s.brush for s in some], np.int32).reshape(-1, *shape) for some in (sheets.above, sheets.below)]
    medium = np.array([s.medium for s in every], np.uint8)
    return (*stacks, allowed, medium, np.array([s.z_min for s in every]), np.array([s.z_max for s in every]))


def _allowed(sheet, palette, fauna):
    """(b, s) whether a sheet may give a brush to a species."""
    rows = [[_may(sheet, brush, name, asset) for name, asset in zip(fauna.names, fauna.assets, strict=True)]
            for brush in palette.brushes]  # fmt: skip
    table = np.array(rows, bool).reshape(len(palette), len(fauna.names))
    return table & can_do(palette, fauna.table)


def _may(sheet, brush, name, asset):
    tags = () if asset is None else asset.tags
    if sheet.species:
        return not {name, *tags}.isdisjoint(sheet.species)
    return asset is None or brush.is_made_for(name, tags)


def can_do(palette, table):
    """(b, s) bool, whether a species can move as a brush does."""
    on_ground = table.media[:, PLANE] | table.media[:, WATER]
    return np.where(palette.flies_free[:, None], table.media[None, :, AIR], on_ground[None, :]).astype(bool)


def cannot(palette, fauna, brush, species):
    """A sentence why a species (by name) cannot do a brush (by name); "" when it can."""
    if species not in fauna.names:
        return ""
    index, kind = palette.named(brush), fauna.names.index(species)
    if can_do(palette, fauna.table)[index, kind]:
        return ""
    asset = fauna.assets[kind]
    needs = "flies" if palette.flies_free[index] else "walks or swims"
    return f"species {species!r} cannot do brush {brush!r}, which {needs}: its media are {', '.join(asset.media)}"


def sheets_of(level, palette_names):
    """The `Sheets` of a level: its zones, its layers that say whom they bind, and its layers one by one."""

    def indexed(layer):
        own = np.array([palette_names.index(name) for name in layer.assets] + [NO_BRUSH], np.int32)
        return own[layer.index]

    above, below = [], []
    for layer in level.brush_layers:
        if layer.weight > 0.0:
            sheet = _sheet(indexed(layer), layer.bounds)
            (below if layer.plain else above).append((layer.weight, sheet))
    above, below = (_from_the_top(some) for some in (above, below))
    for zone in level.zones:
        if zone.brush:
            raster = np.full(level.shape, NO_BRUSH, np.int32)
            raster[rasterise_polygon(zone.polygon, level.shape, level.cell)] = palette_names.index(zone.brush)
            _lay_over(above, _sheet(raster, zone.bounds))
    return Sheets(above, below if len(below) > 1 else [])


def _sheet(raster, bounds):
    return Sheet(raster, bounds.species, MEDIA[bounds.medium], bounds.z_min, bounds.z_max)


def _from_the_top(weighed):
    """The heaviest first, of two equal ones the later."""
    order = sorted(range(len(weighed)), key=lambda k: (weighed[k][0], k), reverse=True)
    return [weighed[k][1] for k in order]


def _lay_over(sheets, new):
    """On top of all, in the top sheet where nothing of it would be hidden and it binds the same."""
    same = sheets and (sheets[0].species, sheets[0].medium, sheets[0].z_min, sheets[0].z_max) == (
        new.species, new.medium, new.z_min, new.z_max
    )  # fmt: skip
    if same and not ((sheets[0].brush >= 0) & (new.brush >= 0)).any():
        sheets[0].brush = np.maximum(sheets[0].brush, new.brush)
    else:
        sheets.insert(0, new)


@njit(cache=True, nogil=True)
def painted_for(
    lo, hi, xyz, cell, above, painted, below, allowed, medium, z_min, z_max, air, species, brush, length, radius,
    height, out,
):  # fmt: skip
    """Write the brush that paint gives to each of rows ``lo`` to ``hi``, -1 for none.

    Parameters
    ----------
    above, painted, below : (a, ny, nx), (ny, nx), (c, ny, nx) int32
        Sheets from the top down.
    allowed, medium, z_min, z_max : (a + 1 + c, ...)
        Whom each sheet binds, the painted one between the two stacks.
    air : (b,) bool
        Whether a brush moves in the air.
    height : (n,)
        m above the ground.
    """
    ny, nx = painted.shape
    first = above.shape[0]
    for i in range(lo, hi):
        ix = int(min(max(xyz[i, 0] / cell, 0.0), nx - 1.0))
        iy = int(min(max(xyz[i, 1] / cell, 0.0), ny - 1.0))
        aloft = air[brush[i]]
        low = height[i] <= LOW * length[i] + radius[i]
        out[i] = NO_BRUSH
        for s in range(first + 1 + below.shape[0]):
            b = above[s, iy, ix] if s < first else painted[iy, ix] if s == first else below[s - first - 1, iy, ix]
            if s == first and b < 0:
                break  # erased, or never painted
            if b < 0 or not allowed[s, b, species[i]] or not z_min[s] <= height[i] <= z_max[s]:
                continue
            asked = medium[s]
            if asked == BY_BRUSH:
                asked = IN_AIR if air[b] else ON_GROUND
            if asked == ANYWHERE or (asked == IN_AIR and aloft) or (asked == ON_GROUND and (not aloft or low)):
                out[i] = b
                break


@njit(cache=True, nogil=True)
def through_media(
    lo, hi, wanted, brush, air, walks, flies, species, slowest, cruise, bound, least, length, radius, height, velocity,
    transit, drawn, driven,
):  # fmt: skip
    """Turn the brushes that are wanted into those that can be taken up now; who must land or take off begins to.

    Parameters
    ----------
    wanted : (n,) int32
        In: the brush that is wanted; out: the one to take up, which is the present one while a bird lands.
    walks, flies, slowest, cruise : (s,)
        Whether a species does, its slowest flight, m/s, and the height at which it flies, m.
    bound : (n,)
        Whether it is bound for a place.
    least : (b,)
        Body lengths / s below which a brush lets nobody fly.
    """
    for i in range(lo, hi):
        now, then, kind = brush[i], wanted[i], species[i]
        speed = np.sqrt(velocity[i, 0] ** 2 + velocity[i, 1] ** 2)
        if air[now] == air[then]:
            up = height[i] > CLEAR * length[i] and speed >= slowest[kind]
            if transit[i] == LANDING or not air[now] or height[i] > 0.9 * cruise[kind] or (bound[i] and up):
                transit[i] = SETTLED
            continue
        if air[then]:  # up
            wanted[i] = then if flies[kind] else now
            if flies[kind] and slowest[kind] > 0.0:
                transit[i] = TAKING_OFF
            continue
        if not walks[kind]:
            wanted[i] = now
            continue
        slow = max(TOUCHDOWN * slowest[kind], 1.2 * least[now] * length[i])
        if height[i] <= radius[i] + TOUCH * length[i] and (speed <= slow or slowest[kind] <= 0.0):
            transit[i] = SETTLED
            drawn[i] = min(drawn[i], speed)
            driven[i] = 1  # the feet brake what is left of the flight
        else:
            transit[i] = LANDING
            wanted[i] = now
