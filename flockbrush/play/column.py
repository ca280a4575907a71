"""The right-hand column: tabs, and below them one panel at a time."""

from __future__ import annotations

import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UIPanel

from flockbrush.play.theme import px


def panel_classes():
    """The panels there are, in the order of their tabs."""
    try:
        from flockbrush.play.panels import PANELS
    except ImportError:
        return ()
    return PANELS


class Column:
    """Hosts the panels; every panel lives while the column does, and one is shown."""

    def __init__(self, app, manager, rect: pygame.Rect):
        self.app = app
        self.back = UIPanel(rect, 1, manager, margins=NO_MARGINS)
        classes = panel_classes()
        tall = px(app.scale, 34)
        wide = rect.width // max(1, len(classes))
        self.tabs, self.panels, self.holders = [], [], []
        inside = pygame.Rect(0, tall, rect.width, rect.height - tall)
        for k, kind in enumerate(classes):
            place = pygame.Rect(k * wide, 0, wide if k + 1 < len(classes) else rect.width - k * wide, tall)
            tab = UIButton(place, kind.title, manager, self.back, tool_tip_text=kind.tip or None, object_id="@tab")
            holder = UIPanel(inside, 1, manager, container=self.back, margins=NO_MARGINS)
            self.tabs.append(tab)
            self.holders.append(holder)
            self.panels.append(kind(app, manager, holder))
        self.show(min(app.memory.get("tab", 0), max(0, len(classes) - 1)))

    def show(self, index):
        """Show the panel with this number."""
        self.index = self.app.memory["tab"] = index
        for k, (tab, holder) in enumerate(zip(self.tabs, self.holders, strict=True)):
            (tab.select if k == index else tab.unselect)()
            (holder.show if k == index else holder.hide)()

    def handle(self, event) -> bool:
        """Switch tabs; the shown panel gets what else there is."""
        if event.type == pygame_gui.UI_BUTTON_PRESSED and event.ui_element in self.tabs:
            self.show(self.tabs.index(event.ui_element))
            return True
        return bool(self.panels) and any(panel.handle(event) for panel in self.panels)

    def update(self, dt):
        """One frame of the shown panel."""
        if self.panels:
            self.panels[self.index].update(dt)


NO_MARGINS = {"left": 0, "right": 0, "top": 0, "bottom": 0}
