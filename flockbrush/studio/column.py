"""The right-hand column: tabs, and below them one panel at a time."""

from __future__ import annotations

import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UIPanel

from flockbrush.studio.panels import offered
from flockbrush.studio.theme import px
from flockbrush.studio.widgets import NO_MARGINS, chosen

TAB = 48  # pixels of a tab at scale 1


class Column:
    """The right-hand column: shows one panel, and creates each panel when it is shown first."""

    def __init__(self, app, manager, rect: pygame.Rect):
        self.app, self.manager = app, manager
        self.back = UIPanel(rect, 1, manager, margins=NO_MARGINS)
        self.classes = offered(app.session)
        tall, count = px(app.scale, 34), max(1, len(self.classes))
        rows = -(-count * px(app.scale, TAB) // max(rect.width, 1))  # of tabs, where their words are too wide for one
        across = -(-count // rows)
        self.tabs: list = []
        self.made: dict = {}  # panels and their containers by number
        self.inside = pygame.Rect(0, rows * tall, rect.width, rect.height - rows * tall)
        for k, kind in enumerate(self.classes):
            left, right = (round(j * rect.width / across) for j in (k % across, k % across + 1))
            place = pygame.Rect(left, k // across * tall, right - left, tall)
            tip = kind.tip or None
            self.tabs.append(UIButton(place, kind.title, manager, self.back, tool_tip_text=tip, object_id="@tab"))
        self.index = -1
        if self.classes:
            self.show(min(app.memory.get("tab", 0), len(self.classes) - 1))

    @property
    def panels(self):
        """Those that have been made."""
        return [panel for panel, _ in self.made.values()]

    def show(self, index):
        """Show the panel with this number."""
        if index not in self.made:
            holder = UIPanel(self.inside, 1, self.manager, container=self.back, margins=NO_MARGINS)
            self.made[index] = self.classes[index](self.app, self.manager, holder), holder
        self.index = self.app.memory["tab"] = index
        chosen(self.tabs, index)
        for k, (panel, holder) in self.made.items():
            (holder.show if k == index else holder.hide)()
            hook = getattr(panel, "show" if k == index else "hide", None)
            if hook is not None:
                hook()

    def show_titled(self, title):
        """Show the panel of this title, if there is one."""
        for k, kind in enumerate(self.classes):
            if kind.title == title and k != self.index:
                self.show(k)

    def handle(self, event) -> bool:
        """Switch tabs; the shown panel gets what else there is."""
        if event.type == pygame_gui.UI_BUTTON_PRESSED and event.ui_element in self.tabs:
            self.show(self.tabs.index(event.ui_element))
            return True
        return any(panel.handle(event) for panel in self.panels)

    def update(self, dt):
        """One frame of the shown panel."""
        if self.index in self.made:
            self.made[self.index][0].update(dt)
