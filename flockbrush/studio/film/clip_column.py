"""The column beside a clip: rows of text, buttons and sliders of a mode."""

from __future__ import annotations

from html import escape

import pygame
from pygame_gui import UI_BUTTON_PRESSED
from pygame_gui.elements import UIButton, UIPanel, UITextBox

from flockbrush.studio.theme import chrome, font, px
from flockbrush.studio.toasts import wrapped
from flockbrush.studio.widgets import NO_MARGINS, PictureButton, Slider, SliderScale, words


class ClipColumn:
    """Rows from the top to the bottom of a panel.

    Parameters
    ----------
    window : ClipWindow
    rect : pygame.Rect
    """

    def __init__(self, window, rect):
        self.app, self.rect = window, rect
        self.back = UIPanel(rect, 1, window.manager, margins=NO_MARGINS)
        self.pad = px(window.scale, 12)
        self.y = self.pad
        self.buttons: dict = {}  # what a button does
        self.sliders: list[Slider] = []

    @property
    def width(self):
        """Pixels between the margins."""
        return self.rect.width - 2 * self.pad

    def _row(self, tall, gap=6):
        place = pygame.Rect(self.pad, self.y, self.width, px(self.app.scale, tall))
        self.y = place.bottom + px(self.app.scale, gap)
        return place

    def _places(self, count, tall, gap):
        """So many places beside each other in one row."""
        row, gap = self._row(tall), px(self.app.scale, gap)
        wide = (row.width - gap * (count - 1)) // count
        return [pygame.Rect(row.x + k * (wide + gap), row.y, wide, row.height) for k in range(count)]

    def title(self, text):
        """The name of the mode."""
        return words(self.app, self._row(24), text, self.back, "@title")

    def heading(self, text):
        """What comes next."""
        self.y += px(self.app.scale, 6)
        return words(self.app, self._row(18, 3), text, self.back, "@heading")

    def line(self, text="", gap=2):
        """One line of words that may change."""
        return words(self.app, self._row(20, gap), text, self.back, "@muted")

    def note(self, text):
        """Some lines of words that stay."""
        letters = font(px(self.app.scale, 13))
        count = len(wrapped(text, letters, self.width - px(self.app.scale, 2)))
        place = self._row(0, 4)
        place.height = count * round(1.25 * letters.get_linesize()) + px(self.app.scale, 10)
        place.x, place.width = place.x - px(self.app.scale, 6), place.width + px(self.app.scale, 12)
        self.y += place.height
        return UITextBox(escape(text, False), place, self.app.manager, container=self.back, object_id="@page")

    def button(self, text, do, tip=None, primary=False):
        """A button over the whole width."""
        look = "@primary" if primary else "@small_button"
        new_button = UIButton(self._row(28), text, self.app.manager, self.back, tool_tip_text=tip, object_id=look)
        self.buttons[new_button] = do
        return new_button

    def pair(self, *pairs):
        """Buttons beside each other: (text, what it does, tip)."""
        buttons = []
        for place, (text, do, tip) in zip(self._places(len(pairs), 28, 5), pairs, strict=True):
            buttons.append(
                UIButton(place, text, self.app.manager, self.back, tool_tip_text=tip, object_id="@small_button")
            )
            self.buttons[buttons[-1]] = do
        return buttons

    def swatches(self, colours, do):
        """Small coloured buttons in one row; `do` is given the number of the colour, from 1."""
        buttons = []
        for k, (place, colour) in enumerate(zip(self._places(len(colours), 26, 3), colours, strict=True), 1):
            side = max(4, min(place.size) - px(self.app.scale, 8))
            chip = pygame.Surface((side, side), pygame.SRCALPHA)
            pygame.draw.rect(chip, colour, chip.get_rect(), border_radius=px(self.app.scale, 3))
            buttons.append(PictureButton(place, "", self.app.manager, self.back, object_id="@tool", pictures=[chip]))
            self.buttons[buttons[-1]] = lambda k=k: do(k)
        return buttons

    def slider(self, name, value, low, high, show, changed, power=False, tip=None):
        """A slider with its name and value."""
        scale = SliderScale(low, high, show, power)
        new_slider = Slider(self.app, self._row(38), name, value, scale, changed, self.back, tip)
        self.sliders.append(new_slider)
        return new_slider

    def chip(self, colour):
        """A colour as a bar, or nothing where there is none."""
        place = self._row(14)
        place.move_ip(self.rect.topleft)
        return Chip(self.app, place, colour)

    def handle(self, event) -> bool:
        """Buttons and sliders; whether the event was ours."""
        if event.type == UI_BUTTON_PRESSED and event.ui_element in self.buttons:
            self.buttons[event.ui_element]()
            return True
        return any(slider.heard(event) for slider in self.sliders)

    def close(self):
        """Take it away with all that is in it."""
        self.back.kill()


class Chip:
    """A bar of a colour in the column, drawn after the controls."""

    def __init__(self, window, rect, colour):
        self.app, self.rect, self.colour = window, rect, colour

    def draw(self, screen):
        """Onto the window; a crossed frame where there is no colour."""
        c = chrome(self.app.theme)
        if self.colour is not None:
            pygame.draw.rect(screen, self.colour, self.rect, border_radius=px(self.app.scale, 3))
        pygame.draw.rect(screen, c.border, self.rect, 1, border_radius=px(self.app.scale, 3))
