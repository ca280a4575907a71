"""Colours and themes: what every picture of a herd looks like, on light and on dark paper.

Leaders are yellow, predators vermilion and of another shape; both keep apart from the fallback brush colours for
colour-blind eyes (palette after Okabe and Ito [1]_).

References
----------
.. [1] M. Okabe, K. Ito, "Color Universal Design", 2008.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

Colour = tuple[int, int, int]

# Okabe-Ito without yellow (leaders) and vermilion (predators), moved until no two are alike to colour-blind eyes.
PALETTE = ("#097abe", "#028157", "#d580a3", "#02a8df", "#61498f", "#c37c06", "#3f5555", "#a8577e")

# "own" are the colours in the brushes' files. The others make the brushes of a level differ for all eyes.
# tol: after P. Tol, "Colour schemes", SRON technical note, 2021, without what is like leaders or predators
PALETTES = {
    "own": (),
    "okabe-ito": PALETTE,
    "tol": ("#332288", "#88ccee", "#44aa99", "#cc6677", "#882255", "#aa4499", "#bbbbbb"),
}

SUN = np.array([-0.42, -0.38, 0.824])  # unit vector to the sun in space: light from the south-west
PLAN_SUN = SUN * (1, -1, 1)  # on the plan from the north-west, as shadows fall there


def rgb(colour) -> Colour:
    """Red, green and blue, 0 to 255, of "#rrggbb" or of any three numbers; ValueError when it is neither."""
    if isinstance(colour, str):
        digits = colour.lstrip("#")
        try:
            if len(digits) != 6:
                raise ValueError
            return int(digits[:2], 16), int(digits[2:4], 16), int(digits[4:], 16)
        except ValueError:
            raise ValueError(f"a colour is written '#rrggbb', got {colour!r}") from None
    red, green, blue = (int(part) for part in colour)
    return red, green, blue


def mix(one: Colour, other: Colour, share: float) -> Colour:
    """The colour that has this share (0 to 1) of the other one."""
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(one, other, strict=True))
    return red, green, blue


def linear_rgb(colour) -> np.ndarray:
    """Linear light (3,), 0 to 1, of an sRGB colour 0 to 255, as renderers want it."""
    share = np.asarray(colour, float) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def palette(count: int) -> np.ndarray:
    """So many fallback brush colours, (count, 3) uint8; they come round again after eight."""
    return np.array([rgb(PALETTE[k % len(PALETTE)]) for k in range(count)], np.uint8).reshape(count, 3)


@dataclass(frozen=True)
class Theme:
    """The colours of one look."""

    name: str
    paper: Colour  # around the level
    ground: Colour  # grass, and everything that has no kind of its own
    rough: Colour  # ground that slows
    road: Colour  # ground that speeds up
    water: Colour  # not walkable, but seen across
    rock: Colour  # neither walkable nor seen through
    frame: Colour  # the level's border
    ink: Colour  # text
    muted: Colour  # lesser text, measure lines
    obstacle: Colour
    obstacle_edge: Colour
    guide: Colour
    goal: Colour
    exit: Colour
    spawn: Colour
    cap: Colour
    shadow: Colour
    shadow_alpha: float
    leader: Colour
    predator: Colour
    outline: Colour  # dark rim of animals
    rim: float  # how much of it, 0 to 1
    lift: float  # how much bodies are lightened, to stand out from dark ground
    head: Colour  # what the head end is lightened towards
    head_share: float
    tint: float  # opacity of painted brush regions
    trail: float  # opacity of a fresh trail
    texture: float  # contrast of the ground's grain
    wash: Colour  # designers' terrain colours are mixed with this, to stand behind the animals
    wash_share: float
    relief: float  # how much slopes are shaded
    link: Colour  # lines between animals
    sight: Colour  # the field of view
    hidden: Colour  # what cannot be seen
    palette: str = "own"  # colours of brushes, from `PALETTES`


_COLOURS = {  # of the themes light, dark and vivid
    "paper": ("#f7f5ef", "#101517", "#fbfaf4"),
    "ground": ("#e4e9d6", "#202b27", "#b9d08c"),
    "rough": ("#d9cfb4", "#342f25", "#d6c08d"),
    "road": ("#f1ead9", "#37403a", "#ead9b0"),
    "water": ("#b3d3e2", "#1c3a4c", "#79b7dc"),
    "rock": ("#b9b5aa", "#41444a", "#a8a196"),
    "frame": ("#aeb3a0", "#46524c", "#7d8d64"),
    "ink": ("#26302c", "#e8ede8", "#17241b"),
    "muted": ("#66716a", "#98a59e", "#4d5a4c"),
    "obstacle": ("#8f8b83", "#59605f", "#857f76"),
    "obstacle_edge": ("#5d5a55", "#8d9794", "#4b4741"),
    "guide": ("#8b6bb5", "#b79be0", "#6c3fa3"),
    "goal": ("#b8433f", "#ff8a80", "#a3211f"),
    "exit": ("#2c8a63", "#63d2a4", "#0b6644"),
    "spawn": ("#6f7c74", "#8fa097", "#4f6152"),
    "cap": ("#a0672f", "#d9a066", "#7a4512"),
    "shadow": ("#2a3326", "#000000", "#1b2a14"),
    "leader": ("#ffd60a", "#ffe14d", "#ffd60a"),
    "predator": ("#d0402b", "#ff6a4d", "#c62d18"),
    "outline": ("#1a2420", "#0a0f0d", "#141d18"),
    "head": ("#ffffff", "#ffffff", "#ffffff"),
    "wash": ("#f3f2ea", "#141b1a", "#e3ead0"),
    "link": ("#1d5f8a", "#8fd0ff", "#0f4a78"),
    "sight": ("#e08a00", "#ffc24a", "#b85f00"),
    "hidden": ("#2b2f3a", "#000000", "#20242e"),
}
_NUMBERS = {
    "shadow_alpha": (0.26, 0.42, 0.34),
    "rim": (0.62, 0.55, 0.7),
    "lift": (0.0, 0.22, 0.0),
    "head_share": (0.62, 0.66, 0.62),
    "tint": (0.20, 0.20, 0.22),
    "trail": (0.55, 0.50, 0.6),
    "texture": (0.045, 0.09, 0.07),
    "wash_share": (0.52, 0.62, 0.06),
    "relief": (0.16, 0.35, 0.28),
}


def _theme(k: int, name: str) -> Theme:
    colours = {part: rgb(by_theme[k]) for part, by_theme in _COLOURS.items()}
    numbers = {part: by_theme[k] for part, by_theme in _NUMBERS.items()}
    return Theme(name=name, **colours, **numbers)  # type: ignore[arg-type]


LIGHT, DARK, VIVID = (_theme(k, name) for k, name in enumerate(("light", "dark", "vivid")))
THEMES = {theme.name: theme for theme in (LIGHT, DARK, VIVID)}


# cividis after Nuñez et al. 2018: even steps of lightness, the same order for colour-blind eyes
_SCALE = ("#00224e", "#123570", "#3b496c", "#575d6d", "#707173", "#8a8678", "#a59c74", "#c3b369", "#e1cc55", "#fee838")


@cache
def scale_colours(theme: str) -> np.ndarray:
    """Colours for a quantity, few to many, (256, 3) uint8: what is much stands out, dark on light and light on dark.

    References
    ----------
    .. [1] J. R. Nuñez, C. R. Anderton, R. S. Renslow, "Optimizing colormaps with consideration for color vision
       deficiency", PLoS ONE 13(7), 2018.
    """
    anchors = np.array([rgb(colour) for colour in (_SCALE if theme == "dark" else _SCALE[::-1])], float)
    at = np.linspace(0, len(anchors) - 1, 256)
    colours = [np.interp(at, np.arange(len(anchors)), anchors[:, c]) for c in range(3)]
    return np.round(np.stack(colours, axis=1)).astype(np.uint8)


@cache
def theme_of(theme: str | Theme, palette: str | None = None) -> Theme:
    """The theme of this name, or the theme itself; with another palette of brushes, if one is named."""
    if not isinstance(theme, Theme):
        if theme not in THEMES:
            raise ValueError(f"no theme {theme!r}; there are {', '.join(THEMES)}")
        theme = THEMES[theme]
    if palette is None or palette == theme.palette:
        return theme
    if palette not in PALETTES:
        raise ValueError(f"no palette {palette!r}; there are {', '.join(PALETTES)}")
    return replace(theme, palette=palette)


def worn_rgb(brush: int, colours, theme: Theme) -> tuple[int, int, int]:
    """Red, green, blue, 0 to 255, of brush number `brush` in a theme; `colours` are the own ones of all brushes."""
    known = worn(colours, theme)
    return rgb(known[brush] if brush < len(known) else PALETTE[brush % len(PALETTE)])


def worn(colours, theme: Theme):
    """The colours that brushes of a world have in a theme, from their own ones: those of its palette, in turn."""
    chosen = PALETTES[theme.palette]
    return tuple(chosen[k % len(chosen)] for k in range(len(colours))) if chosen else colours
