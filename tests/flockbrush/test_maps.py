"""Maps that designers bring: checked, adopted, run."""

import json
import os
import re
import shutil
import subprocess

import cv2
import numpy as np
import pytest
from flockbrush.components import Position
from flockbrush.levels.editor import Editor
from flockbrush.levels.reader import read_level
from flockbrush.levels.tile_data import unpack
from flockbrush.levels.tmx import read_xml
from flockbrush.systems.edits import Paint
from foreign_maps import EXAMPLES, OF_TILED, exported, foreign_map

from flockbrush.render.painter import Painter
from flockbrush.render.scenery import Scenery
from flockbrush.runs import run as running

tiled = pytest.mark.skipif(shutil.which("tiled") is None, reason="Tiled is not installed")
examples = pytest.mark.skipif(not (EXAMPLES / "desert.tmx").is_file(), reason="Tiled's examples are not installed")


def test_check_prints_warnings_and_is_content(cli, tmp_path):
    assert cli("level", "init", tmp_path).code == 0
    path = tmp_path / "first.tmj"
    document = json.loads(path.read_bytes())
    next(layer for layer in document["layers"] if layer["name"] == "terrain")["visible"] = False
    path.write_text(json.dumps(document, indent=1))
    result = cli("level", "check", path)
    lines = result.out.splitlines()
    assert result.code == 0
    assert "layer 'terrain': warning: is hidden in Tiled but still used" in result.out
    assert "first.tmj: ok: 40 x 30 m, 60 animals" in lines[-1]


def adopted(name, tmp_path, of_tiled=False, *words):
    path = foreign_map(name, tmp_path / "maps", of_tiled)
    return path, path.with_suffix(".tmj")


def given(path, **values):
    """Give the map of a file properties."""
    document = json.loads(path.read_bytes())
    others = [entry for entry in document["properties"] if entry["name"] not in values]
    added = [{"name": name, "type": "string", "value": value} for name, value in values.items()]
    document["properties"] = others + added
    path.write_text(json.dumps(document))


def ours(document):
    """The group that adoption adds."""
    return document["layers"][-1]


def unpacked(document):
    """The layers of a map with their tiles as lists: Tiled packs all layers of a map in one way."""
    layers = json.loads(json.dumps(document["layers"]))
    for node in [*layers, *ours({"layers": layers})["layers"]]:
        if "data" in node:
            packing = node.pop("encoding", None), node.pop("compression", None)
            node["data"] = unpack(node["data"], *packing, node["width"], node["height"]).tolist()
    return layers


@pytest.mark.parametrize("name", sorted(OF_TILED))
@pytest.mark.parametrize("of_tiled", [False, pytest.param(True, marks=examples)])
class TestAdopting:
    def test_theirs_stays_as_it_is_and_ours_is_added(self, name, of_tiled, tmp_path, cli):
        path, new = adopted(name, tmp_path, of_tiled)
        before = {file: file.read_bytes() for file in path.parent.rglob("*") if file.is_file()}
        result = cli("level", "adopt", path)
        assert result.code == 0, result.err
        assert f"wrote {new}; {path} was not changed" in result.out
        after = {file: file.read_bytes() for file in path.parent.rglob("*") if file.is_file() and file != new}
        assert after == before
        theirs, document = read_xml(path.read_bytes()), json.loads(new.read_bytes())
        assert document["layers"][:-1] == theirs["layers"]
        for was, now in zip(theirs["tilesets"], document["tilesets"], strict=True):
            assert {key: now[key] for key in was} == was
        assert [entry for entry in document["properties"] if entry in theirs.get("properties", [])] == theirs.get(
            "properties", []
        )
        changed = {"layers", "tilesets", "properties", "nextlayerid", "nextobjectid"}
        assert {k: v for k, v in document.items() if k not in changed} == {
            k: v for k, v in theirs.items() if k not in changed
        }
        assert ours(document)["name"] == "flockbrush"
        assert [layer["name"] for layer in ours(document)["layers"]][:4] == ["terrain", "brush", "speed", "obstacles"]

    def test_a_herd_walks_through_and_the_run_replays(self, name, of_tiled, tmp_path, cli):
        path, new = adopted(name, tmp_path, of_tiled)
        assert cli("level", "adopt", path).code == 0
        assert ": ok: " in cli("level", "check", new).out
        run, picture = tmp_path / "run.flock", tmp_path / "run.png"
        result = cli("run", new, "--seconds", "4", "--record", run, "--export", picture, "--json")
        assert result.code == 0, result.err
        told = json.loads(result.out)
        assert told["agents"] == 30 and told["measures"]["speed_mean"] > 0.2
        assert "identical, bit for bit" in cli("replay", run, "--verify").out

    @pytest.mark.tools
    @tiled
    def test_tiled_opens_and_keeps_it(self, name, of_tiled, tmp_path, cli):
        path, new = adopted(name, tmp_path, of_tiled)
        assert cli("level", "adopt", path).code == 0
        again = exported(new, new.with_name("again.tmj"))
        assert unpacked(again) == unpacked(json.loads(new.read_bytes()))
        assert ": ok: " in cli("level", "check", new.with_name("again.tmj")).out
        out = tmp_path / "tiled.png"
        environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
        subprocess.run(["tmxrasterizer", new, out], env=environment, check=True, capture_output=True, timeout=60)
        assert cv2.imread(str(out)).size


class TestMeaning:
    def test_rules_that_names_suggest_are_in_the_level(self, tmp_path, cli):
        path, new = adopted("island", tmp_path)
        out = cli("level", "adopt", path).out
        assert "ground_rules: class Water = deep water" in out and "ground_rules: collision = walkable=false" in out
        land = read_level(new).terrain
        assert not land.walkable[0].any() and land.walkable[12, 20]  # the sea, the island
        assert not land.walkable[40 - 16, 20]  # a tile with a collision shape

    def test_nobody_walks_into_the_water_of_a_map(self, tmp_path, cli):
        path, new = adopted("island", tmp_path)
        cli("level", "adopt", path)
        simulation = running.start(new)
        walkable = simulation.level.terrain.walkable
        for _ in range(12):
            simulation.run(32)
            x, y, _ = simulation.agents[Position.xyz].T
            assert walkable[y.astype(int), x.astype(int)].all()
        assert len(simulation.agents) == 30

    def test_rules_of_ones_own_count(self, tmp_path, cli):
        path, new = adopted("sewers", tmp_path)
        cli("level", "adopt", path)
        before = read_level(new)
        assert before.terrain.walkable.all() and (before.terrain.speed_factor == 1).all()
        given(new, ground_rules="tileset sewer 0-3 = mud")
        assert (read_level(new).terrain.speed_factor == 0.5).any()

    def test_metres_per_tile_are_as_told(self, tmp_path, cli):
        path, new = adopted("desert", tmp_path)
        assert cli("level", "adopt", path, "--metres-per-tile", "2.5").code == 0
        assert (read_level(new).width, read_level(new).height) == (100, 75)


class TestPictures:
    def test_the_map_is_seen_in_pictures_and_from_a_recording_alone(self, tmp_path, cli):
        path, new = adopted("island", tmp_path)
        cli("level", "adopt", path)
        run = tmp_path / "run.flock"
        assert cli("run", new, "--seconds", "0.2", "--record", run, "--export", tmp_path / "a.png").code == 0
        for file in new.parent.iterdir():
            file.unlink()
        assert cli("export", run, "--to", tmp_path / "b.png").code == 0
        a, b = cv2.imread(str(tmp_path / "a.png")), cv2.imread(str(tmp_path / "b.png"))
        assert np.array_equal(a, b)
        sea = (40 + 31 * 5 % 200, 90 + 53 * 5 % 160, 30 + 17 * 5 % 220)  # the animation begins with tile 5
        assert (np.abs(a.astype(int) - sea).max(axis=2) < 3).mean() > 0.2

    def test_a_stroke_on_the_map_is_drawn_as_the_whole_is(self, tmp_path, cli):
        path, new = adopted("island", tmp_path)
        cli("level", "adopt", path)
        simulation = running.start(new)
        painter = Painter(Scenery(simulation), (640, 480), "light")
        before = painter.ground.copy()
        simulation.submit(Paint("surface", "mud", 10.0, 10.0, 20.0, 14.0, 2.0))
        simulation.tick()
        painter.repaint((6.0, 6.0, 24.0, 18.0))
        mended = painter.ground.copy()
        assert (mended != before).any()
        assert np.array_equal(mended, Painter(Scenery(simulation), (640, 480), "light").ground)

    def test_it_is_painted_in_the_playground_and_saved_into_our_layers(self, tmp_path, cli):
        path, new = adopted("sewers", tmp_path)
        cli("level", "adopt", path)
        before = json.loads(new.read_bytes())
        editor = Editor.open(new)
        editor.do("stroke", [Paint("surface", "mud", 4.0, 4.0, 9.0, 6.0, 1.0)])
        editor.document.save()
        after = json.loads(new.read_bytes())
        assert after["layers"][:-1] == before["layers"][:-1]
        assert any(ours(after)["layers"][0]["data"]) and len(ours(after)["layers"]) == len(ours(before)["layers"])
        assert (read_level(new).terrain.speed_factor == 0.5).any()


class TestRefusals:
    def refused(self, cli, *words):
        result = cli("level", "adopt", *words)
        assert result.code == 1 and "Traceback" not in result.err
        return result.err

    @pytest.mark.parametrize("orientation", ["isometric", "hexagonal", "staggered"])
    def test_other_orientations_say_why(self, orientation, tmp_path, cli):
        path, new = adopted("sewers", tmp_path)
        path.write_text(path.read_text().replace("orthogonal", orientation))
        told = self.refused(cli, path)
        assert (
            f"sewers.tmx:2: the orientation must be orthogonal, got the text '{orientation}': tiles must be squares"
            in told
        )
        assert not new.exists()

    @pytest.mark.parametrize(
        ("was", "now", "message"),
        [
            ('width="40"', 'width="4000000000"', "'width' must be a whole number from 1 to 1000000"),
            ('width="40"', 'width="900000"', "there may be at most 4194304"),
            ('width="40"', "", "'width' must be a whole number from 1 to 1000000, got nothing"),
            ('height="40"', 'height="-1"', "'height' must be a whole number from 1 to 1000000, got -1"),
            ('tilewidth="24"', "", "'tilewidth' must be a whole number from 1 to 4096, got nothing"),
            ('tilewidth="24"', 'tilewidth="48"', "tiles must be square, got 48 x 24 pixels"),
        ],
    )
    def test_a_size_that_is_none_is_told_before_memory_is_taken(self, was, now, message, tmp_path, cli):
        path, _ = adopted("sewers", tmp_path)
        path.write_text(path.read_text().replace(was, now, 1))
        assert message in self.refused(cli, path)

    def test_an_infinite_map_says_what_to_do(self, tmp_path, cli):
        path, new = adopted("sewers", tmp_path)
        path.write_text(path.read_text().replace("<map ", '<map infinite="1" '))
        assert "Map > Map Properties > Infinite off" in self.refused(cli, path)

    @pytest.mark.parametrize(
        ("entry", "message"),
        [
            ({"name": "boundary", "value": "nope"}, "rename property 'boundary' of the map, which is"),
            ({"name": "seed", "value": "abc"}, "rename property 'seed' of the map, which is"),
            ({"name": "metres_per_tile", "value": 2}, "rename property 'metres_per_tile' of the map, which is o"),
            ({"name": "ground_rules", "value": "Be kind."}, "rename property 'ground_rules' of the map, which is"),
            ({"value": 1}, "each of the 'properties' must have a name and a value"),
        ],
    )
    def test_properties_of_a_map_that_are_called_as_ours_are_told_with_their_line(self, entry, message, tmp_path, cli):
        path = tmp_path / "own.tmj"
        size = {"width": 4, "height": 4, "tilewidth": 16, "tileheight": 16, "orientation": "orthogonal"}
        path.write_text(json.dumps({"type": "map", **size, "layers": [], "properties": [entry]}, indent=1))
        told = self.refused(cli, path)
        assert re.search(rf"own\.tmj:\d+: map: {re.escape(message)}", told) and told.count("own.tmj:") == 1, told

    def test_what_is_there_is_never_written_over(self, tmp_path, cli):
        path, new = adopted("sewers", tmp_path)
        other = new.with_name("other.tmj")
        other.write_text("mine")
        assert "already exists; give another file with -o" in self.refused(cli, path, "-o", other)
        assert other.read_text() == "mine"
        assert cli("level", "adopt", path).code == 0
        assert cli("level", "adopt", path).code == 0  # the next free name
        assert new.with_name("sewers-level.tmj").is_file()

    def test_a_level_is_not_adopted_again(self, tmp_path, cli):
        path, new = adopted("sewers", tmp_path)
        cli("level", "adopt", path)
        assert "is already a level" in self.refused(cli, new)

    def test_a_name_that_is_no_level_is_refused(self, tmp_path, cli):
        path, _ = adopted("sewers", tmp_path)
        assert "the name of a level must end in .tmj" in self.refused(cli, path, "-o", tmp_path / "x.tmx")
        assert "there is no folder" in self.refused(cli, path, "-o", tmp_path / "gone" / "x.tmj")
        assert "there is no such file" in self.refused(cli, tmp_path / "gone.tmx")

    def test_another_folder_needs_the_pictures_in_the_project(self, tmp_path, cli):
        path, _ = adopted("desert", tmp_path)
        (tmp_path / "levels").mkdir()
        assert "is outside of the project folder" in self.refused(cli, path, "-o", tmp_path / "levels" / "d.tmj")
        assert cli("level", "init", tmp_path).code == 0
        assert cli("level", "adopt", path, "-o", tmp_path / "levels" / "d.tmj").code == 0
        document = json.loads((tmp_path / "levels" / "d.tmj").read_bytes())
        assert [one["source"] for one in document["tilesets"]] == [
            "../maps/sand.tsx", *(f"../tilesets/{name}.tsj" for name in ("terrain", "brushes", "speed")),
        ]  # fmt: skip

    def test_a_map_that_was_not_adopted_says_what_to_do(self, tmp_path, cli):
        path, _ = adopted("desert", tmp_path)
        result = cli("level", "check", path)
        assert result.code == 1 and "flockbrush level adopt" in result.out
