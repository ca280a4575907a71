"""A learned brush in a designer's hands: in the shipped levels, in Tiled's palette, in a folder of one's own."""

import json
from dataclasses import replace

import numpy as np
import pytest
from flockbrush.behaviours.brush import BrushLibrary, shipped
from flockbrush.behaviours.brush_writer import brush_to_toml

from flockbrush.runs.run import begin, open_level, shipped_levels


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """A folder with a learned brush, before the shipped ones."""
    folder = tmp_path_factory.mktemp("brushes")
    march = shipped().get("march")
    told = march.provenance.model_copy(update={"kind": "learned", "clip": "sheep.mp4", "frames": (0, 99)})
    lambs = march.with_parameters(wander=0.2).model_copy(update={"name": "lambs", "provenance": told})
    (folder / "lambs.brush.toml").write_text(brush_to_toml(lambs))
    return BrushLibrary([folder, *shipped().folders])


@pytest.mark.parametrize("name", shipped_levels())
def test_a_learned_brush_moves_the_herds_of_every_level(name, library):
    level, _ = open_level(name)
    herds = [replace(s, brush="lambs") if library.get(s.brush).model == "herd" else s for s in level.spawns]
    simulation = begin(replace(level, spawns=herds), library, agents=24)
    before = simulation.agents.ids.copy()
    simulation.run(ticks=4)
    assert len(simulation.agents.ids) >= len(before) - 2
    assert np.isfinite(simulation.measures()["polarization"])


def test_a_brush_in_the_folder_brushes_gets_its_tile_and_its_place_in_the_lists(cli, library, tmp_path):
    own = tmp_path / "levels" / "brushes"
    own.mkdir(parents=True)
    own.joinpath("lambs.brush.toml").write_bytes(library.path("lambs").read_bytes())
    assert cli("level", "init", tmp_path / "levels").code == 0
    tiles = json.loads((tmp_path / "levels" / "tilesets" / "brushes.tsj").read_text())["tiles"]
    assert "lambs" in [tile["properties"][0]["value"] for tile in tiles]
    assert "lambs" in (tmp_path / "levels" / "flockbrush.tiled-project").read_text()
    level = tmp_path / "levels" / "first.tmj"
    level.write_text(level.read_text().replace('"march"', '"lambs"'))
    done = cli("run", level, "--ticks", 2, "--agents", 5, "--json")
    assert done.code == 0, done.err
