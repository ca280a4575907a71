"""Which animals belong together: their groups, and the families inside."""

from __future__ import annotations

import colorsys

import numpy as np

from flockbrush.components import Family
from flockbrush.engine.clock import Clock
from flockbrush.render.overlay_registry import overlay
from flockbrush.render.shapes import ink_of
from flockbrush.render.strokes import draw_rings
from flockbrush.systems.groups import groups_of

HUES = 12
GOLDEN = 0.618034  # of the hues from one number to the next
EVERY = 8  # ticks between two times that groups are found: that takes about as long as a tick


@overlay
class Groups:
    """A ring around each animal in the colour of its group, and inside it one in the colour of its family."""

    name, title = "groups", "Groups"
    tip = "Animals that keep together by what they see, and families inside, each in its colour"
    below = in_space = True

    def __init__(self):
        self._key, self._group = None, np.zeros(0, np.int64)

    def draw(self, view):
        """Draw the rings, and how many groups there are in the corner."""
        agents, moment = view.world.agents, view.moment
        if len(agents) != len(moment):
            return
        key = id(view.world), view.world.resource(Clock).tick // EVERY, len(agents)
        if key != self._key:
            self._key, self._group = key, groups_of(view.world)
        radius = np.maximum(6.0 * view.unit, 0.8 * moment.length * view.camera.scale)
        self._rings(view, self._group, radius, 2.4 * view.unit)
        self._rings(view, agents[Family.number], radius - 2.6 * view.unit, 1.6 * view.unit)
        count = len(np.unique(self._group))
        corner = (view.camera.view[2] - 14 * view.unit, view.camera.view[3] - 62 * view.unit)
        text, size = f"{count:,} group{'' if count == 1 else 's'}", round(13 * view.unit)
        view.canvas.words(text, corner, size, view.theme.ink, anchor=(1, 0.5), halo=view.theme.paper)

    def _rings(self, view, numbers, radius, width):
        at = view.camera.pixels(view.moment.xyz)
        hue = (np.floor(numbers * GOLDEN % 1.0 * HUES)).astype(int)
        for k in range(HUES):
            mine = (hue == k) & (numbers > 0)
            if mine.any():
                ink = ink_of(tuple(round(255 * c) for c in colorsys.hsv_to_rgb(k / HUES, 0.75, 0.85)))
                draw_rings(view.canvas.image, view.canvas.clip, at[mine], radius[mine], width, ink, 0.9)
