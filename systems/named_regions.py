"""Named regions of a level: what programs ask about, and zones that raise events."""

from __future__ import annotations

import math

import numpy as np
from flockbrush.behaviours.trigger import Happening
from flockbrush.components import Position
from flockbrush.engine.seam import short_way
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.spawning import inside_polygon
from flockbrush.systems.terrain import centroid


def in_region(name, xyz, land):
    """(n,) bool, animals in a region; all False if the level has none of that name."""
    inside = np.zeros(len(xyz), bool)
    for polygon in land.marks.regions().get(name, ()):
        inside |= inside_polygon(xyz, polygon, land.wrap)
    for goal in land.goals:
        if goal.name == name:
            inside |= in_goal(goal, xyz, land.wrap)
    return inside


def away_from_region(name, xyz, land):
    """(n,) m in plan to the middle of the nearest region or goal of a name; infinite where there is none."""
    middles = [centroid(polygon) for polygon in land.marks.regions().get(name, ())]
    middles += [goal.xy for goal in land.goals if goal.name == name]
    offsets = (short_way(xyz[:, :2] - middle, land.wrap) for middle in middles)
    return np.min([np.full(len(xyz), np.inf), *(np.sqrt((off**2).sum(1)) for off in offsets)], axis=0)


def zones_with_event(land):
    """The zones that raise an event."""
    return [zone for zone in land.marks.zones if zone.event]


def zone_events(world, known):
    """Events of those who have come into a zone since the last tick.

    Parameters
    ----------
    known : (ids, xyz, species) or None
        The animals of the last tick (`flockbrush.systems.programs.Programs`).  Who was not there enters nothing.
    """
    happened: list[Happening] = []
    land, agents = world.resource(Landscape), world.agents
    zones = zones_with_event(land)
    if not zones or known is None or not len(known[0]):
        return happened
    now, ids = agents[Position.xyz], known[0]
    at = np.minimum(np.searchsorted(ids, agents.ids), len(ids) - 1)
    there, before = ids[at] == agents.ids, known[1][at]
    for zone in zones:
        inside, was_inside = (inside_polygon(xyz, zone.polygon, land.wrap) for xyz in (now, before))
        came = there & inside & ~was_inside
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
        return inside_polygon(xyz, goal.polygon, wrap)
    off = short_way(xyz[:, :2] - goal.xy, wrap)
    return off[:, 0] ** 2 + off[:, 1] ** 2 <= goal.radius**2
