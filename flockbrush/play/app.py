"""The playground's window: layout, main loop, and what buttons and keys do."""

from __future__ import annotations

import time
import warnings

import pygame
import pygame_gui

from flockbrush.draw.style import THEMES, theme_of
from flockbrush.play.canvas import Canvas
from flockbrush.play.keys import BY_KEY, key_of
from flockbrush.play.layout import places
from flockbrush.play.settings import load_settings
from flockbrush.play.theme import chrome, look, scale_of
from flockbrush.play.toasts import Toasts

FRAME = 1 / 60  # s, as fast as screens show them
SLOWEST = 1 / 25  # s; a frame whose simulation would take longer lets the simulation lag instead
CALM = 0.1  # s between two drawings of controls that nobody touches
SMALLEST = (200, 120)  # pixels of a window


class App:
    """A window on a session.

    Parameters
    ----------
    session : Session
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
    seconds : dict
        Of the last frame: ``simulation``, ``drawing`` and ``interface``.
    memory : dict
        What panels keep when they are made anew.
    """

    def __init__(self, session, size=(1280, 720), theme=None, scale=None, brush=None, title="Flockbrush"):
        self.session, self.title = session, title
        self.settings, problem = load_settings()
        self.theme = theme_of(theme or self.settings.theme or "light")
        self.wanted_scale = scale or self.settings.ui_scale
        self.brush = brush
        self.overlays = set(self.settings.overlays or ("trails", "leaders"))
        self.selected: int | None = None
        self.memory: dict = {}
        self.seconds = {"simulation": 0.0, "drawing": 0.0, "interface": 0.0}
        self.running, self.columns = True, True
        self.toasts = Toasts()
        pygame.display.init()
        pygame.font.init()
        self.screen = pygame.display.set_mode(size, pygame.RESIZABLE)
        pygame.key.set_repeat(350, 40)
        self.canvas = Canvas(self)
        self.panels: list = []
        self._calm = 0.0
        self.build()
        if problem:
            self.notify(problem, "warning")

    # making the window -------------------------------------------------------------

    def build(self):
        """Make all controls for the window's size, the theme and the scale."""
        for panel in self.panels:
            panel.close()
        size = self.screen.get_size()
        self.scale = scale_of(size, _screen_height(), self.wanted_scale)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # pygame_gui warns of fonts that it then finds
            self.manager = pygame_gui.UIManager(size, look(self.theme, self.scale), enable_live_theme_updates=False)
        self.places = places(size, self.scale, self.columns)
        self.canvas.resize(self.places.canvas)
        self.canvas.prepare()
        self.panels = []
        self._build_right()
        self._calm = 0.0

    def _build_right(self):
        """The column of panels with its tabs."""
        self.column = None
        if self.places.right is not None:
            from flockbrush.play.column import Column

            self.column = Column(self, self.manager, self.places.right)
            self.panels = self.column.panels

    def close(self):
        """Take the window away."""
        for panel in self.panels:
            panel.close()
        pygame.display.quit()

    # one frame -------------------------------------------------------------------------

    def run(self, frames=None):
        """Go on until the window is closed, or for so many frames."""
        clock = pygame.time.Clock()
        while self.running and frames != 0:
            self.frame(min(clock.tick(60) / 1000, 0.25))
            frames = None if frames is None else frames - 1

    def frame(self, dt):
        """One frame, `dt` seconds after the last one, without waiting."""
        begin = time.perf_counter()
        for event in pygame.event.get():
            self._guarded(self.handle, event)
        handled = time.perf_counter()
        self._guarded(self._live, dt)
        lived = time.perf_counter()
        self._guarded(self.canvas.draw)
        drawn = time.perf_counter()
        self._show(dt)
        shown = time.perf_counter()
        self.seconds = {
            "simulation": lived - handled,
            "drawing": drawn - lived,
            "interface": handled - begin + shown - drawn,
        }

    def _live(self, dt):
        """Let the session run, with what time the frame has left."""
        rest = SLOWEST - self.seconds["drawing"] - self.seconds["interface"]
        self.session.advance(dt, max(0.008, rest))
        for notice in self.session.notices():
            self.notify(notice.text, notice.kind)

    def _show(self, dt):
        """Controls and canvas onto the screen; controls that nobody touches are drawn ten times a second."""
        self.toasts.update(dt)
        self.manager.update(dt)
        if self.column is not None:
            self._guarded(self.column.update, dt)
        self._calm -= dt
        covered = self._is_covered()
        if self._calm <= 0 or covered:
            self._calm = CALM
            self.screen.fill(chrome(self.theme).panel)
            self.screen.blit(self.canvas.surface, self.canvas.rect)
            self.manager.draw_ui(self.screen)
        else:
            self.screen.blit(self.canvas.surface, self.canvas.rect)
        self.toasts.draw(self.screen, self.canvas.rect, self.theme, self.scale)
        pygame.display.flip()

    def _is_covered(self):
        """Whether a tooltip, menu or dialog lies above the canvas."""
        root = self.manager.get_root_container()
        return any(
            sprite is not root and sprite.visible and sprite.rect.colliderect(self.canvas.rect)
            for sprite in self.manager.get_sprite_group().sprites()
        )

    def _guarded(self, do, *arguments):
        """Do something; what goes wrong becomes a message, and the window goes on."""
        try:
            return do(*arguments)
        except Exception as error:  # noqa: BLE001  a designer must not lose work to a slip of ours
            self.notify(said(error), "error")

    # events ----------------------------------------------------------------------------

    def handle(self, event):
        """Answer one event."""
        self._calm = 0.0
        if event.type == pygame.QUIT:
            self.running = False
        elif event.type == pygame.VIDEORESIZE:
            self.resize(event.size)
        elif self.manager.process_events(event):
            return
        elif self.column is not None and self.column.handle(event):
            return
        elif event.type == pygame.KEYDOWN:
            action = BY_KEY.get(key_of(event))
            if action is not None:
                action.do(self)
        elif event.type == pygame.MOUSEWHEEL:
            position = pygame.mouse.get_pos()
            if self.canvas.rect.collidepoint(position):
                self.canvas.zoom(1.2**event.y, position)

    def resize(self, size):
        """The window has another size."""
        size = max(SMALLEST[0], size[0]), max(SMALLEST[1], size[1])
        if size != self.screen.get_size():
            self.screen = pygame.display.set_mode(size, pygame.RESIZABLE)
        self.build()

    # what panels and tools use ---------------------------------------------------------

    def draw_above(self, frame, camera, herd):
        """What panels draw on the canvas above the animals."""
        for panel in self.panels:
            panel.draw(frame, camera, herd)

    def notify(self, text, kind="info"):
        """Show a message."""
        self.toasts.say(text, kind)

    def set_theme(self, name):
        """Light or dark, from now on and next time."""
        self.theme = THEMES[name]
        self.build()

    def set_scale(self, scale):
        """The size of words and buttons; None: as window and screen suggest."""
        self.wanted_scale = scale
        self.build()

    def toggle_theme(self):
        self.set_theme("dark" if self.theme.name == "light" else "light")

    def toggle_columns(self):
        self.columns = not self.columns
        self.build()

    def toggle_play(self):
        (self.session.pause if self.session.playing else self.session.play)()

    def step(self, ticks):
        self.session.pause()
        self.session.step(ticks)

    def restart(self):
        self.session.restart()

    def pan_by(self, right, down):
        self.canvas.pan(60 * right * self.scale, 60 * down * self.scale)


def said(error) -> str:
    """An exception in words for a person."""
    known = (ValueError, LookupError, OSError)
    text = str(error.args[0] if isinstance(error, LookupError) and error.args else error)
    return text if isinstance(error, known) and text else f"that did not work: {type(error).__name__}: {text}"


def _screen_height():
    try:
        return max((height for _, height in pygame.display.get_desktop_sizes()), default=0)
    except pygame.error:
        return 0


def open_session(name, **options):
    """The session of a level."""
    try:
        from flockbrush.play.session import Session
    except ImportError:
        from flockbrush.play.stand_in import Session
    return Session.open(name, **options)
