"""What designers get: a project with the schema's classes, tilesets one can read, levels Tiled agrees about."""

import json
import os
import shlex
import shutil
import subprocess
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.components import Velocity
from flockbrush.engine.problems import Problem, ProblemsError
from flockbrush.levels.level_class import ENUMS
from flockbrush.levels.level_writer import dump
from flockbrush.levels.reader import read_level
from flockbrush.levels.schema import CLASSES
from flockbrush.levels.terrain_kinds import TERRAINS
from flockbrush.levels.tile_pictures import BRUSHES_FILE, known_brushes
from flockbrush.levels.tiled import init, object_types, project, project_files, renew_brushes, tile_order, write_project

from flockbrush import levels
from flockbrush.runs.run import start

HERE = Path(levels.__file__).parent
SHIPPED = sorted((HERE / "shipped").glob("*.tmj"))
TILED = shutil.which("tiled")


class Shelf:
    def __init__(self, *names):
        self.shelf = names

    def names(self):
        return sorted(self.shelf)

    def get(self, name):
        return SimpleNamespace(colour="#3366aa")


def started(command, level):
    """What a command of Tiled starts for a level: Tiled quotes names of files, and splits at unquoted spaces."""
    return shlex.split(f"{command['command']} {command['arguments']}".replace("%mapfile", f'"{level}"'))


class TestProject:
    def test_the_shipped_files_are_the_generated_ones(self):
        for name, content in project_files(shipped(), known_brushes(HERE / BRUSHES_FILE)).items():
            kept = (HERE / name).read_bytes()
            if name.endswith(".png"):  # another version of the library may pack or smooth differently
                ours, theirs = (cv2.imdecode(np.frombuffer(b, np.uint8), -1).astype(int) for b in (content, kept))
                assert ours.shape == theirs.shape, name
                assert np.abs(ours - theirs).max() <= 12, f"{name}: run python -m flockbrush.levels.tiled"
            else:
                assert kept == content, f"{name}: run python -m flockbrush.levels.tiled"

    def test_every_class_and_enum_of_the_schema_is_in_it(self):
        types = {t["name"]: t for t in project(["march"])["propertyTypes"]}
        assert set(types) == {*ENUMS, "BrushAsset", "ProgramAsset", *CLASSES}
        for cls in CLASSES.values():
            assert {m["name"] for m in types[cls.name]["members"]} == {p.name for p in cls.properties}
        assert types["BrushAsset"]["values"] == ["", "march"]

    def test_tiled_1_8_finds_the_same_defaults_as_later_versions(self):
        later = {t["name"]: t.get("members") for t in project([])["propertyTypes"]}
        for old in object_types():
            told = [(p["name"], p["type"], p["value"]) for p in old["properties"]]
            assert told == [(m["name"], m["type"], m["value"]) for m in later[old["name"]]]

    def test_f5_plays_and_f6_checks(self):
        commands = {c["shortcut"]: c for c in project([])["commands"]}
        assert started(commands["F5"], "/herds/first.tmj") == ["flockbrush", "play", "/herds/first.tmj"]
        assert started(commands["F6"], "/herds/first.tmj")[1:] == ["level", "check", "--window", "/herds/first.tmj"]

    @pytest.mark.parametrize("key", ["F5", "F6"])
    def test_commands_reach_levels_in_folders_with_spaces(self, key):
        command = next(c for c in project([])["commands"] if c["shortcut"] == key)
        level = "/home/a designer/my herds/first level.tmj"
        assert started(command, level)[-1] == level

    def test_a_brush_keeps_its_tile_when_others_come_and_go(self, tmp_path):
        write_project(tmp_path, Shelf("march", "swarm"))
        write_project(tmp_path, Shelf("graze", "swarm"))
        assert known_brushes(tmp_path / BRUSHES_FILE) == ["march", "swarm", "graze"]
        assert tile_order(Shelf("a", "b"), ["c", "b"]) == ["c", "b", "a"]

    def test_no_two_kinds_of_ground_look_alike(self):
        sheet = cv2.imread(str(HERE / "tilesets" / "terrain.png"))[..., :3].astype(float)
        looks = [sheet[32 * (k // 8) :, 32 * (k % 8) :][:32, :32].mean((0, 1)) for k in range(len(TERRAINS))]
        apart = [np.abs(a - b).max() for i, a in enumerate(looks) for b in looks[:i]]
        assert min(apart) > 8


class TestRenewedBrushes:
    def test_new_brushes_come_into_the_project_and_what_a_designer_set_stays(self, tmp_path):
        write_project(tmp_path, Shelf("march", "swarm"))
        file = tmp_path / "flockbrush.tiled-project"
        own = json.loads(file.read_bytes())
        own["commands"].append({"name": "mine", "command": "true"})
        own["propertyTypes"].append({"name": "Mine", "type": "enum", "values": ["a"], "id": 99})
        file.write_text(json.dumps(own))
        assert renew_brushes(tmp_path, Shelf("march", "rush", "swarm"))
        now = json.loads(file.read_bytes())
        assert now["commands"] == own["commands"]
        assert {t["name"] for t in now["propertyTypes"]} == {t["name"] for t in own["propertyTypes"]}
        listed = next(t for t in now["propertyTypes"] if t["name"] == "BrushAsset")
        assert listed["values"] == ["", "march", "rush", "swarm"]
        assert known_brushes(tmp_path / BRUSHES_FILE) == ["march", "swarm", "rush"]
        assert cv2.imread(str(tmp_path / "tilesets" / "brushes.png"), -1)[:32, 64:96, 3].any()
        assert not list(tmp_path.rglob("*.bak"))

    def test_a_folder_without_a_project_is_left_alone(self, tmp_path):
        assert not renew_brushes(tmp_path, Shelf("march"))
        assert list(tmp_path.iterdir()) == []

    def test_a_damaged_project_is_named(self, tmp_path):
        (tmp_path / "flockbrush.tiled-project").write_text("[")
        with pytest.raises(ProblemsError, match="flockbrush.tiled-project"):
            renew_brushes(tmp_path, Shelf("march"))


class TestInit:
    def test_a_new_project_has_a_level_that_reads(self, tmp_path):
        written = init(tmp_path / "herds", shipped())
        assert tmp_path / "herds" / "first.tmj" in written
        assert read_level(tmp_path / "herds" / "first.tmj").agents == 60

    def test_the_first_level_has_goals_and_an_exit_and_its_fields_and_units_beside_it(self, tmp_path):
        init(tmp_path, shipped())
        level = read_level(tmp_path / "first.tmj")
        assert [goal.name for goal in level.goals] == ["gate"] and level.exits and level.warnings == []
        data = json.loads((tmp_path / "first.tmj").read_bytes())
        notes = next(layer for layer in data["layers"] if layer["name"] == "notes")["objects"]
        spawn = next(note["text"]["text"] for note in notes if note["text"]["text"].startswith("Spawn"))
        assert "rate (1/s)" in spawn and "body_length (m)" in spawn

    def test_the_herd_of_the_first_level_neither_jams_nor_ends(self, tmp_path):
        init(tmp_path, shipped())
        simulation = start(tmp_path / "first.tmj")
        while simulation.clock.now < 60:
            simulation.tick()
        speed = np.hypot(*simulation.agents[Velocity.xyz][:, :2].T)
        assert 20 <= len(speed) <= 80 and speed.mean() > 3 and (speed < 0.5).mean() < 0.1

    def test_running_it_again_leaves_the_designers_levels_alone(self, tmp_path):
        init(tmp_path, shipped())
        (tmp_path / "first.tmj").rename(tmp_path / "mine.tmj")
        before = (tmp_path / "mine.tmj").read_bytes()
        assert all(path.suffix != ".tmj" for path in init(tmp_path, shipped()))
        assert (tmp_path / "mine.tmj").read_bytes() == before

    def test_files_of_other_people_are_refused_and_nothing_is_written(self, tmp_path):
        (tmp_path / "tilesets").mkdir()
        foreign = {
            "flockbrush.tiled-project": b'{"folders": ["."], "propertyTypes": []}',
            "objecttypes.json": b'[{"name": "Chest"}]',
            "tilesets/terrain.png": b"a picture",
            "tilesets/terrain.tsj": b'{"image": "terrain.png", "tiles": [{"id": 0, "type": "Terrain"}]}',
        }
        for name, content in foreign.items():
            (tmp_path / name).write_bytes(content)
        with pytest.raises(ProblemsError, match="was not written by Flockbrush; move or rename") as refusal:
            init(tmp_path, shipped())
        assert {Path(problem.file) for problem in refusal.value.problems} == {tmp_path / name for name in foreign}
        there = [path for path in tmp_path.rglob("*") if path.is_file()]
        assert {path.relative_to(tmp_path).as_posix(): path.read_bytes() for path in there} == foreign

    def test_running_it_again_leaves_what_a_designer_set_in_our_files(self, tmp_path):
        init(tmp_path, shipped())
        file, tiles = tmp_path / "flockbrush.tiled-project", tmp_path / "tilesets" / "terrain.tsj"
        own, ground = json.loads(file.read_bytes()), json.loads(tiles.read_bytes())
        own["commands"][0]["shortcut"] = "F7"
        own["propertyTypes"].insert(0, {"name": "Mine", "type": "enum", "values": ["a"], "id": 1})
        own["propertyTypes"][1]["values"] = []
        ground["tiles"][3]["properties"].append({"name": "depth", "type": "float", "value": 0.3})
        ground["wangsets"] = [{"name": "shores"}]
        file.write_text(json.dumps(own))
        tiles.write_text(json.dumps(ground))
        picture = cv2.imread(str(tiles.with_suffix(".png")), -1)
        picture[8, 8] = 0, 0, 0, 255
        cv2.imwrite(str(tiles.with_suffix(".png")), picture)
        painted = tiles.with_suffix(".png").read_bytes()
        (tmp_path / "tilesets" / "speed.tsj").unlink()
        init(tmp_path, shipped())
        now = json.loads(file.read_bytes())
        assert now["commands"] == own["commands"] and now["propertyTypes"][-1]["name"] == "Mine"
        assert [known["id"] for known in now["propertyTypes"]] == list(range(1, len(now["propertyTypes"]) + 1))
        assert all(known["values"] for known in now["propertyTypes"] if known["type"] == "enum")
        assert json.loads(tiles.read_bytes()) == ground
        assert [path.read_bytes() for path in tmp_path.rglob("*.bak")] == [painted]
        assert (tmp_path / "tilesets" / "speed.tsj").exists()

    def test_running_it_again_changes_nothing_else(self, tmp_path):
        init(tmp_path, shipped())
        before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
        init(tmp_path, shipped())
        assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def same(a, b, where=""):
    """Two levels, thing by thing: where they differ.  A warning is of its own file and line."""
    if isinstance(a, Problem):
        assert (a.where, a.message) == (b.where, b.message), where
    elif is_dataclass(a):
        assert type(a) is type(b), where
        for f in fields(a):
            if f.name not in ("files", "path", "name") or where:
                same(getattr(a, f.name), getattr(b, f.name), f"{where}.{f.name}")
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype, where
        np.testing.assert_array_equal(a, b, err_msg=where)
    elif isinstance(a, list | tuple):
        assert len(a) == len(b), where
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            same(x, y, f"{where}[{k}]")
    elif isinstance(a, dict):
        assert a.keys() == b.keys(), where
        for key in a:
            same(a[key], b[key], f"{where}[{key!r}]")
    else:
        assert a == b, where


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
class TestShipped:
    def test_it_reads(self, path):
        level = read_level(path)
        assert level.agents > 0
        assert level.terrain is not None
        assert len(level.terrain.names) >= 3

    def test_it_is_written_as_tiled_writes(self, path):
        text = path.read_text(encoding="utf-8")
        assert dump(json.loads(text)) == text

    @pytest.mark.tools
    @pytest.mark.skipif(TILED is None, reason="Tiled is not installed")
    def test_tiled_reads_and_writes_the_same_level(self, path, tmp_path):
        shutil.copytree(HERE / "tilesets", tmp_path / "tilesets")
        (tmp_path / "shipped").mkdir()
        shutil.copy(HERE / "flockbrush.tiled-project", tmp_path)
        for picture in path.parent.glob("*.png"):
            shutil.copy(picture, tmp_path / "shipped")
        shutil.copy(path, tmp_path / "shipped" / "before.tmj")
        again = tmp_path / "shipped" / path.name
        environment = {
            **os.environ,
            "QT_QPA_PLATFORM": "offscreen",
            "XDG_RUNTIME_DIR": str(tmp_path),
            "HOME": str(tmp_path),
        }
        command = [TILED, "--export-map", "json", tmp_path / "shipped" / "before.tmj", again]
        subprocess.run(command, env=environment, check=True, timeout=240, capture_output=True)
        same(read_level(path), read_level(again))
        text = again.read_text(encoding="utf-8")
        assert dump(json.loads(text)) == text  # to the byte: a save of ours makes no noise in a designer's diff


def test_the_scenes_of_the_paper_are_there():
    names = {path.stem for path in SHIPPED}
    assert names >= {"meadow", "sheep-pasture", "anthill", "river", "gorge", "predators-valley", "crowded"}


def test_the_crowd_is_as_dense_as_it_says():
    crowd = read_level(HERE / "shipped" / "crowded.tmj")
    assert crowd.agents == 10_000
    assert crowd.width * crowd.height / crowd.agents == 4
    brush = shipped().get(crowd.spawns[0].brush)
    assert brush.vision.range * (crowd.spawns[0].body_length or brush.body.length) == pytest.approx(10)


def test_the_guide_of_the_anthill_runs_counter_clockwise():
    guide = read_level(HERE / "shipped" / "anthill.tmj").guides[0]
    x, y = (guide.points - (7, 9)).T
    assert guide.loop
    assert np.all(np.roll(y, -1) * x - np.roll(x, -1) * y > 0)
