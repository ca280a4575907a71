"""What sets a painted brush apart besides its hue: a pattern of its own, in an ink that stands out from the ground.

Two brushes of one pattern have colours that usual and colour-blind eyes tell apart: `pattern_of` gives each shipped
brush, in order of name, the pattern whose colours so far are farthest from its own.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from flockbrush.render.style import Colour, Theme, linear_rgb, mix, rgb

PATTERNS = ("dots", "level", "upright", "rings", "crosses", "waves", "bricks", "grid", "lattice", "wedges")
EVERY = 15.0  # pixels at scale 1 from one sign of a pattern to the next
CONTRAST = 3.0  # of outlines and patterns to the ground, as the web guidelines (WCAG 2.2, 1.4.11) ask of graphics
# What eyes without one kind of cones see, in linear light: Machado, Oliveira and Fernandes 2009, severity 1.
EYES = {
    "usual": np.eye(3),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
}


def lab(colours, eyes="usual") -> np.ndarray:
    """CIE L*, a*, b* (n, 3) of what these eyes see of sRGB colours (n, 3), 0 to 255."""
    seen = np.clip(linear_rgb(colours) @ EYES[eyes].T, 0, 1)
    xyz = seen @ np.array([[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]])
    f = xyz / (0.9505, 1.0, 1.089)
    f = np.where(f > 0.008856, np.cbrt(f), 7.787 * f + 16 / 116)
    return np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1)


def difference(one, other) -> float:
    """CIE 1976 difference of two colours to those eyes that tell them apart least; 2.3 is just to be seen."""
    return min(float(np.linalg.norm(np.subtract(*lab([one, other], eyes)))) for eyes in EYES)


def contrast(one, other) -> float:
    """Ratio of the luminances of two colours, 1 to 21, as the web guidelines count it."""
    light = linear_rgb([one, other]) @ (0.2126, 0.7152, 0.0722) + 0.05
    return float(light.max() / light.min())


@cache
def _shipped() -> dict[str, tuple[int, Colour]]:
    """{name: (pattern, colour)} of the brushes that come with Flockbrush."""
    from flockbrush.behaviours.brush import shipped

    library = shipped()
    marks: dict[str, tuple[int, Colour]] = {}
    for name in sorted(library.names()):
        colour = rgb(library.get(name).colour)
        marks[name] = _freest(colour, marks.values()), colour
    return marks


def _freest(colour, taken) -> int:
    """The pattern whose colours are farthest from this one; the first of several without any."""
    away = [min((difference(colour, c) for p, c in taken if p == k), default=np.inf) for k in range(len(PATTERNS))]
    return int(np.argmax(away))


@cache
def pattern_of(name: str, colour: Colour) -> int:
    """Which of `PATTERNS` a brush has, by its name; one that is not shipped by its colour beside theirs."""
    known = _shipped()
    return known[name][0] if name in known else _freest(colour, known.values())


@cache
def ink_of(colour: Colour, theme: Theme) -> Colour:
    """The colour, moved towards that of words until it stands out from every plain ground of the theme."""
    grounds = (theme.ground, theme.rough, theme.road)
    for share in np.linspace(0, 1, 21):
        ink = mix(colour, theme.ink, float(share))
        if min(contrast(ink, ground) for ground in grounds) >= CONTRAST:
            return ink
    return theme.ink


def cover(pattern: int, x, y, unit: float) -> np.ndarray:
    """How much of each pixel a pattern covers, 0 to 1.

    Parameters
    ----------
    pattern : int
        Counts in `PATTERNS`.
    x, y : ndarray (h, w), or of shapes that make it
        Pixels from a point that stays on the ground, right and down.
    unit : float
        Pixels of a line at scale 1.
    """
    every = EVERY * unit
    u, v = x / every, y / every
    odd = np.floor(v) % 2
    kind = PATTERNS[pattern]
    if kind in ("dots", "rings", "crosses", "wedges", "bricks"):  # every other row stands between those above
        u = u + 0.5 * odd
    du, dv = (u % 1 - 0.5) * every, (v % 1 - 0.5) * every
    near, far = np.minimum(np.abs(du), np.abs(dv)), np.maximum(np.abs(du), np.abs(dv))
    away = {
        "dots": lambda: np.hypot(du, dv) - 1.7 * unit,
        "level": lambda: np.abs(dv) + 0 * du,
        "upright": lambda: np.abs(du) + 0 * dv,
        "rings": lambda: np.abs(np.hypot(du, dv) - 3.2 * unit),
        "crosses": lambda: np.maximum(near, far - 3 * unit),
        "waves": lambda: np.abs(dv + 2.6 * unit * np.sin(2 * np.pi * u)),
        "bricks": lambda: np.minimum(np.maximum(np.abs(dv), np.abs(du) - 4 * unit), every / 2 - np.abs(dv)),
        "grid": lambda: near,
        "lattice": lambda: np.minimum(np.abs(du + dv), np.abs(du - dv)) / np.sqrt(2),
        "wedges": lambda: np.maximum(np.abs(dv + 2 * unit - np.abs(du)) / np.sqrt(2), np.abs(du) - 4 * unit),
    }[kind]()
    return np.clip(0.6 * unit - away + 0.5, 0, 1)


def swatch(name: str, colour: Colour, theme: Theme, size, unit: float) -> np.ndarray:
    """A patch of painted ground, (height, width, 3) uint8 for ``size`` (width, height)."""
    x, y = np.arange(size[0])[None, :] + EVERY * unit / 2, np.arange(size[1])[:, None] + EVERY * unit / 2
    ground, ink = np.array(mix(theme.ground, colour, 0.35), float), np.array(ink_of(colour, theme), float)
    mask = cover(pattern_of(name, colour), x, y, unit)[..., None]
    return np.round(ground + (ink - ground) * mask).astype(np.uint8)
