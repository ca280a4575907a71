"""Why an animal turns: the reasons of one animal in the tick to come, for designers who ask.

The animal and those around it are copied into a small world of their own, and go through the very systems of the tick
up to the models; nothing of the running world changes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from flockbrush.behaviours.behaviour import TAKES_UP
from flockbrush.components import (
    Body,
    BrushBinding,
    Ground,
    Heading,
    Position,
    ReferenceBird,
    Role,
    Species,
    Speed,
    Thrust,
    Velocity,
    Vision,
    Wish,
)
from flockbrush.components.agent import BY_VELOCITY
from flockbrush.engine.clock import Clock
from flockbrush.engine.noise import Noise
from flockbrush.engine.seam import short_way
from flockbrush.engine.world import World
from flockbrush.systems.allocation import allocated_shares, drives_by_rows
from flockbrush.systems.decide import Roles
from flockbrush.systems.fauna import SpeciesList, kinds_of
from flockbrush.systems.foresight import Ahead, SeeAhead, ShiftMigration
from flockbrush.systems.ground import Underfoot
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.noticing import BeAlarmed, Notice, Noticed
from flockbrush.systems.palette import Palette
from flockbrush.systems.program_reports import reason
from flockbrush.systems.programs import Programs
from flockbrush.systems.senses import (
    FindNeighbours,
    Near,
    ObstaclesInSight,
    See,
    SeeInSpace,
    SeeObstacles,
    Sight,
    SightInSpace,
)
from flockbrush.systems.steer import AskModels, scene_of

SHARED = (Clock, Noise, Landscape, Palette, SpeciesList)


@dataclass(frozen=True)
class Explanation:
    """What one animal perceives and wants, in the tick to come."""

    entity: int
    xy: np.ndarray  # (2,) m
    forward: np.ndarray  # (2,)
    # list of (str, (3,)); what each term of its model and each drive adds; together they point along `wish`. "heading"
    # is that it goes on as it does; the others are what turns it.
    reasons: list
    wish: np.ndarray  # (3,); the way it wishes to move: a unit vector
    shares: dict  # of str to float; what part of the body each drive takes, 0 to 1; the model has the rest
    result: np.ndarray  # (2,); unit vector: the way it wants to face
    pace: float  # times the brush's speed
    sees: list  # of int; entities it sees
    offsets: np.ndarray  # (k, 2); where those are from it, m; across the seam of a wrapped map where that is shorter
    reference: int  # the animal it keeps its place by, 0 for none
    leader: bool
    brush: str
    previous: str  # the brush it comes from while two blend, or ""
    view_range: float  # m
    field_of_view: float  # rad
    obstacles: np.ndarray  # (m, 2) m, from it to the nearest point of each obstacle in reach
    numbers: dict = field(default_factory=dict)  # str to (float, str); what else there is to know, with units
    # program, state, why: the program it follows, its state there, and what led to it since when; "" where it follows
    # none
    program: str = ""
    state: str = ""
    why: str = ""

    @property
    def terms(self):
        """The reasons in plan, [(str, (2,))]."""
        return [(name, vector[:2]) for name, vector in self.reasons]

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
    program_reason = reason(world, row) if world.has(Programs) else None
    small = _surroundings(world, row)
    try:
        explained = _explained(small, entity)
    finally:
        small.close()
    return (
        explained
        if program_reason is None
        else replace(explained, program=program_reason[0], state=program_reason[1], why=program_reason[2])
    )


def _surroundings(world, row):
    """A world of one animal, those it may see, and those they may see, and predators, after what perceives."""
    agents, land = world.agents, world.resource(Landscape)
    xy = agents[Position.xyz][:, :2]
    away = short_way(xy - xy[row], land.wrap)
    palette = world.resource(Palette)
    sight = float((palette.view_range.max() * agents[Body.length].max()) if len(palette) else 0.0)
    size = float((agents[Body.axis] + agents[Body.radius]).max())
    sight = max(sight, float(agents[Vision.range].max()), 3.0 * size)
    near = np.hypot(*away.T) <= 2.0 * (sight + size)
    if len(palette):  # animals noticed by their species
        kind = kinds_of(agents[Species.index], palette.danger[agents[BrushBinding.brush]])
        near |= world.resource(SpeciesList).relations.verb[kind[row], kind] > 0
    brush = agents[BrushBinding.brush]
    if palette.exact[brush[row]]:  # its flock is more than those it sees
        near |= (brush == brush[row]) | (agents[Species.index] == agents[Species.index][row])
    rows = np.flatnonzero(near)
    small = World(agents.kinds, max(len(rows), 1))
    columns = {column: values[: len(agents)][rows] for column, values in agents.arrays.items()}
    small.become(agents.ids[rows], columns, (), int(agents.ids[-1]) + 1)
    for kind in SHARED:
        small.insert(world.resource(kind))
    for resource in (Near(), Sight(), ObstaclesInSight(), SightInSpace(), Ahead(), Noticed()):
        small.insert(resource)
    perceive = (See(), SeeObstacles(), SeeInSpace(), SeeAhead(), Notice())
    for system in (Underfoot(), FindNeighbours(), *perceive, ShiftMigration(), Roles(), BeAlarmed()):
        system.process(small)
    return small


def _explained(small, entity):
    agents, palette = small.agents, small.resource(Palette)
    row, steer = agents.row(entity), AskModels()
    scene = steer.ask_models(small, scene_of(small))
    aloft = small.resource(Near).aloft
    aloft = np.zeros(len(agents), bool) if aloft is None else aloft
    own = _own_wish(agents, aloft, scene, row)
    reasons = _reasons(palette, agents, scene, row, own)
    steer.ask_drives(small, scene)
    reasons, shares = _with_drives(small, aloft, scene, row, own, reasons)
    brush, previous, blend = (
        agents[column][row] for column in (BrushBinding.brush, BrushBinding.previous, BrushBinding.blend)
    )
    lists, walls = small.resource(Sight).lists, small.resource(ObstaclesInSight)
    if palette.flies[brush] and scene.air is not None:
        lists = scene.air
    neighbours = slice(lists.first[row], lists.first[row + 1])
    return Explanation(
        entity=int(entity),
        xy=agents[Position.xyz][row, :2].copy(),
        forward=agents[Heading.forward][row, :2].copy(),
        reasons=[(name, vector) for name, vector in reasons.items() if name == "heading" or np.abs(vector).max() > 0.0],
        wish=_unit(_own_wish(agents, aloft, scene, row)),
        shares=shares,
        result=agents[Wish.direction][row, :2].copy(),
        pace=float(agents[Wish.pace][row]),
        sees=agents.ids[lists.near[neighbours]].tolist(),
        offsets=lists.offset[neighbours, :2].copy(),
        reference=int(agents[ReferenceBird.entity][row]),
        leader=bool(agents[Role.leader][row]),
        brush=palette.names[brush],
        previous=palette.names[previous] if blend < 1.0 else "",
        view_range=float(agents[Vision.range][row]),
        field_of_view=float(agents[Vision.field_of_view][row]),
        obstacles=walls.offset[walls.first[row] : walls.first[row + 1]].copy(),
        numbers=_numbers(small, row),
    )


def _own_wish(agents, aloft, scene, row):
    """(3,) what is wished now: a velocity in m/s, or a unit vector where there is no speed."""
    if aloft[row] and agents[Thrust.kind][row] == BY_VELOCITY:
        return agents[Thrust.velocity][row].copy()
    size = float(agents[Wish.pace][row] * scene.speed[row])
    return (size if size > 1e-9 else 1.0) * agents[Wish.direction][row]


def _reasons(palette, agents, scene, row, own):
    """{reason: (3,)} of the model, which add up to its wish: its own ones, or its heading and what it makes of it."""
    brush, previous, blend = (
        agents[column][row] for column in (BrushBinding.brush, BrushBinding.previous, BrushBinding.blend)
    )
    says = palette.exact[brush]  # its velocity is not mixed with another's
    reasons = _blended(palette, scene, row, brush, previous, 1.0 if says else blend)
    if reasons:
        return reasons
    heading = scene.velocity[row].copy() if scene.velocity[row].any() else scene.forward[row].copy()
    return {"heading": heading, palette.brushes[brush].model: own - heading}


def _with_drives(small, aloft, scene, row, own, reasons):
    """The reasons of model and drives together, and the shares of the drives."""
    agents = small.agents
    [(rows, drives)] = drives_by_rows(small, agents[BrushBinding.brush][row], np.array([row], np.int32))
    drive_shares = None if scene.bodies is None else allocated_shares(scene, rows, drives)
    total = 0.0 if drive_shares is None else float(drive_shares.share.sum())
    if drive_shares is None or total <= 0.0:
        return reasons, {}
    velocity, shares = scene.velocity[row], drive_shares.share[:, 0]
    size = np.sqrt((sum(reasons.values()) ** 2).sum())  # models tell directions; drives ask for velocities
    scale = (1.0 - total) * np.sqrt((own**2).sum()) / max(size, 1e-12)
    combined = {name: scale * vector for name, vector in reasons.items()}
    for name, share, wish in zip(drive_shares.names, shares.tolist(), drive_shares.acceleration[:, 0], strict=True):
        combined[name] = combined.get(name, 0.0) + share * (velocity + TAKES_UP * wish)
    total_wish, now = sum(combined.values()), _own_wish(agents, aloft, scene, row)
    if aloft[row] and agents[Thrust.kind][row] == BY_VELOCITY:  # only so far towards it in one tick
        far = np.sqrt(((total_wish - velocity) ** 2).sum())
        part = min(np.sqrt(((now - velocity) ** 2).sum()) / max(far, 1e-12), 1.0)
        combined = {name: part * vector for name, vector in combined.items()}
        combined["heading"] = combined.get("heading", 0.0) + (1.0 - part) * velocity
    return combined, dict(zip(drive_shares.names, shares.tolist(), strict=True))


def _unit(vector):
    return vector / max(float(np.sqrt((vector**2).sum())), 1e-12)


def _blended(palette, scene, row, brush, previous, blend):
    """The reasons of the brush, mixed with those of the one before while two blend; {} where one has none to give."""
    answers = []
    for index in [brush] if blend >= 1.0 else [previous, brush]:
        model = palette.models[index]
        if model.explain is None:
            return {}
        with model.blaming():
            vectors = model.explain(scene, row, palette.brushes[index].params)
            answers.append({name: np.append(vector, [0.0] * (3 - len(vector))) for name, vector in vectors.items()})
    if len(answers) == 1:
        return answers[0]
    weight = blend * blend * (3.0 - 2.0 * blend)  # as `flockbrush.systems.steer` mixes
    mixed: dict = {}
    for reasons, share in zip(answers, (1.0 - weight, weight), strict=True):
        size = max(float(np.sqrt((sum(reasons.values()) ** 2).sum())), 1e-12)
        for name, vector in reasons.items():
            mixed[name] = mixed.get(name, 0.0) + share / size * vector
    return mixed


def _numbers(small, row):
    """What a designer asks for beside the picture: {name: (value, unit)}."""
    agents, hills = small.agents, {}
    if small.resource(Landscape).hilly:
        rise = float(agents[Ground.slope][row] @ agents[Heading.forward][row, :2])
        steepest = float(small.resource(SpeciesList).table.steepest[agents[Species.index][row]])
        hills = {"slope ahead": (rise, "m/m"), "steepest slope it walks": (steepest, "m/m")}
    return {
        "speed": (float(np.hypot(*agents[Velocity.xyz][row, :2])), "m/s"),
        "speed wanted": (float(agents[Speed.target][row]), "m/s"),
        "body length": (float(agents[Body.length][row]), "m"),
        "blend": (float(agents[BrushBinding.blend][row]), ""),
        **hills,
    }
