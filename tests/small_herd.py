"""Herds small enough to draw: brushes, levels and animals of a few lines, and the oracles they are checked against."""

import datetime

import flockbrush.systems.commands  # noqa: F401  the commands a level's script may give
import numpy as np
from flockbrush.behaviours.brush import BodySpec, Brush, Provenance, SpeedSpec, VisionSpec
from flockbrush.components import (
    Airborne,
    Body,
    BrushBinding,
    Destination,
    Heading,
    Position,
    Species,
    Speed,
    Velocity,
    Vision,
)
from flockbrush.engine.solids import CYLINDER, SPHERE
from flockbrush.levels.build import build
from flockbrush.levels.schema import Level, Obstacle, Spawn
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList

PROVENANCE = Provenance(kind="hand-set", source="a test", date=datetime.date(2026, 1, 1), by="a test")
NOBODY_LEADS = {"leader_neighbours": -1}
NO_FORCES = {"avoidance_weight": 0.0, "cohesion_weight": 0.0, "alignment_weight": 0.0, "obstacle_weight": 0.0}


def brush(name="walk", model="herd", mean=1.0, body=None, vision=None, transition=0.5, speed=None, **parameters):
    """A brush of one's own; by default everybody walks one body length a second, without chance."""
    return Brush(
        name=name,
        model=model,
        parameters=parameters,
        speed=SpeedSpec(mean=mean, **(speed or {})),
        body=BodySpec(**(body or {})),
        vision=VisionSpec(**(vision or {})),
        transition=transition,
        provenance=PROVENANCE,
    )


def straight(name="straight", mean=1.0, **parameters):
    """A brush under which everybody keeps going the way it faces."""
    return brush(name, mean=mean, **{**NO_FORCES, "unled": "keep", "slope_aversion": 0.0, **parameters})


class Shelf:
    """A library of the brushes a test has made."""

    def __init__(self, *brushes):
        self.brushes = {b.name: b for b in brushes}

    def get(self, name):
        return self.brushes[name]


def box(x0, y0, x1, y1):
    """A rectangle as a polygon, counter-clockwise, m."""
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], float)


def obstacle(polygon, name="rock", blocks_view=True, margin=0.0):
    return Obstacle(1, name, np.array(polygon, float), True, blocks_view, margin, 0.0, 1000.0, "box")


def spawn(polygon, brush, count, heading=0.0, species="animal", id=1, name="", start=0.0, rate=0.0, **more):
    values = {"speed": None, "altitude": 0.0, "formation": "scatter"} | more
    return Spawn(id, name, polygon, species, brush, count, heading, start=start, rate=rate, **values)


def level(width=40.0, height=40.0, boundary="open", cell=1.0, seed=1, **things):
    return Level("test", "test.tmj", float(width), float(height), cell, boundary, seed, **things)


def meadow(*brushes, seed=None, shuffle_seed=None, **things):
    """A simulation on open ground, or on what the keywords say (see `level`), with these brushes at hand."""
    ground = level(**things)
    named = [spawn(box(0, 0, 1, 1), b.name, 0, id=1000 + k) for k, b in enumerate(brushes)]
    ground.spawns = [*ground.spawns, *named]  # spawns of nobody: the palette knows their brushes
    return build(ground, seed, library=Shelf(*brushes), shuffle_seed=shuffle_seed)


def put(simulation, xy, heading=0.0, brush=0, species="animal", speed=None, length=None):
    """Animals exactly here; ``heading`` in radians, one for all or one each.  Their entities."""
    world = simulation.world
    palette = world.resource(Palette)
    index = palette.named(brush) if isinstance(brush, str) else brush
    asset = palette.brushes[index]
    size = asset.body.length if length is None else length
    radius = asset.body.radius * size / asset.body.length
    xy = np.atleast_2d(np.asarray(xy, float))
    n = len(xy)
    heading = np.broadcast_to(np.asarray(heading, float), n)
    forward = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(n)])
    drawn = asset.speed.mean * size if speed is None else speed
    world.resource(Landscape).see_to(float(size * palette.view_range.max()))
    return world.create_agents(
        n,
        {
            Position.xyz: np.column_stack([xy, np.zeros(n)]),
            Velocity.xyz: forward * drawn,
            Heading.forward: forward,
            Body.length: size,
            Body.radius: radius,
            Body.axis: 0.0 if asset.body.contact == "disc" else max(0.5 * size - radius, 0.0),
            Species.index: world.resource(SpeciesList).index(species),
            Vision.range: asset.vision.range * size,
            Vision.field_of_view: np.radians(asset.vision.field_of_view),
            BrushBinding.brush: index,
            BrushBinding.previous: index,
            BrushBinding.home: index,
            Speed.drawn: drawn,
            Speed.target: drawn,
            Destination.goal: 0 if world.resource(Landscape).goals else -1,
        },
    )


def xy_of(simulation):
    """(n, 2) m, a copy."""
    return simulation.agents[Position.xyz][:, :2].copy()


def forward_of(simulation):
    """(n, 2), a copy."""
    return simulation.agents[Heading.forward][:, :2].copy()


# oracles -----------------------------------------------------------------------


def point_to_segment(p, a, b):
    """Distance of points to segments, all (k, 2)."""
    along = b - a
    square = np.maximum((along**2).sum(1), 1e-300)
    t = np.clip(((p - a) * along).sum(1) / square, 0, 1)
    return np.hypot(*(a + t[:, None] * along - p).T)


def cross(a, b):
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def segment_distance(a, b, c, d):
    """Distance of segments a-b and c-d, all (k, 2): the nearest of four ends, or 0 where they cross."""
    ends = np.min(
        [point_to_segment(a, c, d), point_to_segment(b, c, d), point_to_segment(c, a, b), point_to_segment(d, a, b)], 0
    )
    crossing = (cross(b - a, c - a) * cross(b - a, d - a) < 0) & (cross(d - c, a - c) * cross(d - c, b - c) < 0)
    return np.where(crossing, 0.0, ends)


def axes(xy, forward, half):
    """Both ends of the axes of capsules, (n, 2) each."""
    reach = np.asarray(forward)[:, :2] * np.asarray(half)[:, None]
    return xy - reach, xy + reach


def gaps(xy, forward, half, radius):
    """(pairs,) m between any two bodies: negative where they overlap."""
    a, b = axes(xy, forward, half)
    i, j = np.triu_indices(len(xy), 1)
    return segment_distance(a[i], b[i], a[j], b[j]) - radius[i] - radius[j]


def wall_gaps(xy, forward, half, radius, edges):
    """(n, edges) m between bodies and edges (k, 4)."""
    a, b = axes(xy, forward, half)
    n, edges = len(xy), np.asarray(edges, float)
    i, e = np.divmod(np.arange(n * len(edges)), len(edges))
    return (segment_distance(a[i], b[i], edges[e, :2], edges[e, 2:]) - radius[i]).reshape(n, -1)


def gaps_of(simulation, who=slice(None)):
    """`gaps` of all animals of a world, or of some."""
    agents = simulation.agents
    return gaps(
        xy_of(simulation)[who], forward_of(simulation)[who], agents[Body.axis][who], agents[Body.radius][who]
    )  # fmt: skip


# in the air -----------------------------------------------------------------------

STARLING = {
    "mean": 45.0,
    "body": {"length": 0.2, "radius": 0.04, "contact": "disc"},
    "vision": {"range": 40.0, "field_of_view": 300.0, "occlusion": False},
}


def boids(name="boids", mean=45.0, model="boids", speed=None, **parameters):
    """A brush of starlings; ``mean`` in body lengths of .2 m a second."""
    return brush(name, model, **{**STARLING, "mean": mean}, speed=speed, **parameters)


def put_aloft(simulation, xyz, forward=(1.0, 0.0, 0.0), **more):
    """Birds exactly here, heading exactly there.  Their entities."""
    xyz = np.atleast_2d(np.asarray(xyz, float))
    forward = np.broadcast_to(np.asarray(forward, float), xyz.shape)
    forward = forward / np.linalg.norm(forward, axis=1, keepdims=True)
    entities = put(simulation, xyz[:, :2], **more)
    agents = simulation.agents
    rows = [agents.row(entity) for entity in entities]
    agents[Position.xyz][rows] = xyz
    agents[Heading.forward][rows] = forward
    agents[Velocity.xyz][rows] = forward * agents[Speed.drawn][rows][:, None]
    up = np.array([0.0, 0.0, 1.0]) - forward[:, 2:] * forward
    agents[Airborne.up][rows] = up / np.linalg.norm(up, axis=1, keepdims=True)
    return entities


def gaps_to_solid(solids, k, xyz):
    """(n,) m from points (n, 3) to the nearest face of a solid, less than 0 inside: the kernels' oracle."""
    away = xyz - solids.centre[k]
    if solids.kind[k] == SPHERE:
        return np.linalg.norm(away, axis=1) - solids.radius[k]
    if solids.kind[k] == CYLINDER:
        along = away @ solids.axis[k]
        aside = np.linalg.norm(away - along[:, None] * solids.axis[k], axis=1)
        return np.maximum(aside - solids.radius[k], np.abs(along) - solids.half[k])
    faces = solids.face[solids.face_first[k] : solids.face_first[k + 1]]
    return (xyz @ faces[:, :3].T - faces[:, 3]).max(axis=1)


def room_in_the_air(simulation, ground=True):
    """(n,) m between each animal and the nearest solid, or the ground, were it a bird."""
    agents, land = simulation.agents, simulation.world.resource(Landscape)
    xyz = agents[Position.xyz]
    room = xyz[:, 2] - [land.ground(xy) for xy in xyz[:, :2]] if ground else np.full(len(xyz), np.inf)
    for k in range(len(land.sky.kind)):
        room = np.minimum(room, gaps_to_solid(land.sky, k, xyz))
    return room - agents[Body.radius]
