"""The five indicators of V-like formations for the birds of a world."""

from __future__ import annotations

import math

import numpy as np

from flockbrush.behaviours.v_rules.indicators import GROUPS, SHAPES, indicators
from flockbrush.components import Body, BrushBinding, Heading, Position
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.measures import compute_unwrapped
from flockbrush.systems.palette import Palette

MEANINGS = {
    "leads": "birds in no upwash (V rules)",
    "groups": "groups of birds that no upwash connects",
    "segments": "straight lines of birds",
    "distance": "mean distance to the nearest line of the own group, wingspans",
}


ALIKE = math.radians(30.0)  # headings of skeins that fly different ways are apart by more.  By eye


def v_indicators(simulation):
    """{measure: value} of all birds that fly by the V rules now, of all skeins together; {} where there are none.

    Birds of one brush whose headings are alike are measured along the mean of these, and skeins that fly other ways or
    by other rules apart from them; counts are added.  Lengths are wingspans.
    """
    agents, palette = simulation.agents, simulation.world.resource(Palette)
    brush, by_rules = agents[BrushBinding.brush], [brush.model == "v_rules" for brush in palette.brushes]
    if not any(by_rules):
        return {}
    flocks = [
        rows[flock] for index in np.flatnonzero(by_rules) for rows in [np.flatnonzero(brush == index)]
        for flock in flying_alike(agents[Heading.forward][rows])
    ]  # fmt: skip
    told = [_of_flock(simulation, rows, palette.brushes[brush[rows[0]]].params) for rows in flocks]
    if not told:
        return {"leads": 0, "groups": 0, "segments": 0, "distance": np.nan, "shape": "nobody"}
    groups, distance = sum(one.groups[0] for one in told), np.array([one.own_distance[0] for one in told])
    known, birds = np.isfinite(distance), np.array([len(rows) for rows in flocks])
    return {
        "leads": int(sum(one.leads[0] for one in told)),
        "groups": int(groups),
        "segments": int(sum(one.segments[0] for one in told)),
        "distance": float(np.average(distance[known], weights=birds[known])) if known.any() else np.nan,
        "shape": SHAPES[told[0].shape[0] if len(told) == 1 else GROUPS],
    }


def flying_alike(forward):
    """Rows of birds, one array for each way: sorted by heading, neighbours are at most `ALIKE` apart."""
    angle = np.arctan2(forward[:, 1], forward[:, 0])
    order = np.argsort(angle, kind="stable")
    gaps = np.diff(angle[order], append=angle[order[:1]] + 2 * np.pi)
    cuts = np.flatnonzero(gaps > ALIKE) + 1
    if not len(cuts):
        return [order] if len(order) else []
    order = np.roll(order, -cuts[-1])  # begins behind a gap
    return [np.sort(rows) for rows in np.split(order, np.cumsum(np.diff(cuts, prepend=cuts[-1] - len(order)))[:-1])]


def _of_flock(simulation, rows, rules):
    agents = simulation.agents
    along = agents[Heading.forward][rows, :2].mean(0)
    along = along / max(float(np.hypot(*along)), 1e-12)
    xyz = agents[Position.xyz][rows]
    xyz[:, :2] = compute_unwrapped(xyz, simulation.world.resource(Landscape).wrap)
    xyz = (xyz - xyz[0]) / (rules.wingspan * agents[Body.length][rows].mean())
    right = np.array([along[1], -along[0]])
    height = xyz[:, 2] if rules.layer else np.zeros(len(rows))
    return indicators(np.column_stack([xyz[:, :2] @ right, xyz[:, :2] @ along, height])[None], rules)
