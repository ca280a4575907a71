"""The base class of the panels of the right-hand column, and their drawing functions."""

from __future__ import annotations

import pygame
from pygame_gui import (
    UI_BUTTON_PRESSED,
    UI_CHECK_BOX_CHECKED,
    UI_CHECK_BOX_UNCHECKED,
    UI_DROP_DOWN_MENU_CHANGED,
    UI_TEXT_ENTRY_CHANGED,
    UI_TEXT_ENTRY_FINISHED,
)
from pygame_gui.elements import (
    UIButton,
    UICheckBox,
    UIDropDownMenu,
    UIImage,
    UILabel,
    UIScrollingContainer,
    UITextEntryLine,
)

from flockbrush.render.style import worn
from flockbrush.studio.theme import chrome, font, px
from flockbrush.studio.widgets import fitted

FRESH = 0.25  # s; numbers that change faster than this cannot be read, and cost time
SCROLL_BAR = 20  # pixels, whatever the scale
_ACTS = (UI_BUTTON_PRESSED, UI_DROP_DOWN_MENU_CHANGED, UI_CHECK_BOX_CHECKED, UI_CHECK_BOX_UNCHECKED)


class Panel:
    """One tab of the column.  It makes its widgets inside a container, and reads the app; it never writes the world.

    Parameters
    ----------
    app : App
        The panels use ``session``, ``selected``, ``brush``, ``theme``, ``scale``, ``overlays``, ``settings``,
        ``seconds``, ``memory``, ``remember``, ``notify``, ``ask_text``, ``set_theme``, ``set_scale`` and ``colour_of``.
    manager : pygame_gui.UIManager
    container : pygame_gui.elements.UIPanel

    Attributes
    ----------
    does : dict
        {button, check box or menu: what is called with the event of its use}.
    """

    title = ""
    tip = ""

    def __init__(self, app, manager, container):
        self.app, self.manager, self.container = app, manager, container
        self._stale, self.does = 0.0, {}
        self._know_bold()
        self.make()

    def make(self):
        """Make the widgets, for the container's size and the app's scale."""

    def _know_bold(self):
        """Load the letters of the names in tooltips now: pygame_gui warns when it meets them unprepared."""
        size, fonts = self.px(13), self.manager.get_theme().get_font_dictionary()
        if not fonts.check_font_preloaded(f"noto_sans_bold_aa_{size}"):
            font = {"name": "noto_sans", "point_size": size, "style": "bold", "antialiased": "1"}
            self.manager.preload_fonts([font])

    def handle(self, event) -> bool:
        """Answer an event; True when it was meant for this panel."""
        do = self.does.get(event.ui_element) if event.type in _ACTS else None
        if do is not None:
            do(event)
        return do is not None

    def refresh(self):
        """Show what is so now.  Called at most four times a second."""

    def update(self, dt):
        """One frame of the shown tab; `dt` are seconds."""
        self._stale -= dt
        if self._stale <= 0:
            self._stale = FRESH
            self.refresh()

    def soon(self):
        """Refresh in the next frame."""
        self._stale = 0.0

    def close(self):
        """Take all widgets away."""

    # sizes -----------------------------------------------------------------------

    @property
    def area(self) -> pygame.Rect:
        """Where widgets may be, in the container's own pixels."""
        width, height = self.container.get_container().get_size()
        return pygame.Rect(0, 0, int(width), int(height))

    @property
    def inner(self) -> int:
        """Width that a column of widgets has beside its scroll bar, pixels."""
        return self.area.width - SCROLL_BAR - self.px(14)

    def px(self, size: float) -> int:
        """So many pixels at the app's scale."""
        return px(self.app.scale, size)

    @property
    def colours(self):
        """The colours of the controls."""
        return chrome(self.app.theme)

    @property
    def brush_colours(self) -> dict:
        """Colours "#rrggbb" of the world's brushes by name."""
        brushes = self.app.session.palette.brushes
        colours = worn([brush.colour for brush in brushes], self.app.theme)
        return {brush.name: colour for brush, colour in zip(brushes, colours, strict=True)}


class ScrollPanel(Panel):
    """A tab whose widgets are in a scrolling container, `scroll`, with columns `inner` pixels wide.

    Attributes
    ----------
    parts : list
        The widgets of the layout.
    """

    def make(self):
        px, area = self.px, self.area
        place = pygame.Rect(px(8), px(4), area.width - px(8), area.height - px(8))
        self.scroll = UIScrollingContainer(place, self.manager, container=self.container, allow_scroll_x=False)
        self.wide = self.inner
        self.parts: list = []

    def close(self):
        self.scroll.kill()

    def clear(self):
        """Take the widgets of the layout away."""
        for part in self.parts:
            part.kill()
        self.parts, self.does = [], {}

    def part(self, widget, do=None):
        """Add a widget to the layout; `do` is called with the events of its use."""
        self.parts.append(widget)
        if do is not None:
            self.does[widget] = do
        return widget

    def picture(self, y, tall, tip=None):
        """A picture over the whole width."""
        return self.part(Picture(pygame.Rect(0, y, self.wide, tall), self.manager, self.scroll, tip))

    def heading(self, text, y) -> int:
        """A heading; returns where what follows begins."""
        place = pygame.Rect(0, y, self.wide, self.px(26))
        self.part(UILabel(place, text, self.manager, container=self.scroll, object_id="@heading"))
        return place.bottom

    def label(self, text, x, y, wide, kind="@row"):
        """One line of words, shortened to its room."""
        place = pygame.Rect(x, y, wide, self.px(26))
        label = self.part(UILabel(place, "", self.manager, container=self.scroll, object_id=kind))
        label.set_text(fitted(text, label.font, wide - 6))
        if label.text != text:
            label.set_tooltip(text)
        return label

    def button(self, text, do, x, y, wide, tip=None):
        """A button; a press calls `do`."""
        place, look = pygame.Rect(x, y, wide, self.px(28)), "@small_button"
        button = UIButton(place, text, self.manager, container=self.scroll, tool_tip_text=tip, object_id=look)
        return self.part(button, lambda event: do())

    def check(self, text, y, on, do, tip):
        """A check box with its words; `do` is given whether it is checked."""
        place = pygame.Rect(0, y, self.px(20), self.px(20))
        box = UICheckBox(
            place, text, self.manager, container=self.scroll, object_id="@check", initial_state=on, tool_tip_text=tip
        )
        return self.part(box, lambda event: do(event.type == UI_CHECK_BOX_CHECKED))

    def menu(self, options, chosen, place, do, look=None):
        """A drop-down; `do` is given the text that is chosen."""
        menu = UIDropDownMenu(list(options), chosen, place, self.manager, container=self.scroll, object_id=look)
        return self.part(menu, lambda event: do(event.text))


class FieldsPanel(ScrollPanel):
    """A tab with text fields: what is typed is taken with Enter, when the fields are left, and before a button acts.

    Attributes
    ----------
    fields : dict
        {text field among the parts: what takes its text; False when it is refused}.
    """

    def make(self):
        super().make()
        self.clear()

    def clear(self):
        super().clear()
        self.fields: dict = {}
        self._typed: dict = {}  # fields whose text is not yet taken, in the order of typing
        self._left = 0  # frames since nobody has used a widget

    def field(self, text, place, take):
        """A text field; `take` takes what is typed."""
        field = self.part(UITextEntryLine(place, self.manager, container=self.scroll, initial_text=text))
        self.fields[field] = take
        return field

    def handle(self, event):
        handled = self._hear(event) or super().handle(event)
        if handled:
            self.soon()
        return handled

    def _hear(self, event) -> bool:
        """Note or take what is typed; whether the event asks for no more, or what was typed before it is refused."""
        element = getattr(event, "ui_element", None)
        if element in self.fields and event.type in (UI_TEXT_ENTRY_CHANGED, UI_TEXT_ENTRY_FINISHED):
            self._typed[element] = None
            if event.type == UI_TEXT_ENTRY_FINISHED:
                self._settle()
            return True
        return event.type in _ACTS and element in self.parts and not self._settle()

    def _settle(self):
        takers, self._typed = dict.fromkeys(self.fields[field] for field in self._typed), {}
        return False not in [take() for take in takers]

    def update(self, dt):
        used = any(field.is_focused for field in self.fields) or any(map(_is_held, self.parts))
        self._left = 0 if used else self._left + 1
        if self._typed and self._left > 1:  # a button that was let go in this frame is heard in the next one
            self._settle()
        super().update(dt)


def _is_held(part):
    """Whether the mouse button is down on a button, or a drop-down is open."""
    if isinstance(part, UIDropDownMenu):
        state = part.current_state
        return state is not part.menu_states["closed"] or state.selected_option_button.held
    return isinstance(part, UIButton) and part.held


class Picture:
    """A transparent picture among the widgets, drawn again only on request."""

    def __init__(self, rect, manager, container, tip=None):
        self.element = UIImage(rect, blank(rect[2:]), manager, container=container)
        if tip:
            self.element.set_tooltip(tip)
        self.said = None

    def show(self, surface, said=None):
        """Show a surface; `said` is its content, so that the same is not drawn again."""
        self.element.set_image(surface)
        self.said = said

    @property
    def size(self):
        """Width and height, pixels."""
        return self.element.relative_rect.size

    def kill(self):
        """Take it away."""
        self.element.kill()


def blank(size) -> pygame.Surface:
    """A see-through surface."""
    return pygame.Surface((max(1, int(size[0])), max(1, int(size[1]))), pygame.SRCALPHA)


def write(surface, text, at, height, colour, anchor=(0.0, 0.5), bold=False, room=None) -> int:
    """Write on a surface; `at` is the point of the text's box at `anchor`. Returns the width taken, pixels.

    `room` shortens the text with three dots to so many pixels.
    """
    letters = font(int(height), bold)
    if room is not None:
        text = fitted(text, letters, room)
    if not text:
        return 0
    image = letters.render(text, True, colour)
    width, tall = image.get_size()
    surface.blit(image, (round(at[0] - anchor[0] * width), round(at[1] - anchor[1] * tall)))
    return width


def picture_on(button, surface):
    """Give a button a picture instead of words."""
    button.normal_images = button.hovered_images = button.selected_images = [surface.premul_alpha()]
    button.disabled_images = button.normal_images
    button.rebuild()
