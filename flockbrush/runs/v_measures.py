"""The five indicators of V-like formations for the birds of a world."""

from __future__ import annotations

import numpy as np

from flockbrush.behaviours.v_rules.indicators import SHAPES, indicators
from flockbrush.components import Body, BrushBinding, Heading, Position
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.measures import compute_unwrapped
from flockbrush.systems.palette import Palette

MEANINGS = {
    "leads": "birds in no upwash (V rules)",
    "groups": "groups of birds that no upwash connects",
    "segments": "straight lines of birds",
    "distance": "mean distance to the nearest line, wingspans",
}


def v_indicators(simulation):
    """{measure: value} of all birds that fly by the V rules now, of all skeins together; {} where there are none.

    Their way is the mean of their headings; lengths are wingspans.
    """
    agents, palette = simulation.agents, simulation.world.resource(Palette)
    by_rules = np.array([brush.model == "v_rules" for brush in palette.brushes], bool)
    if not by_rules.any():
        return {}
    rows = np.flatnonzero(by_rules[agents[BrushBinding.brush]])
    if not len(rows):
        return {"leads": 0, "groups": 0, "segments": 0, "distance": np.nan, "shape": "nobody"}
    rules = palette.brushes[int(agents[BrushBinding.brush][rows[0]])].params
    along = agents[Heading.forward][rows, :2].mean(0)
    along = along / max(float(np.hypot(*along)), 1e-12)
    xyz = agents[Position.xyz][rows]
    xyz[:, :2] = compute_unwrapped(xyz, simulation.world.resource(Landscape).wrap)
    xyz = (xyz - xyz[0]) / (rules.wingspan * agents[Body.length][rows].mean())
    right = np.array([along[1], -along[0]])
    height = xyz[:, 2] if rules.layer else np.zeros(len(rows))
    values = indicators(np.column_stack([xyz[:, :2] @ right, xyz[:, :2] @ along, height])[None], rules)
    return {
        "leads": int(values.leads[0]),
        "groups": int(values.groups[0]),
        "segments": int(values.segments[0]),
        "distance": float(values.distance[0]),
        "shape": SHAPES[values.shape[0]],
    }
