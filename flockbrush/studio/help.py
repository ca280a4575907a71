"""The help window with all keys and buttons, generated from the tables of actions and tools."""

from __future__ import annotations

from html import escape

import pygame
from pygame_gui.elements import UITextBox, UIWindow

from flockbrush.studio.shortcuts import ACTIONS, shown
from flockbrush.studio.theme import chrome, hexed, px
from flockbrush.studio.tools import OF_RECORDINGS, TOOLS

MOUSE = (
    ("Left button", "use the tool"),
    ("Right button", "pick a brush, finish a shape, remove a point"),
    ("Middle button", "move the view; in 3D: orbit"),
    ("Alt and drag", "orbit, in 3D"),
    ("Shift and middle button", "move the view, in 3D"),
    ("Space and drag", "move the view"),
    ("Wheel", "zoom at the mouse pointer"),
    ("Ctrl + wheel", "size of the brush"),
)


def sections():
    """[(heading, [(keys, what they do), ...]), ...] of everything there is."""
    tools = [(shown(tool.key), tool.title) for tool in TOOLS]
    tools += [(shown(tool.key), f"{tool.title} (where one is open)") for tool in OF_RECORDINGS]
    groups: dict[str, list] = {}
    for action in ACTIONS:
        keys = "  or  ".join(shown(key) for key in action.keys)
        groups.setdefault(action.group, []).append((keys, action.title))
    return [("Tools", tools), ("Mouse", list(MOUSE)), *groups.items()]


def columns(theme, count) -> list[str]:
    """The page as so many columns of text, about equally long; no section is torn apart."""
    c = chrome(theme)
    parts = sections()
    share = sum(len(rows) + 2 for _, rows in parts) / count
    pages: list[list[str]] = [[] for _ in range(count)]
    used_height = 0.0
    for heading, rows in parts:
        page = pages[min(int((used_height + len(rows) / 2) / share), count - 1)]
        page.append(f"<font color={hexed(c.accent)}><b>{heading}</b></font>")
        page += [
            f"<b>{escape(keys, False)}</b>   <font color={hexed(c.muted)}>{escape(what, False)}</font>"
            for keys, what in rows
        ]
        page.append("")
        used_height += len(rows) + 2
    return ["<br>".join(page) for page in pages]


class Help(UIWindow):
    """The window with the page."""

    def __init__(self, app):
        width, height = app.screen.get_size()
        size = min(width - 20, px(app.scale, 1010)), min(height - 20, px(app.scale, 650))
        place = pygame.Rect((0, 0), size)
        place.center = width // 2, height // 2
        super().__init__(place, app.manager, "Keys and buttons", object_id="#help", draggable=True)
        inside = self.get_container().get_size()
        count = max(1, min(3, round(inside[0] / px(app.scale, 320))))
        wide = inside[0] // count
        for k, text in enumerate(columns(app.theme, count)):
            column = pygame.Rect(k * wide, 0, wide, inside[1])
            UITextBox(text, column, app.manager, container=self, object_id="@page")
