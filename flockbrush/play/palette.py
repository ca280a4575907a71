"""What one can paint with: brushes as pictures of what they do, speed limits, surfaces."""

from __future__ import annotations

import numpy as np
import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UIScrollingContainer

from flockbrush.draw.style import mix, rgb
from flockbrush.play.theme import chrome, px
from flockbrush.play.widgets import set_pictures

CAPS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0)  # m/s
ACROSS = 2  # pictures side by side


class Palette:
    """Buttons for what can be painted on one layer; one of them is in hand."""

    def __init__(self, app, rect, container, layer):
        self.app, self.layer = app, layer
        self.back = UIScrollingContainer(
            rect, app.manager, container=container, allow_scroll_x=False, object_id="@clear"
        )
        self.entries = {"brush": app.brush_names, "cap": lambda: list(CAPS), "surface": app.surface_names}[layer]()
        bar = 24  # pixels of pygame_gui's scroll bar, whatever the scale
        gap = px(app.scale, 4)
        wide = (rect.width - bar - (ACROSS - 1) * gap) // ACROSS
        self.picture = (wide - px(app.scale, 10), round(0.62 * wide))
        tall = self.picture[1] + px(app.scale, 28)
        rows = -(-len(self.entries) // ACROSS)
        self.back.set_scrollable_area_dimensions((rect.width - bar, max(1, rows * (tall + gap))))
        self.buttons, self._waiting = {}, []
        for k, entry in enumerate(self.entries):
            place = pygame.Rect(k % ACROSS * (wide + gap), k // ACROSS * (tall + gap), wide, tall)
            self._make(entry, place)
        self._marked = None
        self.update()

    def _make(self, entry, place):
        app = self.app
        title, tip = self._words(entry)
        button = UIButton(
            place, fitted(title, place.width - px(app.scale, 6), app.scale), app.manager, self.back,
            tool_tip_text=tip, object_id="@swatch",
        )  # fmt: skip
        self.buttons[button] = entry
        if self.layer == "brush":
            picture, ready = app.thumbnails.get(entry, self.picture)
            if not ready:
                self._waiting.append(button)
        else:
            picture = self._swatch(entry)
        set_pictures(button, picture, at=(0.5, 0.14))

    def _words(self, entry):
        """(what is written, tooltip)."""
        app = self.app
        if self.layer == "cap":
            return f"{entry:g} m/s", f"Nobody goes faster than {entry:g} metres a second here"
        if self.layer == "surface":
            return (entry or "bare ground"), ("Ground without a kind" if not entry else f"Ground of the kind {entry}")
        brush = app.find_brush(entry)
        title = getattr(brush, "title", "") or entry
        return entry, f"<b>{title}</b><br>model {brush.model}" if brush is not None else entry

    def _swatch(self, entry):
        """A speed limit as stripes the closer the slower; a surface as its colour."""
        app, (width, height) = self.app, self.picture
        surface = pygame.Surface(self.picture)
        theme = app.theme
        if self.layer == "surface":
            surface.fill(app.surface_colour(entry))
        else:
            surface.fill(theme.ground)
            step = max(4, round(px(app.scale, 6) * (1 + 0.8 * np.log2(entry / CAPS[0]))))
            for x in range(-height, width + height, step):
                pygame.draw.aaline(
                    surface, mix(theme.cap, theme.ground, 0.15), (x, height), (x + height, 0), px(app.scale, 2)
                )
        pygame.draw.rect(surface, chrome(theme).border, surface.get_rect(), 1)
        return surface

    def handle(self, event) -> bool:
        """Take what was pressed into the hand."""
        if event.type == pygame_gui.UI_BUTTON_PRESSED and event.ui_element in self.buttons:
            self.app.choose(self.layer, self.buttons[event.ui_element])
            return True
        return False

    def update(self):
        """Mark what is in hand; show pictures that have become ready."""
        chosen = self.app.paint[self.layer]
        if chosen != self._marked:
            self._marked = chosen
            for button, entry in self.buttons.items():
                (button.select if entry == chosen else button.unselect)()
        for button in self._waiting[:]:
            picture, ready = self.app.thumbnails.get(self.buttons[button], self.picture)
            if ready:
                self._waiting.remove(button)
                set_pictures(button, picture, at=(0.5, 0.14))


class Thumbnails:
    """Pictures of brushes, made in the background; a plain one until then."""

    def __init__(self, app):
        self.app = app
        self.made: dict = {}
        self._asked: dict = {}
        self._pool = None

    def get(self, name, size):
        """(surface, whether it is the final one)."""
        theme = self.app.theme.name
        key = (name, size, theme, self._source(name))
        if key in self.made:
            return self.made[key], True
        job = self._asked.get(key)
        if job is None:
            job = self._asked[key] = self._ask(name, size, theme)
        if job is None:  # there is nobody to make them
            self.made[key] = self._plain(name, size)
            return self.made[key], True
        if job.done():
            self.made[key] = self._plain(name, size) if job.exception() else self._framed(job.result())
            return self.made[key], True
        return self._plain(name, size), False

    def _source(self, name):
        brush = self.app.find_brush(name)
        return getattr(brush, "source", b"")

    def _ask(self, name, size, theme):
        try:
            from flockbrush.play.thumbnails import thumbnail
        except ImportError:
            return None
        brush = self.app.find_brush(name)
        if brush is None:
            return None
        if self._pool is None:
            from concurrent.futures import ThreadPoolExecutor

            self._pool = ThreadPoolExecutor(1, "thumbnails")
        return self._pool.submit(thumbnail, brush, size, theme)

    def _framed(self, array):
        array = np.ascontiguousarray(array[..., :3])
        surface = pygame.image.frombuffer(array.tobytes(), array.shape[1::-1], "RGB")
        pygame.draw.rect(surface, chrome(self.app.theme).border, surface.get_rect(), 1)
        return surface

    def _plain(self, name, size):
        """The brush's colour on ground."""
        theme = self.app.theme
        surface = pygame.Surface(size)
        surface.fill(mix(theme.ground, rgb(self.app.colour_of(name)), 0.35))
        pygame.draw.rect(surface, chrome(theme).border, surface.get_rect(), 1)
        return surface

    def close(self):
        """Make no more."""
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)


def fitted(text, room, scale):
    """The text as far as there is room for it on a picture's button."""
    from flockbrush.play.theme import font

    letters = font(px(scale, 12))
    if letters.size(text)[0] <= room:
        return text
    while text and letters.size(text + "…")[0] > room:
        text = text[:-1]
    return text + "…"
