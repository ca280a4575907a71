"""The left column: tools, what can be set about the one in hand, and its palette."""

from __future__ import annotations

import pygame
import pygame_gui
from pygame_gui.elements import UICheckBox, UIDropDownMenu, UIPanel, UIScrollingContainer, UITextBox

from flockbrush.studio.brush_palette import PaletteButtons
from flockbrush.studio.shortcuts import shown
from flockbrush.studio.theme import px
from flockbrush.studio.tools import offered
from flockbrush.studio.widgets import NO_MARGINS, Slider, SliderScale, icon_button, marked, words

SWITCHED = (pygame_gui.UI_CHECK_BOX_CHECKED, pygame_gui.UI_CHECK_BOX_UNCHECKED)
ACROSS = 5  # tools side by side
PALETTE, TIP = 170, 110  # pixels at scale 1 that a palette, and a tip, have at least
SCROLL_BAR = 22  # pixels, whatever the scale
SWITCHES = {
    "solid": ("Solid", "Animals cannot walk through the obstacle"),
    "blocks_view": ("Blocks the view", "Animals cannot see through the obstacle"),
}


class Toolbox:
    """Tool buttons, options and palette."""

    def __init__(self, app, rect):
        self.app, self.rect = app, rect
        self.back = UIPanel(rect, 1, app.manager, margins=NO_MARGINS)
        self.pad = px(app.scale, 8)
        self.tools = {}
        bottom = self._make_tools()
        self.inside = pygame.Rect(self.pad, bottom, rect.width - 2 * self.pad, rect.height - bottom - self.pad)
        self.lower = None
        self.palette = None
        self.show()

    def _make_tools(self):
        app, pad = self.app, self.pad
        step = (self.rect.width - 2 * pad) // ACROSS
        side = step - px(app.scale, 2)
        kinds = offered(app.session)
        for k, kind in enumerate(kinds):
            place = pygame.Rect(pad + k % ACROSS * step, pad + k // ACROSS * step, side, side)
            tip = f"<b>{kind.title}</b>   [{shown(kind.key)}]<br>{kind.tip}."
            self.tools[icon_button(app, place, kind.icon, tip, self.back, size=21)] = kind.name
        return pad + -(-len(kinds) // ACROSS) * step + px(app.scale, 4)

    def show(self):
        """Show the options and the palette of the tool in hand."""
        app, tool = self.app, self.app.tool
        for button, name in self.tools.items():
            marked(button, name == tool.name)
        if self.lower is not None:
            self.lower.kill()
        self.sliders, self.menus, self.switches, self.palette = {}, {}, {}, None
        pen = "shape" not in tool.options or app.options["shape"] == "pen"
        options = [name for name in tool.options if name != "size" or pen]
        layer = app.options["layer"] if tool.palette == "layer" else tool.palette
        top = px(app.scale, 30) + sum(self._height(name) for name in options)
        least = px(app.scale, PALETTE if layer else TIP)
        wide, rest = self.inside.width, self.inside.height - top
        if rest < least:  # the options, and the palette below them, scroll as one
            wide, rest = wide - SCROLL_BAR, least
            self.lower = UIScrollingContainer(self.inside, app.manager, container=self.back, allow_scroll_x=False)
            self.lower.set_scrollable_area_dimensions((wide, top + rest))
        else:
            self.lower = UIPanel(
                self.inside, 1, app.manager, container=self.back, margins=NO_MARGINS, object_id="@clear"
            )
        words(app, pygame.Rect(0, 0, wide, px(app.scale, 26)), tool.title, self.lower, "@title")
        y = px(app.scale, 28)
        for option in options:
            self._option(option, y, wide)
            y += self._height(option)
        place = pygame.Rect(0, top, wide, rest)
        if layer:
            self.palette = PaletteButtons(app, place, self.lower, layer)
        else:
            UITextBox(tool.tip + ".", place, app.manager, container=self.lower, object_id="@note")

    def _height(self, option):
        """Pixels that an option takes."""
        return px(self.app.scale, 34 if self.app.choices(option) else 28 if option in SWITCHES else 46)

    def _option(self, name, y, wide):
        """Make the control of an option."""
        app = self.app
        row = pygame.Rect(0, y, wide, px(app.scale, 38))
        choices = [(text, value) for value, text in app.choices(name).items()]
        if choices:
            place = pygame.Rect(0, y, wide, px(app.scale, 28))
            start = next((pair for pair in choices if pair[1] == app.options[name]), choices[0])
            self.menus[UIDropDownMenu(choices, start, place, app.manager, self.lower)] = name
            return
        if name in SWITCHES:
            title, tip = SWITCHES[name]
            side = px(app.scale, 20)
            box = UICheckBox(
                pygame.Rect(0, y, side, side), title, app.manager, self.lower, tool_tip_text=tip, object_id="@check",
                initial_state=app.options[name],
            )  # fmt: skip
            self.switches[box] = name
            return
        self.sliders[name] = self._slider(name, row)

    def _slider(self, name, row):
        app = self.app
        title, value, scale, change, tip = {
            "size": ("Size", app.size, SliderScale(*app.sizes(), "{:.3g} m".format, True), app.set_size,
                     "Radius of the round tools, m (keys [ and ], or Ctrl and the mouse wheel)"),
            "softness": ("Softness", app.softness, SliderScale(0.0, 1.0, lambda share: f"{round(100 * share)} %"),
                         app.set_softness, "How much the stroke fades towards its edge"),
            "count": ("Animals", app.options["count"], SliderScale(1, 500, lambda count: f"{round(count):,}", True),
                      app.set_count, "Number of animals added at once"),
        }[name]  # fmt: skip
        return Slider(app, row, title, value, scale, change, self.lower, tip)

    def handle(self, event) -> bool:
        """Tools, options and palette."""
        app = self.app
        if event.type == pygame_gui.UI_BUTTON_PRESSED and event.ui_element in self.tools:
            app.take_tool(self.tools[event.ui_element])
            return True
        if event.type in SWITCHED and event.ui_element in self.switches:
            app.options[self.switches[event.ui_element]] = event.type == pygame_gui.UI_CHECK_BOX_CHECKED
            return True
        if event.type == pygame_gui.UI_DROP_DOWN_MENU_CHANGED and event.ui_element in self.menus:
            app.set_option(self.menus[event.ui_element], event.selected_option_id)
            return True
        if any(slider.heard(event) for slider in self.sliders.values()):
            return True
        return self.palette is not None and self.palette.handle(event)

    def update(self):
        """Show values that keys have changed, and thumbnails that have become ready."""
        app = self.app
        values = {"size": app.size, "softness": app.softness, "count": app.options["count"]}
        for name, slider in self.sliders.items():
            slider.set(values[name])
        if self.palette is not None:
            self.palette.update()
