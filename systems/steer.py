"""STEER: one call of a model per brush in use; while two brushes blend, both are called."""

from __future__ import annotations

import numpy as np
from flockbrush.behaviours.behaviour import Air, BySlot, FlockBySlot, Scene, Wishes, frozen, read_only
from flockbrush.behaviours.models.line_formation import InFormation
from flockbrush.components import (
    Airborne,
    Alarm,
    Body,
    BrushBinding,
    Destination,
    Family,
    FormationPlace,
    Ground,
    Heading,
    Leading,
    Memory,
    Migration,
    Position,
    Role,
    Species,
    Speed,
    Thrust,
    Transit,
    Urge,
    Velocity,
    Wish,
)
from flockbrush.components.agent import BY_ACCELERATION, BY_HEADING, BY_VELOCITY, NOWHERE, POINT
from flockbrush.engine.clock import Clock
from flockbrush.engine.noise import Noise
from flockbrush.engine.parallel import over_rows
from flockbrush.engine.plugins import PluginError, file_of
from flockbrush.engine.problems import Problem
from flockbrush.engine.schedule import Stage, System
from flockbrush.engine.seam import short_way
from flockbrush.systems.allocation import (
    allocate,
    allocated_shares,
    bodies_of,
    dangers_of,
    drives_by_rows,
    kin,
    relations_of,
    with_wishes,
)
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.foresight import Ahead
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.noticing import Noticed
from flockbrush.systems.palette import Palette
from flockbrush.systems.senses import Near, ObstaclesInSight, Sight, SightInSpace
from flockbrush.systems.space import birds_of
from numba import njit

NOT_MADE = None, None, None  # lists that no model needs


class AskModels(System):
    """Calls each model for the wishes of its animals."""

    stage = Stage.STEER
    reads = (
        Position, Velocity, Heading, Body, Species, Role, BrushBinding, Speed, Ground, Memory, Airborne, Migration,
        Destination, FormationPlace, Family, Transit, Leading, Near, Sight, SightInSpace, ObstaclesInSight, Ahead,
        Landscape, Palette, Clock, Noise, Noticed, SpeciesList, Alarm,
    )  # fmt: skip
    writes = (Wish, Thrust, Urge)

    def process(self, world):
        if not len(world.agents):
            return
        scene = scene_of(world, lists=not _all_by_slot(world))
        scene = self.ask_models(world, scene)
        self.ask_drives(world, scene)

    def ask_models(self, world, scene):
        """Write the wishes of the models into the columns; returns the scene, for the drives."""
        agents, palette = world.agents, world.resource(Palette)
        binding = agents[BrushBinding.brush]
        blend = agents[BrushBinding.blend]
        direction, pace = agents[Wish.direction], agents[Wish.pace]
        for index, rows in _by_brush(binding[scene.order], scene.order):
            wishes = self._ask(world, scene, palette, index, rows)
            wished = (np.ascontiguousarray(some, float) for some in (wishes.direction, wishes.pace))
            over_rows(_put, len(rows), rows, *wished, direction, pace)
            if palette.flies[index]:
                _take(agents, rows, wishes)
        changing = scene.order[blend[scene.order] < 1.0]
        if len(changing):
            before = agents[BrushBinding.previous]
            for index, rows in _by_brush(before[changing], changing):
                was = self._ask(world, scene, palette, index, rows)
                over_rows(_mix, len(rows), rows, blend, was.direction, was.pace, direction, pace)
                if was.acceleration is not None:
                    over_rows(_mix_thrust, len(rows), rows, blend, was.acceleration, *_thrust(agents))
        return with_wishes(world, scene)

    @staticmethod
    def ask_drives(world, scene):
        """Apply drives on top of the wishes of the models."""
        binding, share = world.agents[BrushBinding.brush], world.agents[Urge.share]
        if share.any():
            share[:] = 0.0
        if scene.bodies is None:
            return
        for index, rows in _by_brush(binding[scene.order], scene.order):
            for some, drives in drives_by_rows(world, index, rows):
                taken = allocated_shares(scene, some, drives)
                if taken is not None:
                    allocate(world, scene, taken)

    @staticmethod
    def _ask(world, scene, palette, index, rows):
        model, brush = palette.models[index], palette.brushes[index]
        with model.blaming():
            wishes = model.steer(scene, rows, brush.params)
            _check(model, wishes, len(rows))
            said = (wishes.direction, wishes.pace, wishes.acceleration, wishes.velocity)
            finite = [np.isfinite(some) for some in said if some is not None]
            if not all(some.all() for some in finite):
                fine = np.all([some.reshape(len(rows), -1).all(1) for some in finite], axis=0)
                entity = int(scene.ids[rows[np.argmin(fine)]])
                text = f"model {model.name!r} (brush {brush.name!r}) gave a wish that is not finite"
                text += f", for entity {entity} in tick {scene.tick}"
                raise PluginError([Problem(file_of(model.steer.__module__), None, None, text)])
        return wishes


def _check(model, wishes, k):
    """Raise TypeError or ValueError, with the name of the model, where it returned what no row can take."""
    if not isinstance(wishes, Wishes):
        raise TypeError(f"model {model.name!r} must return Wishes, got {type(wishes).__name__}")
    shapes = np.shape(wishes.direction), np.shape(wishes.pace)
    if shapes != ((k, 3), (k,)):
        raise ValueError(
            f"model {model.name!r} was asked for {k} animals: directions must be ({k}, 3) and paces ({k},), "
            f"got {shapes[0]} and {shapes[1]}"
        )
    for name, vectors in (("accelerations", wishes.acceleration), ("velocities", wishes.velocity)):
        if vectors is not None and np.shape(vectors) != (k, 3):
            raise ValueError(
                f"model {model.name!r} was asked for {k} animals: {name} must be ({k}, 3), got {np.shape(vectors)}"
            )


def _thrust(agents):
    return agents[Thrust.kind], agents[Thrust.acceleration]


def _take(agents, rows, wishes):
    """Write the wishes of a model in the air into the columns."""
    kind = agents[Thrust.kind]
    if wishes.velocity is not None:
        kind[rows], agents[Thrust.velocity][rows] = BY_VELOCITY, wishes.velocity
    elif wishes.acceleration is not None:
        kind[rows], agents[Thrust.acceleration][rows] = BY_ACCELERATION, wishes.acceleration
    else:
        kind[rows] = BY_HEADING


def _by_brush(brush, rows):
    """(index, rows) of every brush in use; ``brush[k]`` is the one of ``rows[k]``."""
    present = np.flatnonzero(np.bincount(brush)).tolist()
    return [(index, rows[brush == index]) for index in present]


def _all_by_slot(world):
    """Whether every model in this world takes its neighbours by slot."""
    agents, palette = world.agents, world.resource(Palette)
    if palette.by_slot.all():
        return True
    brush, before, blend = (
        agents[column] for column in (BrushBinding.brush, BrushBinding.previous, BrushBinding.blend)
    )
    return bool(palette.by_slot[brush].all() and (palette.by_slot[before] | (blend >= 1.0)).all())


def scene_of(world, lists=True):
    """The scene that models see: read-only views of the columns.

    Without ``lists`` the lists of neighbours by row are left out, unless drives or birds on the ground need them.
    """
    agents, clock = world.agents, world.resource(Clock)
    noise, palette = world.resource(Noise), world.resource(Palette)
    obstacles, sight = world.resource(ObstaclesInSight), world.resource(Sight)
    cells, species = sight.by_slot.cells, kin(world)
    bodies = bodies_of(world, agents[Speed.drawn])
    near = world.resource(Near)
    landed = near.aloft is None and palette.flies.any()  # birds that have just landed fly by the lists of walkers
    lists = lists or landed or bodies is not None
    first, others, offset = sight.lists if lists else NOT_MADE
    xyz = agents[Position.xyz]
    order, air = cells.row[~cells.ghost], None
    if near.aloft is not None:
        order = np.concatenate([order, near.space.order])
        air = frozen(Air(*_air_of(world, xyz, near, lists), _flock_by_slot(world, species)))
    scene = Scene(
        clock.dt,
        clock.tick,
        lambda stream, tick=clock.tick: noise.key(stream, tick),
        agents.ids,
        xyz,
        agents[Velocity.xyz],
        agents[Heading.forward],
        agents[Speed.drawn],
        agents[Speed.effort],
        agents[Body.length],
        agents[Role.leader],
        species,
        palette.danger[agents[BrushBinding.brush]],
        first,
        others,
        offset,
        obstacles.first,
        obstacles.offset,
        agents[Ground.guidance],
        agents[Ground.slope],
        short_way(agents[Memory.herd] - xyz[:, :2], world.resource(Landscape).wrap),
        agents[Memory.known],
        order,
        air,
        _formation_of(agents, palette),
        relations_of(world),
        _noticed(world),
        bodies,
        _by_slot(sight.by_slot, species),
        world.resource(Landscape).heights.wrap,
        lambda name: read_only(world.resource(Landscape).ground_at(name, xyz)),
    )
    return frozen(scene)


def _by_slot(found, species):
    cells = found.cells
    return frozen(BySlot(
        cells.slot, found.begin, found.count, found.seen, cells.x, cells.y, cells.fx, cells.fy, species[cells.row]
    ))  # fmt: skip


def _flock_by_slot(world, species):
    """The state of other birds, by slot."""
    found, velocity = world.resource(SightInSpace).by_slot, world.agents[Velocity.xyz]
    return frozen(FlockBySlot(
        found.cells.slot, found.begin, found.count, found.seen, birds_of(found.cells, velocity, species)
    ))  # fmt: skip


def _noticed(world):
    lists = world.resource(Noticed).lists
    return None if lists is None else frozen(lists)


def _formation_of(agents, palette):
    """The state of birds in line formation; None if there are none."""
    if not palette.formation.any():
        return None
    ids, entity = agents.ids, agents[FormationPlace.reference]
    row = np.minimum(np.searchsorted(ids, entity), len(ids) - 1)
    known = InFormation(
        np.where(ids[row] == entity, row, -1), agents[FormationPlace.place], agents[FormationPlace.offset],
        agents[FormationPlace.track], agents[FormationPlace.climb], agents[FormationPlace.wind],
        agents[FormationPlace.felt],
    )  # fmt: skip
    return frozen(known)


def _air_of(world, xyz, near, lists):
    """The columns of `Air`, but for neighbours by slot."""
    agents, land, ahead = world.agents, world.resource(Landscape), world.resource(Ahead)
    bound, target = agents[Migration.kind], agents[Migration.target]
    if (bound == POINT).any() or land.goals:
        target, bound = target.copy(), bound.copy()
        if land.goals:  # a bird without a target of its own flies to its goal at its present height
            goal = agents[Destination.goal]
            heads = near.aloft & (bound == NOWHERE) & (goal >= 0)
            target[heads, :2] = np.array([g.xy for g in land.goals])[goal[heads]]
            target[heads, 2] = xyz[heads, 2]
            bound[heads] = POINT
        points = bound == POINT
        target[points] -= xyz[points]
        target[points, :2] = short_way(target[points, :2], land.wrap)
    return (
        *(world.resource(SightInSpace).lists if lists else NOT_MADE), agents[Airborne.up], ahead.hit, ahead.aim,
        ahead.gap, ahead.normal, ahead.height, bound, target, *dangers_of(world),
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _put(lo, hi, rows, wished, wanted, direction, pace):
    for k in range(lo, hi):
        i = rows[k]
        direction[i, 0], direction[i, 1], direction[i, 2] = wished[k, 0], wished[k, 1], wished[k, 2]
        pace[i] = wanted[k]


@njit(cache=True, nogil=True, error_model="numpy")
def _mix_thrust(lo, hi, rows, blend, was, kind, acceleration):
    """As `_mix`, where both brushes wish an acceleration."""
    for k in range(lo, hi):
        i = rows[k]
        b = blend[i]
        w = b * b * (3.0 - 2.0 * b)
        if kind[i] == BY_ACCELERATION:
            for c in range(3):
                acceleration[i, c] = (1.0 - w) * was[k, c] + w * acceleration[i, c]


@njit(cache=True, nogil=True, error_model="numpy")
def _mix(lo, hi, rows, blend, was_direction, was_pace, direction, pace):
    """Interpolate from the previous brush's wish to the present one's, smoothly at both ends."""
    for k in range(lo, hi):
        i = rows[k]
        b = blend[i]
        w = b * b * (3.0 - 2.0 * b)
        for c in range(3):
            direction[i, c] = (1.0 - w) * was_direction[k, c] + w * direction[i, c]
        size = np.sqrt(direction[i, 0] ** 2 + direction[i, 1] ** 2 + direction[i, 2] ** 2)
        if size > 1e-9:
            for c in range(3):
                direction[i, c] /= size
        else:
            for c in range(3):
                direction[i, c] = was_direction[k, c]
        pace[i] = (1.0 - w) * was_pace[k] + w * pace[i]
