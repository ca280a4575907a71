"""NEAR and SENSE: who is near, who and what is visible."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from flockbrush.components import Body, BrushBinding, Heading, Position, Species, Speed, Vision
from flockbrush.engine.clock import Clock
from flockbrush.engine.maths import sincos_
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.schedule import Stage, System
from flockbrush.engine.scratch import Scratch
from flockbrush.systems.contact import edge_segment_, edges_near
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.grid import Cells, sort_into_cells
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.perception import filtered_by_slot, filters_neighbours, merge_by_row
from flockbrush.systems.space import EyesInSpace, Space, sort_in_space, visible_in_space
from flockbrush.systems.visibility import Lists, VisibleBySlot, lists_of, look_around
from numba import njit


@dataclass
class Near:
    """The herd by cell, as of the start of the tick."""

    cells: Cells | None = None  # of those on the ground
    ghosts: float = np.inf  # m, how far across the seam of a wrapped map there are copies
    aloft: np.ndarray | None = None  # (n,) bool; None when all are on the ground
    space: Space | None = None  # of those in the air

    def trace(self):
        """Arrays by which replays are compared (`flockbrush.engine.trail`)."""
        sorted_herds = (*(self.cells or ()), *((self.space or ()) if self.aloft is not None else ()))
        return [array for array in sorted_herds if isinstance(array, np.ndarray)]


@dataclass
class _Seen:
    by_slot: VisibleBySlot | None = None  # in the order of cells
    _lists: Lists | None = field(default=None, repr=False)

    @property
    def lists(self) -> Lists | None:
        """By row; made on request, because the herd model and boids do without."""
        if self._lists is None and self.by_slot is not None:
            self._lists = lists_of(self.by_slot)
        return self._lists

    def show(self, found):
        """Replace the neighbours by those of this tick."""
        self.by_slot, self._lists = found, None

    def trace(self):
        """Arrays by which replays are compared (`flockbrush.engine.trail`)."""
        return self.lists or ()


@dataclass
class Sight(_Seen):
    """Visible neighbours of every animal on the ground: what any model can use."""


@dataclass
class SightInSpace(_Seen):
    """Visible neighbours of animals in the air, with offsets (m, 3); None if there are none."""

    scratch: Scratch = field(default_factory=Scratch)


@dataclass
class ObstaclesInSight:
    """The nearest point of every solid obstacle within an animal's range."""

    first: np.ndarray = field(default_factory=lambda: np.zeros(1, np.int64))
    offset: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))  # m, from the observer

    def trace(self):
        """Arrays by which replays are compared (`flockbrush.engine.trail`)."""
        return self.first, self.offset


class FindNeighbours(System):
    """Sort the herd into cells: those on the ground on a plane, those in the air in space."""

    stage = Stage.NEAR
    reads = (Position, Heading, Body, Vision, Speed, BrushBinding, Palette, Landscape, Clock)
    writes = (Near,)

    def process(self, world):
        agents, land, near = world.agents, world.resource(Landscape), world.resource(Near)
        near.aloft = world.resource(Palette).aloft(agents[BrushBinding.brush])
        rows, walkers = None, slice(None)
        if near.aloft is not None:
            flyers = np.flatnonzero(near.aloft)
            rows = walkers = np.flatnonzero(~near.aloft).astype(np.int32)
            reach = float(agents[Vision.range][flyers].max())
            near.space = sort_in_space(agents[Position.xyz], agents[Heading.forward], flyers, reach, land.wrap)
        size = agents[Body.axis] + agents[Body.radius]
        reach = float(agents[Vision.range][walkers].max(initial=0.0)) or 1.0
        if land.wrap and len(agents):  # bodies that touch across the seam are seen too, at twice the speed
            ahead = 8.0 * world.resource(Clock).dt * float(agents[Speed.target][walkers].max(initial=0.0))
            reach = max(reach, 3.0 * float(size[walkers].max(initial=0.0)) + ahead)
        near.ghosts = reach if land.wrap else np.inf
        near.cells = sort_into_cells(
            agents[Position.xyz], agents[Heading.forward], 2 * size, agents[Body.radius], reach, land.wrap, rows
        )


class See(System):
    """Field of view, range and line of sight."""

    stage = Stage.SENSE
    reads = (Near, Vision, BrushBinding, Palette, Landscape, Species, SpeciesList)
    writes = (Sight,)
    width = 64  # room for each list: of memory, not of the state

    def process(self, world):
        agents, land, palette = world.agents, world.resource(Landscape), world.resource(Palette)
        near, n = world.resource(Near), len(agents)
        world.resource(Sight).show(None)  # room for the lists to come
        binding = agents[BrushBinding.brush]
        if near.aloft is not None:
            binding = binding[~near.aloft]
            if not len(binding):
                none = np.zeros(0, np.int64)
                world.resource(Sight).show(
                    VisibleBySlot(near.cells, none.astype(np.int32), none, np.zeros(n, np.int64))
                )
                return
        cosine = np.empty(n)
        over_rows(cosine_of_half_kernel, n, agents[Vision.field_of_view], cosine)
        through = palette.sees_through[binding]
        look = near.cells, agents[Vision.range], cosine, land.opaque
        found = look_around(*look, not (n and through.all()), self.width)
        self.width = max(32, 16 + 3 * int(found.count.sum()) // max(2 * len(near.cells.x), 1))
        if palette.bodiless[binding].any() and not through.all():  # each as its own brush says
            everybody = look_around(*look, False, self.width)
            found = merge_by_row(palette.bodiless[agents[BrushBinding.brush]], everybody, found)
        world.resource(Sight).show(filtered_by_slot(world, found) if filters_neighbours(world) else found)


class SeeInSpace(System):
    """Range, field of view and line of sight for those in the air, in three dimensions."""

    stage = Stage.SENSE
    reads = (Near, Body, Vision, BrushBinding, Palette, Landscape, Species, SpeciesList)
    writes = (SightInSpace,)
    width = 32  # room for each list: of memory, not of the state

    def process(self, world):
        agents, palette, near = world.agents, world.resource(Palette), world.resource(Near)
        sight = world.resource(SightInSpace)
        sight.show(None)
        if near.aloft is None:
            return
        cosine = np.empty(len(agents))
        over_rows(cosine_of_half_kernel, len(agents), agents[Vision.field_of_view], cosine)
        through = palette.sees_through[agents[BrushBinding.brush]]
        eyes = EyesInSpace(agents[Vision.range], cosine, through, agents[Body.radius])
        solids = world.resource(Landscape).opaque_solids
        found = visible_in_space(near.space, eyes, solids, self.width, sight.scratch)
        self.width = max(32, 16 + 3 * int(found.count.sum()) // max(2 * len(near.space.x), 1))
        sight.show(filtered_by_slot(world, found) if filters_neighbours(world) else found)


class SeeObstacles(System):
    """The nearest point of each obstacle in range."""

    stage, reads, writes = Stage.SENSE, (Near, Position, Vision, Landscape), (ObstaclesInSight,)

    def process(self, world):
        agents, land, seen = world.agents, world.resource(Landscape), world.resource(ObstaclesInSight)
        n = len(agents)
        if not len(land.solid.ends):
            seen.first, seen.offset = np.zeros(n + 1, np.int64), np.zeros((0, 2))
            return
        count, most = np.zeros(n, np.int64), 8
        while True:
            found = np.empty((n, most, 2))
            args = agents[Position.xyz], agents[Vision.range], land.solid, land.solid_owner
            over_rows(nearest_points_kernel, n, *args, found, count)
            if not n or count.max() <= most:
                break
            most = int(count.max())
        seen.first = np.zeros(n + 1, np.int64)
        np.cumsum(count, out=seen.first[1:])
        seen.offset = found[np.arange(most) < count[:, None]]


@njit(cache=True, nogil=True)
def cosine_of_half_kernel(lo, hi, angle, cosine):
    for i in range(lo, hi):
        if angle[i] >= 2.0 * np.pi - 1e-9:
            cosine[i] = -1.0
        else:
            cosine[i] = sincos_(0.5 * angle[i])[1]


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_points_kernel(lo, hi, xyz, reach, edges, owner, found, count):
    most, item = found.shape[1], edges.item
    for i in range(lo, hi):
        x, y = xyz[i, 0], xyz[i, 1]
        e0, e1 = edges_near(x, y, edges)
        n, last, best = 0, -1, 0.0
        px = py = 0.0
        r2 = reach[i] * reach[i]
        for e in range(e0, e1 + 1):
            # edges of one obstacle follow one another
            who = owner[item[e]] if e < e1 else -1
            if who != last:
                if last >= 0 and best < r2:
                    if n < most:
                        found[i, n, 0], found[i, n, 1] = px, py
                    n += 1
                last, best = who, np.inf
            if e < e1:
                cx, cy, ux, uy, half = edge_segment_(edges.ends, item[e])
                t = min(max((x - cx) * ux + (y - cy) * uy, -half), half)
                ox, oy = cx + t * ux - x, cy + t * uy - y
                d2 = ox * ox + oy * oy
                if d2 < best:
                    best, px, py = d2, ox, oy
        count[i] = n
