"""Buttons with pictures, and other small things made from pygame_gui's widgets."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from itertools import zip_longest
from typing import NamedTuple

import pygame
import pygame_gui
from pygame_gui.elements import UIButton, UIDropDownMenu, UIHorizontalSlider, UILabel, UIScrollingContainer

from flockbrush.studio.icons import icon
from flockbrush.studio.shortcuts import BY_NAME, tip_of
from flockbrush.studio.theme import chrome, px

NO_MARGINS = {"left": 0, "right": 0, "top": 0, "bottom": 0}


def fitted(text, letters, room) -> str:
    """The text, or its beginning with three dots when it is wider than the room."""
    if letters.size(text)[0] <= room:
        return text
    while text and letters.size(text.rstrip() + "…")[0] > room:
        text = text[:-1]
    return text.rstrip() + "…" if text else ""


class PictureButton(UIButton):
    """A button with a picture for each of its states, which are there when it is drawn for the first time."""

    icon = ""  # the name of its picture, if it is one of our icons

    def __init__(self, *arguments, pictures, at=(0.5, 0.5), **more):
        self._pictures, self._at = pictures, at
        super().__init__(*arguments, **more)

    def picture(self, *pictures, at=(0.5, 0.5)):
        """Show other surfaces."""
        self._pictures, self._at = pictures, at
        self.rebuild()
        if self.is_selected:
            self.select()

    def rebuild(self):
        normal = self._pictures[0]
        for state, image in zip_longest(("normal", "hovered", "selected", "disabled"), self._pictures):
            setattr(self, f"{state}_images", [image or normal])
            setattr(self, f"{state}_image_positions", [self._at])
        super().rebuild()


def icon_button(app, rect, picture, tip, container, size=18) -> PictureButton:
    """A button with one of our icons."""
    icons = _icons(app, picture, size)
    button = PictureButton(rect, "", app.manager, container, tool_tip_text=tip, object_id="@tool", pictures=icons)
    button.icon = picture
    return button


def icon_row(app, place, step, icons, container) -> list[PictureButton]:
    """Buttons from a place on, `step` pixels from one to the next: (icon, tip, what a press does) each."""
    buttons = []
    for k, (picture, tip, do) in enumerate(icons):
        buttons.append(icon_button(app, place.move(k * step, 0), picture, tip, container))
        app.buttons[buttons[-1]] = do
    return buttons


def set_icon(app, button, picture):
    """Show an icon on a button, if it shows another."""
    if picture != button.icon:
        button.icon = picture
        button.picture(*_icons(app, picture, 18))


def _icons(app, picture, size):
    c, side = chrome(app.theme), px(app.scale, size)
    return [icon(picture, side, colour) for colour in (c.ink, c.ink, c.accent, c.faint)]


def chosen(buttons, which):
    """Show which one of some buttons is chosen, by its number."""
    for k, button in enumerate(buttons):
        marked(button, k == which)


def marked(button, on):
    """Show a button as chosen, or not."""
    (button.select if on else button.unselect)()


def enabled(button, can):
    """Let a button be pressed, or not."""
    if bool(can) != bool(button.is_enabled):
        (button.enable if can else button.disable)()


def is_open(menu: UIDropDownMenu) -> bool:
    """Whether the list of a menu is shown."""
    return menu.current_state is menu.menu_states["expanded"]


def close_menus(manager) -> bool:
    """Close the menus whose lists are shown; whether there was one."""
    menus = [one for one in manager.get_sprite_group().sprites() if isinstance(one, UIDropDownMenu) and is_open(one)]
    for menu in menus:
        shown = menu.menu_states["expanded"]
        shown.target_state, shown.should_transition = "closed", True
    return bool(menus)


def action_button(app, rect, name, container) -> PictureButton:
    """The button of an action of the table; a press does it."""
    action = BY_NAME[name]
    return icon_row(app, rect, 0, [(action.icon, tip_of(action), partial(action.do, app))], container)[0]


class Shelf(UIScrollingContainer):
    """A column to scroll through whose parts are made when they come into view: most are never looked at."""

    def __init__(self, *arguments, **more):
        self._coming: list = []  # (top, bottom, make) of the parts, pixels from the top of the whole column
        super().__init__(*arguments, allow_scroll_x=False, **more)

    def hold(self, top, bottom, make):
        """Have something made as soon as what lies there comes into view."""
        self._coming.append((top, bottom, make))

    def update(self, time_delta):
        super().update(time_delta)
        if self._coming and self.visible:
            low = -self.scrollable_container.relative_rect.top
            high = low + self.rect.height
            visible = [part for part in self._coming if part[1] > low and part[0] < high]
            if visible:
                self._coming = [part for part in self._coming if part not in visible]
                for _, _, make in visible:
                    make()


class Words(UILabel):
    """A label that is drawn anew only when its text changes."""

    def say(self, text):
        """Show this text, as much of it as there is room for."""
        if text != getattr(self, "said", None):
            self.said = text
            room = self.relative_rect.width - 4
            self.set_text(fitted(text, self.font, room) if room > 0 else text)


def words(app, rect, text, container, object_id=None) -> Words:
    """A label."""
    label = Words(rect, "", app.manager, container, object_id=object_id)
    label.say(text)
    return label


class SliderScale(NamedTuple):
    """What a slider can be set to, and how that is written."""

    low: float
    high: float
    show: Callable[[float], str]
    power: bool = False  # whether equal steps multiply: for sizes

    def way(self, value):
        """How far along it a value is, 0 to 1000."""
        value = min(max(value, self.low), self.high)
        if self.power:
            return round(1000 * math.log(value / self.low) / math.log(self.high / self.low))
        return round(1000 * (value - self.low) / (self.high - self.low))

    def value(self, way):
        """The value so far along it."""
        share = way / 1000
        return self.low * (self.high / self.low) ** share if self.power else self.low + (self.high - self.low) * share


class Slider:
    """A name, a value with its unit, and a slider."""

    def __init__(self, app, rect, name, value, scale, changed, container, tip=None):
        self.scale, self.changed = scale, changed
        half = rect.height // 2
        self.name = words(app, pygame.Rect(rect.x, rect.y, rect.width // 2, half), name, container, "@muted")
        right = pygame.Rect(rect.x + rect.width // 2, rect.y, rect.width - rect.width // 2, half)
        self.value = words(app, right, scale.show(value), container, "@value")
        track = pygame.Rect(rect.x, rect.y + half, rect.width, px(app.scale, 16))
        self.slider = UIHorizontalSlider(
            track, scale.way(value), (0, 1000), app.manager, container, object_id="@slider", click_increment=20
        )
        if tip:
            self.name.set_tooltip(tip)
        self._set = None

    def set(self, value):
        """Show a value that was changed elsewhere."""
        text = self.scale.show(value)
        if text != self._set:
            self._set = text
            self.value.say(text)
            if abs(self.slider.get_current_value() - self.scale.way(value)) > 1:
                self.slider.set_current_value(self.scale.way(value))
                self.slider.has_moved_recently = False

    def heard(self, event) -> bool:
        """Take the value of an event, if it is one of this slider."""
        own = event.type == pygame_gui.UI_HORIZONTAL_SLIDER_MOVED and event.ui_element is self.slider
        if own:
            value = self.scale.value(event.value)
            self._set = self.scale.show(value)
            self.value.say(self._set)
            self.changed(value)
        return own
