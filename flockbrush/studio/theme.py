"""The look of the controls: colours from the theme of the pictures, sizes from the window."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from functools import lru_cache
from types import SimpleNamespace

import pygame
import pygame_gui

from flockbrush.render.style import Colour, Theme, mix

SMALLEST, LARGEST = 0.8, 3.0  # of the interface's scale
ACCENT = {"light": (24, 98, 162), "dark": (104, 178, 232)}  # blue: no animal, leader or predator has it
WARNING = {"light": (166, 106, 0), "dark": (240, 186, 92)}
ERROR = {"light": (176, 48, 32), "dark": (255, 130, 110)}


@dataclass(frozen=True)
class Chrome:
    """Colours of everything around the canvas."""

    bar: Colour  # top bar and time bar
    panel: Colour  # side columns
    raised: Colour  # a button
    hover: Colour
    sunken: Colour  # fields, tracks
    border: Colour
    ink: Colour
    muted: Colour
    faint: Colour  # of what cannot be used now
    accent: Colour
    on_accent: Colour
    warning: Colour
    error: Colour


@lru_cache(maxsize=8)
def chrome(theme: Theme) -> Chrome:
    """The colours of the controls that go with a theme of the pictures."""
    dark = sum(theme.paper) < 384
    lift = (255, 255, 255) if dark else (0, 0, 0)
    panel = mix(theme.paper, lift, 0.045 if dark else 0.0)
    return Chrome(
        bar=mix(theme.paper, lift, 0.075 if dark else 0.05),
        panel=panel,
        raised=mix(panel, (255, 255, 255), 0.075) if dark else (255, 255, 255),
        hover=mix(panel, lift, 0.15 if dark else 0.085),
        sunken=mix(theme.paper, (0, 0, 0), 0.3) if dark else mix(panel, lift, 0.07),
        border=mix(panel, lift, 0.17 if dark else 0.15),
        ink=theme.ink,
        muted=mix(theme.ink, panel, 0.36 if dark else 0.22),
        faint=mix(theme.ink, panel, 0.62),
        accent=ACCENT["dark" if dark else "light"],
        on_accent=(10, 18, 24) if dark else (255, 255, 255),
        warning=WARNING["dark" if dark else "light"],
        error=ERROR["dark" if dark else "light"],
    )


def hexed(colour: Colour, alpha: int | None = None) -> str:
    """A colour as the themes of pygame_gui write it."""
    return "#{:02x}{:02x}{:02x}".format(*colour) + ("" if alpha is None else f"{alpha:02x}")


def scale_of(size, screen_height=0, wanted: float | None = None) -> float:
    """How large the controls are in a window: 1 at 1280 x 720, growing more slowly than the window.

    A screen of very many pixels (high DPI) makes them larger; the environment variable FLOCKBRUSH_SCALE or what a
    person has chosen (`wanted`) comes before everything.
    """
    chosen = wanted or _scale_of_environment()
    if chosen:
        return min(max(float(chosen), SMALLEST), LARGEST)
    fine = max(1.0, screen_height / 1300)  # 2160 lines: 1.66
    room = math.sqrt(max(min(size[0] / 1280, size[1] / 720), 0.05))
    return round(min(max(max(room, fine * min(room, 1.0)), SMALLEST), LARGEST) * 20) / 20


def _scale_of_environment():
    try:
        return float(os.environ.get("FLOCKBRUSH_SCALE", "") or 0)
    except ValueError:
        return 0.0


@lru_cache(maxsize=32)
def font(height: int, bold=False):
    """The controls' font, for what we write ourselves."""
    if not pygame.font.get_init():
        pygame.font.init()
    name = "NotoSans-Bold.ttf" if bold else "NotoSans-Regular.ttf"
    return pygame.font.Font(os.path.join(os.path.dirname(pygame_gui.__file__), "data", name), height)


def px(scale: float, size: float) -> int:
    """So many pixels at this scale, at least one."""
    return max(1, round(size * scale))


class _Kit:
    """What the looks of controls are put together from: colours, letters and shapes as pygame_gui writes them."""

    def __init__(self, theme, scale):
        self.c, self.scale = chrome(theme), scale
        self.hex = SimpleNamespace(**{name: hexed(colour) for name, colour in vars(self.c).items()})
        self.marked = hexed(mix(self.c.panel, self.c.accent, 0.28))
        self.clear = hexed(self.c.panel, 0)
        self.bare = {"normal_bg": self.clear, "normal_border": self.clear}
        self.usual, self.small = self.letters(14), self.letters(13)  # told to each kind: they do not inherit its size
        self.flat = {"shape": "rounded_rectangle", "shape_corner_radius": self.px(4), "shadow_width": "0"}
        self.edged, self.rimless = self.flat | {"border_width": "1"}, self.flat | {"border_width": "0"}
        self.square = {"shape": "rectangle", "shadow_width": "0", "border_width": "0"}

    def px(self, size):
        """So many pixels at this scale."""
        return str(px(self.scale, size))

    def letters(self, size, name="noto_sans", **more):
        """A font of this size at scale 1."""
        return {"name": name, "size": self.px(size), **more}

    def padded(self, across, down):
        """The edge of what is `across` and `down` pixels away from its words."""
        return {"padding": f"{self.px(across)},{self.px(down)}"}


def look(theme: Theme, scale: float) -> dict:
    """The theme of pygame_gui for a theme of the pictures and a scale."""
    kit = _Kit(theme, scale)
    return _texts(kit) | _buttons(kit) | _containers(kit) | _windows(kit)


def _texts(kit):
    """Words and headings."""
    usual, small, right = kit.usual, kit.small, {"text_horiz_alignment": "right"}
    muted, clear, panel = {"normal_text": kit.hex.muted}, {"dark_bg": kit.clear}, {"dark_bg": kit.hex.panel}
    return {
        "defaults": {"colours": _colours(kit), "font": usual},
        "label": {"font": usual, "colours": clear, "misc": {"text_horiz_alignment": "left"}},
        "@title": {"font": kit.letters(15, bold="1")},
        "@heading": {"font": kit.letters(12, bold="1"), "colours": muted},
        "@muted": {"font": small, "colours": muted},
        "@value": {"font": small, "colours": {"normal_text": kit.hex.ink}, "misc": right},
        "@right": {"font": usual, "misc": right},
        "@note": {"font": small, "colours": muted | clear},
        "@note_right": {"font": small, "colours": muted, "misc": right},
        "@clear": {"colours": panel},
        "@page": {"font": small, "colours": panel},
        "@panel_row": {"font": small},
    }


def _buttons(kit):
    """Buttons of all kinds."""
    edged, beside = kit.edged, "text_horiz_alignment_padding"
    below = {"text_vert_alignment": "bottom", "text_vert_alignment_padding": kit.px(3), beside: "1"}
    marked = kit.bare | {"selected_bg": kit.marked, "selected_text": kit.hex.ink}
    return {
        "button": {"font": kit.usual, "misc": edged | {beside: kit.px(8), "tool_tip_delay": "0.6"}},
        "@tool": {"misc": edged | {beside: "0"}, "colours": kit.bare},
        "@plain": {"misc": edged, "colours": kit.bare},
        "@tab": {"misc": kit.square, "font": kit.small, "colours": kit.bare | _tab(kit.hex)},
        "@small_button": {"misc": edged | {beside: kit.px(4)}, "font": kit.small},
        "@primary": {"colours": _primary(kit)},
        "@swatch": {"misc": edged | below, "font": kit.letters(12), "colours": marked},
    }


def _containers(kit):
    """Panels, sliders, menus, lists and fields."""
    edged, rimless, square, small, h = kit.edged, kit.rimless, kit.square, kit.small, kit.hex
    bars, thumb = {"misc": rimless | {"enable_arrow_buttons": "0"}}, {"misc": rimless, "colours": _thumb(h)}
    return {
        "panel": {"misc": square, "colours": {"dark_bg": h.panel, "normal_border": h.border}},
        "@bar": {"colours": {"dark_bg": h.bar}},
        "@card": {"misc": edged, "colours": {"dark_bg": h.raised}},
        "scrolling_container": {"colours": {"dark_bg": kit.clear}},
        "horizontal_slider": {"misc": bars["misc"] | {"sliding_button_width": kit.px(14)}},
        "horizontal_slider.button": {"misc": edged},
        "horizontal_slider.#sliding_button": {"misc": edged, "colours": _knob(kit)},
        "vertical_scroll_bar": bars,
        "vertical_scroll_bar.#sliding_button": thumb,
        "horizontal_scroll_bar": bars,
        "horizontal_scroll_bar.#sliding_button": thumb,
        "drop_down_menu": {"misc": edged | {"expand_direction": "down", "open_button_width": kit.px(18)}},
        "@up": {"misc": {"expand_direction": "up"}},
        "drop_down_menu.button": {"misc": rimless, "font": small},
        "drop_down_menu.#expand_button": {"font": kit.letters(11, "fira_code_symbols")},
        "drop_down_menu.#selected_option": {"misc": rimless | {"text_horiz_alignment": "left"}, "font": small},
        "selection_list": {"misc": edged | {"list_item_height": kit.px(24)}},
        "selection_list.button": {"misc": square, "font": small},
        "text_entry_line": {"misc": edged | kit.padded(5, 3), "font": small},
        "text_box": {"font": kit.usual, "misc": square | kit.padded(6, 4), "colours": {"dark_bg": h.panel}},
    }


def _windows(kit):
    """Windows, and what stands above others."""
    h, symbols = kit.hex, "fira_code_symbols"
    framed = {"shape": "rectangle", "shadow_width": kit.px(10), "border_width": "1", "title_bar_height": kit.px(32)}
    title = dict.fromkeys(("normal_bg", "hovered_bg", "active_bg", "selected_bg"), h.bar) | {"active_text": h.ink}
    return {
        "window": {"misc": framed, "colours": {"dark_bg": h.panel, "normal_border": h.border}},
        "window.#title_bar": {
            "misc": kit.square | {"text_horiz_alignment": "left", "text_horiz_alignment_padding": kit.px(10)},
            "font": kit.letters(14, bold="1"),
            "colours": title,
        },
        "window.#close_button": {"font": kit.letters(11, symbols), "misc": kit.square},
        "tool_tip": {"misc": {"rect_width": kit.px(260)}},
        "tool_tip.text_box": {
            "misc": kit.edged | kit.padded(8, 6),
            "font": kit.small,
            "colours": {"dark_bg": h.raised, "normal_border": h.border},
        },
        "progress_bar": {"misc": kit.rimless},
        "check_box": {"misc": kit.edged, "font": kit.letters(13, symbols)},
        "check_box.label": {"font": kit.small},
    }


def _colours(kit) -> dict:
    """The defaults of every control."""
    c, h = kit.c, kit.hex
    return {
        "normal_bg": h.raised, "hovered_bg": h.hover, "disabled_bg": h.panel, "selected_bg": kit.marked,
        "active_bg": hexed(mix(c.raised, c.accent, 0.35)), "dark_bg": h.sunken, "disabled_dark_bg": h.panel,
        "normal_text": h.ink, "hovered_text": h.ink, "disabled_text": h.faint, "selected_text": h.ink,
        "active_text": h.ink, "normal_border": h.border, "hovered_border": hexed(mix(c.border, c.accent, 0.5)),
        "disabled_border": hexed(mix(c.border, c.panel, 0.5)), "selected_border": h.accent, "active_border": h.accent,
        "link_text": h.accent, "link_hover": h.accent, "link_selected": h.accent, "text_shadow": kit.clear,
        "filled_bar": h.accent, "unfilled_bar": h.sunken, "text_cursor": h.ink, "normal_text_shadow": kit.clear,
    }  # fmt: skip


def _tab(h):
    return {
        "selected_bg": h.panel, "selected_border": h.panel, "selected_text": h.accent, "normal_text": h.muted,
        "normal_bg": h.bar, "hovered_bg": h.hover, "active_bg": h.panel,
    }  # fmt: skip


def _primary(kit):
    h = kit.hex
    return {
        "normal_bg": h.accent, "hovered_bg": hexed(mix(kit.c.accent, kit.c.ink, 0.15)), "active_bg": h.accent,
        "normal_text": h.on_accent, "hovered_text": h.on_accent, "active_text": h.on_accent, "normal_border": h.accent,
    }  # fmt: skip


def _knob(kit):
    h = kit.hex
    return {
        "normal_bg": h.accent, "hovered_bg": hexed(mix(kit.c.accent, kit.c.ink, 0.2)), "active_bg": h.accent,
        "normal_border": h.accent, "disabled_bg": h.faint, "selected_bg": h.accent,
    }  # fmt: skip


def _thumb(h):
    return {"normal_bg": h.border, "hovered_bg": h.faint, "active_bg": h.accent, "disabled_bg": h.panel}
