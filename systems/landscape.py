"""The ground and what stands on it, as the kernels want it: rasters, edges, fields."""

from __future__ import annotations

import json
from dataclasses import astuple, dataclass, field

import numpy as np

from engine.fields import bilinear_
from engine.solids import Solids, convex_parts, cylinder, half_space, packed, prism, sphere
from systems.navigation import Navigation, navigation_of
from systems.terrain import compose_blocked, relief_of
from systems.visibility import Edges, edges_by_cell, no_edges

BRUSHES_OWN = -1.0  # of `Landscape.transition`: the brush's own time


@dataclass
class Barrier:
    """Something that stops bodies, sight, or both."""

    polygon: np.ndarray  # (k, 2) m, counter-clockwise
    solid: bool = True
    blocks_view: bool = True
    name: str = ""
    margin: float = 0.0  # m, kept free around it by those who follow a field
    z_min: float = 0.0  # m above the ground; animals on the ground pass below what begins higher
    z_max: float = 1000.0  # m above the ground
    shape: str = "box"  # how it stands up from its outline: box, cylinder, sphere or plane


@dataclass
class Glide:
    """An obstacle on its way."""

    name: str
    by: np.ndarray  # (3,) m still to go
    left: float  # s until it is there


@dataclass
class Landscape:
    """Everything about the place that animals feel.

    Attributes
    ----------
    width, height : float
        Metres.
    boundary : str
        ``wall``, ``wrap``, ``open`` or ``despawn``.
    cell : float
        Size of a cell of the rasters, m.
    surface : ndarray (ny, nx, 2)
        Speed factor and cap (m/s).
    brush : ndarray (ny, nx) int32
        Painted brush as an index into the `Palette`; -1 unpainted.
    transition : ndarray (ny, nx)
        Seconds in which a brush is taken up here; `BRUSHES_OWN` where the brush says so itself.
    walkable : ndarray (ny, nx) bool
        Terrain on which one can stand.
    blind : ndarray (ny, nx) bool
        Terrain that blocks the view.
    cost : ndarray (ny, nx)
        Of a metre on the way to a goal.
    relief : ndarray (my, mx, 3)
        See `systems.terrain.relief_of`.
    """

    width: float
    height: float
    boundary: str
    cell: float
    surface: np.ndarray
    brush: np.ndarray
    walkable: np.ndarray
    blind: np.ndarray
    cost: np.ndarray
    relief: np.ndarray = field(default_factory=relief_of)
    relief_cell: float = 1.0
    barriers: list[Barrier] = field(default_factory=list)
    guides: list = field(default_factory=list)
    goals: list = field(default_factory=list)
    exits: list = field(default_factory=list)  # polygons
    reach: float = 4.0  # m, the farthest any animal looks: edges are sorted for it
    navigation: Navigation | None = None
    solid: Edges = field(default_factory=no_edges)
    solid_owner: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))  # obstacle of each solid edge
    opaque: Edges = field(default_factory=no_edges)
    walls: Edges = field(default_factory=no_edges)  # the solid edges again, sorted for contact: a much shorter reach
    touch: float = 0.0  # m, the reach of `walls`
    _head: bytes | None = None
    blocked: np.ndarray | None = None
    transition: np.ndarray | None = None
    overhead: list[Barrier] = field(default_factory=list)  # what begins above the ground
    glides: list[Glide] = field(default_factory=list)  # what is on its way to another place
    _sky: tuple[Solids, Solids] | None = None
    moved: bool = False  # whether anything has glided or moved in height since the level was built

    def __post_init__(self):
        if self.transition is None:
            self.transition = np.full(self.brush.shape, BRUSHES_OWN)

    @property
    def wrap(self):
        """(width, height) of a periodic map, or None."""
        return (self.width, self.height) if self.boundary == "wrap" else None

    @property
    def bounds(self):
        """(west, south, east, north), m, of the ground one can stand on; an open map has no end."""
        return (-np.inf, -np.inf, np.inf, np.inf) if self.boundary == "open" else (0.0, 0.0, self.width, self.height)

    @property
    def solids(self):
        """Polygons (k, 2) m of the obstacles that keep bodies out."""
        return [b.polygon for b in self.barriers if b.solid]

    @property
    def sky(self):
        """`Solids` that keep those in the air out."""
        return self._in_space()[0]

    @property
    def opaque_solids(self):
        """`Solids` that hide whoever is behind them from those in the air."""
        return self._in_space()[1]

    def _in_space(self):
        if self._sky is None:
            things = [(b, solid) for b in (*self.barriers, *self.overhead) for solid in self._stood_up(b)]
            bodies = [solid for b, solid in things if b.solid]
            views = [solid for b, solid in things if b.blocks_view]
            if self.wrap is not None:
                bodies, views = _in_all_images(bodies, self.wrap), _in_all_images(views, self.wrap)
            if self.boundary == "wall":
                w, h = self.width, self.height
                bodies += [
                    half_space((0, 0, 0), (1, 0, 0)), half_space((w, 0, 0), (-1, 0, 0)),
                    half_space((0, 0, 0), (0, 1, 0)), half_space((0, h, 0), (0, -1, 0)),
                ]  # fmt: skip
            self._sky = packed(bodies), packed(views)
        return self._sky

    def ground(self, xy):
        """Height of the ground at one place, m."""
        flat = self.relief.shape[:2] == (1, 1)
        return 0.0 if flat else float(bilinear_(self.relief[..., 0], self.relief_cell, xy[0], xy[1]))

    def _stood_up(self, barrier):
        """The `Solid` pieces of a barrier."""
        polygon, ground = barrier.polygon, self.ground(barrier.polygon.mean(0))
        low, high = barrier.z_min + ground, barrier.z_max + ground
        if barrier.shape == "plane":  # below it when it lies on the ground, above it when it is a ceiling
            point = np.array([*polygon.mean(0), low if barrier.z_min > 0 else high])
            return [half_space(point, (0, 0, -1) if barrier.z_min > 0 else (0, 0, 1), barrier.blocks_view)]
        middle, away = np.array([*polygon.mean(0), 0.5 * (low + high)]), polygon - polygon.mean(0)
        radius = float(np.sqrt((away**2).sum(1).max()))
        if barrier.shape == "sphere":
            return [sphere(middle, radius, barrier.blocks_view)]
        if barrier.shape == "cylinder":
            return [cylinder(middle, radius, 0.5 * (high - low), opaque=barrier.blocks_view)]
        return [prism(part, low, high, barrier.blocks_view) for part in convex_parts(polygon)]

    def rebuild(self, navigation=True):
        """Make edges and fields anew after barriers, terrain, guides or goals have changed."""
        self._head = self._sky = None
        walls, wall_owner, views = [], [], []
        for owner, b in enumerate(self.barriers):
            edges = np.hstack([b.polygon, np.roll(b.polygon, -1, axis=0)])
            if b.solid:
                walls.append(edges)
                wall_owner += [owner] * len(edges)
            if b.blocks_view:
                views.append(edges)
        owner = len(self.barriers)
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
            walls, self.solid_owner = _across_seam(walls, self.solid_owner, self.wrap, self.reach)
            views, _ = _across_seam(views, np.zeros(len(views), np.int32), self.wrap, self.reach)
        self.solid, self.opaque = edges_by_cell(walls, self.reach), edges_by_cell(views, self.reach)
        self.touch = 0.0
        solids = [b for b in self.barriers if b.solid]
        self.blocked = compose_blocked(self.brush.shape, self.cell, self.walkable, solids)
        if navigation:
            self.navigation = navigation_of(self.guides, self.goals, self.blocked, self.cost, self.cell)

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

    def _painted(self):
        return self.surface, self.brush, self.transition

    def find(self, name):
        """The barriers of this name."""
        return [b for b in (*self.barriers, *self.overhead) if b.name == name]

    def shift(self, barrier, by):
        """Put a barrier elsewhere, by (3,) m."""
        barrier.polygon = barrier.polygon + np.asarray(by[:2], float)
        barrier.z_min, barrier.z_max = barrier.z_min + float(by[2]), barrier.z_max + float(by[2])
        self._sky, self.moved = None, True
        if self.on_the_ground(barrier):
            self.rebuild(navigation=bool(self.goals or self.guides))

    def on_the_ground(self, barrier):
        """Whether animals on the ground meet this barrier."""
        return any(b is barrier for b in self.barriers)

    def hashed_state(self):
        """What of `state` makes a difference: heights only once something has moved."""
        return self._state_of(self.moved)

    def state(self):
        """What may change while a world runs: paint, obstacles and goals (see `engine.state`)."""
        return self._state_of(True)

    def _state_of(self, heights):
        if self._head is None:
            self._head = self._things()
        text = self._head
        if heights:
            text = json.dumps(json.loads(text) | self._heights()).encode()
        return b"".join([len(text).to_bytes(8, "little"), text, *(raster.tobytes() for raster in self._painted())])

    def _heights(self):
        return {
            "heights": [[b.z_min, b.z_max, b.shape] for b in self.barriers],
            "overhead": [[b.polygon.tolist(), *astuple(b)[1:]] for b in self.overhead],
            "glides": [[g.name, g.by.tolist(), g.left] for g in self.glides],
            "moved": self.moved,
        }

    def _things(self):
        """What is not a raster, as JSON; kept until the next `rebuild`, for it is asked for in every tick."""
        head = {
            "reach": self.reach,
            "barriers": [[b.polygon.tolist(), b.solid, b.blocks_view, b.name, b.margin] for b in self.barriers],
            "goals": [
                [goal.xy.tolist(), None if goal.polygon is None else goal.polygon.tolist()] for goal in self.goals
            ],
        }
        return json.dumps(head).encode()

    def set_state(self, data):
        """Take back what `state` gave."""
        start = 8 + int.from_bytes(data[:8], "little")
        head = json.loads(data[8:start])
        for raster in self._painted():
            end = start + raster.nbytes
            raster[:] = np.frombuffer(data[start:end], raster.dtype).reshape(raster.shape)
            start = end
        self.reach = head["reach"]
        pairs = zip(head["barriers"], head["heights"], strict=True)
        self.barriers = [Barrier(np.array(polygon), *rest, *heights) for (polygon, *rest), heights in pairs]
        self.overhead = [Barrier(np.array(polygon), *rest) for polygon, *rest in head["overhead"]]
        self.glides = [Glide(name, np.array(by), left) for name, by, left in head["glides"]]
        self.moved = head["moved"]
        for goal, (xy, polygon) in zip(self.goals, head["goals"], strict=True):
            goal.xy, goal.polygon = np.array(xy), None if polygon is None else np.array(polygon)
        self.rebuild()


def _in_all_images(solids, wrap):
    """Solids of a periodic map and their copies across the seams."""
    shifts = [(dx * wrap[0], dy * wrap[1], 0.0) for dx in (0, -1, 1) for dy in (0, -1, 1)]
    return [solid.moved(shift) for shift in shifts for solid in solids]


def outline_edges(mask):
    """Straight edges around the true cells of a mask, long runs in one piece.

    Parameters
    ----------
    mask : ndarray (ny, nx) bool

    Returns
    -------
    ndarray (k, 4)
        ``x0, y0, x1, y1`` in cells.
    """
    padded = np.pad(mask, 1)
    edges = []
    across = padded[1:, 1:-1] != padded[:-1, 1:-1]  # a horizontal edge below row iy
    for iy, line in enumerate(across):
        edges += [(a, iy, b, iy) for a, b in _runs(line)]
    along = padded[1:-1, 1:] != padded[1:-1, :-1]
    for ix, line in enumerate(along.T):
        edges += [(ix, a, ix, b) for a, b in _runs(line)]
    return np.array(edges, float).reshape(-1, 4)


def _runs(line):
    """(first, after last) of every run of true."""
    steps = np.flatnonzero(np.diff(np.pad(line.astype(np.int8), 1)))
    return zip(steps[::2], steps[1::2], strict=True)


def _across_seam(edges, owner, wrap, reach):
    """Edges and their copies just across the seams of a periodic map."""
    out, owners = [], []
    for dx in (-wrap[0], 0.0, wrap[0]):
        for dy in (-wrap[1], 0.0, wrap[1]):
            moved = edges + (dx, dy, dx, dy)
            low, high = np.minimum(moved[:, :2], moved[:, 2:]), np.maximum(moved[:, :2], moved[:, 2:])
            near = ((high > -reach) & (low < np.array(wrap) + reach)).all(1)
            out.append(moved[near])
            owners.append(owner[near])
    return np.concatenate(out), np.concatenate(owners)
