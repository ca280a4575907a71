"""The ground and what stands on it, as the kernels want it: rasters, edges, fields."""

from __future__ import annotations

import functools
import json
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

import numpy as np
from flockbrush.components.level_things import ENUMS, Exit, Goal, Guide, Obstacle, as_before
from flockbrush.engine.problems import did_you_mean
from flockbrush.engine.seam import wrap_of
from flockbrush.engine.solids import Solids
from flockbrush.systems.binding import Sheets
from flockbrush.systems.fauna import STEEPEST
from flockbrush.systems.ground_edges import across_seam, outline_edges, solid_images
from flockbrush.systems.ground_height import Heights, Hills, height_of_ground, heights_of_ground
from flockbrush.systems.marks import BRUSHES_OWN, Above, MapMarks
from flockbrush.systems.navigation import Navigation, navigation_of
from flockbrush.systems.sky_solids import solids_in_the_air, solids_on_the_ground
from flockbrush.systems.terrain import NO_BRUSH, compose_blocked, relief_of, steepest_within, steepness_of
from flockbrush.systems.visibility import Edges, edges_by_cell, no_edges

OF_BARE = {"walkable": True, "blocks_view": False, "cost": 1.0, "speed_factor": 1.0}  # what nothing painted means
NATIVE, BARE = -2, -1  # of `Painted.ground`: as the level was read; nothing painted
SHAPES = ENUMS["ObstacleShape"]  # how an obstacle stands up from its outline
PATIENCE = 8  # ticks without a change after which the navigation field is made anew: strokes come in pieces


@dataclass
class Glide:
    """An obstacle on its way."""

    name: str
    by: np.ndarray  # (3,) m still to go
    left: float  # s until it is there


@dataclass
class Painted:
    """What has been painted on the ground; zones lie above it."""

    brush: np.ndarray  # (ny, nx) int32, index into the `Palette`; -1 unpainted
    cap: np.ndarray  # (ny, nx) m/s, infinite for none
    ground: np.ndarray  # (ny, nx) int16, index into `Landscape.kinds`, `BARE` or `NATIVE`

    def rasters(self):
        """All three."""
        return self.brush, self.cap, self.ground


@dataclass
class Native:
    """The ground as the level was read."""

    factor: np.ndarray  # (ny, nx) of the ground alone
    walkable: np.ndarray
    blind: np.ndarray
    cost: np.ndarray
    kind: np.ndarray  # (ny, nx) int16, index into `Landscape.kinds`, `BARE` where nothing was painted
    regular: np.ndarray | None = None  # (ny, nx) bool, where it is no other than its kind
    more: dict[str, np.ndarray] = field(default_factory=dict)  # (ny, nx) of properties beyond those above


@dataclass
class Landscape:
    """Everything about the place that animals feel."""

    # width, height: metres
    width: float
    height: float
    boundary: str  # ``wall``, ``wrap``, ``open`` or ``despawn``
    cell: float  # size of a cell of the rasters, m
    surface: np.ndarray  # (ny, nx, 2); speed factor and cap (m/s)
    brush: np.ndarray  # (ny, nx) int32; the brush that acts as an index into the `Palette`; -1 unpainted
    walkable: np.ndarray  # (ny, nx) bool; terrain on which one can stand
    blind: np.ndarray  # (ny, nx) bool; terrain that blocks the view
    cost: np.ndarray  # (ny, nx); of a metre on the way to a goal
    relief: np.ndarray = field(default_factory=relief_of)  # (my, mx, 3); see `flockbrush.systems.terrain.relief_of`
    relief_cell: float = 1.0
    obstacles: list[Obstacle] = field(default_factory=list)
    guides: list[Guide] = field(default_factory=list)
    goals: list[Goal] = field(default_factory=list)
    exits: list[Exit] = field(default_factory=list)
    reach: float = 4.0  # m, the farthest any animal looks: edges are sorted for it
    navigation: Navigation | None = None
    solid: Edges = field(default_factory=no_edges)
    solid_owner: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))  # obstacle of each solid edge
    opaque: Edges = field(default_factory=no_edges)
    walls: Edges = field(default_factory=no_edges)  # the solid edges again, sorted for contact: a much shorter reach
    touch: float = 0.0  # m, the reach of `walls`
    _head: bytes | None = None
    blocked: np.ndarray | None = None
    # (ny, nx); seconds in which a brush is taken up here; `BRUSHES_OWN` where the brush says so itself
    transition: np.ndarray | None = None
    # kinds of ground one can paint: ``name``, ``walkable``, ``speed_factor``, ``cost``, ``blocks_view`` and more
    kinds: list = field(default_factory=list)
    # the properties of ground on which nothing is painted
    of_bare: dict[str, Any] = field(default_factory=lambda: dict(OF_BARE))
    # painted, above, native: what `surface`, `brush`, `walkable`, `blind` and `cost` are composed of
    painted: Painted | None = None
    above: Above | None = None
    native: Native | None = None
    marks: MapMarks = field(default_factory=MapMarks)  # zones, lines and areas
    sheets: Sheets = field(default_factory=Sheets)  # zones and layers by the species that they bind
    stale: int | None = None  # the tick of the last change that the navigation field does not know yet
    _known: tuple | None = None  # what the navigation field was made of
    slope_limits: tuple = (STEEPEST,)  # rise per metre; the navigation field is for animals with these, on hills
    _limits_of: tuple = (None, None)  # the limits of all species, and which of `slope_limits` each has
    glides: list[Glide] = field(default_factory=list)  # what is on its way to another place
    _sky: tuple[Solids, Solids] | None = None
    _standing: Solids | None = None

    def __post_init__(self):
        shape = self.brush.shape
        if self.transition is None:
            self.transition = np.full(shape, BRUSHES_OWN)
        if self.painted is None:
            cap = self.surface[..., 1].copy()
            self.painted = Painted(self.brush.copy(), cap, np.full(shape, NATIVE, np.int16))
        if self.above is None:
            self.above = Above(np.full(shape, NO_BRUSH, np.int32), np.full(shape, np.inf), np.ones(shape))
        if self.native is None:
            bare = np.full(shape, BARE, np.int16)
            self.native = Native(self.surface[..., 0].copy(), self.walkable, self.blind, self.cost, bare)
        self.walkable, self.blind, self.cost = self.walkable.copy(), self.blind.copy(), self.cost.copy()
        if self.native.regular is None:
            self.native.regular = self._regular()

    def _regular(self):
        """(ny, nx) bool, where the ground as read is no other than its kind: there one may say so by its name."""
        native, everywhere = self.native, (..., slice(None))
        properties = {name: self._of_ground(name, None, native.kind, *everywhere) for name in (*OF_BARE, *native.more)}
        rasters = native.walkable, native.blind, native.cost, native.factor
        rasters = dict(zip(OF_BARE, rasters, strict=True)) | native.more
        return np.logical_and.reduce([properties[name] == rasters[name] for name in rasters])

    @property
    def wrap(self):
        """(width, height) of a periodic map, or None."""
        return wrap_of(self)

    @property
    def bounds(self):
        """(west, south, east, north), m, of the ground one can stand on; an open map has no end."""
        return (-np.inf, -np.inf, np.inf, np.inf) if self.boundary == "open" else (0.0, 0.0, self.width, self.height)

    @property
    def barriers(self):
        """The obstacles that animals on the ground meet."""
        return [b for b in self.obstacles if b.on_the_ground]

    @property
    def overhead(self):
        """The obstacles that begin above the ground: animals there pass below them."""
        return [b for b in self.obstacles if not b.on_the_ground]

    @property
    def solids(self):
        """Polygons (k, 2) m of the obstacles that keep bodies out, with those that reach over the seam."""
        return [image.polygon for image in solid_images(self.barriers, self.wrap)]

    # in the air -----------------------------------------------------------------

    @property
    def sky(self):
        """`Solids` that keep those in the air out."""
        return self._in_space()[0]

    @property
    def standing(self):
        """`Solids` that keep those out that a model of flight moves along the ground."""
        if self._standing is None:
            self._standing = solids_on_the_ground(self)
        return self._standing

    @property
    def opaque_solids(self):
        """`Solids` that block the view of animals in the air."""
        return self._in_space()[1]

    def _in_space(self):
        if self._sky is None:
            self._sky = solids_in_the_air(self)
        return self._sky

    @property
    def heights(self):
        """`Heights` of the ground, for kernels."""
        return Heights(self.relief, self.relief_cell, self.wrap or (0.0, 0.0))

    @functools.cached_property
    def steepness(self):
        """Slope of the ground, as from `flockbrush.systems.terrain.steepness_of`."""
        return steepness_of(self.relief[..., 0], self.relief_cell, self.wrap is not None)

    def hills_for(self, steepest):
        """`Hills` for animals that walk up to these slopes (n,)."""
        return Hills(self.heights, self.steepness, steepest)

    @functools.cached_property
    def hilly(self):
        """Whether the ground is not level."""
        return bool(self.relief[..., 1:].any())

    def ground(self, xy):
        """Height of the ground at one place, m."""
        flat = self.relief.shape[:2] == (1, 1)
        return 0.0 if flat else float(height_of_ground(self.heights, xy[0], xy[1]))

    # the ground -----------------------------------------------------------------

    @property
    def kind_at(self):
        """(ny, nx) which of `kinds` is on the ground, `BARE` where nothing is painted."""
        return np.where(self.painted.ground == NATIVE, self.native.kind, self.painted.ground)

    def ground_of(self, iy, ix):
        """Which of `kinds` is on cells: `NATIVE` only where no kind says what is there."""
        ground, native = self.painted.ground[iy, ix], self.native
        return np.where((ground == NATIVE) & native.regular[iy, ix], native.kind[iy, ix], ground)

    # paint ----------------------------------------------------------------------

    def lay_brush(self, iy, ix, index):
        """Paint brushes on cells; a zone above still has its own."""
        self.painted.brush[iy, ix] = index
        above = self.above.brush[iy, ix]
        self.brush[iy, ix] = np.where(above >= 0, above, self.painted.brush[iy, ix])

    def lay_cap(self, iy, ix, cap):
        """Paint maximum speeds on cells, m/s, infinite for none; a zone above may be lower still."""
        self.painted.cap[iy, ix] = cap
        self.surface[iy, ix, 1] = np.minimum(self.painted.cap[iy, ix], self.above.cap[iy, ix])

    def lay_ground(self, iy, ix, kind):
        """Paint kinds of ground on cells; call `rebuild` when somebody can stand or see there no longer."""
        as_read = (kind == self.native.kind[iy, ix]) & self.native.regular[iy, ix]
        self.painted.ground[iy, ix] = np.where(as_read, NATIVE, kind)
        ground = self.painted.ground[iy, ix]
        self.walkable[iy, ix] = self._of_ground("walkable", "walkable", ground, iy, ix)
        self.blind[iy, ix] = self._of_ground("blocks_view", "blind", ground, iy, ix)
        self.cost[iy, ix] = self._of_ground("cost", "cost", ground, iy, ix)
        self._lay_factor(iy, ix)

    def _lay_factor(self, iy, ix):
        factor = self._of_ground("speed_factor", "factor", self.painted.ground[iy, ix], iy, ix)
        self.surface[iy, ix, 0] = factor * self.above.factor[iy, ix]

    def lay_above(self):
        """Lay what zones say over all that is painted."""
        everywhere = ..., slice(None)
        self.lay_brush(*everywhere, self.painted.brush)
        self.lay_cap(*everywhere, self.painted.cap)
        self._lay_factor(*everywhere)
        self._head = None

    def _of_ground(self, name, native, ground, iy, ix):
        """One property of painted cells, the level's own where they are as it was read."""
        by_kind = np.array([getattr(kind, name) for kind in self.kinds] + [self.of_bare[name]])[
            np.maximum(ground, BARE)
        ]
        if name in self.native.more:
            return np.where(ground == NATIVE, self.native.more[name][iy, ix], by_kind)
        return by_kind if native is None else np.where(ground == NATIVE, getattr(self.native, native)[iy, ix], by_kind)

    def ground_at(self, name, xyz):
        """(n,) a property of the ground, none of `OF_BARE`, under places (n, 2 or 3) m; that of the nearest cell."""
        if name in OF_BARE:
            raise ValueError(f"{name} is in the rasters of the landscape: walkable, blind, cost and surface")
        if name not in self.of_bare:
            raise ValueError(f"{name!r} is no property of the ground{did_you_mean(name, self.of_bare)}")
        (ny, nx), cells = self.brush.shape, np.asarray(xyz)[:, :2] / self.cell
        ix, iy = np.clip(cells, 0, (nx - 1, ny - 1)).astype(int).T
        return self._of_ground(name, None, self.painted.ground[iy, ix], iy, ix)

    # edges and fields -----------------------------------------------------------

    def rebuild(self, navigation=True):
        """Make edges and fields anew after obstacles, terrain, guides or goals have changed."""
        self.changed()
        walls, wall_owner, views, barriers = [], [], [], self.barriers
        for owner, b in enumerate(barriers):
            edges = np.hstack([b.polygon, np.roll(b.polygon, -1, axis=0)])
            if b.solid:
                walls.append(edges)
                wall_owner += [owner] * len(edges)
            if b.blocks_view:
                views.append(edges)
        owner = len(barriers)
        for mask, into in ((~self.walkable, walls), (self.blind, views)):
            if mask.any():
                edges = outline_edges(mask) * self.cell
                into.append(edges)
                if into is walls:
                    wall_owner += [owner] * len(edges)
        if self.boundary == "wall":
            w, h = self.width, self.height
            walls.append(np.array([(0, 0, w, 0), (w, 0, w, h), (w, h, 0, h), (0, h, 0, 0)], float))
            wall_owner += [owner + 1, owner + 2, owner + 3, owner + 4]
        walls, views = np.concatenate(walls or [np.zeros((0, 4))]), np.concatenate(views or [np.zeros((0, 4))])
        self.solid_owner = np.array(wall_owner, np.int32)
        if self.boundary == "wrap":
            walls, self.solid_owner = across_seam(walls, self.solid_owner, self.wrap, self.reach)
            views, _ = across_seam(views, np.zeros(len(views), np.int32), self.wrap, self.reach)
        self.solid, self.opaque = edges_by_cell(walls, self.reach), edges_by_cell(views, self.reach)
        self.touch = 0.0
        self.blocked = self._blocked(barriers, self.walkable)
        if navigation:
            self.navigate()

    def changed(self):
        """Say that obstacles, guides, goals or exits are others now."""
        self._head = self._sky = self._standing = None
        names = [goal.name for goal in self.goals]
        for goal in self.goals:
            goal.next_index = names.index(goal.next) if goal.next in names else -1

    def navigate_later(self, tick):
        """Have the navigation field made anew `PATIENCE` ticks from now, unless there is a change before."""
        self._head = None
        self.stale = None if self._inputs() == self._known else tick

    def settle(self, tick):
        """Make the navigation field anew if that is due."""
        if self.stale is not None and tick >= self.stale + PATIENCE:
            self.navigate()

    def _blocked(self, barriers, walkable):
        return compose_blocked(self.brush.shape, self.cell, walkable, solid_images(barriers, self.wrap))

    def navigate(self):
        """Make the navigation field anew, after guides or goals have changed."""
        self.changed()
        self.navigation = self._navigation(self.guides, self.goals, self.blocked, self.cost)
        self._known, self.stale, self._head = self._inputs(), None, None

    def ways_for(self, steepest, species, goal):
        """(n,) which fields animals of these species follow that are bound to these goals, as `Navigation.at` counts.

        The fields are made anew when a species with another slope limit comes, of ``steepest`` (s,).
        """
        if not self.hilly:
            return goal
        if self._limits_of[0] is not steepest:
            limits, which = np.unique(steepest, return_inverse=True)
            if len(limits) and tuple(limits.tolist()) != self.slope_limits:
                self.slope_limits = tuple(limits.tolist())
                if self._known is not None:
                    self._navigate_as_known(self._known)
            self._limits_of = steepest, which.astype(np.int32)
        if len(self.slope_limits) == 1:
            return goal
        return goal + self._limits_of[1][species] * np.int32(len(self.navigation.fields) // len(self.slope_limits))

    def _navigation(self, guides, goals, blocked, cost):
        height = None
        if self.hilly:
            ny, nx = blocked.shape
            x, y = np.meshgrid((np.arange(nx) + 0.5) * self.cell, (np.arange(ny) + 0.5) * self.cell)
            height = heights_of_ground(self.heights, np.stack([x.ravel(), y.ravel()], 1))
            height = height.reshape(blocked.shape)
            steep = steepest_within(self.steepness, self.relief_cell, blocked.shape, self.cell)
        closed = [blocked] if height is None else [blocked | (steep > limit) for limit in self.slope_limits]
        wrap = self.wrap is not None
        parts = [navigation_of(guides, goals, where, cost, self.cell, height, wrap) for where in closed]
        fields, times = (np.concatenate([getattr(part, name) for part in parts]) for name in ("fields", "times"))
        return Navigation(self.cell, fields, times, wrap)

    def _inputs(self):
        """What the navigation field is made of: (barriers, guides and goals as JSON, painted ground)."""
        things = [[_plain(thing) for thing in things] for things in (self.barriers, self.guides, self.goals)]
        return json.dumps(things), self.painted.ground.tobytes()

    def _navigate_as_known(self, known):
        """The navigation field of how everything was when it was last made."""
        things, ground = known
        barriers, guides, goals = (
            [kind(**_arrays(thing)) for thing in entries]
            for kind, entries in zip((Obstacle, Guide, Goal), json.loads(things), strict=True)
        )
        ground = np.frombuffer(ground, np.int16).reshape(self.brush.shape)
        walkable = self._of_ground("walkable", "walkable", ground, ..., slice(None))
        cost = self._of_ground("cost", "cost", ground, ..., slice(None))
        self.navigation = self._navigation(guides, goals, self._blocked(barriers, walkable), cost)
        self._known = known

    def walls_within(self, reach):
        """Solid edges by cell, for contact: at least all within ``reach`` metres of an animal."""
        if reach > self.touch:
            self.touch = 2.0 * reach
            self.walls = edges_by_cell(self.solid.ends, self.touch)
        return self.walls

    def see_to(self, reach):
        """Sort the edges for animals that look ``reach`` metres far, if they are not yet."""
        if reach > self.reach:
            self.reach = reach
            self.rebuild(navigation=False)

    def find(self, name):
        """The obstacles of this name."""
        return [b for b in self.obstacles if b.name == name]

    def shift(self, obstacle, by):
        """Put an obstacle elsewhere, by (3,) m; the navigation field is for the caller to see to.

        One that leaves the ground lets animals there pass, and one that comes down bars their way.
        """
        was_on_the_ground = obstacle.on_the_ground
        obstacle.polygon = obstacle.polygon + np.asarray(by[:2], float)
        obstacle.z_min, obstacle.z_max = obstacle.z_min + float(by[2]), obstacle.z_max + float(by[2])
        if was_on_the_ground or obstacle.on_the_ground:
            self.rebuild(navigation=False)
        else:
            self.changed()

    # state ----------------------------------------------------------------------

    def state(self):
        """What may change while a world runs: paint, obstacles, guides, goals and exits (see
        `flockbrush.engine.state`)."""
        if self._head is None:
            self._head = self._things()
        text = self._head
        late = [] if self.stale is None else [self._known[1]]
        rasters = [raster.tobytes() for raster in self.painted.rasters()]
        return b"".join([len(text).to_bytes(8, "little"), text, *rasters, *late])

    def _things(self):
        """What is not a raster, as JSON; kept until the next change, for it is asked for in every tick."""
        head = {
            "reach": self.reach,
            "stale": self.stale,
            "known": None if self.stale is None else self._known[0],
            "glides": [[g.name, g.by.tolist(), g.left] for g in self.glides],
            **{name: [_plain(thing) for thing in getattr(self, name)] for name in _THINGS},
        }
        aloft = [not b.on_the_ground for b in self.obstacles]
        head |= {"aloft": aloft} if aloft != sorted(aloft) else {}
        marks = self.marks.state()
        head |= {} if marks is None else {"marks": marks}
        return json.dumps(head).encode()

    def set_state(self, data):
        """Take back what `state` gave."""
        start = 8 + int.from_bytes(data[:8], "little")
        head = json.loads(data[8:start])
        rasters = []
        for raster in self.painted.rasters():
            end = start + raster.nbytes
            rasters.append(np.frombuffer(data[start:end], raster.dtype).reshape(raster.shape))
            start = end
        ground_before, known_before = self.painted.ground.tobytes(), self._known
        edges_before = self.reach, [_plain(b) for b in self.barriers], ground_before
        everywhere = ..., slice(None)
        self.marks.set_state(head.get("marks"), self)
        self.lay_brush(*everywhere, rasters[0])
        self.lay_cap(*everywhere, rasters[1])
        if rasters[2].tobytes() != ground_before:
            self.lay_ground(*everywhere, rasters[2])
        self.reach = head["reach"]
        things = {name: [kind(**_arrays(thing)) for thing in head[name]] for name, kind in _THINGS.items()}
        lists = [iter(things.pop(name)) for name in ("barriers", "overhead")]
        obstacles = [next(lists[aloft]) for aloft in head["aloft"]] if "aloft" in head else list(chain(*lists))
        for name, entries in {"obstacles": obstacles, **things}.items():
            setattr(self, name, as_before(getattr(self, name), entries))
        self.glides = [Glide(name, np.array(by), left) for name, by, left in head["glides"]]
        if edges_before != (self.reach, [_plain(b) for b in self.barriers], self.painted.ground.tobytes()):
            self.rebuild(navigation=False)
        self.changed()
        self.stale = head["stale"]
        known = self._inputs() if self.stale is None else (head["known"], data[start:])
        if known != known_before:
            self._navigate_as_known(known)


_THINGS: dict[str, Any] = {"barriers": Obstacle, "overhead": Obstacle, "guides": Guide, "goals": Goal, "exits": Exit}
_ORDER = {  # of fields in the state: its hash depends on it
    Obstacle: ("polygon", "solid", "blocks_view", "name", "margin", "id", "z_min", "z_max", "shape", "corners"),
    Guide: ("points", "strength", "radius", "decay", "goal", "loop", "name", "id"),
    Goal: ("name", "xy", "radius", "polygon", "on_arrive", "next", "id"),
    Exit: ("polygon", "name", "id"),
}
_ARRAYS = ("polygon", "points", "xy", "corners")


def _plain(thing):
    """A barrier, guide, goal or exit as JSON takes it."""
    values = {name: getattr(thing, name) for name in _ORDER[type(thing)]}
    if values.get("corners", ...) is None:  # none but hulls have any
        del values["corners"]
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}


def _arrays(values):
    """The arguments of a thing from what `_plain` told."""
    return {name: np.array(v, float) if name in _ARRAYS and v is not None else v for name, v in values.items()}
