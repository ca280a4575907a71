"""Marks over a picture in space: the selected animal, and the directions east, north and up."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flockbrush.render.canvas import Canvas
from flockbrush.render.orbit import OrbitCamera
from flockbrush.render.shapes import ink_of
from flockbrush.render.strokes import draw_lines, draw_rings
from flockbrush.render.style import Theme


class SpaceMarks(NamedTuple):
    """Draws marks on a picture (h, w, 3) as the camera sees them; ``view`` is its part that shows the scene."""

    frame: np.ndarray
    view: tuple
    camera: OrbitCamera
    theme: Theme
    unit: float

    def stand(self, place, long, floor):
        """A circle on the ground under an animal of this length, m, and a line down to it."""
        camera, (x, y, z) = self.camera, place
        turn = np.linspace(0, 2 * np.pi, 49)
        ring = np.column_stack([x + 0.9 * long * np.cos(turn), y + 0.9 * long * np.sin(turn), 0 * turn + floor])
        if (camera.project(ring)[1] < camera.numbers()[15]).any():
            return
        for width, ink, alpha in ((3.0, self.theme.paper, 0.6), (1.4, self.theme.ink, 0.9)):
            at = camera.pixels(ring)
            draw_lines(self.frame, self._clip, np.hstack([at[:-1], at[1:]]), width * self.unit, ink_of(ink), alpha)
        if z - floor > 0.5 * long:
            canvas = Canvas(self.frame, self.view)
            ends = camera.pixels([[x, y, floor], [x, y, z]])
            canvas.line(ends, 1.2 * self.unit, self.theme.ink, 0.75, dash=(5, 4))

    def ring(self, middle, long):
        """A ring in the picture around an animal of this length, m, whose middle is (1, 3) m."""
        at, depth = self.camera.project(middle)
        if depth[0] <= self.camera.numbers()[15]:
            return
        radius = np.array([max(8.0 * self.unit, 0.95 * long * self.camera.focal / depth[0])])
        for width, ink, alpha in ((4.4, self.theme.paper, 0.8), (2.0, self.theme.ink, 1.0)):
            draw_rings(self.frame, self._clip, at, radius, width * self.unit, ink_of(ink), alpha)

    @property
    def _clip(self):
        return np.array(self.view, np.int64)

    def compass(self, spacing):
        """Where east, north and up are, and how wide a square of the grid is, m, in the upper right corner."""
        theme, unit = self.theme, self.unit
        canvas = Canvas(self.frame, self.view)
        long = 26.0 * unit
        middle = np.array([self.view[2] - 52.0 * unit, self.view[1] + 50.0 * unit])
        right, up, ahead = self.camera.axes
        tips = np.stack([right, -up], axis=1) * long
        inks = (theme.predator, theme.exit, theme.link)
        order = np.argsort(-ahead, kind="stable")
        for k in order:
            canvas.line([middle, middle + tips[k]], 2.2 * unit, inks[k], 0.95)
        for k in order:
            word = middle + tips[k] * 1.42
            if _hidden(tips, k):
                canvas.disc(middle + tips[k], 3.0 * unit, inks[k])
                word = middle + tips[k] - (12.0 * unit, 0.0)
            height = max(10, round(12 * unit))
            canvas.words(("E", "N", "up")[k], word, height, theme.ink, anchor=(0.5, 0.5), halo=theme.paper)
        text = f"grid {_metres(spacing)}"
        at = (self.view[2] - 52 * unit, self.view[1] + 106.0 * unit)
        canvas.words(text, at, max(10, round(12 * unit)), theme.ink, anchor=(0.5, 1), halo=theme.paper)


def _hidden(tips, k):
    """Whether an axis of the compass points the same way as a longer one."""
    long = np.hypot(*tips.T)
    along = tips @ tips[k] > 0.94 * long * long[k]
    return bool((along & (long > long[k])).any())


def _metres(value):
    return f"{value:g} m" if value < 1000 else f"{value / 1000:g} km"
