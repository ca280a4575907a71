"""The window of the playground: its parts, its main loop and the distribution of events."""

from __future__ import annotations

import contextlib
import gc
import os
import time
import warnings

import numpy as np
import pygame
import pygame_gui
from pygame_gui.elements import UIPanel, UITextEntryBox, UITextEntryLine

from flockbrush.render.style import theme_of
from flockbrush.studio.actions import Deeds
from flockbrush.studio.active_tool import Hand
from flockbrush.studio.brush_palette import Thumbnails
from flockbrush.studio.canvas_events import CanvasEvents
from flockbrush.studio.column import Column
from flockbrush.studio.control_keys import ControlKeys
from flockbrush.studio.layout import places
from flockbrush.studio.legend import Legend, ScaleBar
from flockbrush.studio.manager import Manager
from flockbrush.studio.opening_key import OpeningKey
from flockbrush.studio.settings import load_settings
from flockbrush.studio.theme import chrome, look, scale_of
from flockbrush.studio.timebar import TimeBar
from flockbrush.studio.toasts import Toasts
from flockbrush.studio.toolbox import Toolbox
from flockbrush.studio.topbar import TopBar
from flockbrush.studio.viewport import Viewport
from flockbrush.studio.widgets import NO_MARGINS, words

SLOWEST = 1 / 25  # s; a frame whose simulation would take longer lets the simulation lag instead
LEAST = 0.008  # s of a frame that the simulation has in any case
CALM = 0.1  # s between two drawings of controls that nobody touches
OVERLAYS = ("trails", "shadows", "dust", "forces", "field_of_view")  # shown at first
QUICK = 0.03  # s, while the mouse moves over them
FRESH = 0.15  # s between two looks at labels
DISK = 1.0  # s between two looks at the level file
SMALLEST = (200, 120)  # pixels of a window


class App(Hand, Deeds, CanvasEvents):
    """A window on a session.

    Parameters
    ----------
    size : (int, int)
        Of the window, pixels.
    theme : {"light", "dark"}, optional
        The one of last time unless told.
    scale : float, optional
        Of the controls; found from window and screen unless told.
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

    def __init__(self, session, size=(1280, 720), theme=None, scale=None, brush=None, palette=None):
        self.session = session
        self.settings, problem = load_settings()
        self.theme = theme_of(theme or self.settings.theme or "light", palette or self.settings.palette)
        self.wanted_scale = scale or self.settings.ui_scale
        self.overlays = self.settings.shown(OVERLAYS)
        self.selected: int | None = None
        self.memory: dict = {}
        self.seconds = {"simulation": 0.0, "drawing": 0.0, "interface": 0.0}
        self.running, self.columns = True, True
        self.now = self._calm = self._fresh = self._unseen = 0.0
        self._unheard = 0.0  # s since panels were told of time
        self._disk = DISK
        self.film = self.dialog = self.help = self.hint = None
        self._panning = self._turning = self._space = self._space_used = self._stroking = False
        self._button = 0  # the one that holds the stroke
        self._told_disk: tuple | str = ""  # what of the level's file on disk the person knows
        self._covered = False
        self.toasts, self.thumbnails = Toasts(), Thumbnails(self)
        self.column = None
        self.control_keys, self.opening_key = ControlKeys(self), OpeningKey()
        self._open(size)
        self.canvas, self.legend, self.scale_bar = Viewport(self), Legend(self), ScaleBar(self)
        self.empty(brush)
        self.build()
        self._guarded(self.canvas.show_flyers)
        if problem:
            self.notify(problem, "warning")

    # making the window -------------------------------------------------------------

    def _open(self, size):
        pygame.display.init()
        pygame.font.init()
        pygame.display.set_caption(self.title())
        self.screen = pygame.display.set_mode(_least(size), pygame.RESIZABLE)
        pygame.key.set_repeat(350, 40)
        pygame.event.set_blocked([pygame.JOYDEVICEADDED, pygame.AUDIODEVICEADDED])

    def build(self):
        """Build all controls for the window size, the theme and the scale."""
        for panel in self.panels:
            self._guarded(panel.close)
        size = self.screen.get_size()
        self.scale = scale_of(size, _screen_height(), self.wanted_scale)
        self.manager = Manager(size, look(self.theme, self.scale))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of labels that are shorter than their words, which are cut in time
            self._build_parts(size)
        self.canvas.resize(self.places.canvas)
        self._guarded(self.canvas.prepare)
        self.legend.picture, self.legend._said = None, None
        self._calm = self._fresh = 0.0

    def _build_parts(self, size):
        self.places = place = places(size, self.scale, self.columns)
        self.buttons: dict = {}  # of the action table
        self.dialog = self.help = None
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

    def close(self, keep=False):
        """Close the window; returns whether unsaved changes were kept for recovery, if asked."""
        self.end_video()
        self.thumbnails.close()
        for panel in self.panels:
            self._guarded(panel.close)
        kept = self.session.close(keep)
        if pygame.display.get_init():
            pygame.event.get()  # clear() and quit() would keep for ever the controls that waiting events speak of
            pygame.display.quit()
        return kept

    # one frame -------------------------------------------------------------------------

    def run(self, frames=None, stop=lambda: False):
        """Run the main loop until the window is closed, for some frames, or until `stop()`."""
        clock = pygame.time.Clock()
        self.session.play()
        self.thumbnails.start()
        gc.freeze()  # what was made until now stays; looking through it again and again would make frames stutter
        while self.running and frames != 0 and not stop():
            self.frame(min(clock.tick(60) / 1000, 0.25), patience_s=0.0)
            frames = None if frames is None else frames - 1

    def frame(self, dt, patience_s=None):
        """Run one frame, `dt` seconds after the last one.

        Ticks that are due run beside the drawing, which shows the last finished state; the next frame has what they
        leave.  It waits for them no longer than ``patience_s``: as long as they take unless told.
        """
        begin = time.perf_counter()
        self.now += dt
        for event in _merged(pygame.event.get()):
            self._guarded(self.handle, event)
        handled = time.perf_counter()
        budget = max(LEAST, SLOWEST - self.seconds["drawing"] - self.seconds["interface"])
        still = self._guarded(self.session.catch_up, dt, budget, patience_s)
        lived = time.perf_counter()
        self._unheard += dt
        if still:
            self._guarded(self._between_ticks)
            self._guarded(self.session.set_off, budget)
        looked = time.perf_counter()
        self._guarded(self.canvas.draw)
        drawn = time.perf_counter()
        self._guarded(self._show, dt)
        shown = time.perf_counter()
        self.seconds = {
            "simulation": lived - handled,
            "drawing": drawn - looked,
            "interface": handled - begin + looked - lived + shown - drawn,
        }

    def _between_ticks(self):
        """Everything that reads the world, between ticks."""
        dt, self._unheard = self._unheard, 0.0
        self.session.autosave()
        self.tell()
        self._disk -= dt
        if self._disk <= 0:
            self._disk = DISK
            self._look_at_disk()
        if self.column is not None:
            self._guarded(self.column.update, dt)
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
        version = changed and (changed, _written(self.session.path))
        if self.dialog is None:
            if changed == "changed" and not self.session.dirty and version != self._told_disk:
                self.reload_live()
            elif changed and version != self._told_disk:
                self.offer_reload(changed)
            self._told_disk = version

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
        from flockbrush.systems.landscape import Landscape

        land = self.session.simulation.world.resource(Landscape)
        iy, ix = (min(int(v / land.cell), n - 1) for v, n in zip((at[1], at[0]), land.brush.shape, strict=True))
        index = int(land.brush[iy, ix])
        painted = self.world_palette().names[index] + "   " if index >= 0 else ""
        return f"{painted}{at[0]:.1f}, {at[1]:.1f} m"

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
        self._guarded(self.tool.cursor, surface, self.canvas.camera)

    def _is_covered(self):
        """Whether a tooltip, menu or dialog covers the canvas."""
        root, area = self.manager.get_root_container(), self.canvas.rect
        return any(
            sprite.visible and sprite is not root and sprite.rect.colliderect(area)
            for sprite in self.manager.get_sprite_group().sprites()
        )

    def _guarded(self, do, *arguments):
        """Call a function; an exception becomes a message, and the window continues."""
        try:
            return do(*arguments)
        except Exception as error:
            from flockbrush.runs.terminal import debugging

            if debugging():
                raise
            self.notify(said(error), "error")

    # events ----------------------------------------------------------------------------

    def handle(self, event):
        """Handle one event."""
        if event.type != pygame.MOUSEMOTION:
            self._calm = 0.0
        elif not self.canvas.rect.collidepoint(event.pos):
            self._calm = min(self._calm, QUICK)
        if event.type == pygame.QUIT:
            self.ask_to_quit()
        elif event.type == pygame.VIDEORESIZE:
            self.resize(event.size)
        elif event.type in (pygame.WINDOWFOCUSLOST, pygame.WINDOWLEAVE):
            self._let_go(event)
        elif not self.opening_key.is_its_text(event):
            self._of_user(event)

    def _of_user(self, event):
        """Handle an event of mouse or keyboard, or of a control."""
        asking = self._is_asking()
        if not self._is_of_controls(event):
            self._of_canvas(event)
        if event.type == pygame.KEYDOWN and not asking and self._is_asking():
            self.opening_key.opened(event)

    def _is_asking(self):
        return self.dialog is not None and self.dialog.alive()

    def _is_of_controls(self, event):
        """Whether a dialog, control or panel has used an event."""
        if self._is_asking():
            self.manager.process_events(event)
            self.dialog.handle(event)
            return True
        self.dialog = None
        if self.control_keys.handle(event):
            return True
        key = event.type in (pygame.KEYDOWN, pygame.KEYUP)
        if key and not self._is_typing():
            return False
        if self._stroking or self._panning:  # a stroke that leaves the canvas goes on
            return False
        if self.timebar is not None and not self._covered and self.timebar.mouse(event):
            return True
        # no control wants to hear of movements (they look where the mouse is), and asking them all takes long
        taken = event.type != pygame.MOUSEMOTION and self.manager.process_events(event)
        if event.type == pygame_gui.UI_BUTTON_PRESSED and event.ui_element in self.buttons:
            self.buttons[event.ui_element].do(self)
            return True
        parts = (self.timebar, self.toolbox, self.column)
        heard = taken or any(part is not None and part.handle(event) for part in parts)
        return heard or key  # letters that are typed are no keys of tools

    def _is_typing(self):
        focus = self.manager.get_focus_set() or ()
        return any(isinstance(element, (UITextEntryLine, UITextEntryBox)) for element in focus)

    def resize(self, size):
        """Handle a new window size; an unfinished drawing ends."""
        self.let_go()
        size = _least(size)
        if size != self.screen.get_size():
            self.screen = pygame.display.set_mode(size, pygame.RESIZABLE)
        self.build()

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

    def notify(self, text, kind="info"):
        """Show a message."""
        self.toasts.say(text, kind)

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
        try:
            self.settings.save()
        except (AttributeError, OSError):
            pass


def _merged(events):
    """Events without outdated mouse motions and resizes; during a stroke all motions are kept."""
    kept = []
    for event in events:
        if event.type == pygame.VIDEORESIZE and kept and kept[-1].type == pygame.VIDEORESIZE:
            kept.pop()
        kept.append(event)
    return kept


def _written(path):
    """Modification time of a file, ns; 0 if it does not exist."""
    try:
        return os.stat(path).st_mtime_ns
    except OSError:
        return 0


def _least(size):
    return max(SMALLEST[0], int(size[0])), max(SMALLEST[1], int(size[1]))


def said(error) -> str:
    """The message of an exception for the user."""
    known = isinstance(error, (ValueError, OSError)) or type(error) is LookupError
    text = str(error.args[0] if type(error) is LookupError and error.args else error)
    return text if known and text else f"this failed: {type(error).__name__}: {text}"


def _screen_height():
    try:
        return max((height for _, height in pygame.display.get_desktop_sizes()), default=0)
    except pygame.error:
        return 0
