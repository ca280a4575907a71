"""Rows of the Brush panel: name, unit, the asset's value, and a slider, check box or drop-down to turn it."""

from __future__ import annotations

from typing import Any

import pygame
from pygame_gui import (
    UI_BUTTON_PRESSED,
    UI_CHECK_BOX_CHECKED,
    UI_CHECK_BOX_UNCHECKED,
    UI_DROP_DOWN_MENU_CHANGED,
    UI_HORIZONTAL_SLIDER_MOVED,
    UI_TEXT_ENTRY_CHANGED,
    UI_TEXT_ENTRY_FINISHED,
)
from pygame_gui.core import ObjectID
from pygame_gui.elements import UIButton, UICheckBox, UIDropDownMenu, UIHorizontalSlider, UITextEntryLine

from flockbrush.studio.icons import icon
from flockbrush.studio.panels.knobs import CHOICE, NUMBER, SENTENCE, SWITCH, WHOLE, Knob, Scale
from flockbrush.studio.panels.panel import Picture, blank, picture_on, write


class PanelRow:
    """One knob on the panel.  Its widgets are made when it comes into view, or when somebody asks for one of them.

    `turn(knob, value, done)` is called when the designer has turned it; `done` is False while the mouse still drags.
    """

    reset: UIButton | None
    shown: Any  # (value, the asset's value), once there is something to show

    def __init__(self, panel, knob: Knob, container, top: int, width: int, turn):
        self.panel, self.knob, self.container, self.turn = panel, knob, container, turn
        self.top, self.width = top, width
        self.line = panel.px(20)
        self.reset = None
        self.shown = None
        self.made = False
        container.hold(top, top + self.height, self.make)

    def __getattr__(self, name):
        if name not in WIDGETS or self.made:
            raise AttributeError(f"{type(self).__name__} has no {name!r}")
        self.make()
        return getattr(self, name)

    def make(self):
        """Make the widgets, if they are not there yet."""
        if not self.made:
            self.made = True
            self._make()
            if self.shown is not None:
                self._bring(*self.shown)

    def _make(self):
        place = pygame.Rect(0, self.top, self.width, self.height)
        tip = f"<b>{self.knob.words}</b><br>{self.knob.help}"
        self.picture = Picture(place, self.panel.manager, self.container, tip)

    def kill(self):
        """Take the widgets away."""
        for name in (*WIDGETS, "reset") if self.made else ():
            widget = getattr(self, name, None)
            if widget is not None:
                widget.kill()
        self.made = True  # and nobody makes them again

    @property
    def height(self) -> int:
        """Pixels down to the next row."""
        return self.panel.px(65 if self.knob.note else 46)

    def show(self, value, asset):
        """Show a value against the asset's."""
        if self.shown == (value, asset):
            return
        self.shown = value, asset
        if self.made:
            self._bring(value, asset)

    def _bring(self, value, asset):
        self.picture.show(self.drawn(value, asset))
        self._offer_reset(value != asset)
        self.place(value)

    def place(self, value):
        """Bring the widget to a value."""

    def settle(self):
        """Take what was typed and left without Enter."""

    def handle(self, event) -> bool:
        """Answer an event of one of the row's widgets."""
        return self.made and (self.heard(event) or self._is_reset(event))

    def heard(self, event) -> bool:
        """Whether an event turns the knob."""
        return False

    def _is_reset(self, event):
        if event.type == UI_BUTTON_PRESSED and self.reset is not None and event.ui_element is self.reset:
            self.turn(self.knob, self.shown[1], True)
            return True
        return False

    def drawn(self, value, asset) -> pygame.Surface:
        """The words of the row: name and unit left, the value against the asset's right when it has been changed."""
        panel, colours, knob = self.panel, self.panel.colours, self.knob
        surface, height, y = blank((self.width, self.height)), panel.px(13), self.line / 2
        right, pad = self.width - panel.px(2), panel.px(6)
        right -= write(surface, self.against(), (right, y), height, colours.accent, (1, 0.5)) + pad
        x = write(surface, knob.words, (0, y), height, colours.ink, room=right)
        write(surface, knob.measure, (x + pad, y), panel.px(12), colours.muted, room=right - x - pad)
        write(surface, knob.note, (0, self.note_y), panel.px(12), colours.muted, room=self.width)
        return surface

    @property
    def note_y(self) -> float:
        """Pixels from the row's top to the middle of its note."""
        return self.panel.px(53)

    def against(self) -> str:
        """The value against the asset's, "" when they are the same."""
        value, asset = self.shown
        return f"{self.knob.said(value)}, asset {self.knob.said(asset)}" if value != asset else ""

    def _offer_reset(self, offered):
        """A button that takes the asset's value back, while there is something to take back."""
        if offered and self.reset is None:
            self.reset = UIButton(
                self.reset_rect,
                "",
                self.panel.manager,
                container=self.container,
                tool_tip_text=f"Back to the asset's {self.knob.words}",
                object_id=ObjectID(object_id="#reset_button", class_id="@tool"),
            )
            picture_on(self.reset, icon("undo", self.panel.px(14), self.panel.colours.accent))
        elif not offered and self.reset is not None:
            self.reset.kill()
            self.reset = None

    @property
    def reset_rect(self) -> pygame.Rect:
        """Where the reset button stands: at the right end of the second line."""
        side = self.panel.px(22)
        return pygame.Rect(self.width - side, self.top + self.line, side, side)


class NumberRow(PanelRow):
    """A slider with a box to type in; a mark on the track shows the asset's value."""

    scale: Any  # Scale, as soon as the asset's value is known

    def __init__(self, panel, knob, container, top, width, turn):
        super().__init__(panel, knob, container, top, width, turn)
        self.scale = None
        self.typing = False  # something was typed, and not yet taken
        px = panel.px
        self.track = pygame.Rect(0, top + self.line + px(2), width - px(58) - px(22) - px(10), px(16))

    def _make(self):
        super()._make()
        px, knob = self.panel.px, self.knob
        common = dict(manager=self.panel.manager, container=self.container)
        self.slider = UIHorizontalSlider(self.track, 0.0, (0.0, 1.0), object_id="@slider", **common)
        self.entry = UITextEntryLine(
            pygame.Rect(self.track.right + px(6), self.top + self.line, px(58), px(22)),
            object_id="@panel_entry",
            **common,
        )
        self.entry.set_text_length_limit(16)
        self.entry.set_tooltip(f"Type a value{f' in {knob.unit}' if knob.unit else ''} and press Enter")

    def show(self, value, asset):
        if self.scale is None or self.shown is None or self.shown[1] != asset:
            self.scale = Scale.of(self.knob, asset)
        super().show(value, asset)

    def place(self, value):
        if self.scale is not None and not self.held and abs(self.slider.current_value - self.scale.along(value)) > 1e-9:
            self.slider.set_current_value(self.scale.along(value), warn=False)
        if not self.entry.is_focused:
            self.entry.set_text(self.knob.said(value))

    @property
    def held(self) -> bool:
        """Whether the mouse holds the slider now."""
        return self.made and bool(self.slider.sliding_button is not None and self.slider.sliding_button.held)

    def drawn(self, value, asset):
        surface, panel = super().drawn(value, asset), self.panel
        if self.scale is None:
            return surface
        x, y, size = self.mark_x(asset), self.track.bottom - self.top, panel.px(4)
        colour = panel.colours.accent if value != asset else panel.colours.muted
        pygame.draw.polygon(surface, colour, [(x - size, y + size + 1), (x + size, y + size + 1), (x, y)])
        return surface

    def mark_x(self, asset) -> float:
        """Pixels from the row's left end to the asset's value on the track."""
        slider = self.slider
        inside = slider.sliding_button_width / 2 + self.scale.along(asset) * slider.scrollable_width
        return self.track.x + (self.track.width - slider.scrollable_width - slider.sliding_button_width) / 2 + inside

    def heard(self, event):
        if event.type == UI_HORIZONTAL_SLIDER_MOVED and event.ui_element is self.slider:
            self.turn(self.knob, self.scale.value(self.slider.current_value), not self.held)
            return True
        if event.type == UI_TEXT_ENTRY_CHANGED and event.ui_element is self.entry:
            self.typing = True
            return True
        if event.type == UI_TEXT_ENTRY_FINISHED and event.ui_element is self.entry:
            self._typed(event.text)
            return True
        return False

    def settle(self):
        if self.typing and not self.entry.is_focused:
            self._typed(self.entry.get_text())

    def _typed(self, text):
        self.typing = False
        try:
            value = self.shown[0] if text == self.knob.said(self.shown[0]) else self.knob.read(text)
        except ValueError as error:
            self.panel.app.notify(str(error), "warning")
            value = self.shown[0]
        if self.entry.is_focused:
            self.panel.manager.set_focus_set(None)
        self.entry.set_text(self.knob.said(value))
        if value != self.shown[0]:
            self.turn(self.knob, value, True)


class SentenceRow(PanelRow):
    """A row without a widget: a sentence with the reason."""

    @property
    def height(self) -> int:
        return self.panel.px(42)

    @property
    def note_y(self) -> float:
        return self.panel.px(28)

    def show(self, value, asset):
        super().show(value, value)


class SwitchRow(PanelRow):
    """A check box."""

    def _make(self):
        super()._make()
        side = self.panel.px(20)
        self.box = UICheckBox(
            pygame.Rect(0, self.top + self.line, side, side), "yes", self.panel.manager, container=self.container,
            object_id="@check",
        )  # fmt: skip

    def place(self, value):
        self.box.set_state(bool(value))

    def heard(self, event):
        if event.type in (UI_CHECK_BOX_CHECKED, UI_CHECK_BOX_UNCHECKED) and event.ui_element is self.box:
            if self.box.is_checked != self.shown[0]:
                self.turn(self.knob, self.box.is_checked, True)
            return True
        return False


class ChoiceRow(PanelRow):
    """A drop-down."""

    menu: UIDropDownMenu | None

    def _make(self):
        super()._make()
        self.menu = None

    def place(self, value):
        if self.menu is not None and self.menu.selected_option[0] == value:
            return
        if self.menu is not None:
            self.menu.kill()
        px = self.panel.px
        rect = pygame.Rect(0, self.top + self.line, self.width - px(28), px(22))
        self.menu = UIDropDownMenu(
            list(self.knob.choices), value, rect, self.panel.manager, container=self.container, object_id="@choice"
        )

    def heard(self, event):
        if event.type == UI_DROP_DOWN_MENU_CHANGED and event.ui_element is self.menu:
            if event.text != self.shown[0]:
                self.turn(self.knob, event.text, True)
            return True
        return False


WIDGETS = ("picture", "slider", "entry", "box", "menu")  # of rows of any kind
ROWS = {NUMBER: NumberRow, WHOLE: NumberRow, SWITCH: SwitchRow, CHOICE: ChoiceRow, SENTENCE: SentenceRow}


def row_of(panel, knob, container, top, width, turn) -> PanelRow:
    """The row that fits a knob."""
    return ROWS[knob.kind](panel, knob, container, top, width, turn)
