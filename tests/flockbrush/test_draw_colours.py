"""Colours for colour-blind eyes: what means different things looks different, and more looks like more."""

from itertools import combinations

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped

from flockbrush.render.brush_marks import CONTRAST, EYES, PATTERNS, contrast, cover, ink_of, lab, pattern_of
from flockbrush.render.forces import REASONS, reason_colour
from flockbrush.render.style import PALETTE, THEMES, palette, rgb, scale_colours

TELL_APART = 12.0  # CIE 1976 colour difference; 2.3 is just to be seen


def nearest(named, eyes):
    """(difference, one, other) of the two colours that look most alike."""
    names, points = list(named), lab(list(named.values()), eyes)
    pairs = combinations(range(len(names)), 2)
    return min((float(np.linalg.norm(points[a] - points[b])), names[a], names[b]) for a, b in pairs)


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


@pytest.mark.parametrize("eyes", EYES)
def test_no_two_shipped_brushes_have_one_pattern_and_colours_that_are_alike(eyes):
    marks = {}
    for name in shipped().names():
        colour = rgb(shipped().get(name).colour)
        marks.setdefault(pattern_of(name, colour), {})[name] = colour
    assert len(marks) == len(PATTERNS)
    assert min(nearest(named, eyes) for named in marks.values())[0] > TELL_APART


@pytest.mark.parametrize("theme", THEMES.values(), ids=lambda theme: theme.name)
def test_what_is_painted_stands_out_from_every_ground(theme):
    tan = rgb(shipped().get("pelicans").colour)
    assert theme.name == "dark" or contrast(tan, theme.rough) < 2  # tan on sand, as it is named
    for name in shipped().names():
        ink = ink_of(rgb(shipped().get(name).colour), theme)
        assert min(contrast(ink, ground) for ground in (theme.ground, theme.rough, theme.road)) >= CONTRAST, name


def test_no_two_patterns_are_alike():
    x, y = np.arange(90.0)[None, :], np.arange(90.0)[:, None]
    made = [cover(k, x, y, 1.0) for k in range(len(PATTERNS))]
    assert all(0.02 < one.mean() < 0.3 for one in made)
    assert min(np.abs(a - b).mean() for a, b in combinations(made, 2)) > 0.03
