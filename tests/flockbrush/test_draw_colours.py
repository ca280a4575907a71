"""Colours for colour-blind eyes: what means different things looks different, and more looks like more."""

from itertools import combinations

import numpy as np
import pytest

from flockbrush.render.forces import REASONS, reason_colour
from flockbrush.render.style import PALETTE, THEMES, palette, rgb, scale_colours

# what eyes without one kind of cones see, in linear light: Machado, Oliveira and Fernandes 2009, severity 1
EYES = {
    "usual": np.eye(3),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
}
TELL_APART = 12.0  # CIE 1976 colour difference; 2.3 is just to be seen


def linear(colours):
    """Light of sRGB colours (n, 3), 0 to 1."""
    values = np.asarray(colours, float) / 255
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab(colours, eyes):
    """L*, a*, b* (n, 3) of what these eyes see."""
    seen = np.clip(linear(colours) @ EYES[eyes].T, 0, 1)
    xyz = seen @ np.array([[0.4124, 0.2126, 0.0193], [0.3576, 0.7152, 0.1192], [0.1805, 0.0722, 0.9505]])
    f = xyz / (0.9505, 1.0, 1.089)
    f = np.where(f > 0.008856, np.cbrt(f), 7.787 * f + 16 / 116)
    return np.stack([116 * f[:, 1] - 16, 500 * (f[:, 0] - f[:, 1]), 200 * (f[:, 1] - f[:, 2])], axis=1)


def nearest(named, eyes):
    """(difference, one, other) of the two colours that look most alike."""
    names, points = list(named), lab(list(named.values()), eyes)
    pairs = combinations(range(len(names)), 2)
    return min((float(np.linalg.norm(points[a] - points[b])), names[a], names[b]) for a, b in pairs)


def contrast(one, other):
    """Ratio of luminances as the web guidelines count it."""
    light = linear([one, other]) @ (0.2126, 0.7152, 0.0722) + 0.05
    return light.max() / light.min()


@pytest.mark.parametrize("eyes", EYES)
def test_no_two_brush_colours_are_alike(eyes):
    marks = {"leader": THEMES["light"].leader, "predator": THEMES["light"].predator}
    assert nearest({colour: rgb(colour) for colour in PALETTE} | marks, eyes)[0] > TELL_APART
    assert len(palette(20)) == 20


@pytest.mark.parametrize("eyes", EYES)
@pytest.mark.parametrize("theme", THEMES.values(), ids=lambda theme: theme.name)
def test_no_two_reasons_are_alike(theme, eyes):
    colours = {name: reason_colour(name, theme) for name in REASONS if name != "prey"}
    assert nearest(colours, eyes)[0] > TELL_APART


@pytest.mark.parametrize("theme", THEMES.values(), ids=lambda theme: theme.name)
def test_what_is_written_and_drawn_stands_out_from_the_paper(theme):
    assert contrast(theme.ink, theme.paper) > 7 and contrast(theme.muted, theme.paper) > 4.5
    assert all(contrast(reason_colour(name, theme), theme.paper) > 3 for name in [*REASONS, "heading", "of one's own"])


@pytest.mark.parametrize("eyes", EYES)
@pytest.mark.parametrize("theme", THEMES)
def test_a_scale_goes_one_way_in_even_steps(theme, eyes):
    light = lab(scale_colours(theme), eyes)[:, 0]
    step = np.diff(light[::16])
    assert (np.sign(step) == np.sign(step[0])).all()
    assert np.abs(step).min() > 0.35 * np.abs(step).mean()
    ground = lab([THEMES[theme].ground], eyes)[0, 0]
    assert abs(light[-1] - ground) > abs(light[0] - ground)  # much stands out
