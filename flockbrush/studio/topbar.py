"""The bar above: which level, undo and redo, files, pictures, help."""

from __future__ import annotations

import pygame
from pygame_gui.elements import UIPanel

from flockbrush.studio.theme import px
from flockbrush.studio.widgets import NO_MARGINS, action_button, enabled, marked, words

LEFT = ("undo", "redo", None, "save")
RIGHT = ("video", "screenshot", None, "space", "theme", "panels", "help")


class TopBar:
    """Buttons of the whole level, and its name."""

    def __init__(self, app, rect):
        self.app = app
        self.back = UIPanel(rect, 1, app.manager, margins=NO_MARGINS, object_id="@bar")
        side, gap = px(app.scale, 32), px(app.scale, 4)
        y = (rect.height - side) // 2
        self.buttons = {}
        right = rect.width - px(app.scale, 8)
        for name in reversed(RIGHT):
            right -= side + gap if name else 2 * gap
            if name and right > 0.35 * rect.width:
                self.buttons[name] = action_button(app, pygame.Rect(right, y, side, side), name, self.back)
        left = px(app.scale, 8)
        for name in LEFT:
            if name and left + side < right - side:
                self.buttons[name] = action_button(app, pygame.Rect(left, y, side, side), name, self.back)
            left += side + gap if name else 2 * gap
        left += px(app.scale, 10)
        self.title = None
        if right - left > px(app.scale, 60):
            place = pygame.Rect(left, 0, right - left - gap, rect.height)
            self.title = words(app, place, "", self.back, "@title")
        self._said = None

    def update(self):
        """Show what is so now."""
        app, session = self.app, self.app.session
        undo, redo = session.undo_label, session.redo_label
        in_space = app.canvas.in_space
        content = (undo, redo, session.dirty, app.level_name(), app.film is not None, in_space)
        if content == self._said:
            return
        self._said = content
        if self.title is not None:
            self.title.say(app.level_name() + ("   •  not saved" if session.dirty else ""))
        shown = (
            (enabled, "undo", undo), (enabled, "redo", redo), (marked, "video", app.film), (marked, "space", in_space),
        )  # fmt: skip
        for show, name, on in shown:
            if name in self.buttons:
                show(self.buttons[name], on)
