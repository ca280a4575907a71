"""Colours of brushes that a person chooses for all pictures, and the third theme."""

import base64
import json
import re
import zlib

import numpy as np
import pytest

from flockbrush.output.export import Exports
from flockbrush.output.pictures import herd_of, painter_of
from flockbrush.render.brush_marks import difference
from flockbrush.render.drawn_herd import checked
from flockbrush.render.painter import brush_rgb, brushes_in_sight
from flockbrush.render.sprites import look_colours
from flockbrush.render.style import PALETTES, THEMES, rgb, theme_of, worn
from flockbrush.runs.run import start
from flockbrush.runs.snapshots import moment_of


@pytest.mark.parametrize("name", [name for name in PALETTES if name != "own"])
def test_eyes_of_all_kinds_tell_the_colours_of_a_palette_apart(name):
    colours = [rgb(colour) for colour in PALETTES[name]]
    assert len(colours) >= 7
    apart = [difference(a, b) for k, a in enumerate(colours) for b in colours[:k]]
    assert min(apart) > 9
    for theme in THEMES.values():
        assert min(difference(colour, theme.predator) for colour in colours) > 9
        assert min(difference(colour, theme.leader) for colour in colours) > 20


def test_a_palette_colours_the_brushes_of_a_world_in_turn():
    own = ("#ff0000", "#00ff00", "#0000ff")
    assert worn(own, theme_of("light")) == own
    assert worn(own, theme_of("dark", "tol")) == PALETTES["tol"][:3]
    assert theme_of("light", "tol") is theme_of("light", "tol")
    assert theme_of(theme_of("light", "tol"), "own") == theme_of("light")
    with pytest.raises(ValueError, match="okabe-ito"):
        theme_of("light", "rainbow")


@pytest.mark.parametrize("view", ["plan", "space"])
@pytest.mark.parametrize("theme", THEMES)
def test_pictures_show_animals_in_the_colours_of_the_palette(view, theme):
    run = start("meadow", seed=1)
    herd = herd_of(run, moment_of(run))
    frames = []
    for palette in ("own", "tol"):
        painter = painter_of(run, (480, 320), theme_of(theme, palette), view=view)
        frames.append(painter.frame(herd, time=0.0).astype(int))
    run.close()
    assert (np.abs(frames[0] - frames[1]).max(axis=2) > 20).sum() > 100


def test_a_page_has_the_palette_that_was_asked_for(tmp_path):
    run, page = start("meadow", seed=1), tmp_path / "run.html"
    with Exports([page], run, palette="okabe-ito") as exports:
        exports.take()
        run.run(4)
        exports.take()
    run.close()
    data = re.search('data-kind="about">([^<]+)<', page.read_text()).group(1)
    about = json.loads(zlib.decompress(base64.b64decode(data)))
    assert about["brush_colours"][:2] == list(PALETTES["okabe-ito"][:2])
    grounds = dict(zip(about["words"]["brush"], about["brush_grounds"], strict=True))
    assert grounds["graze"].startswith("data:image/jpeg;base64,") and grounds["graze"] != grounds["march"]


@pytest.mark.parametrize("view", ["plan", "space"])
def test_the_legend_shows_the_ground_that_a_brush_is_painted_on(view):
    run = start("meadow", seed=1)
    shown = herd_of(run, moment_of(run))
    painter = painter_of(run, (640, 420), view=view)
    blank = np.full((420, 640, 3), 255, np.uint8)
    with_ground, without = blank.copy(), blank.copy()
    checked_herd, colours = checked(shown), look_colours(brush_rgb(shown.brush_colours), painter.theme)
    painter.hud.legend(with_ground, 640, checked_herd, colours, brushes_in_sight(painter.level))
    painter.hud.legend(without, 640, checked_herd, colours)
    run.close()
    assert brushes_in_sight(painter.level) == {"graze"}
    assert (with_ground != without).any(axis=2).sum() > 150


def test_brushes_that_are_painted_nowhere_are_not_in_sight():
    run = start("gorge", seed=1)
    scenery = painter_of(run, (640, 420)).level
    herd = herd_of(run, moment_of(run))
    run.close()
    assert "sheep-narrow" in herd.brush_names and brushes_in_sight(scenery) == set()


def test_leaders_are_marked_where_they_are_the_fewer():
    run = start("anthill", seed=1)
    run.run(32)
    moment = moment_of(run)
    assert moment.leader.mean() > 0.5 and not herd_of(run, moment).leader.any()
    few = np.flatnonzero(moment.brush == 0)[:5]
    moment.leader[moment.brush == 0] = False
    moment.leader[few] = True
    assert np.array_equal(np.flatnonzero(herd_of(run, moment).leader), few), "those of the other brush all lead"
    run.close()
