"""Named regions of a level: what programs ask about, and zones that raise events."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from flockbrush.behaviours.trigger import Happening
from flockbrush.components import Position, Velocity
from flockbrush.engine.clock import Clock
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.spawning import inside_polygon

EVERYWHERE = -1.0  # of `ZoneEvent.reach`: heard by all


@dataclass(frozen=True)
class ZoneEvent:
    """A zone that raises an event when somebody comes into it."""

    event: str
    polygon: np.ndarray  # (k, 2) m
    reach: float = 0.0  # m from who comes in; 0: it alone hears it; below 0: all do


@dataclass
class Regions:
    """Polygons by name: zones and areas of the level; goals are asked of the landscape, since they move.

    A constant of the level.
    """

    polygons: dict[str, list[np.ndarray]] = field(default_factory=dict)
    events: list[ZoneEvent] = field(default_factory=list)

    def names(self, land):
        """Names that a region may have."""
        return [*self.polygons, *(goal.name for goal in land.goals if goal.name not in self.polygons)]

    def inside(self, name, xyz, land):
        """(n,) bool, who is in a region; nobody where the level has none of that name."""
        found = np.zeros(len(xyz), bool)
        for polygon in self.polygons.get(name, ()):
            found |= inside_polygon(xyz, polygon)
        for goal in land.goals:
            if goal.name == name:
                found |= in_goal(goal, xyz)
        return found

    def middle(self, name, land):
        """(2,) m, the middle of a region or goal; None where there is none."""
        goal = next((goal.xy for goal in land.goals if goal.name == name), None)
        polygons = self.polygons.get(name)
        return goal if goal is not None else polygons[0].mean(0) if polygons else None

    def entered(self, world):
        """Events of those who have come into a zone in the last step."""
        happened: list[Happening] = []
        if not self.events or not len(world.agents):
            return happened
        agents, land = world.agents, world.resource(Landscape)
        now = agents[Position.xyz]
        before = now - agents[Velocity.xyz] * world.resource(Clock).dt
        if land.wrap is not None:
            before[:, :2] -= np.floor(before[:, :2] / land.wrap) * land.wrap
        for zone in self.events:
            came = inside_polygon(now, zone.polygon) & ~inside_polygon(before, zone.polygon)
            for row in np.flatnonzero(came).tolist():
                xyz, reach = tuple(now[row].tolist()), zone.reach if zone.reach >= 0 else math.inf
                alone = int(agents.ids[row]) if zone.reach == 0 else 0
                happened.append(Happening(zone.event, xyz, reach, alone))
                if zone.reach < 0:
                    break
        return happened


def in_goal(goal, xyz):
    """(n,) bool, who stands in a goal."""
    if goal.polygon is not None:
        return inside_polygon(xyz, goal.polygon)
    off = xyz[:, :2] - goal.xy
    return off[:, 0] ** 2 + off[:, 1] ** 2 <= goal.radius**2
