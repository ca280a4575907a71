"""A level edited while it lives: its document follows, undoes to the byte, survives a crash, and Tiled agrees."""

import base64
import json
import os
import shutil
import subprocess
import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
from flockbrush.behaviours.brush import BrushLibrary, load_brush, save_brush, shipped
from flockbrush.components import Position
from flockbrush.engine.commands import CommandError, Commands
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.build import build
from flockbrush.levels.editor import EditError, Editor, JournalError
from flockbrush.levels.libraries import brush_library
from flockbrush.levels.reader import read_level, read_level_text
from flockbrush.levels.writer import Document, dump
from flockbrush.systems.commands import (
    AddAnimals,
    AddObstacle,
    MoveGoal,
    PaintBrush,
    PaintCells,
    RemoveObstacle,
    SetParameter,
)
from flockbrush.systems.edits import (
    DrawGuide,
    MarkSpawn,
    Paint,
    PlaceExit,
    PlaceGoal,
    RemoveThing,
    UseBrush,
    fill,
)
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.life import Nursery
from flockbrush.systems.palette import Palette
from hypothesis import given, settings
from hypothesis import strategies as st
from small_level import GRASS, MARCH, SLOW, herd, level, objects, polygon, polyline, properties, thing, tiles

from flockbrush import levels

HERE = Path(levels.__file__).parent
TILED = shutil.which("tiled")
FRONT = shipped().get("front").source.decode()


def small(*layers, **more):
    """The document of a small level: ten by ten tiles of 2 m."""
    return level(*layers, nextobjectid=20, nextlayerid=9, **more)


def editor(*layers, path="small.tmj", **more):
    return Editor(Document(small(*layers, **more), path), shipped())


def done(edit, *commands, **more):
    edit.do("edit", list(commands), **more)
    return edit


def read(edit):
    """The level as it would be saved, read again."""
    return read_level_text(edit.text().encode(), edit.path, shipped())


@pytest.fixture
def meadow(tmp_path):
    """A copy of a shipped level with its project, as a designer has it."""
    shutil.copytree(HERE / "tilesets", tmp_path / "tilesets")
    shutil.copy(HERE / "flockbrush.tiled-project", tmp_path)
    (tmp_path / "shipped").mkdir()
    return Path(shutil.copy(HERE / "shipped" / "meadow.tmj", tmp_path / "shipped"))


class Living:
    """A level that lives and is edited, as in the playground."""

    def __init__(self, path):
        found = read_level(path)
        self.library = brush_library(path, found.files)
        self.simulation = build(found, library=self.library)
        self.editor = Editor.open(path, self.library)
        self.queue = self.simulation.world.resource(Commands)
        self.land = self.simulation.world.resource(Landscape)

    def do(self, *commands, join=None):
        commands = list(commands)
        self.editor.check(commands)
        back = self.queue.perform(self.simulation.world, commands)
        self.editor.do("edit", commands, back, self.simulation.clock.tick, join)

    def undo(self):
        again = self.queue.perform(self.simulation.world, self.editor.undo_commands)
        self.editor.undo(self.simulation.clock.tick, again)

    def redo(self):
        back = self.queue.perform(self.simulation.world, self.editor.redo_commands)
        self.editor.redo(self.simulation.clock.tick, back)


def same_place(living, again):
    """The living world and the one built from its file: the same ground and the same things."""
    one, two = living.land, again.world.resource(Landscape)
    for name in ("walkable", "blind", "cost", "surface", "blocked", "transition"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name), err_msg=name)
    assert names_on(living.simulation) == names_on(again)
    assert [k.name for k in one.kinds] == [k.name for k in two.kinds]
    np.testing.assert_array_equal(one.kind_at, two.kind_at)
    for kind in ("barriers", "guides", "goals", "exits"):
        same_things(getattr(one, kind), getattr(two, kind))
    same_things(living.simulation.world.resource(Nursery).spawns, again.world.resource(Nursery).spawns)
    one.settle(10**9)
    np.testing.assert_allclose(one.navigation.fields, two.navigation.fields, atol=1e-5)


def names_on(simulation):
    names = [*simulation.world.resource(Palette).names, ""]
    return [[names[k] for k in row] for row in simulation.world.resource(Landscape).brush.tolist()]


def same_things(one, two):
    """By id, for a new thing stands behind all others in its layer, wherever it stands in the world."""
    one, two = ({thing.id: thing for thing in things} for things in (one, two))
    assert one.keys() == two.keys()
    for number, mine in one.items():
        for name, value in vars(mine).items():
            other = getattr(two[number], name)
            if isinstance(value, np.ndarray):
                np.testing.assert_allclose(value, other, atol=1e-6)
            elif isinstance(value, float) and name != "since":
                assert value == pytest.approx(other), name
            elif name not in ("since", "next_index"):
                assert value == other, name


# the whole way ------------------------------------------------------------------------------------


def many_edits(edit):
    """One of everything on the meadow, which is 120 x 80 m."""
    corral = [[88.0, 8.0], [116.0, 8.0], [116.0, 24.0], [88.0, 24.0]]
    goal, guide = edit.new_id(), edit.new_id()
    return [
        [UseBrush("front", FRONT), Paint("brush", "front", 10.0, 60.0, 40.0, 66.0, 6.0, 0.5)],
        [Paint("brush", "", 20.0, 60.0, 24.0, 60.0, 3.0)],
        [Paint("cap", 1.37, 60.0, 20.0, 74.0, 22.0, 6.0), Paint("cap", 3.0, 66.0, 20.0, 80.0, 26.0, 7.0, 0.8)],
        [Paint("surface", "deep water", 76.0, 66.0, 92.0, 72.0, 3.0)],
        [Paint("surface", "", 20.0, 30.0, 26.0, 34.0, 3.0)],
        [Paint("surface", "road", 4.0, 4.0, 60.0, 9.0, 1.5)],
        [PlaceGoal(goal, "fold", 104.0, 16.0, 4.0)],
        [DrawGuide(guide, "home", [[60.0, 10.0], [90.12345678, 14.3], [104.0, 16.0]], 2.0, 5.0, 3.0, "fold")],
        [PlaceGoal(edit.new_id(), "gate", 80.0, 12.0, 2.0, "next", "fold"), PlaceGoal(goal, "fold", 106.0, 17.0, 3.0)],
        [MarkSpawn(edit.new_id(), "corral", corral, "graze", "goat", 12, 0.7853981633974483, body_length=1.1)],
        [PlaceExit(edit.new_id(), "out", [[0.0, 0.0], [6.0, 0.0], [6.0, 6.0]])],
        [AddObstacle("hut", [[50.0, 60.0], [56.0, 60.0], [56.0, 66.0]], id=edit.new_id(), margin=0.5)],
        [AddObstacle("fence", [[50.0, 4.0], [50.5, 4.0], [50.5, 20.0]], True, False, edit.new_id())],
        [RemoveThing("obstacle", edit_ids(edit, "Obstacle")[1])],
        [RemoveThing("guide", edit_ids(edit, "Guide")[0])],
        [AddAnimals("graze", 30.0, 14.0, 6.0, 5, "dog")],
    ]  # fmt: skip


def edit_ids(edit, cls):
    return [o["id"] for o, node, *_ in edit.sheet.objects() if edit.sheet.class_of(o, node) == cls]


def test_a_level_edited_while_it_lives_is_saved_undone_and_done_again(meadow):
    living = Living(meadow)
    texts, grounds = [living.editor.text()], [names_on(living.simulation)]
    for commands in many_edits(living.editor):
        living.do(*commands)
        texts.append(living.editor.text())
        grounds.append(names_on(living.simulation))
        living.simulation.tick()
    assert len(set(texts)) == len(texts) - 1  # animals added are no thing of the file
    for text, ground in zip(texts[-2::-1], grounds[-2::-1], strict=True):
        living.undo()
        assert living.editor.text() == text
        assert names_on(living.simulation) == ground
        living.simulation.tick()
    assert living.editor.undo_commands is None
    same_place(living, build(read_level(meadow), library=living.library))
    for text, ground in zip(texts[1:], grounds[1:], strict=True):
        living.redo()
        assert living.editor.text() == text
        assert names_on(living.simulation) == ground
    living.editor.save()
    same_place(living, build(read_level(meadow), library=living.library))


def without_project(node):
    """Tiled's command line knows no project, and so forgets which enum a property is of."""
    node.pop("propertytype", None)
    return node


@pytest.mark.tools
@pytest.mark.skipif(TILED is None, reason="Tiled is not installed")
def test_tiled_opens_and_saves_an_edited_level_and_loses_nothing(meadow, tmp_path):
    living = Living(meadow)
    for commands in many_edits(living.editor):
        living.do(*commands)
    living.editor.save()
    again = meadow.with_name("again.tmj")
    environment = {
        **os.environ,
        "QT_QPA_PLATFORM": "offscreen",
        "XDG_RUNTIME_DIR": str(tmp_path),
        "HOME": str(tmp_path),
    }
    command = [TILED, "--export-map", "json", meadow, again]
    out = subprocess.run(command, env=environment, check=True, timeout=240, capture_output=True)
    assert b"rror" not in out.stderr, out.stderr
    same_place(living, build(read_level(again), library=living.library))
    ours, theirs = (json.loads(path.read_text(), object_hook=without_project) for path in (meadow, again))
    assert dump(ours) == dump(theirs)  # neither makes noise in the other's diff
    assert dump(json.loads(again.read_text())) == again.read_text()
    edited = Editor.open(again, living.library)
    done(edited, Paint("brush", "front", 60.0, 40.0, 66.0, 40.0, 3.0)).save()
    assert [t["name"] for t in json.loads(again.read_text())["tilesets"] if "name" in t] == ["playground"]


# to the byte ----------------------------------------------------------------------------------------

spot = st.floats(0, 20)
strokes = st.builds(
    lambda what, x, y, u, v, r, soft: Paint(*what, x, y, u, v, r, soft),
    st.sampled_from(
        [("brush", "march"), ("brush", "graze"), ("brush", ""), ("cap", 0.0), ("cap", 1.5), ("cap", 0.7)]
        + [("surface", "grass"), ("surface", "wall"), ("surface", "mud"), ("surface", "")]
    ),
    spot, spot, spot, spot, st.floats(0, 6), st.sampled_from([0.0, 0.5, 1.0]),
)  # fmt: skip
corners = st.tuples(spot, spot, st.floats(1, 8), st.floats(1, 8)).map(
    lambda v: [[v[0], v[1]], [v[0] + v[2], v[1]], [v[0] + v[2], v[1] + v[3]]]
)
ids = st.integers(1, 6)
things = st.one_of(
    st.builds(AddObstacle, st.just("rock"), corners, id=ids, margin=st.sampled_from([0.0, 1.0])),
    st.builds(DrawGuide, ids, st.just("way"), corners),
    st.builds(PlaceGoal, ids, st.just("pen"), spot, spot),
    st.builds(PlaceExit, ids, st.just("out"), corners),
    st.builds(MarkSpawn, ids, st.just("pen"), corners, st.just("graze"), count=ids, speed=st.sampled_from([None, 1.0])),
    st.builds(RemoveThing, st.sampled_from(["obstacle", "guide", "goal", "exit", "spawn"]), ids),
    st.builds(AddAnimals, st.just("march"), spot, spot, st.just(1.0)),
)
moves = st.one_of(
    st.tuples(st.just("do"), st.one_of(strokes, things)), st.just(("undo", None)), st.just(("redo", None))
)


@settings(max_examples=40, deadline=None)
@given(st.lists(moves, min_size=1, max_size=10), st.integers(0, 10))
def test_however_one_goes_back_and_forth_the_text_is_that_of_the_step(history, tick):
    edit, texts, ahead, seen = editor(), [], [], []
    start = edit.text()
    for now, (move, command) in enumerate(history):
        seen.append(edit.text())
        if move == "do":
            try:
                edit.check([command])
                assert edit.text() == seen[-1]
                edit.do("edit", [command], tick=now)
            except EditError:
                assert edit.text() == seen[-1]
                continue
            texts, ahead = [*texts, edit.text()], []
        elif move == "undo" and edit.undo_label:
            edit.undo(now)
            ahead.append(texts.pop())
        elif move == "redo" and edit.redo_label:
            edit.redo(now)
            texts.append(ahead.pop())
        assert edit.text() == [start, *texts][-1]
    other = edit.at(tick)
    assert other.text() == [*seen, edit.text()][min(tick, len(seen))]
    back_and_forth(other)
    back_and_forth(edit)
    assert edit.text() == start


def back_and_forth(edit):
    """All is done again that can be, then all is taken back, and the end is the beginning of what was redone."""
    while edit.redo_label:
        edit.redo()
    end = edit.text()
    steps = len(edit._done)
    while edit.undo_label:
        edit.undo()
    for _ in range(steps):
        edit.redo()
    assert edit.text() == end
    while edit.undo_label:
        edit.undo()


def test_a_stroke_of_many_pieces_is_one_step():
    edit = editor()
    start = edit.text()
    for x in range(3, 15, 3):
        done(
            edit,
            Paint("brush", "march", float(x), 5.0, x + 3.0, 5.0, 1.0),
            back=[RemoveThing("guide", x)],
            join="stroke 1",
        )
    done(edit, Paint("brush", "march", 3.0, 15.0, 6.0, 15.0, 1.0), join="stroke 2")
    edit.undo()
    assert [c.id for c in edit.undo_commands] == [12, 9, 6, 3]  # the last piece is taken back first
    edit.undo()
    assert edit.text() == start
    assert len(edit.redo_commands) == 4


def test_a_stroke_that_goes_on_after_undo_is_another_step():
    edit = editor()
    done(edit, Paint("brush", "march", 3.0, 5.0, 3.0, 5.0, 1.0), join="a")
    edit.undo()
    done(edit, Paint("brush", "march", 9.0, 5.0, 9.0, 5.0, 1.0), join="a")
    assert edit.redo_label is None
    edit.undo()
    assert edit.undo_label is None


def test_it_is_dirty_until_it_is_saved_and_clean_again_when_one_is_back_there(tmp_path):
    edit = editor(path=tmp_path / "small.tmj")
    assert not edit.dirty
    done(edit, AddAnimals("march", 3.0, 3.0, 1.0))
    assert not edit.dirty  # the file does not know of it
    done(edit, DrawGuide(20, "way", [[1.0, 1.0], [9.0, 9.0]]), join="pen")
    assert edit.dirty
    edit.save()
    assert not edit.dirty
    done(edit, DrawGuide(20, "way", [[1.0, 1.0], [9.0, 8.0]]), join="pen")
    assert edit.dirty
    edit.undo()
    assert edit.dirty
    done(edit, DrawGuide(20, "way", [[1.0, 1.0], [9.0, 8.0]]))
    edit.save()
    edit.undo()
    assert edit.dirty
    edit.redo()
    assert not edit.dirty


def test_new_ids_are_nobodys_and_do_not_change_the_file():
    edit = editor()
    start = edit.text()
    assert [edit.new_id(), edit.new_id()] == [20, 21]
    assert edit.text() == start
    done(edit, DrawGuide(30, "way", [[1.0, 1.0], [9.0, 9.0]]))
    assert edit.new_id() == 31


# what the file says --------------------------------------------------------------------------------------


def test_missing_layers_are_added_with_what_they_are_for():
    edit = editor()
    done(edit, Paint("brush", "march", 3.0, 5.0, 9.0, 5.0, 1.0), Paint("cap", 1.5, 3.0, 5.0, 9.0, 5.0, 1.0))
    done(edit, DrawGuide(20, "way", [[1.0, 1.0], [9.0, 9.0]]), PlaceGoal(21, "pen", 3.0, 3.0))
    layers = edit.document.data["layers"]
    assert [n["name"] for n in layers] == ["terrain", "brush", "speed", "spawns", "guides", "goals"]
    assert [n["id"] for n in layers[1:3]] == [9, 10]
    found = read(edit)
    assert found.brush_layers[0].assets == ["march"]
    assert found.guides[0].points.tolist() == [[1, 1], [9, 9]]
    assert found.goals[0].name == "pen"


def test_a_level_without_ground_gets_it_below_all_other_layers():
    edit = editor(objects("spawns", herd()))
    done(edit, Paint("surface", "wall", 18.0, 1.0, 19.0, 1.0, 1.5))
    assert [n["name"] for n in edit.document.data["layers"]] == ["terrain", "spawns"]
    assert not read(edit).terrain.walkable[0, 9]


def test_what_no_tileset_has_becomes_a_tile_of_the_playground_once():
    edit = editor()
    for _ in range(2):
        done(edit, Paint("brush", "graze", 3.0, 5.0, 9.0, 5.0, 1.0), Paint("cap", 0.35, 3.0, 5.0, 9.0, 5.0, 1.0))
    done(edit, Paint("surface", "mud", 18.0, 1.0, 19.0, 1.0, 1.5), Paint("brush", "march", 15.0, 15.0, 15.0, 15.0, 1.0))
    (extra,) = [t for t in edit.document.data["tilesets"] if t["name"] == "playground"]
    assert [t["type"] for t in extra["tiles"]] == ["Brush", "SpeedCap", "Terrain"]
    assert (extra["firstgid"], extra["tilecount"]) == (6, 8)
    found = read(edit)
    assert found.brush_layers[0].assets == ["graze", "march"]
    assert found.cap.values[2, 3] == 0.35
    assert "mud" in found.terrain.names
    for value in range(1, 10):
        done(edit, Paint("cap", value / 7, 3.0, 15.0, 3.0, 15.0, 1.0))
    assert [t["tilecount"] for t in edit.document.data["tilesets"]] == [5, 16]
    read(edit)


def test_a_tileset_that_came_behind_the_playground_is_not_run_into():
    edit = editor()
    done(edit, Paint("cap", 0.35, 3.0, 5.0, 9.0, 5.0, 1.0))
    data = json.loads(edit.text())
    data["tilesets"].append({**data["tilesets"][0], "firstgid": 14, "name": "later"})
    edit = Editor(Document(data, "small.tmj"), shipped())
    done(edit, Paint("cap", 0.36, 3.0, 5.0, 9.0, 5.0, 1.0))
    assert [(t["name"], t["firstgid"]) for t in edit.document.data["tilesets"]][-1] == ("playground 2", 19)
    assert read(edit).cap.values[2, 3] == 0.36


def test_paint_wins_over_all_layers_and_an_eraser_erases_all():
    strong = tiles("brush strong", [MARCH] * 100, opacity=0.9)
    weak = tiles("brush weak", [0] * 100, opacity=0.2)
    hidden = tiles("brush hidden", [MARCH] * 100, opacity=0)
    edit = editor(tiles(), strong, weak, hidden, objects("spawns", herd()))
    done(edit, Paint("brush", "graze", 5.0, 5.0, 5.0, 5.0, 1.0))
    assert names_on(build(read(edit)))[2][2] == "graze"
    done(edit, Paint("brush", "", 5.0, 5.0, 5.0, 5.0, 1.0))
    assert names_on(build(read(edit)))[2][2] == ""
    assert edit.document.layer("brush hidden")[0]["data"] == [MARCH] * 100


def test_a_cap_replaces_caps_of_all_layers_and_leaves_their_factors():
    edit = editor(tiles(), tiles("speed a", [SLOW] * 100), tiles("speed b", [SLOW] * 100), objects("spawns", herd()))
    done(edit, Paint("cap", 4.0, 5.0, 5.0, 5.0, 5.0, 1.0))
    found = read(edit)
    assert found.cap.values[2, [2, 5]].tolist() == [4.0, 1.5]
    assert found.factor.values[2, [2, 5]].tolist() == [0.25, 0.25]
    done(edit, Paint("cap", 0.0, 5.0, 5.0, 5.0, 5.0, 1.0))
    found = read(edit)
    assert np.isinf(found.cap.values[2, 2])
    assert found.factor.values[2, 2] == 0.25


def test_layers_in_groups_and_pushed_aside_are_painted_where_they_are():
    pushed = tiles("terrain", [GRASS] * 100, offsetx=16, offsety=-32)
    edit = editor({"type": "group", "name": "g", "layers": [pushed]}, objects("spawns", herd()))
    start = edit.text()
    done(edit, Paint("surface", "wall", 19.0, 19.0, 19.0, 19.0, 0.5), Paint("surface", "", 3.0, 19.0, 3.0, 19.0, 0.5))
    ground = read(edit).terrain
    assert not ground.walkable[9, 9]
    assert ground.index[9, 1] == -1
    edit.undo()
    assert edit.text() == start


@pytest.mark.parametrize("compression", ["", "zlib", "gzip"])
def test_packed_tiles_stay_packed_and_come_back_to_the_byte(compression):
    gids = np.full(100, GRASS, "<u4")
    gids[7] |= 0x80000000  # mirrored
    packed = gids.tobytes()
    window = {"zlib": 15, "gzip": 31}.get(compression)
    if window:
        stream = zlib.compressobj(9, zlib.DEFLATED, window)
        packed = stream.compress(packed) + stream.flush()
    layer = tiles(gids=base64.b64encode(packed).decode(), encoding="base64", compression=compression)
    edit = editor(layer, objects("spawns", herd()))
    start = edit.text()
    done(edit, Paint("surface", "wall", 19.0, 1.0, 19.0, 1.0, 0.5))
    node = edit.document.layer("terrain")[0]
    assert isinstance(node["data"], str)
    assert not read(edit).terrain.walkable[0, 9]
    assert edit.sheet.grid(node).gids.ravel()[7] == 0x80000000 | GRASS
    edit.undo()
    assert edit.text() == start


def test_what_a_designer_drew_keeps_its_shape_and_what_we_do_not_know():
    pond = thing(5, "Obstacle", 16, 16, 32, 48, "pond", {"ellipse": True, "studio_note": [1]}, z_max=3.0)
    edit = editor(tiles(), objects("spawns", herd()), objects("obstacles", pond))
    found = read(edit).obstacles[0]
    done(edit, AddObstacle("lake", found.polygon.tolist(), True, False, 5, 1.0))
    node = edit.document.object(5)[0]
    assert (node["ellipse"], node["width"], node["studio_note"], node["name"]) == (True, 32, [1], "lake")
    assert {p["name"]: p["value"] for p in node["properties"]} == {"blocks_view": False, "margin": 1.0, "z_max": 3.0}
    moved = found.polygon + (4.0, -2.0)
    done(edit, AddObstacle("lake", moved.tolist(), True, False, 5, 1.0))
    node = edit.document.object(5)[0]
    assert (node["ellipse"], node["x"], node["y"]) == (True, 48.0, 32.0)
    np.testing.assert_allclose(read(edit).obstacles[0].polygon, moved)
    done(edit, AddObstacle("lake", moved[:5].tolist(), True, False, 5, 1.0))
    node = edit.document.object(5)[0]
    assert "ellipse" not in node
    np.testing.assert_allclose(read(edit).obstacles[0].polygon, moved[:5])


def test_an_area_goal_stays_an_area_when_it_moves():
    fold = thing(5, "Goal", 16, 16, 32, 32, "fold")
    edit = editor(tiles(), objects("spawns", herd()), objects("goals", fold))
    done(edit, PlaceGoal(5, "fold", 10.0, 10.0, 2.0))
    goal = read(edit).goals[0]
    assert goal.xy.tolist() == [10.0, 10.0]
    assert goal.polygon.max(0).tolist() == [12.0, 12.0]
    done(edit, MoveGoal("fold", 4.0, 6.0))
    assert read(edit).goals[0].xy.tolist() == [4.0, 6.0]


def test_properties_of_every_spelling_are_changed_where_they_are():
    whole = {"name": "Guide", "propertytype": "Guide", "type": "class", "value": {"strength": 3, "radius": 4}}
    arrow = thing(5, "Guide", 0, 160, name="way", extra=polyline((0, 0), (128, -64)) | {"properties": [whole]})
    gate = thing(6, "Goal", 32, 32, name="gate", extra={"point": True})
    by_id = thing(7, "Guide", 0, 160, name="path", extra=polyline((0, 0), (64, -64)))
    by_id["properties"] = [{"name": "goal", "type": "object", "value": 6}]
    edit = editor(tiles(), objects("spawns", herd()), objects("guides", arrow, by_id), objects("goals", gate))
    way, path = read(edit).guides
    done(edit, DrawGuide(5, "way", way.points.tolist(), 5.0, 4.0, 10.0))
    done(edit, DrawGuide(7, "path", path.points.tolist(), 1.0, 6.0, 10.0, "gate"))
    way, path = read(edit).guides
    assert (way.strength, way.radius, path.radius, path.goal) == (5.0, 4.0, 6.0, "gate")
    assert edit.document.object(7)[0]["properties"][0] == {"name": "goal", "type": "object", "value": 6}
    done(edit, DrawGuide(7, "path", path.points.tolist(), 1.0, 6.0, 10.0))
    assert read(edit).guides[1].goal == ""


def test_a_spawn_with_a_density_is_counted_once_it_is_edited():
    pen = thing(1, "Spawn", 32, 32, 64, 64, "pen", brush="march", density=0.25)
    edit = editor(tiles(), objects("spawns", pen))
    before = read(edit).spawns[0]
    done(edit, MarkSpawn(1, "pen", before.polygon.tolist(), "graze", count=9, heading=-1.0))
    after = read(edit).spawns[0]
    assert (before.count, after.count, after.brush) == (16, 9, "graze")
    assert np.cos(after.heading) == pytest.approx(np.cos(-1.0))


def test_an_obstacle_without_an_id_is_in_no_file_and_by_name_all_of_it_go():
    rocks = [thing(n, "Obstacle", 16 * n, 16, 8, 8, "rock") for n in (5, 6)]
    edit = editor(tiles(), objects("spawns", herd()), objects("obstacles", *rocks))
    start = edit.text()
    done(edit, AddObstacle("rock", [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]]))
    assert edit.text() == start
    done(edit, RemoveObstacle("rock"))
    assert read(edit).obstacles == []


def test_the_corners_of_a_hull_are_in_the_file():
    edit = editor(tiles(), objects("spawns", herd()))
    start, foot = edit.text(), [[4.0, 4.0], [8.0, 4.0], [8.0, 8.0], [4.0, 8.0]]
    corners = [[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [0.0, 2.0, 0.1], [1 / 3, 0.0, 5.0]]
    done(edit, AddObstacle("tent", foot, id=edit.new_id(), z_max=5.0, shape="hull", corners=corners))
    tent = read(edit).obstacles[0]
    assert tent.shape == "hull"
    assert tent.corners == pytest.approx(np.array(corners), abs=1e-9)
    edit.undo(0)
    assert edit.text() == start


# what it refuses ---------------------------------------------------------------------------------------------


def test_what_the_file_cannot_say_is_refused_and_nothing_has_changed():
    fold = thing(5, "Goal", 16, 16, name="fold", extra={"point": True})
    cue = thing(6, "Key", 0, 0, extra={"point": True}, at=1.0, command="SendTo", goal="fold")
    edit = editor(tiles(), objects("spawns", herd()), objects("goals", fold), objects("script", cue))
    start = edit.text()
    for command, reason in (
        (Paint("surface", "lava", 5.0, 5.0, 5.0, 5.0, 1.0), "no tileset has a ground 'lava'"),
        (PaintCells("surface", [None], [[1, 1, 1, 0]]), "does not know how the ground was before"),
        (PaintBrush("march", 5.0, 5.0, 1.0), "paint with Paint"),
        (RemoveThing("guide", 77), "the level has no Guide with id 77"),
        (RemoveThing("goal", 5), "the script names goal 'fold' in object 6; change that first"),
        (PlaceGoal(5, "pen", 3.0, 3.0), "the script names goal 'fold'"),
        (DrawGuide(5, "way", [[1.0, 1.0], [2.0, 2.0]]), "object 5 of the level is Goal, not Guide"),
        (MoveGoal("nowhere", 3.0, 3.0), "the level has no goal 'nowhere'"),
    ):
        for refused in (edit.check, lambda commands: edit.do("edit", commands)):
            with pytest.raises(EditError, match=reason):
                refused([Paint("brush", "graze", 5.0, 5.0, 5.0, 5.0, 3.0), command])
            assert edit.text() == start
    assert edit.undo_label is None


def test_the_last_spawn_stays_for_a_level_without_animals_is_none(meadow):
    edit = Editor.open(meadow, shipped())
    spawns = [spawn.id for spawn in read(edit).spawns]
    for number in spawns[:-1]:
        done(edit, RemoveThing("spawn", number))
    before = edit.text()
    with pytest.raises(EditError, match="only spawn area"):
        done(edit, RemoveThing("spawn", spawns[-1]))
    assert edit.text() == before and read(edit).spawns[0].id == spawns[-1]


def test_an_infinite_map_is_refused_in_words(tmp_path):
    (tmp_path / "endless.tmj").write_text(json.dumps(small(infinite=True)))
    with pytest.raises(ProblemsError, match="an infinite map cannot be edited here; fix its size in Tiled"):
        Editor.open(tmp_path / "endless.tmj")


def test_a_tileset_that_is_gone_is_said(tmp_path):
    (tmp_path / "small.tmj").write_text(json.dumps(small(tilesets=[{"firstgid": 1, "source": "gone.tsj"}])))
    with pytest.raises(ProblemsError, match=r"gone\.tsj.*no such file"):
        Editor.open(tmp_path / "small.tmj")


# crashes and other times --------------------------------------------------------------------------------------


def history(edit, journal):
    """A day of edits, with a journal."""
    edit.journal(journal)
    for k in range(4):
        done(edit, Paint("brush", "march", 3.0, 2.0 + k, 9.0, 2.0 + k, 0.5), tick=k, join="stroke")
    done(edit, DrawGuide(20, "way", [[1.0, 1.0], [9.0, 9.0]]), back=[RemoveThing("guide", 20)], tick=10)
    done(edit, Paint("cap", 0.35, 3.0, 5.0, 9.0, 5.0, 1.0), tick=20)
    edit.undo(25, again=[PaintCells("cap", [0.35], [[2, 1, 3, 0]])])
    done(edit, PlaceGoal(21, "pen", 3.0, 3.0), tick=30)
    edit.undo(40)
    return edit


def stacks(edit):
    return [[(s.label, s.commands, s.back, s.tick, s.again) for s in steps] for steps in (edit._done, edit._undone)]


def test_a_journal_gives_the_level_and_all_steps_back(tmp_path):
    edit = history(editor(path=tmp_path / "small.tmj"), tmp_path / "journal")
    found = Editor.recover(tmp_path / "journal", shipped())
    assert found.text() == edit.text()
    assert stacks(found) == stacks(edit)
    assert (found.dirty, found.path) == (edit.dirty, edit.path)
    found.redo(50)
    edit.redo(50)
    assert found.text() == edit.text()
    found.journal(tmp_path / "journal")
    done(found, DrawGuide(22, "more", [[1.0, 1.0], [9.0, 2.0]]))
    assert Editor.recover(tmp_path / "journal", shipped()).text() == found.text()


def test_a_journal_cut_off_anywhere_opens_up_to_its_last_whole_line(tmp_path):
    edit = editor(path=tmp_path / "small.tmj")
    start = edit.text()
    history(edit, tmp_path / "journal")
    whole = (tmp_path / "journal").read_bytes()
    lines = whole.split(b"\n")
    for cut in range(len(lines[0]) + 1, len(whole), 97):
        (tmp_path / "cut").write_bytes(whole[:cut])
        found = Editor.recover(tmp_path / "cut", shipped())
        assert len(found._events) == whole[:cut].count(b"\n") - 1
        if not found._events:
            assert found.text() == start
    (tmp_path / "cut").write_bytes(lines[0][:50])
    with pytest.raises(JournalError, match="this is not the journal of an editor"):
        Editor.recover(tmp_path / "cut")
    with pytest.raises(JournalError, match="cannot be read: No such file"):
        Editor.recover(tmp_path / "none")


def test_a_journal_that_can_no_longer_be_written_stops_nobody(tmp_path):
    edit = editor(path=tmp_path / "small.tmj")
    edit.journal(tmp_path / "journal")
    edit._journal.close()
    done(edit, DrawGuide(20, "way", [[1.0, 1.0], [9.0, 9.0]]))
    assert "journal: cannot be written" in edit.journal_problem
    assert edit.undo_label == "edit"


def test_the_document_of_another_time_with_what_came_after_to_be_done_again(tmp_path):
    edit = history(editor(path=tmp_path / "small.tmj"), tmp_path / "journal")
    end, steps = edit.text(), stacks(edit)
    early = edit.at(10)
    assert read(early).guides == []
    assert len(early._done) == 1
    assert [s.tick for s in early._undone] == [10]
    assert read(edit.at(10, after=True)).guides[0].name == "way"
    assert edit.at(0).undo_label is None
    early.redo(12)
    assert early.text() == end
    done(early, DrawGuide(23, "other", [[1.0, 1.0], [9.0, 3.0]]), tick=13)
    assert (edit.text(), stacks(edit)) == (end, steps)  # the other branch is as it was
    early.journal(tmp_path / "branch")
    assert Editor.recover(tmp_path / "branch", shipped()).text() == early.text()
    assert edit.at(99).text() == end


def test_a_branch_of_a_saved_level_is_dirty_where_it_differs(tmp_path):
    edit = editor(path=tmp_path / "small.tmj")
    done(edit, DrawGuide(20, "way", [[1.0, 1.0], [9.0, 9.0]]), tick=5)
    edit.save()
    done(edit, PlaceGoal(21, "pen", 3.0, 3.0), tick=9)
    assert not edit.at(7).dirty
    branch = edit.at(3)
    assert branch.dirty
    done(branch, PlaceGoal(21, "pen", 3.0, 3.0), tick=4)
    assert branch.dirty


# saving -----------------------------------------------------------------------------------------------------------


def test_saved_elsewhere_it_takes_along_what_it_needs(meadow, tmp_path_factory):
    living = Living(meadow)
    living.do(Paint("cap", 0.37, 60.0, 20.0, 74.0, 22.0, 6.0))
    away = tmp_path_factory.mktemp("away") / "mine.tmj"
    living.editor.save(away)
    assert sorted(os.listdir(away.parent)) == ["meadow-playground.png", "mine.tmj", "tilesets"]
    assert sorted(os.listdir(away.parent / "tilesets")) == [
        "brushes.png", "brushes.tsj", "speed.png", "speed.tsj", "terrain.png", "terrain.tsj",
    ]  # fmt: skip
    same_place(living, build(read_level(away), library=living.library))
    assert living.editor.path == away
    assert not living.editor.dirty
    living.undo()
    assert living.editor.dirty
    living.redo()
    living.editor.save()
    inside = meadow.parent.parent / "other" / "deep"
    inside.mkdir(parents=True)
    Living(meadow).editor.save(inside / "copy.tmj")
    assert os.listdir(inside) == ["copy.tmj"]  # in the project it finds its tilesets where they are
    assert read_level(inside / "copy.tmj").agents == 140


def test_the_picture_of_the_playground_shows_its_tiles(meadow):
    import cv2

    living = Living(meadow)
    living.do(Paint("cap", 0.37, 60.0, 20.0, 74.0, 22.0, 6.0), Paint("cap", 0.39, 60.0, 40.0, 74.0, 42.0, 6.0))
    living.editor.save()
    picture = cv2.imread(str(meadow.parent / "meadow-playground.png"), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (32, 256, 4)
    assert [bool(picture[:, 32 * k : 32 * k + 32, 3].any()) for k in range(3)] == [True, True, False]


def test_a_save_that_fails_leaves_file_and_editor_as_they_were(meadow, monkeypatch):
    living = Living(meadow)
    before = meadow.read_bytes()
    living.do(Paint("cap", 0.37, 60.0, 20.0, 74.0, 22.0, 6.0))
    monkeypatch.setattr(os, "fsync", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(ProblemsError, match="cannot be written: No space left on device"):
        living.editor.save()
    assert meadow.read_bytes() == before
    assert living.editor.dirty
    assert living.editor.undo_label == "edit"


# together with the world ----------------------------------------------------------------------------------------------


def test_a_region_filled_in_the_world_is_filled_in_the_file(meadow):
    living = Living(meadow)
    land = living.simulation.world.resource(Landscape)
    before = land.kind_at.copy()
    living.do(fill(living.simulation.world, "surface", 34.0, 54.0, "mud"))
    turned = land.kind_at[land.kind_at != before]
    assert len(turned) > 1 and {land.kinds[k].name for k in turned} == {"mud"}
    living.editor.save()
    same_place(living, build(read_level(meadow), library=living.library))


def test_a_brush_tuned_and_kept_as_a_new_asset_is_painted_and_found_again(meadow):
    living = Living(meadow)
    mine = shipped().get("march").model_copy(update={"name": "mine"})
    (meadow.parent / "brushes").mkdir()
    path = save_brush(mine, meadow.parent / "brushes")
    living.do(UseBrush("mine", path.read_text()), Paint("brush", "mine", 30.0, 40.0, 40.0, 40.0, 4.0))
    living.do(SetParameter("mine", "cohesion_weight", 0.1))
    living.editor.save()
    again = build(read_level(meadow), library=brush_library(meadow))
    assert names_on(living.simulation) == names_on(again)
    assert load_brush(path) == BrushLibrary([meadow.parent / "brushes"]).get("mine")


def test_what_the_world_refuses_is_not_in_the_file(meadow):
    living = Living(meadow)
    start = living.editor.text()
    with pytest.raises(CommandError):
        living.do(Paint("brush", "graze", -50.0, 5.0, -40.0, 5.0, 3.0))
    assert living.editor.text() == start
    assert len(living.simulation.agents[Position.xyz]) == 140


def test_a_stroke_costs_what_it_paints_and_not_what_the_map_is_large():
    def memory(size):
        plain = properties(schema="flockbrush-level/1", metres_per_tile=2.0)
        ground = tiles(gids=[GRASS] * size**2) | {"width": size, "height": size}
        document = small(ground, objects("spawns", herd()), width=size, height=size, properties=plain)
        edit = Editor(Document(document, "large.tmj"), shipped())
        strokes = [Paint(*what, 4.0, 4.0, 9.0, 5.0, 3.0) for what in (("brush", "march"), ("surface", "wall"))]
        done(edit, *strokes)
        tracemalloc.start()
        done(edit, Paint("brush", "graze", 4.0, 4.0, 9.0, 5.0, 3.0), Paint("surface", "grass", 4.0, 4.0, 9.0, 5.0, 3.0))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    assert memory(500) < 1.5 * memory(10) < 100_000  # bytes; one bit for each cell of the large map would be 250,000


def test_a_document_is_laid_out_as_before(tmp_path):
    edit = editor(
        tiles(),
        objects("spawns", herd()),
        objects("exits", thing(5, "Exit", 0, 0, extra=polygon((0, 0), (9, 0), (9, 9)))),
    )
    assert edit.text() == dump(small(*edit.document.data["layers"]))


def test_strokes_by_hand_lie_in_no_layer_that_says_whom_it_binds():
    bounded = tiles("brush high", [MARCH] * 100, opacity=0.9, properties=properties(z_min=5.0))
    stroke = Paint("brush", "graze", 9.0, 9.0, 9.0, 9.0, 3.0)
    edit = done(editor(tiles(), bounded, objects("spawns", herd())), stroke)
    high, painted = read(edit).brush_layers
    assert high.assets == ["march"] and (high.index == 0).all()
    assert painted.plain and painted.assets == ["graze"] and (painted.index >= 0).any()
    before = edit.text()
    erased = done(edit, Paint("brush", "", 9.0, 9.0, 9.0, 9.0, 3.0))
    assert (read(erased).brush_layers[0].index == 0).all()
    edit.undo()
    assert edit.text() == before
