"""The palette: pictures of brushes, speed limits and surfaces to paint with."""

from __future__ import annotations

import html
from threading import Thread

import numpy as np
import pygame
import pygame_gui

from flockbrush.behaviours.brush import shipped
from flockbrush.render.brush_marks import swatch
from flockbrush.render.style import mix, rgb
from flockbrush.studio import thumbnails
from flockbrush.studio.theme import chrome, font, px
from flockbrush.studio.widgets import PictureButton, Shelf, fitted, marked

CAPS = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 8.0)  # m/s
ACROSS = 2  # pictures side by side


def whence(brush) -> str:
    """Tooltip text about the origin of a brush's parameters, and the fit of a learned brush."""
    provenance = brush.provenance
    lines = [f"{provenance.kind}: {provenance.clip or provenance.source}"]
    if provenance.clip and provenance.frames:
        lines[0] += f", frames {provenance.frames[0]} to {provenance.frames[1]}"
    for name in ("polarization", "milling"):
        pair = [provenance.report.get(f"held-out {name}, {source}") for source in ("clip", "simulated")]
        if None not in pair:
            lines.append(f"{name} {pair[0]:.2f} in frames held out, {pair[1]:.2f} simulated")
    return "<br>".join(map(html.escape, lines))


class PaletteButtons:
    """Buttons of everything that can be painted on one layer; one of them is selected."""

    def __init__(self, app, rect, container, layer):
        self.app, self.layer = app, layer
        self.back = Shelf(rect, app.manager, container=container, object_id="@clear")
        self.entries = app.paints(layer)
        bar = 24  # pixels of pygame_gui's scroll bar, whatever the scale
        gap = px(app.scale, 4)
        wide = (rect.width - bar - (ACROSS - 1) * gap) // ACROSS
        side = min(wide - px(app.scale, 10), px(app.scale, 76))
        self.picture = (side, side) if layer == "brush" else (wide - px(app.scale, 10), round(0.55 * side))
        tall = self.picture[1] + px(app.scale, 28)
        rows = -(-len(self.entries) // ACROSS)
        self.back.set_scrollable_area_dimensions((rect.width - bar, max(1, rows * (tall + gap))))
        self._made, self._waiting, self._pictured = {}, [], {}
        self._places = {
            entry: pygame.Rect(k % ACROSS * (wide + gap), k // ACROSS * (tall + gap), wide, tall)
            for k, entry in enumerate(self.entries)
        }
        for entry, place in self._places.items():
            self.back.hold(place.top, place.bottom, lambda entry=entry: self._make(entry))
        self._marked = self.app.paint[self.layer]
        self._scroll_to_chosen(tall + gap, rows, rect.height)

    def _scroll_to_chosen(self, row, rows, height):
        """Scroll to the selected entry."""
        bar, chosen = self.back.vert_scroll_bar, self.app.paint[self.layer]
        if bar is None or chosen not in self.entries:
            return
        at = self.entries.index(chosen) // ACROSS
        if (at + 1) * row > height:
            bar.set_scroll_from_start_percentage(min(max(at - 0.4, 0) * row, rows * row - height) / (rows * row))

    @property
    def buttons(self):
        """{button: what it stands for} of all, whether they have been looked at or not."""
        return {self._make(entry): entry for entry in self.entries}

    def _make(self, entry):
        """The button of an entry, made if it is not there yet."""
        if entry in self._made:
            return self._made[entry]
        app, place = self.app, self._places[entry]
        title, tip = self._words(entry)
        if self.layer == "brush":
            self._pictured[entry] = app.find_brush(entry)
            picture, ready = self._brush_picture(entry)
        else:
            picture, ready = self._swatch(entry), True
        button = PictureButton(
            place, fitted(title, font(px(app.scale, 12)), place.width - px(app.scale, 6)), app.manager, self.back,
            tool_tip_text=tip, object_id="@swatch", pictures=[picture], at=(0.5, 0.12),
        )  # fmt: skip
        self._made[entry] = button
        if not ready:
            self._waiting.append(entry)
        if entry == self._marked:
            button.select()
        return button

    def _brush_picture(self, entry):
        """(what a brush does, above a strip of ground painted with it; whether it is the final picture)."""
        app, (width, height) = self.app, self.picture
        band = max(6, height // 6)
        side = height - band - 2
        picture, ready = app.thumbnails.get(entry, (side, side))
        strip = swatch(entry, rgb(app.colour_of(entry)), app.theme, (width, band), app.scale)
        whole = pygame.Surface(self.picture, pygame.SRCALPHA)
        whole.blit(picture, ((width - side) // 2, 0), special_flags=pygame.BLEND_PREMULTIPLIED)
        whole.blit(pygame.surfarray.make_surface(strip.swapaxes(0, 1)), (0, height - band))
        return whole, ready

    def _words(self, entry):
        """(what is written, tooltip)."""
        app = self.app
        if self.layer == "cap":
            return f"{entry:g} m/s", f"Speed limit {entry:g} m/s"
        if self.layer == "surface":
            return (entry or "bare ground"), ("No surface" if not entry else f"Surface: {entry}")
        brush = app.find_brush(entry)
        title = getattr(brush, "title", "") or entry
        return entry, f"<b>{html.escape(title)}</b><br>model {brush.model}<br>{whence(brush)}" if brush else entry

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
        """Select the entry that was pressed."""
        if event.type == pygame_gui.UI_BUTTON_PRESSED:
            for entry, button in self._made.items():
                if event.ui_element is button:
                    self.app.choose(self.layer, entry)
                    return True
        return False

    def update(self):
        """Mark the selected entry, and show pictures that are ready."""
        chosen = self.app.paint[self.layer]
        if chosen != self._marked:
            self._marked = chosen
            for entry, button in self._made.items():
                marked(button, entry == chosen)
        if not any(pygame.mouse.get_pressed()):  # not at every step of a slider
            self._look_again()
        for entry in self._waiting[:]:
            picture, ready = self._brush_picture(entry)
            if ready:
                self._waiting.remove(entry)
                self._made[entry].picture(picture, at=(0.5, 0.12))

    def _look_again(self):
        """Show brushes as they are since they were changed, or since that was undone."""
        for entry, was in self._pictured.items():
            now = self.app.find_brush(entry)
            if now is not was:
                self._pictured[entry] = now
                picture, ready = self._brush_picture(entry)
                self._made[entry].picture(picture, at=(0.5, 0.12))
                if not ready and entry not in self._waiting:
                    self._waiting.append(entry)


class Thumbnails:
    """Pictures of what brushes do: from the cache, or made by another process.

    Until `start` is called nothing is made: tests and pictures of the window take what there is.
    """

    SIDE = 128  # pixels, whatever the size on the screen: one picture serves every window

    def __init__(self, app):
        self.app = app
        self.made: dict = {}
        self._plain: dict = {}
        self._bodies: dict = {}  # by library and source of a brush
        self._working = False
        self._makers: dict = {}  # process by theme
        self._thread = None

    def start(self):
        """From now on make what is missing."""
        self._working = True

    def get(self, name, size):
        """(surface, whether it is the final one)."""
        brush, theme = self.app.find_brush(name), self.app.theme
        if brush is None:
            return pygame.Surface(size, pygame.SRCALPHA), True
        own = theme.palette == "own"
        colour = None if own else self.app.colour_of(name)
        library = self.app.session.library
        if (library, brush.source) not in self._bodies:
            self._bodies[library, brush.source] = thumbnails.body_of(brush, library.species)
        body = self._bodies[library, brush.source]
        key = (brush.source, size, theme.name, colour, body)
        if key in self.made:
            return self.made[key], True
        array = thumbnails.cached(brush, self.SIDE, theme, colour, body)
        if array is not None:
            self.made[key] = surface_of(array, size)
            return self.made[key], True
        if self._working:
            self._make(brush, theme, colour, body)
        if key not in self._plain:
            self._plain[key] = surface_of(thumbnails.placeholder(brush, self.SIDE, theme, colour), size)
        return self._plain[key], False

    def _make(self, brush, theme, colour, body):
        """Have a picture made: of shipped brushes by another process, of others by a thread, one after the other."""
        if colour is None and theme.name not in self._makers:
            self._makers[theme.name] = thumbnails.make_in_background((), self.SIDE, theme)
        library = shipped()
        ours = colour is None and brush.name in library.names() and library.get(brush.name).source == brush.source
        ours = ours and body == thumbnails.body_of(brush)
        if not ours and (self._thread is None or not self._thread.is_alive()):
            self._thread = Thread(
                target=thumbnails.thumbnail, args=(brush, self.SIDE, theme, colour, body), daemon=True
            )
            self._thread.start()

    def close(self):
        """Make no more."""
        self._working = False
        for process in self._makers.values():
            process.kill()  # what is half written has another name
            process.wait()


def surface_of(array, size):
    """A picture (h, w, 4) as a surface of this size, as pygame_gui wants it."""
    array = np.ascontiguousarray(array)
    surface = pygame.image.frombuffer(array.tobytes(), array.shape[1::-1], "RGBA")
    return pygame.transform.smoothscale(surface, size).premul_alpha()
