"""Counts of a level: crossings of its lines and animals in its areas."""

from __future__ import annotations

import numpy as np

from flockbrush.components import Position
from flockbrush.engine.seam import images, short_way
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.measures import compute_crossings
from flockbrush.systems.program_reports import state_codes, state_names
from flockbrush.systems.spawning import inside_polygon


class Counts:
    """What the level itself asks to be measured: crossings of its lines, animals in its areas.

    Crossings add up from tick to tick, each animal by its id, on a periodic map on the short way, also over its border.
    Lines and areas are those of now: one that is drawn in the running world counts from then on.
    """

    def __init__(self, simulation):
        self.simulation, self.level = simulation, simulation.level
        land = simulation.world.resource(Landscape)
        self.marks, self.wrap = land.marks, land.wrap
        self.crossed = {line.name: [0, 0] for line in self.marks.lines}
        self._ids, self._xy = self._now()

    def _now(self):
        agents = self.simulation.agents
        return agents.ids.copy(), agents[Position.xyz][:, :2].copy()

    def take(self):
        """Count what was crossed since the last time: call it after every tick."""
        if not self.marks.lines:
            self._ids = self._ids[:0]
            return
        ids, xy = self._now()
        _, old, new = np.intersect1d(self._ids, ids, assume_unique=True, return_indices=True)
        moved = xy[new] - self._xy[old]
        step = short_way(moved, self.wrap)
        near = np.abs(step).max(1, initial=0) < 0.5 * min(self.level.width, self.level.height)
        before, after = self._xy[old][near], (xy[new] + (step - moved))[near]
        for line in self.marks.lines:
            total = self.crossed.setdefault(line.name, [0, 0])
            for way in images(line.points, self.wrap, np.abs(step[near]).max(initial=0)):
                left, right = compute_crossings(before, after, line.points + way)
                total[0] += left
                total[1] += right
        self._ids, self._xy = ids, xy

    def values(self):
        """{"line NAME, to its left": so far, "area NAME": animals in it now}."""
        counted = {}
        for name, (left, right) in self.crossed.items():
            counted |= {f"crossed {name} to its left": left, f"crossed {name} to its right": right}
        _, xy = self._now()
        for area in self.marks.areas:
            counted[f"in {area.name}"] = int(np.sum(inside_polygon(xy, area.polygon, self.wrap)))
        names = state_names(self.simulation.world)
        tally = np.bincount(state_codes(self.simulation.world), minlength=len(names)) if names else []
        return counted | {f"state {name}": int(n) for name, n in zip(names, tally, strict=True) if name}
