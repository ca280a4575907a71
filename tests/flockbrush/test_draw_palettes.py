"""Colours of brushes that a person chooses for all pictures, and the third theme."""

import base64
import json
import re
import zlib

import numpy as np
import pytest
from flockbrush.systems.palette import Palette

from flockbrush.cli.shared_options import PaletteName, ThemeName
from flockbrush.output.export import Exports
from flockbrush.output.gltf.bodies import LIGHT
from flockbrush.output.pictures import herd_of, painter_of
from flockbrush.render.brush_marks import difference
from flockbrush.render.drawn_herd import checked
from flockbrush.render.painter import brush_rgb, brushes_in_sight
from flockbrush.render.sprites import look_colours
from flockbrush.render.style import PALETTES, THEMES, linear_rgb, rgb, theme_of, worn
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


def test_commands_know_every_palette_and_theme(tmp_path, cli):
    assert [name.value for name in PaletteName] == list(PALETTES)
    assert [name.value for name in ThemeName] == list(THEMES)
    few = ("--agents", 20, "--seconds", 0)
    for words in (("level", "render", "meadow"), ("brush", "preview", "march", *few)):
        pictures = [tmp_path / f"{words[0]}-{palette}.png" for palette in ("own", "tol")]
        for palette, picture in zip(("own", "tol"), pictures, strict=True):
            cli(*words, "-o", picture, "--palette", palette)
        assert pictures[0].read_bytes() != pictures[1].read_bytes()


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


def test_scenes_for_other_tools_have_the_palette_that_was_asked_for(tmp_path):
    """The materials of brushes in glTF and USD, and the ground that is painted with them."""
    usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed")
    from pxr import UsdShade

    grounds = []
    for palette in ("own", "tol"):
        run, paths = start("meadow", seed=1), [tmp_path / f"{palette}.glb", tmp_path / f"{palette}.usdc"]
        brushes = run.world.resource(Palette).brushes
        with Exports(paths, run, palette=palette) as exports:
            exports.take()
            exports.take()
        run.close()
        worn_here = worn([brush.colour for brush in brushes], theme_of("light", palette))
        wanted = {brush.name: linear_rgb(rgb(c)) for brush, c in zip(brushes, worn_here, strict=True)}
        data = paths[0].read_bytes()
        materials = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])["materials"]
        stage, found = usd.Stage.Open(str(paths[1])), []
        for material in materials:
            word, _, name = material["name"].partition(" ")
            if word != "brush":
                continue
            found.append(name)
            light = np.minimum(wanted[name] * LIGHT, 1)
            assert material["pbrMetallicRoughness"]["baseColorFactor"][:3] == pytest.approx(light, abs=1e-4)
            shader = UsdShade.Shader(stage.GetPrimAtPath(f"/World/Materials/brush_{name}/Surface"))
            assert list(shader.GetInput("diffuseColor").Get()) == pytest.approx(wanted[name], abs=1e-6)
        assert found
        grounds.append(paths[1].with_suffix(".ground.jpg").read_bytes())
    assert grounds[0] != grounds[1]


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


def test_marks_of_leaders_do_not_flicker_where_about_half_lead():
    run = start("crowded", seed=1, agents=100)
    moment = moment_of(run)

    def marked(leaders):
        moment.leader[:] = np.arange(100) < leaders
        return int(herd_of(run, moment).leader.sum())

    assert [marked(leaders) for leaders in (49, 51, 49, 52)] == [49, 51, 49, 52]
    assert [marked(leaders) for leaders in (61, 49, 51, 45)] == [0, 0, 0, 0]
    assert marked(39) == 39
    run.close()
