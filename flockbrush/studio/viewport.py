"""The middle of the window: the living herd on its ground, and the camera that looks at it."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from typing import Any

import numpy as np
import pygame

from flockbrush.engine.seam import short_way
from flockbrush.output.pictures import herd_of
from flockbrush.render import Painter, Scenery
from flockbrush.render.ground_texture import Underlay
from flockbrush.render.overlay_registry import EXPLAINED, OVERLAYS
from flockbrush.render.overlays import Overlays
from flockbrush.render.space_view import SpacePainter
from flockbrush.render.view_camera import ViewCamera

NEAREST, FARTHEST = 400.0, 0.25  # pixels per metre; share of the whole map in the window
FIRST = 0.5  # s that may go into the ground of a new window before it is shown
REFINE = 0.004  # s of a frame that may go into the ground
MARGIN = 14  # pixels around the map when all of it is shown, at scale 1
TURN = 0.35  # degrees the camera goes round for each pixel the mouse is dragged
LOW, HIGH = 14.0, 30.0  # degrees above a flock in the air, and above a herd on the ground, at the first look
LAID = 0.1  # s between two drawings of overlays that lie on the ground in space
FARAWAY = 6.0  # sizes of the map from which one may look at it at most


class Viewport:
    """Shows the session's herd in a rectangle of the window, as a plan or in space.

    Attributes
    ----------
    in_space : bool
        Whether one looks at the herd in space.
    follows : bool
        Whether the view goes with the herd.
    pointer : (float, float) or None
        Where the mouse was seen last, in pixels of the window.
    """

    def __init__(self, app):
        self.app, self.rect = app, pygame.Rect(0, 0, 64, 64)
        self.painter: Any = None  # Painter or SpacePainter, as soon as there is something to draw
        self.camera: Any = None  # Camera or OrbitCamera
        self.frame = np.zeros((64, 64, 3), np.uint8)
        self.surface = pygame.image.frombuffer(self.frame, (64, 64), "RGB")
        self.herd = None
        self.in_space = self.follows = False
        self.pointer: tuple[float, float] | None = None
        self._simulation = self._theme = None
        self._overlays = self._moment = self._other = None
        self._flat: dict = {}
        self._followed: tuple | None = None
        self._edition = 0  # of the session, in what is drawn
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
        simulation = app.session.scene
        if simulation is self._simulation and app.theme is self._theme:
            return
        self._simulation, self._theme = simulation, app.theme
        if self.in_space:
            self._prepare_space(simulation, size)
            return
        level = simulation.level
        home = ViewCamera.fit(level.width, level.height, size, margin=MARGIN * app.scale)
        camera = self.camera
        if camera is None or self._following_fit:
            camera = home
        self.painter, self._overlays = painter_of(simulation, size, app.theme, app.overlay_failed)
        self.home = home
        self.look(ViewCamera(camera.centre, camera.scale, size, (0, 0, *size)))
        self.painter.refine(FIRST)

    def _prepare_space(self, simulation, size):
        scenery = Scenery(simulation)
        self.painter = SpacePainter(scenery, size, self.app.theme, words=False, live=True)
        theme, failed = self.app.theme, self.app.overlay_failed
        self._overlays = Overlays(scenery, theme, failed=failed)
        explanations = self._overlays.explanations
        self._flat = defaultdict(
            lambda: Overlays(scenery, theme, 1.0, explanations, failed)
        )  # each picture has its own
        self.home = self.painter.home
        self.painter.refine(FIRST)
        if self.camera is None:
            self._first_look()
        else:
            self.look(replace(self.camera, size=size, view=self.painter.view))

    def toggle_space(self):
        """Look at the herd in space, or at the plan; each keeps its own camera."""
        self.in_space = not self.in_space
        self.camera, self._other = self._other, self.camera
        self._simulation = self._followed = None
        self.prepare()

    def show_flyers(self):
        """Look at the herd in space, and go with it, when most of it is in the air as the level begins."""
        self.prepare()
        if self._flies():
            self.toggle_space()
            self.follow()
            self._followed = None, np.median(self._places(), axis=0)  # the first look shows all of it: it stays

    def _first_look(self):
        """From behind the herd, a little above it: who flies is seen before the sky."""
        elevation = np.radians(LOW if self._flies() else HIGH)
        self.look(self.painter.around(self.herd, replace(self.home, elevation=elevation)))

    def _flies(self):
        """Whether most of the herd is in the air now."""
        self._now()
        return len(self.herd.xy) and float(np.mean(self.herd.z > self.herd.length)) > 0.5

    def look(self, camera):
        """Look at another part of the level; never so far away that it is lost."""
        level = self._simulation.level
        if self.in_space:
            self.camera = self._not_lost(camera, level)
        else:
            scale = float(np.clip(camera.scale, FARTHEST * self.home.scale, max(NEAREST, self.home.scale)))
            east = float(np.clip(camera.centre[0], 0, level.width))
            north = float(np.clip(camera.centre[1], 0, level.height))
            self.camera = ViewCamera((east, north), scale, camera.size, camera.view)
        self.painter.look(self.camera)

    def _not_lost(self, camera, level):
        """The camera with its target over the map, or near a herd that has left it."""
        sides = np.array([level.width, level.height])
        low, high = np.zeros(2), sides
        if self.herd is not None and len(self.herd.xy):
            east, north = self.herd.xy.T  # each on its own: several times faster than along the rows
            low = np.minimum(low, (east.min(), north.min()))
            high = np.maximum(high, (east.max(), north.max()))
        x, y = np.clip(camera.target[:2], low - 0.5 * sides, high + 0.5 * sides)
        far = min(camera.distance, FARAWAY * max(float((high - low).max()), 1.0))
        return replace(camera, distance=far).at(x, y)

    def fit(self):
        """Show the whole map."""
        self._following_fit = True
        self.prepare()
        self.look(self.painter.whole(self.camera.azimuth, self.camera.elevation) if self.in_space else self.home)

    def fit_herd(self):
        """Show all animals, as large as they can be."""
        self.prepare()
        self._now()
        if not len(self.herd.xy):
            self.fit()
        elif self.in_space:
            self.look(self.painter.around(self.herd))
        else:
            self._following_fit = False
            room = 3 * float(np.max(self.herd.length))
            low, high = self.herd.xy.min(axis=0) - room, self.herd.xy.max(axis=0) + room
            sides, middle = high - low, tuple(float(v) for v in (low + high) / 2)
            self.look(ViewCamera.fit(*sides, self.rect.size, margin=MARGIN * self.app.scale, centre=middle))

    def follow(self):
        """Let the view go with the herd, or stay where it is."""
        self.follows, self._followed = not self.follows, None

    def zoom(self, factor, about=None):
        """Come nearer by this factor, with the window position `about` staying over its ground."""
        self._following_fit = False
        about = None if about is None else (about[0] - self.rect.left, about[1] - self.rect.top)
        if self.in_space:
            self.look(self.camera.zoomed(factor, None if self.follows else about))
            return
        low, high = FARTHEST * self.home.scale, max(NEAREST, self.home.scale)
        factor = float(np.clip(self.camera.scale * factor, low, high)) / self.camera.scale
        self.look(self.camera.zoomed(factor, about))

    def pan(self, right, down):
        """Drag the ground by so many pixels."""
        self._following_fit = False
        self.look(self.camera.moved(right, down))

    def orbit(self, right, down):
        """Go round what is looked at: the scene turns with the mouse, dragged by so many pixels."""
        if self.in_space:
            self.look(self.camera.turned(*np.radians((TURN * right, TURN * down))))

    def metres(self, position):
        """The point of the ground (x, y), m, under a position of the window."""
        x, y = self.camera.metres((position[0] - self.rect.left, position[1] - self.rect.top))
        return float(x), float(y)

    def pixels(self, xy):
        """The position in the window of a point of the ground (m)."""
        x, y = self.camera.pixels(xy)
        return float(x) + self.rect.left, float(y) + self.rect.top

    def pick(self, reach=9.0):
        """Id of the animal that is drawn under the mouse in space, not farther than so many pixels; None for none."""
        if not self.in_space or self.pointer is None or self.herd is None:
            return None
        row = self.painter.pick(np.subtract(self.pointer, self.rect.topleft), reach * self.app.scale)
        return None if row is None or row >= len(self.herd.ids) else int(self.herd.ids[row])

    def middle_of(self, animals):
        """The middle (x, y), m, of some animals as they are shown; ValueError where none of them is."""
        rows = np.isin(self.herd.ids, animals)
        if not rows.any():
            raise ValueError("none of the selected animals is there at this moment")
        x, y = self.herd.xy[rows, :2].mean(axis=0)
        return round(float(x), 3), round(float(y), 3)

    # drawing -----------------------------------------------------------------------

    def look_ahead(self):
        """Ask the world, which stands still, what overlays are to show while ticks run."""
        if self._overlays is not None and self.app.selected is not None and self.app.overlays & EXPLAINED:
            self._overlays.explanations.of(self.app.selected)

    def repaint(self):
        """Draw the ground anew where it has changed; while the world stands still, as it does once in a frame."""
        self.prepare()
        for box in self.app.session.ground_changes():
            self.painter.repaint(box)

    def _wait_for_ticks(self):
        """Overlays that look at the world itself are drawn when it stands still."""
        app = self.app
        shown = {name for name in app.overlays if name in OVERLAYS and OVERLAYS[name].looks_at_world}
        if shown if app.selected is not None else {name for name in shown if not OVERLAYS[name].of_one}:
            app.session.timeline  # noqa: B018  who asks for it waits

    def draw(self):
        """Draw the moment that the session shows, with its overlays."""
        app = self.app
        self.prepare()
        self._wait_for_ticks()
        self._overlays.explanations.held = app.session.ticking
        self.painter.refine(REFINE)
        moment = self._now()
        self._go_along()
        trails, self.painter.shadows = "trails" in app.overlays, "shadows" in app.overlays
        self.painter.dust = "dust" in app.overlays
        if self.in_space:
            lying, self.painter.see_through = self._lying(), self.follows
            under = Underlay(self._on_ground, (frozenset(lying), app.selected, round(moment.time / LAID)))
            self.painter.frame(
                self.herd, moment.time, "", legend=False, trails=trails, out=self.frame,
                under=under if lying else None, selected=app.selected,
            )  # fmt: skip
            in_space = {name for name, overlay in OVERLAYS.items() if overlay.in_space}
            self._overlays.over(self.frame, self.camera, app.overlays & in_space, replace(moment, xyz=self._places()))
            return
        self.painter.frame(
            self.herd, moment.time, "", legend=False, trails=trails, out=self.frame, under=self._under
        )  # fmt: skip
        self._overlays.over(self.frame, self.camera, app.overlays, moment, app.selected)

    def _now(self):
        """The moment to be shown; its animals are `herd`."""
        before, moment = self._moment, self.app.session.view()
        taken = before is not None and before.time == moment.time and len(moment.ids) < len(before.ids)
        if taken or self._edition != self.app.session.edition:
            self._edition = self.app.session.edition
            self.painter.trails.clear()  # nobody went where they show
        self._moment = moment
        self.herd = herd_of(self._simulation, moment)
        return moment

    def _places(self):
        """(n, 3) m, where the animals are drawn in space: on flat ground."""
        return np.column_stack([self.herd.xy, self.herd.z])

    def _go_along(self):
        """Move the view as far as the herd has moved, or the selected animal."""
        if not self.follows or not len(self.herd.xy):
            return
        app, moment = self.app, self._moment
        chosen = moment.ids == app.selected if app.selected is not None else np.zeros(len(moment), bool)
        places = self._places()
        place = places[chosen][0] if chosen.any() else np.median(places, axis=0)
        key = (app.selected if chosen.any() else None, place)
        before, self._followed = self._followed, key
        if before is None or before[0] != key[0]:
            self._centre_on(place)
            return
        step = place - before[1]
        step[:2] = short_way(step[:2], app.session.wrap)
        if self.in_space:
            self.look(self.camera.at(*(np.asarray(self.camera.target) + step)))
            return
        step = np.rint(step[:2] * self.camera.scale) / self.camera.scale  # by whole pixels: a picture moved stays sharp
        self._followed = key[0], before[1] + np.append(step, 0.0)  # what is left is gone later
        if step.any():
            self.look(self.camera.at(*(np.asarray(self.camera.centre) + step)))

    def _centre_on(self, place):
        """Bring a point (3,) m into the middle."""
        self._following_fit = False
        self.look(self.camera.at(*place) if self.in_space else self.camera.at(*place[:2]))

    def _under(self, frame):
        free = self.app.scale_bar.height(self.rect.size, self.camera)
        self._overlays.under(frame, self.camera, self.app.overlays, self._moment, free)

    def _lying(self):
        """Names of the overlays that lie on the ground in space."""
        app, shown = self.app, self.app.overlays
        of_one = {name for name, overlay in OVERLAYS.items() if overlay.of_one and app.selected is not None}
        below = {name for name, overlay in OVERLAYS.items() if overlay.below}
        return shown & (below | of_one | {"links"})

    def _on_ground(self, picture, camera):
        """Lay overlays on the ground's picture, as the plan has them."""
        shown, overlays = self._lying(), self._flat[camera.size]
        overlays.under(picture, camera, shown, self._moment)
        if shown & (EXPLAINED | {"links"}):
            overlays.over(picture, camera, shown, self._moment, self.app.selected)


def painter_of(simulation, size, theme, failed=None):
    """(painter, overlays) for a running simulation."""
    scenery = Scenery(simulation)
    painter = Painter(scenery, size, theme, words=False, labels=True, live=True)
    return painter, Overlays(scenery, theme, failed=failed)
