"""Dialogs: a question with a text field or with buttons."""

from __future__ import annotations

from html import escape

import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UITextBox, UITextEntryLine, UIWindow

from flockbrush.studio.theme import font, px
from flockbrush.studio.toasts import wrapped


class Modal(UIWindow):
    """A window in the middle that gets all input, at most as large as the screen; `inside` is its room, pixels."""

    def __init__(self, app, title, width, height):
        self.app, (widest, tallest) = app, app.screen.get_size()
        place = pygame.Rect(0, 0, min(widest - 10, width), min(tallest - 10, height))
        place.center = widest // 2, tallest // 2
        super().__init__(place, app.manager, title, object_id="#dialog", draggable=True)
        self.set_blocking(True)
        self.inside = pygame.Rect((0, 0), self.get_container().get_size())

    def take_up(self, entry):
        """Give a field the keyboard, with its text selected: what is typed takes its place."""
        entry.edit_position = len(entry.get_text())
        entry.select_range = [0, entry.edit_position]
        self.app.manager.set_focus_set(entry)


class Dialog(Modal):
    """A question with some answers, and a text to be changed if there is one.

    Parameters
    ----------
    answers : sequence of (text, callable or None)
        The buttons, from right to left; the first is what Enter means, the last what Escape means.
    entry : str, optional
        A text to be changed, selected at first; it is given to the first answer, which may return False to refuse it.
    """

    def __init__(self, app, title, question, answers, entry=None):
        self.question, self.answers = question, {}
        wide = min(app.screen.get_width() - 10, px(app.scale, 460))
        pad, row = px(app.scale, 12), px(app.scale, 32)
        lines = wrapped(question, font(px(app.scale, 14)), wide - 3 * pad)
        text_height = len(lines) * px(app.scale, 20) + px(app.scale, 14)
        tall = px(app.scale, 34) + text_height + (row + pad if entry is not None else 0) + row + 3 * pad
        super().__init__(app, title, wide, tall)
        inside = self.inside
        bottom = inside.height - pad - row
        self.entry = None
        top = bottom - pad
        if entry is not None:
            top -= row
            line = pygame.Rect(pad, top, inside.width - 2 * pad, row)
            self.entry = UITextEntryLine(line, app.manager, container=self, initial_text=entry)
            self.take_up(self.entry)
            self.entry.cursor_has_moved_recently = True
            top -= pad
        said_place = pygame.Rect(pad // 2, pad // 2, inside.width - pad, max(10, top - pad // 2))
        UITextBox(
            escape(question, False).replace("\n", "<br>"), said_place, app.manager, container=self, object_id="@page"
        )
        self._make_answers(answers, inside, bottom, row, pad)

    def _make_answers(self, answers, inside, y, row, pad):
        right = inside.width - pad
        share = (inside.width - pad) // max(1, len(answers)) - pad // 2
        for k, (text, do) in enumerate(answers):
            wide = min(px(self.app.scale, 130), share)
            look = "@primary" if k == 0 else None
            button = UIButton(pygame.Rect(right - wide, y, wide, row), text, self.app.manager, self, object_id=look)
            self.answers[button] = do
            right -= wide + pad // 2

    def handle(self, event) -> bool:
        """Answer buttons, Enter and Escape; whether the event was ours."""
        if event.type == pygame_gui.UI_BUTTON_PRESSED and event.ui_element in self.answers:
            self.answer(event.ui_element)
            return True
        if event.type == pygame_gui.UI_TEXT_ENTRY_FINISHED and event.ui_element is self.entry:
            self.answer(next(iter(self.answers)))
            return True
        if event.type == pygame.KEYDOWN:
            if event.key == pygame.K_ESCAPE:
                self.answer(list(self.answers)[-1])
            elif event.key in (pygame.K_RETURN, pygame.K_KP_ENTER) and not (self.entry and self.entry.is_focused):
                self.answer(next(iter(self.answers)))
            return True
        return False

    def answer(self, button):
        """Close and call the function of the button; if it returns False, the text can be changed."""
        do, first = self.answers[button], button is next(iter(self.answers))
        if self.entry is None or not first or do is None:
            self.kill()
            return do and do()
        if do(self.entry.get_text().strip()) is not False and self.alive():
            self.kill()
        if self.alive():
            self.app.manager.set_focus_set(self.entry)
        return None
