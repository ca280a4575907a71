"""The base class of the windows for marks, clips and flights: main loop, dialogs, unsaved changes."""

from __future__ import annotations

import contextlib

import pygame
import pygame_gui

from flockbrush.engine.problems import ProblemsError
from flockbrush.render.style import theme_of
from flockbrush.studio.dialogs import Dialog
from flockbrush.studio.manager import Manager
from flockbrush.studio.opening_key import OpeningKey
from flockbrush.studio.settings import load_settings
from flockbrush.studio.shortcuts import key_of
from flockbrush.studio.theme import look, scale_of
from flockbrush.studio.toasts import Toasts


class PlainWindow:
    """The common part of the windows for marks, clips and flights.

    Who derives from it has `build` (all controls, beginning with `begin`), `frame` (one frame; it calls `events`),
    `_key` (a key by its name), `_mouse` (what no control has taken) and `_file` (what a message about a file is about).

    Attributes
    ----------
    manager : Manager
        Of all controls.
    buttons : dict
        What a button does, by the button.
    dialog : Dialog or None
        While one is open it hears everything.
    running : bool
        Until somebody closes the window.
    """

    smallest = 480, 360  # pixels
    repeat = 350, 40  # ms until a key that is held counts again, and from then on

    def __init__(self, theme=None):
        self.theme = theme_of(theme or load_settings()[0].theme or "light")
        self.running, self.toasts = True, Toasts()
        self.dialog: Dialog | None = None
        self.buttons: dict = {}
        self._held: tuple | None = None  # what the mouse has taken hold of

    def open(self, size):
        """Put the window on the screen, and everything into it."""
        pygame.display.init()
        pygame.font.init()
        self.screen = pygame.display.set_mode(size, pygame.RESIZABLE)
        pygame.key.set_repeat(*self.repeat)
        self.build()

    def begin(self):
        """The window's size, for controls that are made anew in it."""
        size = self.screen.get_size()
        self.scale = scale_of(size)
        self.manager = Manager(size, look(self.theme, self.scale))
        self.dialog, self._opening_key = None, OpeningKey()
        return size

    def run(self, frames=None, stop=lambda: False):
        """Run the main loop until the window is closed, for some frames, or until `stop()`."""
        clock = pygame.time.Clock()
        while self.running and frames != 0 and not stop():
            self.frame(min(clock.tick(60) / 1000, 0.25))
            frames = None if frames is None else frames - 1

    def events(self):
        """Answer everything that has happened."""
        for event in pygame.event.get():
            self.guarded(self.handle, event)

    def guarded(self, do, *arguments):
        """Do something; what goes wrong becomes a message, and the window goes on with all it has."""
        try:
            return do(*arguments)
        except ProblemsError as error:
            self.toasts.say(error, "error")
        except OSError as error:
            self.toasts.say(f"{error.filename or self._file()}: {error.strerror or error}", "error")
        return None

    @property
    def asking(self) -> bool:
        """Whether a dialog is open."""
        return self.dialog is not None and self.dialog.alive()

    def handle(self, event):
        """Answer one event: a dialog first, then the window, the keyboard, the controls, the mouse."""
        if self.asking:
            self._of_dialog(event)
        elif event.type == pygame.QUIT:
            self.ask_to_quit()
        elif event.type == pygame.VIDEORESIZE:
            size = max(self.smallest[0], event.w), max(self.smallest[1], event.h)
            self.screen = pygame.display.set_mode(size, pygame.RESIZABLE)
            self.build()
        elif event.type == pygame.KEYDOWN:
            self._pressed(event)
        elif self._held is None and self._of_controls(event):
            pass
        elif event.type == pygame_gui.UI_BUTTON_PRESSED and event.ui_element in self.buttons:
            self.buttons[event.ui_element]()
        else:
            self._mouse(event)

    def _of_dialog(self, event):
        """Give an event to the dialog, but not the letter of the key that opened it."""
        if not self._opening_key.is_its_text(event):
            self.manager.process_events(event)
            self.dialog.handle(event)

    def _pressed(self, event):
        """A key went down."""
        self._key(key_of(event))
        if self.asking:
            self._opening_key.opened(event)

    def _of_controls(self, event) -> bool:
        """Whether a control has taken an event; none wants to hear of movements."""
        return event.type != pygame.MOUSEMOTION and self.manager.process_events(event)

    def _inside(self, position):
        """A pixel of the window as one of its canvas, whose place is `area`."""
        return position[0] - self.area.x, position[1] - self.area.y

    def ask_to_quit(self):
        """Close the window; who could lose something by it asks before."""
        self.quit()

    def quit(self):
        """Close the window after this frame."""
        self.running = False

    def close(self):
        """Take the window away."""
        with contextlib.suppress(pygame.error):
            if pygame.display.get_init():
                pygame.event.get()
                pygame.display.quit()
