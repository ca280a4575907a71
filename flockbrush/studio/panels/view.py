"""The View panel: overlays, camera, colours and text size."""

from __future__ import annotations

import pygame
from pygame_gui.elements import UILabel

from flockbrush.render.overlay_registry import OVERLAYS, load_overlays
from flockbrush.render.style import PALETTES, THEMES
from flockbrush.studio.panels.panel import ScrollPanel

ALWAYS = {
    "trails": ("Trails", "Path of each animal in the last seconds"),
    "shadows": ("Shadows", "Shadows under the animals; they show the height of birds"),
    "dust": ("Dust and ripples", "Dust behind runners on dry ground, ripples behind swimmers and waders"),
}
CAMERA = {
    "space": ("3D view", "View the herd in 3D (key 3): the middle button orbits, the wheel zooms"),
    "follow": ("Follow the herd", "Keep the herd, or the selected animal, in view (T)"),
}
AUTOMATIC = "automatic"
SCALES = (0.75, 1.0, 1.25, 1.5, 2.0, 3.0)


class ViewPanel(ScrollPanel):
    """Settings of overlays, camera, colours and text size."""

    title = "View"
    tip = "Overlays, camera, colours and text size"

    def make(self):
        super().make()
        px = self.px
        self.camera, self.boxes, y = {}, {}, self.heading("Camera", 0)
        for name, (words, tip) in CAMERA.items():
            turn = lambda on, name=name: self._turn(name, on)  # noqa: E731
            self.camera[name] = self.check(words, y, self._camera_now(name), turn, tip)
            y += px(24)
        y += px(4)
        for heading, offered in overlays().items():
            y = self.heading(heading, y)
            for name, (words, tip) in offered.items():
                show = lambda on, name=name: self._show(name, on)  # noqa: E731
                self.boxes[name] = self.check(words, y, name in self.app.overlays, show, tip)
                y += px(24)
            y += px(4)
        y, theme, scales = self.heading("Window", y), self.app.theme, [AUTOMATIC, *map(said, SCALES)]
        self.theme = self._menu("Colours", THEMES, theme.name, self.app.set_theme, y)
        self._menu("Brushes", PALETTES, theme.palette, self.app.set_palette, y + px(34))
        self.scale = self._menu("Text size", scales, self._scale_now(), self._set_scale, y + px(68))
        self.scroll.set_scrollable_area_dimensions((self.wide, y + px(106)))

    def refresh(self):
        for name, box in self.boxes.items():
            if box.is_checked != (name in self.app.overlays):
                box.set_state(name in self.app.overlays)
        for name, box in self.camera.items():
            if box.is_checked != self._camera_now(name):
                box.set_state(self._camera_now(name))

    def _turn(self, name, on):
        if on != self._camera_now(name):
            (self.app.toggle_space if name == "space" else self.app.toggle_follow)()

    def _show(self, name, on):
        (self.app.overlays.add if on else self.app.overlays.discard)(name)
        self.app.remember(overlays={**self.app.settings.overlays, name: on})

    def _set_scale(self, text):
        self.app.set_scale(None if text == AUTOMATIC else float(text.rstrip(" %")) / 100)

    def _camera_now(self, name) -> bool:
        """Whether the view is in space, or follows."""
        canvas = self.app.canvas
        return bool(canvas.in_space if name == "space" else canvas.follows)

    # widgets ---------------------------------------------------------------------

    def _menu(self, words, options, chosen, do, y):
        """A menu with its words before it."""
        rect = pygame.Rect(0, y, self.wide // 2 - self.px(8), self.px(28))
        UILabel(rect, words, self.manager, container=self.scroll, object_id="@panel_row")
        return self.menu(options, chosen, pygame.Rect(self.wide // 2, y, self.wide // 2, self.px(28)), do, "@up")

    def _scale_now(self) -> str:
        """The choice in words of the drop-down."""
        chosen = self.app.settings.ui_scale
        return said(min(SCALES, key=lambda scale: abs(scale - chosen))) if chosen else AUTOMATIC


def overlays() -> dict[str, dict[str, tuple[str, str]]]:
    """{heading: {name: (title, what it shows)}} of everything that can be laid over the herd."""
    load_overlays()
    groups: dict = {"Herd": dict(ALWAYS), "Ground": {}, "Selected animal": {}}
    for name, overlay in OVERLAYS.items():
        heading = "Selected animal" if overlay.of_one else "Ground" if overlay.below else "Herd"
        groups[heading][name] = overlay.title, overlay.tip
    return groups


def said(scale) -> str:
    """A scale as people write it."""
    return f"{round(100 * scale)} %"
