"""The middle of the window: the living herd on its ground, and the camera that looks at it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pygame

from flockbrush.draw import Painter, Scenery
from flockbrush.draw.camera import Camera
from flockbrush.draw.overlays import Overlays
from flockbrush.export import herd_of

NEAREST, FARTHEST = 400.0, 0.25  # pixels per metre; share of the whole map in the window
FIRST = 0.5  # s that may go into the ground of a new window before it is shown
REFINE = 0.004  # s of a frame that may go into the ground
MARGIN = 14  # pixels around the map when all of it is shown, at scale 1


class Canvas:
    """Shows the session's herd in a rectangle of the window.

    Parameters
    ----------
    app : App
    """

    def __init__(self, app):
        self.app, self.rect = app, pygame.Rect(0, 0, 64, 64)
        self.painter: Any = None  # Painter, as soon as there is something to draw
        self.camera: Any = None  # Camera
        self.frame = np.zeros((64, 64, 3), np.uint8)
        self.surface = pygame.image.frombuffer(self.frame, (64, 64), "RGB")
        self.herd = None
        self._simulation = self._theme = None
        self._overlays = self._moment = None
        self._following_fit = True  # until somebody pans or zooms, the whole map is shown at every size

    # the camera ------------------------------------------------------------------

    def resize(self, rect: pygame.Rect):
        """Stand in this rectangle of the window."""
        size = max(8, rect.width), max(8, rect.height)
        if size != self.frame.shape[1::-1]:
            self.frame = np.zeros((size[1], size[0], 3), np.uint8)
            self.surface = pygame.image.frombuffer(self.frame, size, "RGB")
            self._simulation = None
        self.rect = pygame.Rect(rect.topleft, size)

    def prepare(self):
        """Have a painter for the simulation, size and theme there are now."""
        app, size = self.app, self.rect.size
        simulation = app.session.simulation
        if simulation is self._simulation and app.theme is self._theme:
            return
        level = simulation.level
        home = Camera.fit(level.width, level.height, size, margin=MARGIN * app.scale)
        camera = self.camera
        if camera is None or self._following_fit:
            camera = home
        self.painter, self._overlays = painter_of(simulation, size, app.theme)
        self.home, self._simulation, self._theme = home, simulation, app.theme
        self.look(Camera(camera.centre, camera.scale, size, (0, 0, *size)))
        self.painter.refine(FIRST)

    def look(self, camera: Camera):
        """Look at another part of the level; never so far away that it is lost."""
        level = self._simulation.level
        scale = float(np.clip(camera.scale, FARTHEST * self.home.scale, max(NEAREST, self.home.scale)))
        east = float(np.clip(camera.centre[0], 0, level.width))
        north = float(np.clip(camera.centre[1], 0, level.height))
        self.camera = Camera((east, north), scale, camera.size, camera.view)
        self.painter.look(self.camera)

    def fit(self):
        """Show the whole map."""
        self._following_fit = True
        self.prepare()
        self.look(self.home)

    def zoom(self, factor, about=None):
        """Come nearer by this factor, with the window position `about` staying over its ground."""
        self._following_fit = False
        about = None if about is None else (about[0] - self.rect.left, about[1] - self.rect.top)
        low, high = FARTHEST * self.home.scale, max(NEAREST, self.home.scale)
        factor = float(np.clip(self.camera.scale * factor, low, high)) / self.camera.scale
        self.look(self.camera.zoomed(factor, about))

    def pan(self, right, down):
        """Drag the ground by so many pixels."""
        self._following_fit = False
        self.look(self.camera.moved(right, down))

    def metres(self, position):
        """The point of the ground (x, y), m, under a position of the window."""
        x, y = self.camera.metres((position[0] - self.rect.left, position[1] - self.rect.top))
        return float(x), float(y)

    def pixels(self, xy):
        """The position in the window of a point of the ground (m)."""
        x, y = self.camera.pixels(xy)
        return float(x) + self.rect.left, float(y) + self.rect.top

    # drawing -----------------------------------------------------------------------

    def draw(self):
        """Draw the moment that the session shows, with its overlays."""
        app = self.app
        self.prepare()
        for box in app.session.ground_changes():
            self.painter.repaint(box)
        self.painter.refine(REFINE)
        moment = self._moment = app.session.view()
        self.herd = herd_of(self._simulation, moment)
        trails, self.painter.shadows = "trails" in app.overlays, "shadows" in app.overlays
        self.painter.frame(
            self.herd, moment.time, "", legend=False, trails=trails, out=self.frame, under=self._under
        )  # fmt: skip
        self._overlays.over(self.frame, self.camera, app.overlays, moment, app.selected)

    def _under(self, frame):
        self._overlays.under(frame, self.camera, self.app.overlays, self._moment)


def painter_of(simulation, size, theme):
    """(painter, overlays) for a running simulation."""
    scenery = Scenery(simulation)
    painter = Painter(scenery, size, theme, words=False, labels=True, live=True)
    return painter, Overlays(scenery, theme)
