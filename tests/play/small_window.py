"""A window just large enough for one panel, with a real session behind it; and hands for mouse and keys."""

import os

os.environ["SDL_VIDEODRIVER"] = "dummy"
os.environ["SDL_AUDIODRIVER"] = "dummy"
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")

from types import SimpleNamespace

import pygame
from pygame_gui.elements import UIPanel

from flockbrush.render.style import theme_of
from flockbrush.studio.actions import AppActions
from flockbrush.studio.manager import Manager
from flockbrush.studio.session import Session
from flockbrush.studio.settings import Settings
from flockbrush.studio.theme import chrome, look

FLAT = {"left": 0, "right": 0, "top": 0, "bottom": 0}


class SmallWindow:
    """What panels know of the app, and nothing else."""

    def __init__(self, level, kind, theme="light", scale=1.0, size=(320, 640), brush=None):
        pygame.display.init()
        pygame.font.init()
        pygame.event.clear()
        self.screen = pygame.display.set_mode(size)
        self.session = Session.open(level)
        self.theme, self.scale, self.settings = theme_of(theme), scale, Settings()
        self.selected, self.brush, self.memory, self.overlays = None, brush, {}, {"trails"}
        self.seconds = {"simulation": 0.004, "drawing": 0.003, "interface": 0.002}
        self.said, self.question, self.asked_theme, self.asked_scale = [], None, None, "nothing"
        self.canvas = SimpleNamespace(in_space=False, follows=False)
        self.manager = Manager(size, look(self.theme, scale))
        self.container = UIPanel(pygame.Rect(0, 0, *size), manager=self.manager, margins=FLAT)
        self.panel = kind(self, self.manager, self.container)
        self.frames(2)

    # what panels ask of the app ------------------------------------------------------

    def notify(self, text, kind="info"):
        self.said.append((kind, text))

    def ask_text(self, title, question, default, on_ok):
        self.question = (title, question, default, on_ok)

    ask_for_brush = AppActions.ask_for_brush

    def tell(self):
        self.said += [(notice.kind, notice.text) for notice in self.session.notices()]

    def remember(self, **choices):
        for name, value in choices.items():
            setattr(self.settings, name, value)

    def toggle_space(self):
        self.canvas.in_space = not self.canvas.in_space

    def toggle_follow(self):
        self.canvas.follows = not self.canvas.follows

    def colour_of(self, name):
        return "#4b7bc9"

    def set_theme(self, name):
        self.asked_theme = name

    def set_palette(self, name):
        self.asked_palette = name

    def set_scale(self, scale):
        self.asked_scale = scale

    # time and hands ------------------------------------------------------------------

    def frames(self, count=1, dt=1 / 30):
        """So many frames, as the app does them."""
        for _ in range(count):
            for event in pygame.event.get():
                if not self.manager.process_events(event):
                    self.panel.handle(event)
            self.manager.update(dt)
            self.panel.update(dt)
            self.said += [(notice.kind, notice.text) for notice in self.session.notices()]

    def wait(self, seconds=0.5):
        """Let numbers be refreshed."""
        self.frames(round(30 * seconds))

    def point(self, at):
        """Move the mouse."""
        pygame.mouse.set_pos(at)
        self.manager.mouse_position = at
        pygame.event.post(pygame.event.Event(pygame.MOUSEMOTION, pos=at, rel=(0, 0), buttons=(0, 0, 0)))

    def press(self, at):
        self.point(at)
        self.frames()
        pygame.event.post(pygame.event.Event(pygame.MOUSEBUTTONDOWN, pos=at, button=1))
        self.frames()

    def release(self, at):
        pygame.event.post(pygame.event.Event(pygame.MOUSEBUTTONUP, pos=at, button=1))
        self.frames(2)

    def click(self, element):
        """Press and release the left button on a widget."""
        at = element.rect.center
        self.press(at)
        self.release(at)
        self.frames(2)

    def drag(self, start, by, steps=5):
        """Drag the mouse from a place by (right, down) pixels."""
        self.press(start)
        for k in range(1, steps + 1):
            self.point((start[0] + by[0] * k // steps, start[1] + by[1] * k // steps))
            self.frames()
        self.release((start[0] + by[0], start[1] + by[1]))

    def type(self, text, enter=True):
        """Type into the widget that has the focus."""
        for letter in text:
            key = pygame.event.Event(pygame.KEYDOWN, key=ord(letter), mod=0, unicode=letter)
            pygame.event.post(key)
            pygame.event.post(pygame.event.Event(pygame.TEXTINPUT, text=letter))
        if enter:
            for kind in (pygame.KEYDOWN, pygame.KEYUP):
                pygame.event.post(pygame.event.Event(kind, key=pygame.K_RETURN, mod=0, unicode="\r"))
        self.frames(2)

    # what can be seen ------------------------------------------------------------------

    def picture(self):
        """The window as an array (h, w, 3)."""
        self.screen.fill(chrome(self.theme).panel)
        self.manager.draw_ui(self.screen)
        return pygame.surfarray.array3d(self.screen).swapaxes(0, 1)

    def tip_of(self, element):
        """The tooltip of a widget, without its tags."""
        return element.tool_tip_text or ""

    def close(self):
        self.panel.close()
        self.session.close()
