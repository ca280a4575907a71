"""The window of the playground: its parts, its frames and the distribution of events."""

from __future__ import annotations

import contextlib
import gc
import time
import warnings

import numpy as np
import pygame
from pygame_gui.elements import UIPanel

from flockbrush.studio.actions import AppActions
from flockbrush.studio.active_tool import ActiveTool
from flockbrush.studio.brush_palette import Thumbnails
from flockbrush.studio.canvas_events import CanvasEvents
from flockbrush.studio.column import Column
from flockbrush.studio.control_keys import ControlKeys
from flockbrush.studio.layout import places
from flockbrush.studio.legend import Legend, ScaleBar
from flockbrush.studio.session_files import file_version
from flockbrush.studio.theme import chrome
from flockbrush.studio.timebar import TimeBar
from flockbrush.studio.toolbox import Toolbox
from flockbrush.studio.topbar import TopBar
from flockbrush.studio.viewport import Viewport
from flockbrush.studio.widgets import NO_MARGINS, close_menus, words
from flockbrush.studio.window import Window

SLOWEST = 1 / 25  # s; a frame whose simulation would take longer lets the simulation lag instead
LEAST = 0.008  # s of a frame that the simulation has in any case
CALM = 0.1  # s between two drawings of controls that nobody touches
OVERLAYS = ("trails", "shadows", "dust", "forces", "field_of_view")  # shown at first
QUICK = 0.03  # s, while the mouse moves over them
FRESH = 0.15  # s between two looks at labels
DISK = 1.0  # s between two looks at the level file
KEPT = "unsaved changes are kept; flockbrush play offers to recover them when you open the same file again"


class App(ActiveTool, AppActions, CanvasEvents, Window):
    """A window on a session.

    Parameters
    ----------
    size : (int, int)
        Of the window, pixels.
    theme : {"light", "dark"}, optional
        The one of last time by default.
    scale : float, optional
        Of the controls; found from window and screen by default.
    brush : str, optional
        The brush in hand at first.

    Attributes
    ----------
    canvas : Canvas
    tool : Tool
        The one in hand.
    selected : int or None
        Id of the animal one looks at more closely.
    overlays : set of str
        Names of what is drawn above the ground and the animals.
    seconds : dict
        Of the last frame: ``simulation``, ``drawing`` and ``interface``.
    memory : dict
        What panels keep when they are made anew.
    now : float
        Seconds since the window was opened.
    """

    smallest = 200, 120

    def __init__(self, session, size=(1280, 720), theme=None, scale=None, brush=None, palette=None):
        super().__init__(theme, palette, scale)
        self.session = session
        self.overlays = self.settings.shown(OVERLAYS)
        self.selected: int | None = None
        self.memory: dict = {}
        self.seconds = {"simulation": 0.0, "drawing": 0.0, "interface": 0.0}
        self.columns = True
        self.patience: float | None = None  # s that a frame waits for ticks; None: until they are done
        self.now = self._calm = self._fresh = self._unseen = 0.0
        self._unheard = 0.0  # s since panels were told of time
        self._disk = DISK
        self.film = self.help = self.hint = None
        self._panning = self._turning = self._space = self._space_used = self._stroking = False
        self._button = 0  # the one that holds the stroke
        self._known_disk: tuple | str = ""  # what of the level's file on disk the person knows
        self._covered = False
        self.thumbnails = Thumbnails(self)
        self.column = None
        self.control_keys = ControlKeys(self)
        self.open_screen(size)
        self.canvas, self.legend, self.scale_bar = Viewport(self), Legend(self), ScaleBar(self)
        self.empty(brush)
        self.build()
        self.guarded(self.canvas.show_flyers)
        if self.settings_problem:
            self.notify(self.settings_problem, "warning")

    # making the window -------------------------------------------------------------

    def build(self):
        """Build all controls for the window size, the theme and the scale."""
        for panel in self.panels:
            self.guarded(panel.close)
        size = self.begin()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of labels that are shorter than their words, which are cut in time
            self._build_parts(size)
        self.canvas.resize(self.places.canvas)
        self.guarded(self.canvas.prepare)
        self.legend.picture, self.legend._said = None, None
        self._calm = self._fresh = 0.0

    def _build_parts(self, size):
        self.places = place = places(size, self.scale, self.columns)
        self.help = None
        self.top = None if place.top is None else TopBar(self, place.top)
        self.toolbox = None if place.left is None else Toolbox(self, place.left)
        self.timebar = None if place.time is None else TimeBar(self, place.time)
        self.column = None if place.right is None else Column(self, self.manager, place.right)
        self.hint = self.place = None
        if place.hint is not None:
            self._build_hint(place.hint)

    def _build_hint(self, rect):
        """Build the line under the canvas: the hint on the left, what is under the mouse on the right."""
        back = UIPanel(rect, 1, self.manager, margins=NO_MARGINS, object_id="@bar")
        pad, tall = round(10 * self.scale), rect.height
        right = round(190 * self.scale) if rect.width > 660 * self.scale else 0
        inside = pygame.Rect(pad, 0, rect.width - right - 2 * pad, tall)
        self.hint = words(self, inside, self.tool.hint, back, "@note")
        if right:
            self.place = words(self, pygame.Rect(rect.width - right - pad, 0, right, tall), "", back, "@note_right")

    def leave(self, keep=False):
        self.end_video()
        self.thumbnails.close()
        for panel in self.panels:
            self.guarded(panel.close)
        return KEPT if self.session.close(keep) else ""

    # one frame -------------------------------------------------------------------------

    def started(self):
        self.patience = 0.0
        self.session.play()
        self.thumbnails.start()
        gc.freeze()  # what was made until now stays; looking through it again and again would make frames stutter

    def frame(self, dt):
        """Run one frame, `dt` seconds after the last one.

        Ticks that are due run beside the drawing, which shows the last finished state; the next frame has what they
        leave.  It waits for them no longer than `patience`.
        """
        begin = time.perf_counter()
        self.now += dt
        self.events()
        handled = time.perf_counter()
        budget = max(LEAST, SLOWEST - self.seconds["drawing"] - self.seconds["interface"])
        still = self.guarded(self.session.catch_up, dt, budget, self.patience)
        lived = time.perf_counter()
        self._unheard += dt
        if still:
            self.guarded(self._between_ticks)
            self.guarded(self.session.set_off, budget)
        looked = time.perf_counter()
        self.guarded(self.canvas.draw)
        drawn_at = time.perf_counter()
        self.guarded(self._show, dt)
        shown = time.perf_counter()
        self.seconds = {
            "simulation": lived - handled,
            "drawing": drawn_at - looked,
            "interface": handled - begin + looked - lived + shown - drawn_at,
        }

    def _between_ticks(self):
        """Everything that reads the world, between ticks."""
        dt, self._unheard = self._unheard, 0.0
        self.session.autosave()
        self.canvas.repaint()
        self.tell()
        self._disk -= dt
        if self._disk <= 0:
            self._disk = DISK
            self._look_at_disk()
        if self.column is not None:
            self.guarded(self.column.update, dt)
        self._fresh -= dt
        if self._fresh <= 0:
            self._fresh = FRESH
            self._freshen()
        elif self.timebar is not None and self._calm <= dt:
            self.timebar.draw()
        self.canvas.look_ahead()

    def _look_at_disk(self):
        if self.session.edits is not None:
            self.guard_edits(self.session.edits.follow)
        changed = self.session.changed_on_disk()
        version = changed and (changed, file_version(self.session.path))
        if self.dialog is None:
            if changed == "changed" and not self.session.dirty and version != self._known_disk:
                self.reload_live()
            elif changed and version != self._known_disk:
                self.offer_reload(changed)
            self._known_disk = version

    def tell(self):
        """Show the notices of the session."""
        for notice in self.session.notices():
            self.notify(notice.text, notice.kind)

    def _show(self, dt):
        """Draw controls and canvas; controls that are not used are drawn ten times a second."""
        self.toasts.update(dt)
        self._calm, self._unseen = self._calm - dt, self._unseen + dt
        touched = self._calm <= 0
        if touched:
            self.manager.update(self._unseen)
            self._calm, self._unseen, self._covered = CALM, 0.0, self._is_covered()
        whole = touched or self._covered
        if whole:
            self.screen.fill(chrome(self.theme).panel)
        self.screen.blit(self.canvas.surface, self.canvas.rect)
        self._above(self.screen.subsurface(self.canvas.rect.clip(self.screen.get_rect())), dt)
        if whole:
            self.manager.draw_ui(self.screen)
            self.control_keys.draw(self.screen)
        self.toasts.draw(self.screen, self.canvas.rect, self.theme, self.scale)
        if self.film is not None:
            self.film.take(self.canvas.frame, dt)
        pygame.display.flip()

    def _freshen(self):
        """Update labels and buttons from the session."""
        for part in (self.top, self.toolbox, self.timebar):
            if part is not None:
                part.update()
        if self.place is not None:
            self.place.say(self._under_mouse())

    def _under_mouse(self):
        """Text about the mouse position and the paint there."""
        at = self.tool.at
        animal = self.canvas.pick()
        if animal is not None:
            return self._animal_in_space(animal)
        if at is None or self.is_off_map(at, at, 0.0):
            return ""
        brush = self.painted_at(at)
        return f"{brush.name + '   ' if brush is not None else ''}{at[0]:.1f}, {at[1]:.1f} m"

    def _animal_in_space(self, animal):
        """Text about the animal under the mouse in the 3D view, and its height."""
        herd = self.canvas.herd
        row = int(np.searchsorted(herd.ids, animal))
        name = herd.brush_names[herd.brush[row]] if herd.brush[row] >= 0 else "animal"
        return f"{name} {animal}   {herd.z[row]:.1f} m up"

    def _above(self, surface, dt):
        """Draw legend, scale bar and tool cursor on the canvas; they are not in videos."""
        self.legend.update(dt)
        self.legend.draw(surface)
        if not self.canvas.in_space:  # there it is the grid that says how long a metre is
            self.scale_bar.draw(surface, self.canvas.camera)
        self.guarded(self.tool.cursor, surface, self.canvas.camera)

    def _is_covered(self):
        """Whether a tooltip, menu or dialog covers the canvas."""
        root, area = self.manager.get_root_container(), self.canvas.rect
        return any(
            sprite.visible and sprite is not root and sprite.rect.colliderect(area)
            for sprite in self.manager.get_sprite_group().sprites()
        )

    # events ----------------------------------------------------------------------------

    def handle(self, event):
        """Handle one event."""
        if event.type != pygame.MOUSEMOTION:
            self._calm = 0.0
        elif not self.canvas.rect.collidepoint(event.pos):
            self._calm = min(self._calm, QUICK)
        super().handle(event)

    def _is_of_controls(self, event):
        if event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE and close_menus(self.manager):
            return True
        return self.control_keys.handle(event) or super()._is_of_controls(event)

    def _is_dragging(self):
        return self._stroking or self._panning

    def _of_strip(self, event):
        return self.timebar is not None and not self._covered and self.timebar.mouse(event)

    def _of_parts(self, event):
        return any(part is not None and part.handle(event) for part in (self.timebar, self.toolbox, self.column))

    # what panels and tools use ---------------------------------------------------------

    @property
    def panels(self):
        """The panels of the right-hand column that have been made."""
        return [] if self.column is None else self.column.panels

    @property
    def painter(self):
        """Draws the herd on its ground."""
        return self.canvas.painter

    @property
    def accent(self):
        """The colour of what is selected."""
        return chrome(self.theme).accent

    def set_hint(self, text):
        """Set the hint under the canvas."""
        if self.hint is not None:
            self.hint.say(text)

    def tool_changed(self, palette=True):
        """Show the active tool and the selected paint."""
        if self.toolbox is not None:
            (self.toolbox.show if palette else self.toolbox.update)()
        self.set_hint(getattr(self.tool, "HINTS", {}).get(self.options["shape"], self.tool.hint))
        self._calm = 0.0

    def remember(self, **choices):
        """Save settings for the next session; a write error is ignored."""
        for name, value in choices.items():
            with contextlib.suppress(ValueError):
                setattr(self.settings, name, value)
        self.settings.save()

    def overlay_failed(self, name, error):
        """Switch off an overlay of others that cannot be drawn, and show why; the View panel can show it again."""
        self.overlays.discard(name)
        self.notify(f"{error}; this overlay is switched off", "error")
