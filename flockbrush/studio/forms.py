"""A form for any command, with a row for each field of its dataclass; units and meanings are from the level schema."""

from __future__ import annotations

import math
from dataclasses import MISSING, fields
from typing import NamedTuple

import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UIDropDownMenu, UILabel, UIScrollingContainer, UITextEntryLine

from flockbrush.components.level_things import degrees_text, radians_of
from flockbrush.engine.commands import commands, default_values, from_record, place_fields
from flockbrush.levels.schema import CLASSES
from flockbrush.studio.dialogs import Modal
from flockbrush.studio.theme import px

GIVEN = {"id", "at", "points", "corners", "born", "since"}  # fields of a thing that no form asks for
PLAIN = ("str", "float", "int", "bool", "float | None", "int | None", "str | None", "str | float")
INTERNAL = "systems.undo"  # whose commands undo gives, and no person by name
STROKES = {"Paint"}  # commands that tools give piece by piece


class FormRow(NamedTuple):
    """One row of a form: label, value and tooltip of a field."""

    name: str
    label: str
    text: str
    tip: str = ""


def rows_of(command, kind="") -> list[FormRow]:
    """The rows of a command; `kind` is the level class whose units and meanings hold, such as "Goal".

    The tip of a row that no class describes is the description of the command, which names units.
    """
    about = " ".join((type(command).__doc__ or "").replace("``", "").split())
    schema = CLASSES.get(kind)
    place = {"x", "y"} if kind else set()
    rows = []
    for field in fields(command):
        if field.name in GIVEN | place or field.type not in PLAIN:
            continue
        described = schema.property(field.name) if schema else None
        value = getattr(command, field.name)
        unit = "degrees" if field.name == "heading" else described.unit if described else ""
        label = field.name.replace("_", " ") + (f", {unit}" if unit else "")
        rows.append(FormRow(field.name, label, _shown(field.name, value), described.meaning if described else about))
    return rows


def changed(command, texts):
    """The command with these texts for its fields; ValueError with what is wrong with one."""
    kinds = {field.name: field.type for field in fields(command)}
    values = {name: getattr(command, name) for name in kinds}
    values |= {name: _value(name, text, kinds[name]) for name, text in texts.items()}
    return from_record(type(command).__name__, values)


def said(command, here) -> dict:
    """The arguments of a script key that gives a command: its fields, but what it has from its place or by default."""
    left_out = default_values(type(command)) | here
    return {name: value for name, value in vars(command).items() if name not in left_out or value != left_out[name]}


def live_commands() -> dict[str, type]:
    """Commands that a form can submit, by name: their fields are numbers and texts, lists stay empty."""
    live = {}
    for name, kind in sorted(commands().items()):
        own = fields(kind)
        plain = own and all(
            field.name != "id" and (field.type in PLAIN or field.default_factory is not MISSING) for field in own
        )
        if plain and name not in STROKES and not kind.__module__.endswith(INTERNAL) and hasattr(kind, "touches"):
            live[name] = kind
    return live


def blank(kind, xy):
    """A command to begin with, at a point of the ground: fields without a default are 0 or empty."""
    here = [round(float(v), 2) for v in xy[:2]]
    values: dict = {name: v for pair in place_fields(kind, {}) for name, v in zip(pair, here, strict=True)}
    for field in fields(kind):
        if field.name in values:
            continue
        if field.default is MISSING and field.default_factory is MISSING:
            values[field.name] = {"float": 0.0, "int": 0, "bool": False}.get(str(field.type), "")
    return kind(**values)


def _shown(name, value) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if name == "heading":
        return degrees_text(value)
    return f"{value:.12g}" if isinstance(value, float) else str(value)


def _value(name, text, kind):
    text = text.strip()
    if kind == "bool":
        words = {"yes": True, "true": True, "no": False, "false": False}
        if text.lower() not in words:
            raise ValueError(f"{name} must be yes or no, got {text!r}")
        return words[text.lower()]
    if not text and "None" in kind:
        return None
    if kind == "str | float" and _is_number(text):
        return float(text)
    if "str" in kind:
        return text
    if not _is_number(text):
        raise ValueError(f"{name} must be a number, got {text!r}")
    number = float(text)
    if kind.startswith("int"):
        if number != int(number):
            raise ValueError(f"{name} must be a whole number, got {text!r}")
        return int(number)
    return radians_of(number) if name == "heading" else number


def number(text, label) -> float:
    """The number of a text; ValueError with the label of its field, which may have a unit, and what is wrong."""
    if not _is_number(text):
        raise ValueError(f"{label.partition(',')[0]} must be a number, got {text!r}")
    return float(text)


def _is_number(text) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


class Form(Modal):
    """A window with a row for each field; Tab goes to the next one, Enter accepts, Escape closes.

    Parameters
    ----------
    rows : list of FormRow
    accept : callable
        Given {name: text}; False keeps the form open.
    choices, chosen : list of str, str
        What a menu above the rows offers, and what it shows; `choose` is called with another one.
    """

    def __init__(self, app, title, rows, accept, choices=(), chosen="", choose=None):
        self.accept, self.choose = accept, choose
        step, pad = px(app.scale, 34), px(app.scale, 12)
        above = step if choices else 0
        super().__init__(app, title, px(app.scale, 480), px(app.scale, 60) + above + step * (len(rows) + 1) + 2 * pad)
        inside = self.inside
        self.menu = None
        if choices:
            menu = pygame.Rect(pad, pad // 2, inside.width - 2 * pad, step - 4)
            self.menu = UIDropDownMenu(list(choices), chosen, menu, app.manager, self)
        body = pygame.Rect(pad, above + pad, inside.width - 2 * pad, inside.height - above - step - 3 * pad)
        self._make_rows(rows, body, step)
        button = pygame.Rect(0, inside.height - step - pad // 2, px(app.scale, 130), step - 4)
        button.right = inside.width - pad
        self.ok = UIButton(button, "OK", app.manager, self, object_id="@primary")
        button = button.move(-button.width - pad, 0)
        self.cancel = UIButton(button, "Cancel", app.manager, self)

    def _make_rows(self, rows, body, step):
        app = self.app
        scroll = UIScrollingContainer(body, app.manager, container=self, allow_scroll_x=False)
        wide = body.width - 24  # a scroll bar
        scroll.set_scrollable_area_dimensions((wide, max(step * len(rows), body.height - 4)))
        half = wide // 2
        self.entries: dict[str, UITextEntryLine] = {}
        for k, row in enumerate(rows):
            line = pygame.Rect(0, k * step, half - 8, step - 4)
            UILabel(line, row.label, app.manager, scroll, object_id="@name")
            field = pygame.Rect(half, k * step, wide - half, step - 4)
            self.entries[row.name] = UITextEntryLine(field, app.manager, container=scroll, initial_text=row.text)
            if row.tip:
                self.entries[row.name].set_tooltip(row.tip)
        if rows:
            self.take_up(self.entries[rows[0].name])

    def texts(self) -> dict[str, str]:
        """The values of the fields."""
        return {name: entry.get_text() for name, entry in self.entries.items()}

    def handle(self, event) -> bool:
        """Answer buttons, the menu and keys; whether the event was ours."""
        if event.type == pygame_gui.UI_BUTTON_PRESSED and event.ui_element in (self.ok, self.cancel):
            self.answer(event.ui_element is self.ok)
        elif event.type == pygame_gui.UI_DROP_DOWN_MENU_CHANGED and event.ui_element is self.menu:
            self.choose(event.text)
        elif event.type == pygame.KEYDOWN and event.key == pygame.K_TAB:
            self._next(-1 if event.mod & pygame.KMOD_SHIFT else 1)
        elif event.type == pygame.KEYDOWN and event.key in (pygame.K_RETURN, pygame.K_KP_ENTER):
            self.answer(True)
        elif event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE:
            self.answer(False)
        else:
            return False
        return True

    def _next(self, step):
        names = list(self.entries)
        focus = self.app.manager.get_focus_set() or ()
        now = next((k for k, name in enumerate(names) if self.entries[name] in focus), -step)
        if names:
            self.take_up(self.entries[names[(now + step) % len(names)]])

    def answer(self, accepted):
        """Close, with the texts when they are accepted."""
        if not self.alive() or (accepted and self.accept(self.texts()) is False):
            return
        self.kill()
