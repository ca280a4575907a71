"""Keyboard control of widgets: F6 starts it, Tab moves, arrows change values, Enter presses."""

from __future__ import annotations

import pygame
import pygame_gui
from pygame_gui.elements import (
    UIButton,
    UICheckBox,
    UIDropDownMenu,
    UIHorizontalSlider,
    UIScrollingContainer,
    UITextEntryLine,
)

from flockbrush.studio.theme import chrome, px

KINDS = (UIHorizontalSlider, UIDropDownMenu, UICheckBox, UITextEntryLine, UIButton)
PARTS = {"#sliding_button", "#left_button", "#right_button", "#top_button", "#bottom_button", "#expand_button"}
STEPS = 50  # of a slider, from end to end; with Shift ten at once
BACK, ON = (pygame.K_LEFT, pygame.K_DOWN), (pygame.K_RIGHT, pygame.K_UP)
PRESS = (pygame.K_RETURN, pygame.K_KP_ENTER, pygame.K_SPACE)


class ControlKeys:
    """The control that has the keyboard focus, if any."""

    def __init__(self, app):
        self.app, self.now, self._at = app, None, (0, 0)

    def controls(self) -> list:
        """All that can be reached, in order: the bar above, the tools, the tabs, the bar below; each from the top."""
        elements = [e for e in self.app.manager.get_sprite_group().sprites() if isinstance(e, KINDS)]
        parts = {_words_of(menu) for menu in elements if isinstance(menu, UIDropDownMenu)}
        return sorted((e for e in elements if e not in parts and self._usable(e)), key=self._order)

    def _usable(self, element):
        whole = element.object_ids[-1] not in PARTS if element.object_ids else True
        return whole and element.alive() and element.visible and element.is_enabled and element.rect.width > 0

    def _order(self, element):
        bars, (x, y) = self.app.places, element.rect.center
        scroller = self._scroller(element)  # what lies in one may be scrolled to anywhere
        top = element.rect.top if scroller is None else scroller.rect.top
        places = (bars.top, bars.left, bars.right, bars.time)
        part = next((k for k, place in enumerate(places) if place is not None and place.collidepoint(x, top)), 4)
        return part, top, y // px(self.app.scale, 16), x

    def step(self, way):
        """Go to the next control, or the one before."""
        controls = self.controls()
        if not controls:
            return
        if self.now in controls:
            place = (controls.index(self.now) + way) % len(controls)
        elif self.now is not None:  # it was made anew
            place = min(range(len(controls)), key=lambda k: _distance(controls[k].rect.center, self._at))
        else:
            place = 0 if way > 0 else len(controls) - 1
        self.take(controls[place])

    def take(self, element):
        """Let the keys be for a control."""
        self._show(element)
        self.now, self._at = element, element.rect.center
        self.app.manager.set_focus_set(element if isinstance(element, UITextEntryLine) else None)

    def leave(self):
        """Let the keys be for tools and canvas again."""
        if self.now is not None:
            self.now = None
            self.app.manager.set_focus_set(None)

    def handle(self, event) -> bool:
        """Take a key that is for the control; whether it was one."""
        if event.type == pygame.MOUSEBUTTONDOWN:
            self.now = None
        if self.now is None or event.type not in (pygame.KEYDOWN, pygame.KEYUP):
            return False
        self._find_again()
        typing = isinstance(self.now, UITextEntryLine)
        if event.key == pygame.K_TAB:
            if event.type == pygame.KEYDOWN:
                self.step(-1 if event.mod & pygame.KMOD_SHIFT else 1)
            return True
        if event.key == pygame.K_ESCAPE:
            if event.type == pygame.KEYDOWN:
                self.leave()
            return True
        ours = not typing and event.key in (*BACK, *ON, *PRESS)
        if ours and event.type == pygame.KEYDOWN:
            self._turn(event)
        return ours

    def _find_again(self):
        """The control that stands where one stood that was made anew."""
        if not self.now.alive():
            same = [e for e in self.controls() if type(e) is type(self.now)]
            self.now = min(same, key=lambda e: _distance(e.rect.center, self._at), default=self.now)

    def _turn(self, event):
        way = 1 if event.key in ON else -1 if event.key in BACK else 0
        element = self.now
        if isinstance(element, UIHorizontalSlider) and way:
            low, high = element.value_range
            step = way * (high - low) / STEPS * (10 if event.mod & pygame.KMOD_SHIFT else 1)
            value = min(max(element.get_current_value() + step, low), high)
            element.set_current_value(round(value) if isinstance(low, int) else value, warn=False)
            self._tell(pygame_gui.UI_HORIZONTAL_SLIDER_MOVED, element, value=element.get_current_value())
        elif isinstance(element, UIDropDownMenu) and way:
            options = element.options_list
            place = min(max(options.index(element.selected_option) - way, 0), len(options) - 1)
            element.selected_option = options[place]
            text, number = options[place]
            _words_of(element).set_text(text)
            self._tell(pygame_gui.UI_DROP_DOWN_MENU_CHANGED, element, text=text, selected_option_id=number)
        elif isinstance(element, UICheckBox) and not way:
            element.set_state(not element.is_checked)
            kind = pygame_gui.UI_CHECK_BOX_CHECKED if element.is_checked else pygame_gui.UI_CHECK_BOX_UNCHECKED
            self._tell(kind, element)
        elif type(element) is not UIDropDownMenu and isinstance(element, UIButton) and not way:
            self._tell(pygame_gui.UI_BUTTON_PRESSED, element, mouse_button=1)

    def _tell(self, kind, element, **values):
        """Send the control's event to the window at once, because the control may be remade later."""
        about = {"ui_element": element, "ui_object_id": element.most_specific_combined_id}
        self.app.handle(pygame.event.Event(kind, about | values))

    # what is seen ------------------------------------------------------------------

    def _show(self, element):
        """Scroll to a control that is out of view."""
        scroller = self._scroller(element)
        if scroller is None or scroller.vert_scroll_bar is None or scroller.rect.contains(element.rect):
            return
        inner = scroller.scrollable_container.rect
        share = (element.rect.centery - inner.top - scroller.rect.height / 2) / max(inner.height, 1)
        scroller.vert_scroll_bar.set_scroll_from_start_percentage(min(max(share, 0.0), 1.0))
        scroller.vert_scroll_bar.has_moved_recently = True
        scroller.update(0.0)

    def _scroller(self, element):
        """The scrolling column that a control lies in, or None."""
        sprites = self.app.manager.get_sprite_group().sprites()
        columns = {s.scrollable_container: s for s in sprites if isinstance(s, UIScrollingContainer)}
        inside, root = element.ui_container, self.app.manager.get_root_container()
        while inside is not None and inside is not root:
            if inside in columns:
                return columns[inside]
            inside = inside.ui_container
        return None

    def draw(self, surface):
        """A frame around the control that the keys are for."""
        if self.now is None or not self.now.alive():
            return
        scroller = self._scroller(self.now)
        wide = max(2, px(self.app.scale, 2))
        place = self.now.rect.inflate(2 * wide, 2 * wide)
        if scroller is not None:
            place = place.clip(scroller.rect)
        if place.width and place.height:
            pygame.draw.rect(surface, chrome(self.app.theme).accent, place, wide, px(self.app.scale, 4))


def _words_of(menu):
    """The button of a closed menu that shows its choice."""
    return getattr(menu.current_state, "selected_option_button", None)


def _distance(one, other):
    return abs(one[0] - other[0]) + abs(one[1] - other[1])
