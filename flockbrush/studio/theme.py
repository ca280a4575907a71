"""The look of the controls: colours from the theme of the pictures, sizes from the window."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

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


class _Kit(NamedTuple):
    """What the looks of controls are put together from."""

    c: Chrome
    scale: float
    usual: dict  # font, told to each kind: they do not inherit its size
    flat: dict
    edged: dict
    square: dict
    symbols: dict
    bare: dict
    bars: dict


def _kit(theme, scale):
    c = chrome(theme)
    flat = {"shape": "rounded_rectangle", "shape_corner_radius": str(px(scale, 4)), "shadow_width": "0"}
    return _Kit(
        c, scale,
        usual={"name": "noto_sans", "size": str(px(scale, 14))},
        flat=flat,
        edged=flat | {"border_width": "1"},
        square={"shape": "rectangle", "shadow_width": "0", "border_width": "0"},
        symbols={"font": {"name": "fira_code_symbols", "size": str(px(scale, 11))}},
        bare={"normal_bg": hexed(c.panel, 0), "normal_border": hexed(c.panel, 0)},
        bars={"misc": flat | {"border_width": "0", "enable_arrow_buttons": "0"}},
    )  # fmt: skip


def look(theme: Theme, scale: float) -> dict:
    """The theme of pygame_gui for a theme of the pictures and a scale."""
    kit = _kit(theme, scale)
    return _texts(kit) | _buttons(kit) | _containers(kit) | _windows(kit)


def _texts(kit):
    """Words and headings."""
    return {
        "defaults": {"colours": _colours(kit.c), "font": kit.usual},
        "label": {
            "font": kit.usual,
            "colours": {"dark_bg": hexed(kit.c.panel, 0)},
            "misc": {"text_horiz_alignment": "left"},
        },
        "@title": {"font": {"name": "noto_sans", "size": str(px(kit.scale, 15)), "bold": "1"}},
        "@heading": {
            "font": {"name": "noto_sans", "size": str(px(kit.scale, 12)), "bold": "1"},
            "colours": {"normal_text": hexed(kit.c.muted)},
        },
        "@muted": {"font": _small(kit.scale), "colours": {"normal_text": hexed(kit.c.muted)}},
        "@value": {
            "font": _small(kit.scale),
            "colours": {"normal_text": hexed(kit.c.ink)},
            "misc": {"text_horiz_alignment": "right"},
        },
        "@right": {"font": kit.usual, "misc": {"text_horiz_alignment": "right"}},
        "@note": {
            "font": _small(kit.scale),
            "colours": {"normal_text": hexed(kit.c.muted), "dark_bg": hexed(kit.c.panel, 0)},
        },
        "@note_right": {
            "font": _small(kit.scale),
            "colours": {"normal_text": hexed(kit.c.muted)},
            "misc": {"text_horiz_alignment": "right"},
        },
        "@clear": {"colours": {"dark_bg": hexed(kit.c.panel)}},
        "@page": {"font": _small(kit.scale), "colours": {"dark_bg": hexed(kit.c.panel)}},
        "@panel_row": {"font": _small(kit.scale)},
    }


def _buttons(kit):
    """Buttons of all kinds."""
    return {
        "button": {
            "font": kit.usual,
            "misc": kit.edged | {"text_horiz_alignment_padding": str(px(kit.scale, 8)), "tool_tip_delay": "0.6"},
        },
        "@tool": {"misc": kit.edged | {"text_horiz_alignment_padding": "0"}, "colours": kit.bare},
        "@plain": {"misc": kit.edged, "colours": kit.bare},
        "@tab": {"misc": kit.square, "font": _small(kit.scale), "colours": kit.bare | _tab(kit.c)},
        "@small_button": {
            "misc": kit.edged | {"text_horiz_alignment_padding": str(px(kit.scale, 4))},
            "font": _small(kit.scale),
        },
        "@primary": {"colours": _primary(kit.c)},
        "@swatch": {
            "misc": kit.edged
            | {
                "text_vert_alignment": "bottom",
                "text_vert_alignment_padding": str(px(kit.scale, 3)),
                "text_horiz_alignment_padding": "1",
            },
            "font": {"name": "noto_sans", "size": str(px(kit.scale, 12))},
            "colours": kit.bare
            | {"selected_bg": hexed(mix(kit.c.panel, kit.c.accent, 0.28)), "selected_text": hexed(kit.c.ink)},
        },
    }


def _containers(kit):
    """Panels, sliders, menus, lists and fields."""
    return {
        "panel": {"misc": kit.square, "colours": {"dark_bg": hexed(kit.c.panel), "normal_border": hexed(kit.c.border)}},
        "@bar": {"colours": {"dark_bg": hexed(kit.c.bar)}},
        "@card": {"misc": kit.edged, "colours": {"dark_bg": hexed(kit.c.raised)}},
        "scrolling_container": {"colours": {"dark_bg": hexed(kit.c.panel, 0)}},
        "horizontal_slider": {
            "misc": kit.flat
            | {"border_width": "0", "enable_arrow_buttons": "0", "sliding_button_width": str(px(kit.scale, 14))}
        },
        "horizontal_slider.button": {"misc": kit.edged},
        "horizontal_slider.#sliding_button": {"misc": kit.edged, "colours": _knob(kit.c)},
        "vertical_scroll_bar": kit.bars,
        "vertical_scroll_bar.#sliding_button": {"misc": kit.flat | {"border_width": "0"}, "colours": _thumb(kit.c)},
        "horizontal_scroll_bar": kit.bars,
        "horizontal_scroll_bar.#sliding_button": {"misc": kit.flat | {"border_width": "0"}, "colours": _thumb(kit.c)},
        "drop_down_menu": {
            "misc": kit.edged | {"expand_direction": "down", "open_button_width": str(px(kit.scale, 18))}
        },
        "@up": {"misc": {"expand_direction": "up"}},
        "drop_down_menu.button": {"misc": kit.flat | {"border_width": "0"}, "font": _small(kit.scale)},
        "drop_down_menu.#expand_button": kit.symbols,
        "drop_down_menu.#selected_option": {
            "misc": kit.flat | {"border_width": "0", "text_horiz_alignment": "left"},
            "font": _small(kit.scale),
        },
        "selection_list": {"misc": kit.edged | {"list_item_height": str(px(kit.scale, 24))}},
        "selection_list.button": {"misc": kit.square, "font": _small(kit.scale)},
        "text_entry_line": {
            "misc": kit.edged | {"padding": f"{px(kit.scale, 5)},{px(kit.scale, 3)}"},
            "font": _small(kit.scale),
        },
        "text_box": {
            "font": kit.usual,
            "misc": kit.square | {"padding": f"{px(kit.scale, 6)},{px(kit.scale, 4)}"},
            "colours": {"dark_bg": hexed(kit.c.panel)},
        },
    }


def _windows(kit):
    """Windows, and what stands above others."""
    return {
        "window": {
            "misc": {
                "shape": "rectangle",
                "shadow_width": str(px(kit.scale, 10)),
                "border_width": "1",
                "title_bar_height": str(px(kit.scale, 32)),
            },
            "colours": {"dark_bg": hexed(kit.c.panel), "normal_border": hexed(kit.c.border)},
        },
        "window.#title_bar": {
            "misc": kit.square
            | {"text_horiz_alignment": "left", "text_horiz_alignment_padding": str(px(kit.scale, 10))},
            "font": {"name": "noto_sans", "size": str(px(kit.scale, 14)), "bold": "1"},
            "colours": {name: hexed(kit.c.bar) for name in ("normal_bg", "hovered_bg", "active_bg", "selected_bg")}
            | {"active_text": hexed(kit.c.ink)},
        },
        "window.#close_button": kit.symbols | {"misc": kit.square},
        "tool_tip": {"misc": {"rect_width": str(px(kit.scale, 260))}},
        "tool_tip.text_box": {
            "misc": kit.edged | {"padding": f"{px(kit.scale, 8)},{px(kit.scale, 6)}"},
            "font": _small(kit.scale),
            "colours": {"dark_bg": hexed(kit.c.raised), "normal_border": hexed(kit.c.border)},
        },
        "progress_bar": {"misc": kit.flat | {"border_width": "0"}},
        "check_box": {"misc": kit.edged, "font": {"name": "fira_code_symbols", "size": str(px(kit.scale, 13))}},
        "check_box.label": {"font": _small(kit.scale)},
    }


def _small(scale):
    return {"name": "noto_sans", "size": str(px(scale, 13))}


def _colours(c: Chrome) -> dict:
    """The defaults of every control."""
    marked = mix(c.panel, c.accent, 0.28)
    return {
        "normal_bg": hexed(c.raised), "hovered_bg": hexed(c.hover), "disabled_bg": hexed(c.panel),
        "selected_bg": hexed(marked), "active_bg": hexed(mix(c.raised, c.accent, 0.35)), "dark_bg": hexed(c.sunken),
        "disabled_dark_bg": hexed(c.panel), "normal_text": hexed(c.ink), "hovered_text": hexed(c.ink),
        "disabled_text": hexed(c.faint), "selected_text": hexed(c.ink), "active_text": hexed(c.ink),
        "normal_border": hexed(c.border), "hovered_border": hexed(mix(c.border, c.accent, 0.5)),
        "disabled_border": hexed(mix(c.border, c.panel, 0.5)), "selected_border": hexed(c.accent),
        "active_border": hexed(c.accent), "link_text": hexed(c.accent), "link_hover": hexed(c.accent),
        "link_selected": hexed(c.accent), "text_shadow": hexed(c.panel, 0), "filled_bar": hexed(c.accent),
        "unfilled_bar": hexed(c.sunken), "text_cursor": hexed(c.ink), "normal_text_shadow": hexed(c.panel, 0),
    }  # fmt: skip


def _tab(c):
    return {
        "selected_bg": hexed(c.panel), "selected_border": hexed(c.panel), "selected_text": hexed(c.accent),
        "normal_text": hexed(c.muted), "normal_bg": hexed(c.bar), "hovered_bg": hexed(c.hover),
        "active_bg": hexed(c.panel),
    }  # fmt: skip


def _primary(c):
    return {
        "normal_bg": hexed(c.accent), "hovered_bg": hexed(mix(c.accent, c.ink, 0.15)), "active_bg": hexed(c.accent),
        "normal_text": hexed(c.on_accent), "hovered_text": hexed(c.on_accent), "active_text": hexed(c.on_accent),
        "normal_border": hexed(c.accent),
    }  # fmt: skip


def _knob(c):
    return {
        "normal_bg": hexed(c.accent), "hovered_bg": hexed(mix(c.accent, c.ink, 0.2)), "active_bg": hexed(c.accent),
        "normal_border": hexed(c.accent), "disabled_bg": hexed(c.faint), "selected_bg": hexed(c.accent),
    }  # fmt: skip


def _thumb(c):
    return {
        "normal_bg": hexed(c.border), "hovered_bg": hexed(c.faint), "active_bg": hexed(c.accent),
        "disabled_bg": hexed(c.panel),
    }  # fmt: skip
