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


LIGHT = Theme(
    name="light",
    paper=rgb("#f7f5ef"),
    ground=rgb("#e4e9d6"),
    rough=rgb("#d9cfb4"),
    road=rgb("#f1ead9"),
    water=rgb("#b3d3e2"),
    rock=rgb("#b9b5aa"),
    frame=rgb("#aeb3a0"),
    ink=rgb("#26302c"),
    muted=rgb("#66716a"),
    obstacle=rgb("#8f8b83"),
    obstacle_edge=rgb("#5d5a55"),
    guide=rgb("#8b6bb5"),
    goal=rgb("#b8433f"),
    exit=rgb("#2c8a63"),
    spawn=rgb("#6f7c74"),
    cap=rgb("#a0672f"),
    shadow=rgb("#2a3326"),
    shadow_alpha=0.26,
    leader=rgb("#ffd60a"),
    predator=rgb("#d0402b"),
    outline=rgb("#1a2420"),
    rim=0.62,
    lift=0.0,
    head=rgb("#ffffff"),
    head_share=0.62,
    tint=0.20,
    trail=0.55,
    texture=0.045,
    wash=rgb("#f3f2ea"),
    wash_share=0.52,
    relief=0.16,
    link=rgb("#1d5f8a"),
    sight=rgb("#e08a00"),
    hidden=rgb("#2b2f3a"),
)

DARK = Theme(
    name="dark",
    paper=rgb("#101517"),
    ground=rgb("#202b27"),
    rough=rgb("#342f25"),
    road=rgb("#37403a"),
    water=rgb("#1c3a4c"),
    rock=rgb("#41444a"),
    frame=rgb("#46524c"),
    ink=rgb("#e8ede8"),
    muted=rgb("#98a59e"),
    obstacle=rgb("#59605f"),
    obstacle_edge=rgb("#8d9794"),
    guide=rgb("#b79be0"),
    goal=rgb("#ff8a80"),
    exit=rgb("#63d2a4"),
    spawn=rgb("#8fa097"),
    cap=rgb("#d9a066"),
    shadow=rgb("#000000"),
    shadow_alpha=0.42,
    leader=rgb("#ffe14d"),
    predator=rgb("#ff6a4d"),
    outline=rgb("#0a0f0d"),
    rim=0.55,
    lift=0.22,
    head=rgb("#ffffff"),
    head_share=0.66,
    tint=0.20,
    trail=0.50,
    texture=0.09,
    wash=rgb("#141b1a"),
    wash_share=0.62,
    relief=0.35,
    link=rgb("#8fd0ff"),
    sight=rgb("#ffc24a"),
    hidden=rgb("#000000"),
)

VIVID = Theme(
    name="vivid",
    paper=rgb("#fbfaf4"),
    ground=rgb("#b9d08c"),
    rough=rgb("#d6c08d"),
    road=rgb("#ead9b0"),
    water=rgb("#79b7dc"),
    rock=rgb("#a8a196"),
    frame=rgb("#7d8d64"),
    ink=rgb("#17241b"),
    muted=rgb("#4d5a4c"),
    obstacle=rgb("#857f76"),
    obstacle_edge=rgb("#4b4741"),
    guide=rgb("#6c3fa3"),
    goal=rgb("#a3211f"),
    exit=rgb("#0b6644"),
    spawn=rgb("#4f6152"),
    cap=rgb("#7a4512"),
    shadow=rgb("#1b2a14"),
    shadow_alpha=0.34,
    leader=rgb("#ffd60a"),
    predator=rgb("#c62d18"),
    outline=rgb("#141d18"),
    rim=0.7,
    lift=0.0,
    head=rgb("#ffffff"),
    head_share=0.62,
    tint=0.22,
    trail=0.6,
    texture=0.07,
    wash=rgb("#e3ead0"),
    wash_share=0.06,
    relief=0.28,
    link=rgb("#0f4a78"),
    sight=rgb("#b85f00"),
    hidden=rgb("#20242e"),
)

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
