"""The overlay "Walkable": every cell that stops animals, with the outline that they meet."""

from __future__ import annotations

import numpy as np


def walkable_layer(sketcher, land, theme, unit):
    """A function that hatches all blocked cells of a landscape on a canvas: ground and obstacles alike.

    Parameters
    ----------
    sketcher : Sketcher
        Aimed at the view.
    land : Landscape
    unit : float
        Pixels of a hairline.
    """
    left, top, right, _ = sketcher.canvas.clip
    if right <= left:
        return lambda canvas: None
    rows, columns = sketcher.cells(land.cell, land.blocked.shape)
    edge = sketcher.wall_edge(land.blocked[rows, columns], land.cell, (rows.start, columns.start))
    inside = np.clip(edge + 0.5, 0, 1)
    line = np.clip(1.3 * unit - np.abs(edge - 0.6 * unit) + 0.5, 0, 1)

    def draw(canvas):
        canvas.blend(inside, left, top, theme.ink, 0.14)
        canvas.blend(inside * sketcher.stripes(1), left, top, theme.predator, 0.55)
        canvas.blend(line, left, top, theme.predator, 0.95)

    return draw
