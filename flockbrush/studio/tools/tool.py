"""What a tool is: it hears the mouse in metres, and answers with commands."""

from __future__ import annotations

import itertools

import numpy as np
import pygame

from flockbrush.render.style import Colour, rgb
from flockbrush.render.view_camera import ViewCamera

_strokes = itertools.count(1)
CHOICES = {  # options that are one of several, and what a person reads
    "shape": {"pen": "Round pen", "rectangle": "Rectangle", "polygon": "Polygon"},
    "erase": {
        "usual": "Paint and objects",
        "everything": "All, with surfaces",
        "brush": "Behaviour",
        "cap": "Speed limits",
        "surface": "Surfaces",
        "things": "Objects",
    },
    "layer": {"brush": "Behaviour", "cap": "Speed limit", "surface": "Surface"},
}


class Tool:
    """One thing to do with the mouse on the canvas.

    Attributes
    ----------
    name, title, key, icon, tip : str
        For buttons and the help page; `tip` is one sentence.
    hint : str
        What to do now: shown under the canvas while the tool is in hand.
    palette : {"", "brush", "cap", "surface", "layer"}
        What one chooses from while the tool is in hand; "layer": whatever the option of that name says.
    options : tuple of str
        Names of what can be set, see `flockbrush.studio.options`.
    ink : str
        What the theme calls the colour that its cursor has, unless it works with a brush.
    selects : str
        What to do before something can be deleted.
    """

    name = title = key = icon = tip = hint = palette = ""
    options: tuple[str, ...] = ()
    ink = "ink"
    selects = "first click an object with the Select tool"

    def __init__(self, app):
        self.app = app
        self.at: tuple[float, float] | None = None  # m, where the mouse is; None when it is elsewhere

    # the mouse -------------------------------------------------------------------

    def press(self, xy, button, mods):
        """A button went down at a point of the ground, m; `button` 1 is the left one, 3 the right one."""

    def drag(self, xy):
        """The mouse moved with the button down."""

    def move(self, xy):
        """The mouse moved with no button down."""

    def release(self, xy):
        """The button came up."""

    # keys ------------------------------------------------------------------------

    def hear(self, key, down) -> bool:
        """A key, by its plain name, went down or came up; whether the tool takes it, before others do."""
        return False

    def let_go(self):
        """Whoever held keys looks elsewhere: they are up."""

    def cancel(self) -> bool:
        """Drop what is half done; whether there was anything."""
        return False

    def interrupt(self):
        """Something else changes: drop what is half done."""
        self.cancel()

    def finish(self):
        """End a shape that is being clicked together."""

    def delete(self) -> bool:
        """Take away what the tool has hold of; whether there was anything."""
        return False

    # looks -----------------------------------------------------------------------

    def cursor(self, surface, camera):
        """Draw what the tool would do, above everything, on the canvas."""

    def colour(self) -> Colour:
        """Of the cursor: that of the selected brush for a tool that works with one."""
        brush = self.app.brush if self.palette == "brush" else ""
        return rgb(self.app.colour_of(brush)) if brush else getattr(self.app.theme, self.ink)

    def ring(self, surface, camera, radius, colour: Colour):
        """Draw a circle of so many metres around the mouse, to be seen on light and dark ground."""
        if self.at is None:
            return
        dark = self.app.theme.name == "dark"
        scale, wide = camera.scale_at(self.at), max(1, round(1.6 * self.app.scale))
        radius = max(2.0 / scale, radius)
        self.circle(surface, camera, self.at, radius + 1.5 / scale, (0, 0, 0) if dark else (255, 255, 255), 1)
        self.circle(surface, camera, self.at, radius, colour, wide)

    def circle(self, surface, camera, centre, radius, colour: Colour, width=1):
        """Draw a circle of so many metres around a point of the ground, as it lies there."""
        if isinstance(camera, ViewCamera):
            pygame.draw.aacircle(surface, colour, camera.pixels(centre), radius * camera.scale, width)
            return
        turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
        around = np.asarray(centre, float) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        if (camera.project(np.column_stack([around, np.full(len(around), camera.floor)]))[1] > 0).all():
            pygame.draw.lines(surface, colour, True, camera.pixels(around).tolist(), width)

    def dots(self, surface, camera, points, colour: Colour, hot=None):
        """Draw handles at points (k, 2) m; number `hot` is larger."""
        u = self.app.scale
        for k, (x, y) in enumerate(camera.pixels(np.asarray(points, float).reshape(-1, 2))):
            r = (6.5 if k == hot else 4.5) * u
            pygame.draw.aacircle(surface, (255, 255, 255), (x, y), r)
            pygame.draw.aacircle(surface, colour, (x, y), r, max(1, round(1.8 * u)))

    def path(self, surface, camera, points, colour: Colour, closed=False, width=2.0):
        """Draw a line through points (k, 2) m."""
        pixels = camera.pixels(np.asarray(points, float).reshape(-1, 2))
        if len(pixels) > 1:
            pygame.draw.lines(surface, colour, closed, pixels.tolist(), max(1, round(width * self.app.scale)))

    # helpers ---------------------------------------------------------------------

    def needed(self) -> list:
        """Commands that must come before: those that load the selected brush, for a tool that works with one."""
        return self.app.brush_needed(self.app.brush) if self.palette == "brush" else []

    def reach(self, pixels=9.0):
        """So many pixels in metres, at the interface's scale: how near is near enough."""
        camera = self.app.canvas.camera
        return pixels * self.app.scale / (camera.scale if self.at is None else camera.scale_at(self.at))


class Stroke(Tool):
    """A tool that works along the way of the mouse; the whole way is one step of undo."""

    spacing = 0.2  # of the radius: how far the mouse must go for the next part

    def __init__(self, app):
        super().__init__(app)
        self.join = ""
        self.last: tuple[float, float] | None = None

    def press(self, xy, button, mods):
        if button == 1:
            self.join = f"{self.name} {next(_strokes)}"
            self.last = xy
            self.begin(xy)

    def drag(self, xy):
        if self.last is not None and np.hypot(xy[0] - self.last[0], xy[1] - self.last[1]) >= self.step():
            self.go(self.last, xy)
            self.last = xy

    def release(self, xy):
        if self.last is not None:
            if xy != self.last:
                self.go(self.last, xy)
            self.last = None
            self.end()

    def cancel(self) -> bool:
        going, self.last = self.last is not None, None
        return going

    def step(self) -> float:
        """Metres between two parts of a stroke."""
        return self.spacing * self.app.size

    def begin(self, xy):
        """The stroke starts."""
        self.go(xy, xy)

    def go(self, start, stop):
        """The stroke goes on, from a point to a point."""

    def end(self):
        """The stroke is over."""

    def cursor(self, surface, camera):
        self.ring(surface, camera, self.app.size, self.colour())
