"""Why an animal turns: the reasons of one animal in the tick to come, for designers who ask.

The animal and those around it are copied into a small world of their own, and go through the very systems of the tick
up to the models; nothing of the running world changes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from components import Body, BrushBinding, Heading, Position, ReferenceBird, Role, Speed, Velocity, Vision, Wish
from engine.clock import Clock
from engine.noise import Noise
from engine.world import World
from systems.decide import Roles
from systems.foresight import Ahead, SeeAhead
from systems.ground import Underfoot
from systems.landscape import Landscape
from systems.palette import Palette
from systems.senses import (
    FindNeighbours,
    Near,
    ObstaclesInSight,
    See,
    SeeByHiddenPoints,
    SeeInSpace,
    SeeObstacles,
    Sight,
    SightByHiddenPoints,
    SightInSpace,
)
from systems.steer import Steer, scene_of

SHARED = (Clock, Noise, Landscape, Palette)


@dataclass(frozen=True)
class Explanation:
    """What one animal perceives and wants, in the tick to come.

    Attributes
    ----------
    entity : int
    terms : list of (str, ndarray (2,))
        What each reason adds; together they point along `result`.  "heading" is that it goes on as it does; the
        others are what turns it.  Empty when the model does not explain itself.
    result : ndarray (2,)
        Unit vector: the way it wants to face.
    pace : float
        Times the brush's speed.
    sees : list of int
        Entities it sees.
    offsets : ndarray (k, 2)
        Where those are from it, m; across the seam of a wrapped map where that is shorter.
    reference : int
        The animal it keeps its place by, 0 for none.
    leader : bool
    numbers : dict of str to (float, str)
        What else there is to know, with units.
    """

    entity: int
    xy: np.ndarray  # (2,) m
    forward: np.ndarray  # (2,)
    terms: list
    result: np.ndarray
    pace: float
    sees: list
    offsets: np.ndarray
    reference: int
    leader: bool
    brush: str
    previous: str  # the brush it comes from while two blend, or ""
    view_range: float  # m
    field_of_view: float  # rad
    obstacles: np.ndarray  # (m, 2) m, from it to the nearest point of each obstacle in reach
    numbers: dict = field(default_factory=dict)

    @property
    def turn(self):
        """Radians it wants to turn by, counter-clockwise."""
        (fx, fy), (wx, wy) = self.forward, self.result
        return float(np.arctan2(fx * wy - fy * wx, fx * wx + fy * wy))


def explain(world, entity) -> Explanation:
    """Why this animal will turn as it does.

    Raises
    ------
    KeyError
        When it is not alive.
    """
    row = world.agents.row(entity)
    small = _surroundings(world, row)
    try:
        return _explained(small, entity)
    finally:
        small.close()


def _surroundings(world, row):
    """A world of one animal, those it may see, and those they may see, and predators, after what perceives."""
    agents, land = world.agents, world.resource(Landscape)
    xy = agents[Position.xyz][:, :2]
    away = xy - xy[row]
    if land.wrap is not None:
        away -= np.round(away / land.wrap) * land.wrap
    palette = world.resource(Palette)
    sight = float((palette.view_range.max() * agents[Body.length].max()) if len(palette) else 0.0)
    size = float((agents[Body.axis] + agents[Body.radius]).max())
    sight = max(sight, float(agents[Vision.range].max()), 3.0 * size)
    near = np.hypot(*away.T) <= 2.0 * (sight + size)
    if len(palette):  # those in the air know of predators wherever they are
        near |= palette.danger.astype(bool)[agents[BrushBinding.brush]]
    rows = np.flatnonzero(near)
    small = World(agents.kinds, max(len(rows), 1))
    columns = {column: values[: len(agents)][rows] for column, values in agents.arrays.items()}
    small.become(agents.ids[rows], columns, (), int(agents.ids[-1]) + 1)
    for kind in SHARED:
        small.insert(world.resource(kind))
    for resource in (Near(), Sight(), SightByHiddenPoints(), ObstaclesInSight(), SightInSpace(), Ahead()):
        small.insert(resource)
    perceive = (See(), SeeByHiddenPoints(), SeeObstacles(), SeeInSpace(), SeeAhead())
    for system in (Underfoot(), FindNeighbours(), *perceive, Roles(), Steer()):
        system.process(small)
    return small


def _explained(small, entity):
    agents, palette = small.agents, small.resource(Palette)
    row, scene = agents.row(entity), scene_of(small)
    brush, previous, blend = (
        agents[column][row] for column in (BrushBinding.brush, BrushBinding.previous, BrushBinding.blend)
    )
    lists, walls = small.resource(Sight).lists, small.resource(ObstaclesInSight)
    if palette.flies[brush] and scene.air is not None:
        lists = scene.air
    seen = slice(lists.first[row], lists.first[row + 1])
    return Explanation(
        entity=int(entity),
        xy=agents[Position.xyz][row, :2].copy(),
        forward=agents[Heading.forward][row, :2].copy(),
        terms=list(_blended(palette, scene, row, brush, previous, blend).items()),
        result=agents[Wish.direction][row, :2].copy(),
        pace=float(agents[Wish.pace][row]),
        sees=agents.ids[lists.near[seen]].tolist(),
        offsets=lists.offset[seen, :2].copy(),
        reference=int(agents[ReferenceBird.entity][row]),
        leader=bool(agents[Role.leader][row]),
        brush=palette.names[brush],
        previous=palette.names[previous] if blend < 1.0 else "",
        view_range=float(agents[Vision.range][row]),
        field_of_view=float(agents[Vision.field_of_view][row]),
        obstacles=walls.offset[walls.first[row] : walls.first[row + 1]].copy(),
        numbers=_numbers(agents, row),
    )


def _blended(palette, scene, row, brush, previous, blend):
    """The reasons of the brush, mixed with those of the one before while two blend; {} where one has none to give."""
    asked = [brush] if blend >= 1.0 else [previous, brush]
    answers = []
    for index in asked:
        model = palette.models[index]
        if model.explain is None:
            return {}
        answers.append(model.explain(scene, row, palette.brushes[index].params))
    if len(answers) == 1:
        return answers[0]
    weight = blend * blend * (3.0 - 2.0 * blend)  # as `systems.steer` mixes
    mixed: dict = {}
    for reasons, share in zip(answers, (1.0 - weight, weight), strict=True):
        size = max(float(np.hypot(*sum(reasons.values()))), 1e-12)
        for name, vector in reasons.items():
            mixed[name] = mixed.get(name, 0.0) + share / size * vector
    return mixed


def _numbers(agents, row):
    """What a designer asks for beside the picture: {name: (value, unit)}."""
    return {
        "speed": (float(np.hypot(*agents[Velocity.xyz][row, :2])), "m/s"),
        "speed wanted": (float(agents[Speed.target][row]), "m/s"),
        "body length": (float(agents[Body.length][row]), "m"),
        "blend": (float(agents[BrushBinding.blend][row]), ""),
    }
