"""Whom paint binds, and how an animal comes from one medium to another.

Paint lies in sheets: zones and layers that say whom they bind on top, then what has been painted, and below it the
level's own layers one by one.  An animal looks down through them and takes the first brush that binds it: one that is
made for its species (or that the sheet gives to it), that its species can do, in the medium and at the height where the
animal is.

Paint of part weight (``blend`` mix or share, a soft edge, a zone's ``strength``) lies above all that.  It gives brushes
between what is below and its own (`flockbrush.behaviours.mixture`), one step of eight nearer for as many animals as the
weight lies between two steps; where models differ it takes a share of the animals.

A brush of another medium comes on purpose alone: as the animal's own, from a program, or from paint whose ``medium``
says so.  Who flies then lands first, who walks takes off.  Birds that fly as low as `LOW` let themselves down on
painted ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from flockbrush.behaviours.brush import cannot_move
from flockbrush.behaviours.mixture import STEPS
from flockbrush.components.agent import LANDING, SETTLED, TAKING_OFF
from flockbrush.engine.maths import inner_kernel
from flockbrush.engine.noise import uniform_
from flockbrush.engine.raster import bilinear_
from flockbrush.systems.fauna import AIR, PLANE, WATER
from flockbrush.systems.terrain import NO_BRUSH, is_off_, rasterise_polygon
from numba import njit

LOW = 1.0  # body lengths: lower flyers may be bound by paint on the ground
TOUCH = 0.25  # body lengths besides the radius: so low a bird stands
CLEAR = 8.0  # body lengths above the ground: so high a bird has taken off
TOUCHDOWN = 0.6  # times the slowest flight: slower than this a bird stands on its feet
BY_BRUSH, ON_GROUND, IN_AIR, ANYWHERE = range(4)  # of `Sheet.medium`
MEDIA = {"brush": BY_BRUSH, "ground": ON_GROUND, "air": IN_AIR, "any": ANYWHERE}


@dataclass
class Sheet:
    """Paint of one kind."""

    brush: np.ndarray  # (ny, nx) int32, -1 unpainted
    species: tuple[str, ...] = ()  # species that it binds; empty: those its brushes are made for
    medium: int = BY_BRUSH
    z_min: float = -np.inf  # m above the ground
    z_max: float = np.inf
    weight: np.ndarray | None = None  # (ny, nx) 0 to 1; None: it covers
    shares: bool = False  # whether the weight is a share of the animals


@dataclass
class Sheets:
    """The layers of a level that are not painted while it runs, from the top down."""

    above: list[Sheet] = field(default_factory=list)
    below: list[Sheet] = field(default_factory=list)
    mixing: list[Sheet] = field(default_factory=list)  # of part weight, above all others
    _cached: tuple = (None, None)
    _mixing_told: tuple = (None, None)

    def packed(self, palette, fauna):
        """`Covering` sheets."""
        about = _about(palette, fauna)
        if self._cached[0] != about:
            self._cached = about, _packed(self, palette, fauna)
        return self._cached[1]

    def packed_mixing(self, palette, fauna):
        """`Mixing` of the sheets of part weight, from the top down."""
        about = _about(palette, fauna)
        if self._mixing_told[0] != about:
            self._mixing_told = about, _packed_mixing(self.mixing, palette, fauna)
        return self._mixing_told[1]


class Covering(NamedTuple):
    """Sheets that cover, for a kernel; k of them, with the painted one between the two stacks."""

    above: np.ndarray  # (a, ny, nx) int32, from the top down
    below: np.ndarray  # (c, ny, nx) int32
    allowed: np.ndarray  # (k, b, s) uint8
    medium: np.ndarray  # (k,) uint8
    z_min: np.ndarray  # (k,) m
    z_max: np.ndarray  # (k,) m


class Mixing(NamedTuple):
    """Sheets of part weight for a kernel."""

    brush: np.ndarray  # (k, ny, nx) int32
    weight: np.ndarray  # (k, ny, nx) 0 to 1
    shares: np.ndarray  # (k,) bool, whether the weight is a share of the animals
    allowed: np.ndarray  # (k, b, s) uint8
    medium: np.ndarray  # (k,) uint8
    z_min: np.ndarray  # (k,) m
    z_max: np.ndarray  # (k,) m


def _about(palette, fauna):
    return tuple(b.made_for for b in palette.brushes), tuple(palette.flies), tuple(fauna.names)


def _packed_mixing(sheets, palette, fauna):
    return Mixing(
        np.array([s.brush for s in sheets], np.int32),
        np.array([s.weight for s in sheets]),
        np.array([s.shares for s in sheets], np.bool_),
        np.array([_allowed(s, palette, fauna) for s in sheets], np.uint8),
        np.array([s.medium for s in sheets], np.uint8),
        np.array([s.z_min for s in sheets]),
        np.array([s.z_max for s in sheets]),
    )


def _packed(sheets, palette, fauna):
    every = [*sheets.above, Sheet(np.zeros((0, 0), np.int32)), *sheets.below]
    allowed = np.array([_allowed(sheet, palette, fauna) for sheet in every], np.uint8)
    shape = next((s.brush.shape for s in every if s.brush.size), (1, 1))
    stacks = [np.array([s.brush for s in some], np.int32).reshape(-1, *shape) for some in (sheets.above, sheets.below)]
    medium = np.array([s.medium for s in every], np.uint8)
    return Covering(*stacks, allowed, medium, np.array([s.z_min for s in every]), np.array([s.z_max for s in every]))


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
    """A sentence why a species (by name) cannot use a brush (by name); "" when it can."""
    if species not in fauna.names:
        return ""
    return cannot_move(species, fauna.assets[fauna.names.index(species)], palette.brushes[palette.named(brush)])


def binds_nobody(palette, fauna, brush, species, aloft):
    """A sentence why paint of a brush (by name) binds none of some animals; "" when it binds one.

    Parameters
    ----------
    species : (n,) int
    aloft : (n,) bool
        Who is in the air.
    """
    index, plain = palette.named(brush), Sheet(np.zeros((0, 0), np.int32))
    binds, flies = _allowed(plain, palette, fauna)[index][species], palette.flies_free[index]
    if not len(species) or (binds & (aloft == flies)).any():
        return ""
    if binds.any():
        why = "it flies, and they are on the ground" if flies else "it walks or swims, and they are in the air"
        return f"Paint of {brush} binds none of these animals now: {why}."
    kinds, asset = np.unique(species), palette.brushes[index]
    meant = [fauna.names[k] for k in kinds if _may(plain, asset, fauna.names[k], fauna.assets[k])]
    why = f"it is made for {', '.join(asset.made_for)}, and they are {', '.join(fauna.names[k] for k in kinds)}"
    return f"Paint of {brush} binds none of these animals: {cannot(palette, fauna, brush, meant[0]) if meant else why}."


def cannot_follow(palette, fauna, program, species):
    """A sentence why a species (by name) cannot follow a program; "" when it can."""
    for name, state in program.states.items():
        why = cannot(palette, fauna, state.brush, species) if state.brush in palette.names else ""
        if why:
            return f"program {program.name!r}, state {name!r}: {why}"
    return ""


def sheets_of(level, palette_names):
    """The `Sheets` of a level's layers: those that say whom they bind, and its layers one by one."""

    def indexed(layer):
        own = np.array([palette_names.index(name) for name in layer.assets] + [NO_BRUSH], np.int32)
        return own[layer.index]

    above, below, mixing = [], [], []
    for layer in level.brush_layers:
        if layer.weight > 0.0 and layer.bounds.covers:
            sheet = _sheet(indexed(layer), layer.bounds)
            (below if layer.plain else above).append((layer.weight, sheet))
        elif layer.weight > 0.0:
            wraps = level.boundary == "wrap"
            mixing.insert(0, _weighted(indexed(layer), layer.bounds, layer.weight, level.cell, wraps))
    above, below = (_from_the_top(some) for some in (above, below))
    return Sheets(above, below if len(below) > 1 else [], mixing)


def with_zones(layers, zones, palette_names, shape, cell, wraps=False):
    """The `Sheets` of layers with zones on top of them, later zones above earlier ones."""
    above, mixing = [replace(sheet) for sheet in layers.above], list(layers.mixing)
    for zone in zones:
        if zone.brush:
            raster = np.full(shape, NO_BRUSH, np.int32)
            raster[rasterise_polygon(zone.polygon, shape, cell, wraps)] = palette_names.index(zone.brush)
            if zone.bounds.covers:
                _lay_over(above, _sheet(raster, zone.bounds))
            else:
                mixing.insert(0, _weighted(raster, zone.bounds, zone.bounds.strength, cell, wraps))
    return Sheets(above, layers.below, mixing)


def mixed_brushes(level):
    """Names of the brushes that paint of part weight mixes with others."""
    names = {name for layer in level.brush_layers if layer.bounds.blend == "mix" for name in layer.assets}
    return sorted(names | {zone.brush for zone in level.zones if zone.brush and zone.bounds.blend == "mix"})


def _weighted(raster, bounds, weight, cell, wraps):
    """A sheet of part weight: its weight grows from 0 at the border over the length of its edge.

    Cells beside painted ones get their brush with weight 0, so that the weight between cells ends nowhere abruptly.
    On a map that ``wraps``, those across its border are beside one another, too.
    """
    from scipy.ndimage import distance_transform_edt  # takes long to load, and few levels need it

    rim = min(math.ceil(bounds.edge / cell) + 2, max(raster.shape)) if wraps else 0
    within = tuple(slice(rim, rim + n) for n in raster.shape)
    raster = np.pad(raster, rim, mode="wrap")
    inside = raster >= 0
    far, nearest = distance_transform_edt(~inside, return_indices=True)
    spread = np.where(far < 1.5, raster[tuple(nearest)], NO_BRUSH).astype(np.int32) if inside.any() else raster
    depth = (distance_transform_edt(inside) - 0.5) * cell if not inside.all() else np.full(raster.shape, np.inf)
    share = np.clip(depth / bounds.edge, 0.0, 1.0) if bounds.edge > 0.0 else 1.0
    sheet = _sheet(np.ascontiguousarray(spread[within]), bounds)
    sheet.weight = np.ascontiguousarray(np.where(inside, weight * share, 0.0)[within])
    sheet.shares = bounds.blend == "share"
    return sheet


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


class Bindable(NamedTuple):
    """Animals that brushes may bind, (n,) each unless stated."""

    ids: np.ndarray
    species: np.ndarray  # int32
    brush: np.ndarray  # int32, that moves it now
    home: np.ndarray  # int32, where there is no paint
    xyz: np.ndarray  # (n, 3) m
    velocity: np.ndarray  # (n, 3) m/s
    length: np.ndarray  # m
    radius: np.ndarray  # m
    height: np.ndarray  # m above the ground


@njit(cache=True, nogil=True)
def painted_brush(lo, hi, animals, cell, sheets, painted, air, out):
    """Write the brush that paint gives to each of rows ``lo`` to ``hi``, -1 for none.

    Parameters
    ----------
    animals : Bindable
    sheets : Covering
    painted : (ny, nx) int32
        The sheet between the two stacks.
    air : (b,) bool
        Whether a brush moves in the air.
    """
    xyz, species, brush = animals.xyz, animals.species, animals.brush
    length, radius, height = animals.length, animals.radius, animals.height
    above, below, allowed, medium, z_min, z_max = sheets
    ny, nx = painted.shape
    first = above.shape[0]
    for i in range(lo, hi):
        out[i] = NO_BRUSH
        if is_off_(xyz[i, 0], xyz[i, 1], cell, nx, ny):
            continue
        ix, iy = min(int(xyz[i, 0] / cell), nx - 1), min(int(xyz[i, 1] / cell), ny - 1)
        aloft = air[brush[i]]
        low = height[i] <= LOW * length[i] + radius[i]
        for s in range(first + 1 + below.shape[0]):
            b = above[s, iy, ix] if s < first else painted[iy, ix] if s == first else below[s - first - 1, iy, ix]
            if s == first and b < 0:
                break  # erased, or never painted
            if b < 0 or not allowed[s, b, species[i]] or not z_min[s] <= height[i] <= z_max[s]:
                continue
            if _is_in(medium[s], air[b], aloft, low):
                out[i] = b
                break


@inner_kernel
def _is_in(medium, air, aloft, low):
    """Whether an animal is in the medium that a sheet asks for; ``air``: the brush moves there."""
    asked = medium
    if asked == BY_BRUSH:
        asked = IN_AIR if air else ON_GROUND
    return asked == ANYWHERE or (asked == IN_AIR and aloft) or (asked == ON_GROUND and (not aloft or low))


@njit(cache=True, nogil=True)
def mix_paint(lo, hi, animals, cell, wrap, sheets, air, mixes, key, out):
    """Lay paint of part weight over what other paint has given to rows ``lo`` to ``hi``.

    The uppermost sheet that binds an animal mixes with what is below; those below it take a share of the animals.

    Parameters
    ----------
    animals : Bindable
    wrap : (float, float)
        m, size of a map that goes on at the opposite border; (0, 0) of another.
    sheets : Mixing
    air : (b,) bool
        Whether a brush moves in the air.
    mixes : (b, b) int32
        `Palette.mixes`.
    key : uint64
        Of the animals' own numbers: who belongs to a share, and who is the next step further on between two.
    out : (n,) int32
        In: what other paint gives, -1 for none; out: the brush, -1 still for none.
    """
    xyz, ids, species, brush, home = animals.xyz, animals.ids, animals.species, animals.brush, animals.home
    length, radius, height = animals.length, animals.radius, animals.height
    count, ny, nx = sheets.brush.shape
    for i in range(lo, hi):
        if is_off_(xyz[i, 0], xyz[i, 1], cell, nx, ny):
            continue
        u = min(max(xyz[i, 0] / cell - 0.5, 0.0), nx - 1.0)
        v = min(max(xyz[i, 1] / cell - 0.5, 0.0), ny - 1.0)
        iy, ix = int(v + 0.5), int(u + 0.5)
        aloft, low = air[brush[i]], height[i] <= LOW * length[i] + radius[i]
        top = -1
        for s in range(count):
            b = sheets.brush[s, iy, ix]
            if b < 0 or not sheets.allowed[s, b, species[i]] or not sheets.z_min[s] <= height[i] <= sheets.z_max[s]:
                continue
            if _is_in(sheets.medium[s], air[b], aloft, low):
                top = s
                break
        if top < 0:
            continue
        for s in range(count - 1, top - 1, -1):
            b = sheets.brush[s, iy, ix]
            if b < 0 or not sheets.allowed[s, b, species[i]] or not sheets.z_min[s] <= height[i] <= sheets.z_max[s]:
                continue
            if not _is_in(sheets.medium[s], air[b], aloft, low):
                continue
            weight, own = bilinear_(sheets.weight[s], cell, xyz[i, 0], xyz[i, 1], wrap), uniform_(key, ids[i], s)
            under = out[i] if out[i] >= 0 else home[i]
            if s == top and not sheets.shares[s] and under != b and mixes[under, b] >= 0:
                step = int(weight * STEPS + own)
                out[i] = b if step >= STEPS else mixes[under, b] + step - 1 if step > 0 else out[i]
            elif own < weight:
                out[i] = b


class MediaChange(NamedTuple):
    """How animals come from one medium to another, (n,) each; is written."""

    wanted: np.ndarray  # int32, in: the brush that is wanted; out: the one to take up, the present one while it lands
    transit: np.ndarray  # uint8, `SETTLED`, `LANDING` or `TAKING_OFF`
    drawn: np.ndarray  # m/s, the speed process
    driven: np.ndarray  # uint8, 1 until the speed is again what the brush says


@njit(cache=True, nogil=True)
def through_media(lo, hi, animals, air, least, table, bound, crossing):
    """Turn the brushes that are wanted into those that can be taken up now; who must land or take off begins to.

    Parameters
    ----------
    animals : Bindable
    air, least : (b,)
        Whether a brush moves in the air, and body lengths / s below which it lets nobody fly.
    table : SpeciesTable
    bound : (n,)
        Whether it is bound for a place.
    """
    brush, species, velocity = animals.brush, animals.species, animals.velocity
    length, radius, height = animals.length, animals.radius, animals.height
    media, slowest, cruise = table.media, table.slowest, table.height
    wanted, transit, drawn, driven = crossing
    for i in range(lo, hi):
        now, then, kind = brush[i], wanted[i], species[i]
        speed = np.sqrt(velocity[i, 0] ** 2 + velocity[i, 1] ** 2)
        if air[now] == air[then]:
            up = height[i] > CLEAR * length[i] and speed >= slowest[kind]
            if transit[i] == LANDING or not air[now] or height[i] > 0.9 * cruise[kind] or (bound[i] and up):
                transit[i] = SETTLED
            continue
        if air[then]:  # up
            wanted[i] = then if media[kind, AIR] else now
            if media[kind, AIR] and slowest[kind] > 0.0:
                transit[i] = TAKING_OFF
            continue
        if not (media[kind, PLANE] or media[kind, WATER]):
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
