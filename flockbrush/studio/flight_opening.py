"""The window that is shown while a flight is read or lifted."""

from __future__ import annotations

import numpy as np

from flockbrush.render.canvas import Canvas
from flockbrush.render.space_view import SpacePainter
from flockbrush.studio.lift_window import LiftWindow
from flockbrush.studio.opening import Opening


def flight_opening(name, size, theme, read, under=""):
    """The window in which a flight is read or lifted, and then shown.

    Parameters
    ----------
    read : callable
        Returns the `flockbrush.lifting.flight_show.Show`.
    under : str, optional
        What it is opened over, see `LiftWindow`.
    """

    def work():
        show = read()
        _try_drawing(show)
        return show

    doing = "Reading the flight …", "Lifting the flight, or compiling kernels (only at the first start) …"
    return Opening(name, size, theme, work, lambda show, size: LiftWindow(show, size, theme, under), doing)


def _try_drawing(show):
    """Draw a flight once, so that all is compiled before the window needs it."""
    painter = SpacePainter(None, (320, 240), words=False, live=True, floor=show.floor)
    canvas = Canvas(painter.frame(show.herd(0), title="", legend=False))
    corners = np.array([(10.0, 10.0), (60.0, 10.0), (60.0, 60.0)])
    canvas.segments(np.hstack([corners, np.roll(corners, 1, 0)]), 1.0, painter.theme.ink, 0.5)
    canvas.area(corners, painter.theme.ink, 0.1)
    canvas.disc(corners[0], 3.0, painter.theme.ink)
