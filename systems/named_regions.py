"""Named regions of a level: what programs ask about, and zones that raise events."""

from __future__ import annotations

import math

import numpy as np
from flockbrush.behaviours.trigger import Happening
from flockbrush.components import Position, Velocity
from flockbrush.engine.clock import Clock
from flockbrush.systems.grid import short_way
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.spawning import inside_polygon


def in_region(name, xyz, land):
    """(n,) bool, who is in a region; nobody where the level has none of that name."""
    inside = np.zeros(len(xyz), bool)
    for polygon in land.marks.regions().get(name, ()):
        inside |= inside_polygon(xyz, polygon)
    for goal in land.goals:
        if goal.name == name:
            inside |= in_goal(goal, xyz, land.wrap)
    return inside


def middle_of_region(name, land):
    """(2,) m, the middle of a region or goal; None where there is none."""
    goal = next((goal.xy for goal in land.goals if goal.name == name), None)
    polygons = land.marks.regions().get(name)
    return goal if goal is not None else polygons[0].mean(0) if polygons else None


def entered(world):
    """Events of those who have come into a zone in the last step."""
    happened: list[Happening] = []
    land, agents = world.resource(Landscape), world.agents
    zones = [zone for zone in land.marks.zones if zone.event]
    if not zones or not len(agents):
        return happened
    now = agents[Position.xyz]
    before = now - agents[Velocity.xyz] * world.resource(Clock).dt
    if land.wrap is not None:
        before[:, :2] -= np.floor(before[:, :2] / land.wrap) * land.wrap
    for zone in zones:
        came = inside_polygon(now, zone.polygon) & ~inside_polygon(before, zone.polygon)
        for row in np.flatnonzero(came).tolist():
            xyz, reach = tuple(now[row].tolist()), zone.event_reach if zone.event_reach >= 0 else math.inf
            alone = int(agents.ids[row]) if zone.event_reach == 0 else 0
            happened.append(Happening(zone.event, xyz, reach, alone))
            if zone.event_reach < 0:
                break
    return happened


def in_goal(goal, xyz, wrap=None):
    """(n,) bool, who stands in a goal, on a map that ends at its borders or has a size ``wrap`` and goes on there."""
    if goal.polygon is not None:
        images = [(0.0, 0.0)] if wrap is None else [(i * wrap[0], k * wrap[1]) for i in (0, -1, 1) for k in (0, -1, 1)]
        return np.any([inside_polygon(xyz, goal.polygon + np.array(image)) for image in images], axis=0)
    off = short_way(xyz[:, :2] - goal.xy, wrap)
    return off[:, 0] ** 2 + off[:, 1] ** 2 <= goal.radius**2
