"""Somebody who presses, drags, types and resizes at random, the same way for the same seed."""

import random
import traceback

import pygame
from flockbrush.engine.commands import CommandError
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import RecordingError
from pygame_gui.core.interfaces import IContainerLikeInterface
from window import Window

from flockbrush.render.overlays import OVERLAYS
from flockbrush.studio.history import History
from flockbrush.studio.shortcuts import ACTIONS
from flockbrush.studio.tools import TOOLS
from flockbrush.studio.window import said

KEYS = [key for action in ACTIONS for key in action.keys if action.name not in ("quit", "fullscreen", "video")]
MISTAKES = (ProblemsError, CommandError, RecordingError, OSError)  # of people and disks, not of ours
SIZES = [(1000, 640), (200, 200), (640, 480), (420, 300), (1280, 720), (900, 140)]


class RandomHands(Window):
    """A window with somebody at it who knows nothing.

    Attributes
    ----------
    broken : list of str
        Tracebacks of what was no mistake of the hands.
    """

    def __init__(self, level, seed, **options):
        self.broken = []
        super().__init__(level, **options)
        self.random = random.Random(seed)
        self.do_something = {
            self.try_mouse: 30, self.try_drag: 14, self.try_widget: 14, self.try_key: 16, self.try_tool: 8,
            self.try_type: 3, self.try_wheel: 4, self.try_window_event: 4, self.try_resize: 1, self.try_look: 1,
            self.try_tab: 2, self.try_paint: 3, self.try_scrub: 2, self.try_rest: 12, self.try_overlay: 3,
        }  # fmt: skip

    def guarded(self, do, *arguments):
        try:
            return do(*arguments)
        except Exception as error:  # noqa: BLE001  all are wanted here
            if not isinstance(error, MISTAKES):
                self.broken.append(traceback.format_exc())
            self.notify(said(error), "error")

    def act(self, count):
        """So many random deeds."""
        deeds, weights = list(self.do_something), list(self.do_something.values())
        for _ in range(count):
            self.random.choices(deeds, weights)[0]()
            if self.dialog is not None and self.dialog.alive() and self.random.random() < 0.2:
                self.push(self.random.choice(list(self.dialog.answers)))
            self.running = True  # they never leave

    # the mouse -----------------------------------------------------------------------

    def _anywhere(self):
        width, height = self.screen.get_size()
        if self.random.random() < 0.6:
            area = self.canvas.rect
            return self.random.randrange(area.left, area.right), self.random.randrange(area.top, area.bottom)
        return self.random.randrange(-5, width + 5), self.random.randrange(-5, height + 5)

    def _point(self, pos):
        pygame.mouse.set_pos(pos)
        self.post(pygame.MOUSEMOTION, pos=pos, rel=(self.random.randrange(-9, 9), 3), buttons=(0, 0, 0))

    def try_mouse(self):
        pos, button = self._anywhere(), self.random.choice((1, 1, 1, 2, 3, 4))
        kind = self.random.choice((pygame.MOUSEBUTTONDOWN, pygame.MOUSEBUTTONUP, pygame.MOUSEMOTION))
        self._point(pos)
        if kind != pygame.MOUSEMOTION:
            self.post(kind, pos=pos, button=button)

    def try_drag(self):
        pos, button = self._anywhere(), self.random.choice((1, 1, 1, 1, 2, 3))
        self._point(pos)
        self.post(pygame.MOUSEBUTTONDOWN, pos=pos, button=button)
        for _ in range(self.random.randrange(1, 6)):
            pos = pos[0] + self.random.randrange(-60, 61), pos[1] + self.random.randrange(-60, 61)
            self._point(pos)
        if self.random.random() < 0.9:
            self.post(pygame.MOUSEBUTTONUP, pos=pos, button=button)

    def try_wheel(self):
        self._point(self._anywhere())
        self.post(pygame.MOUSEWHEEL, x=0, y=self.random.choice((-3, -1, 1, 3)), flipped=False)

    def try_widget(self):
        """Click some control that can be seen."""
        seen = [s for s in self.manager.get_sprite_group().sprites() if s.visible]
        leaves = [s for s in seen if not isinstance(s, IContainerLikeInterface)]
        pos = self.random.choice(leaves or seen).rect.center
        self._point(pos)
        self.post(pygame.MOUSEBUTTONDOWN, pos=pos, button=1)
        self.post(pygame.MOUSEBUTTONUP, pos=pos, button=1)

    # the keyboard ----------------------------------------------------------------------

    def try_key(self):
        self.key(self.random.choice(KEYS))

    def try_tool(self):
        self.key(self.random.choice(TOOLS).key)

    def try_paint(self):
        self.next_paint(self.random.choice((-1, 1)))
        self.frame(1 / 32)

    def try_type(self):
        for letter in self.random.choices("abc 0129.-é", k=3):
            self.post(pygame.KEYDOWN, key=ord(letter), mod=0, unicode=letter)
            self.post(pygame.TEXTINPUT, text=letter)
            self.post(pygame.KEYUP, key=ord(letter), mod=0, unicode=letter)

    # the window ------------------------------------------------------------------------

    def try_window_event(self):
        kinds = (pygame.WINDOWFOCUSLOST, pygame.WINDOWFOCUSGAINED, pygame.WINDOWLEAVE, pygame.WINDOWENTER, pygame.QUIT)
        self.post(self.random.choice(kinds))

    def try_resize(self):
        width, height = self.random.choice(SIZES)
        self.post(pygame.VIDEORESIZE, size=(width, height), w=width, h=height)

    def try_overlay(self):
        self.overlays ^= {self.random.choice(list(OVERLAYS))}
        self.frame(1 / 32)

    def try_look(self):
        self.set_scale(self.random.choice((None, 0.8, 1.0, 1.5, 2.0)))

    def try_tab(self):
        if self.column is not None:
            self.guarded(self.column.show, self.random.randrange(5))

    def try_scrub(self):
        self.scrub(self.random.randrange(self.session.last_tick + 1))
        self.frame(1 / 32)

    def try_rest(self):
        if self.random.random() < 0.5:
            self.session.play()
        self.frames(self.random.randrange(1, 8))

    # the end ---------------------------------------------------------------------------

    def not_taken_back(self):
        """Names of branches whose document is not that of their beginning when all that was done is undone."""
        found = []
        for name in list(self.session.branches):
            self.session.switch(name)
            if isinstance(self.session.editor, History):
                continue
            first = self.session.editor.at(0).text()
            while self.session.undo():
                pass
            if self.session.editor.text() != first:
                found.append(name)
        return found
