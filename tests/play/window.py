"""The playground's window without a screen, and hands for its mouse and keys."""

import gc
import os
import weakref

os.environ["SDL_VIDEODRIVER"] = "dummy"
os.environ["SDL_AUDIODRIVER"] = "dummy"
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")

import numpy as np
import pygame
from flockbrush.components import BrushBinding, Position
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette

from flockbrush.studio.app import App
from flockbrush.studio.session import Session

MODS = {"ctrl": pygame.KMOD_LCTRL, "shift": pygame.KMOD_LSHIFT}
NAMES = {"pageup": "page up", "pagedown": "page down"}


class Window(App):
    """The app, with hands.  Places are metres on the ground unless they are said to be pixels."""

    _before = staticmethod(lambda: None)  # the last one opened, while it is there

    def __new__(cls, *arguments, **options):
        gc.collect()  # the window before: it was full of circles
        if cls._before() is None:
            gc.freeze()  # what there is stays, and need not be looked through again for the next window
        window = super().__new__(cls)
        cls._before = weakref.ref(window)
        return window

    def __init__(self, level, size=(1000, 640), **options):
        super().__init__(Session.open(level), size, options.pop("theme", "light"), **options)
        pygame.event.get()
        self.frames(2)

    def frames(self, count=1, dt=1 / 32):
        """So many frames, each as long as a tick."""
        for _ in range(count):
            self.frame(dt)

    def post(self, kind, **values):
        """One event, and the frame that hears it."""
        pygame.event.post(pygame.event.Event(kind, **values))
        self.frame(1 / 32)

    # the mouse ---------------------------------------------------------------------

    def at(self, xy):
        """Pixels of a point of the ground."""
        return tuple(round(value) for value in self.canvas.pixels(xy))

    def press(self, xy, button=1):
        self.post(pygame.MOUSEBUTTONDOWN, pos=self.at(xy), button=button)

    def move(self, xy, rel=(0, 0)):
        self.post(pygame.MOUSEMOTION, pos=self.at(xy), rel=rel, buttons=(1, 0, 0))

    def release(self, xy, button=1):
        self.post(pygame.MOUSEBUTTONUP, pos=self.at(xy), button=button)

    def click(self, xy, button=1):
        self.press(xy, button)
        self.release(xy, button)

    def drag(self, *points, button=1, steps=6):
        """Along some points with the button down."""
        self.press(points[0], button)
        for a, b in zip(points, points[1:], strict=False):
            for k in range(1, steps + 1):
                self.move(np.add(a, np.subtract(b, a) * k / steps))
        self.release(points[-1], button)

    def push(self, element):
        """Click a button of the window."""
        pos = element.rect.center
        self.post(pygame.MOUSEBUTTONDOWN, pos=pos, button=1)
        self.post(pygame.MOUSEBUTTONUP, pos=pos, button=1)
        self.frame(1 / 32)

    # keys --------------------------------------------------------------------------

    def key(self, text):
        """Press and release a key, as the table of actions writes it: "ctrl+z"."""
        *mods, name = text.split("+") if text != "+" else ["+"]
        sign = name if len(name) == 1 and not mods else ""
        code = pygame.key.key_code(NAMES.get(name, name)) if name not in "?{}+" else pygame.K_UNKNOWN
        mod = sum(MODS[part] for part in mods)
        self.post(pygame.KEYDOWN, key=code, mod=mod, unicode=sign)
        self.post(pygame.KEYUP, key=code, mod=mod, unicode=sign)

    def type(self, text):
        """Write into the field that has the focus, and press Enter."""
        for letter in text:
            self.post(pygame.TEXTINPUT, text=letter)
        self.key("return")

    # what there is -------------------------------------------------------------------

    @property
    def land(self):
        return self.session.simulation.world.resource(Landscape)

    @property
    def agents(self):
        return self.session.simulation.agents

    def names(self, index):
        """Names of brushes by their indices; None where nothing is painted."""
        known = self.session.simulation.world.resource(Palette).names
        return [known[k] if k >= 0 else None for k in np.ravel(index)]

    def painted(self, xy):
        """The brush painted at a point, or None."""
        return self.names(self.land.brush[self._cell(xy)])[0]

    def cap(self, xy):
        """The speed limit at a point, m/s."""
        return float(self.land.surface[self._cell(xy)][1])

    def ground(self, xy):
        """The kind of ground at a point, or None."""
        kind = int(self.land.kind_at[self._cell(xy)])
        return self.land.kinds[kind].name if kind >= 0 else None

    def _cell(self, xy):
        return int(xy[1] / self.land.cell), int(xy[0] / self.land.cell)

    def behaviour(self):
        """Name of the brush that each animal moves by now."""
        return self.names(self.agents[BrushBinding.brush])

    def standing(self):
        """Where the animals are, (n, 2) m."""
        return self.agents[Position.xyz][:, :2].copy()

    def said(self, kind=None):
        """What messages were shown."""
        return [toast.text for toast in self.toasts.log if kind is None or toast.kind == kind]
