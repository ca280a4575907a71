"""The View panel: overlays, camera, colours and text size."""

from __future__ import annotations

import pygame
from pygame_gui import UI_CHECK_BOX_CHECKED, UI_CHECK_BOX_UNCHECKED, UI_DROP_DOWN_MENU_CHANGED
from pygame_gui.elements import UICheckBox, UIDropDownMenu, UILabel

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
        self.camera, self.boxes, y = {}, {}, self._head("Camera", 0)
        for name, (words, tip) in CAMERA.items():
            self.camera[name] = self._check(words, tip, y, self._camera_now(name))
            y += px(24)
        y += px(4)
        for heading, offered in overlays().items():
            y = self._head(heading, y)
            for name, (words, tip) in offered.items():
                self.boxes[name] = self._check(words, tip, y, name in self.app.overlays)
                y += px(24)
            y += px(4)
        y = self._head("Window", y)
        self._label("Colours", y)
        self.theme = self._menu(list(THEMES), self.app.theme.name, y)
        y += px(34)
        self._label("Brushes", y)
        self.palette = self._menu(list(PALETTES), self.app.theme.palette, y)
        y += px(34)
        self._label("Text size", y)
        self.scale = self._menu([AUTOMATIC, *map(said, SCALES)], self._scale_now(), y)
        y += px(38)
        self.scroll.set_scrollable_area_dimensions((self.wide, y))

    def refresh(self):
        for name, box in self.boxes.items():
            if box.is_checked != (name in self.app.overlays):
                box.set_state(name in self.app.overlays)
        for name, box in self.camera.items():
            if box.is_checked != self._camera_now(name):
                box.set_state(self._camera_now(name))

    def handle(self, event):
        if event.type in (UI_CHECK_BOX_CHECKED, UI_CHECK_BOX_UNCHECKED) and event.ui_element in self.camera.values():
            for name, box in self.camera.items():
                if event.ui_element is box and box.is_checked != self._camera_now(name):
                    (self.app.toggle_space if name == "space" else self.app.toggle_follow)()
            return True
        if event.type in (UI_CHECK_BOX_CHECKED, UI_CHECK_BOX_UNCHECKED):
            for name, box in self.boxes.items():
                if event.ui_element is box:
                    (self.app.overlays.add if box.is_checked else self.app.overlays.discard)(name)
                    self.app.remember(overlays={**self.app.settings.overlays, name: box.is_checked})
                    return True
        if event.type == UI_DROP_DOWN_MENU_CHANGED and event.ui_element is self.theme:
            self.app.set_theme(event.text)
            return True
        if event.type == UI_DROP_DOWN_MENU_CHANGED and event.ui_element is self.palette:
            self.app.set_palette(event.text)
            return True
        if event.type == UI_DROP_DOWN_MENU_CHANGED and event.ui_element is self.scale:
            self.app.set_scale(None if event.text == AUTOMATIC else float(event.text.rstrip(" %")) / 100)
            return True
        return False

    def _camera_now(self, name) -> bool:
        """Whether the view is in space, or follows."""
        canvas = self.app.canvas
        return bool(canvas.in_space if name == "space" else canvas.follows)

    # widgets ---------------------------------------------------------------------

    def _head(self, words, y) -> int:
        """A heading; returns where what follows begins."""
        rect = pygame.Rect(0, y, self.wide, self.px(26))
        UILabel(rect, words, self.manager, container=self.scroll, object_id="@heading")
        return y + self.px(26)

    def _label(self, words, y):
        rect = pygame.Rect(0, y, self.wide // 2 - self.px(8), self.px(28))
        UILabel(rect, words, self.manager, container=self.scroll, object_id="@panel_row")

    def _check(self, words, tip, y, checked) -> UICheckBox:
        side = self.px(20)
        return UICheckBox(
            pygame.Rect(0, y, side, side), words, self.manager, container=self.scroll, object_id="@check",
            initial_state=checked, tool_tip_text=tip,
        )  # fmt: skip

    def _menu(self, options, chosen, y) -> UIDropDownMenu:
        rect = pygame.Rect(self.wide // 2, y, self.wide // 2, self.px(28))
        return UIDropDownMenu(options, chosen, rect, self.manager, container=self.scroll, object_id="@up")

    def _scale_now(self) -> str:
        """What the person has chosen, as the drop-down says it."""
        chosen = self.app.settings.ui_scale if self.app.settings is not None else None
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
