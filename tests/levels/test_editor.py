"""A level edited while it lives: its document follows, undoes to the byte, survives a crash, and Tiled agrees."""

import json
import os
import shutil
import subprocess
import tracemalloc

import numpy as np
import pytest
from edited_level import done, editor, names_on, read, small
from flockbrush.behaviours.brush import BrushLibrary, load_brush, save_brush, shipped
from flockbrush.engine.commands import Commands
from flockbrush.levels.build import build
from flockbrush.levels.editor import Editor
from flockbrush.levels.level_writer import Document, dump
from flockbrush.levels.libraries import brush_library
from flockbrush.levels.reader import read_level
from flockbrush.systems.commands import AddAnimals, AddObstacle, SetParameter
from flockbrush.systems.edits import DrawGuide, MarkSpawn, Paint, PlaceExit, PlaceGoal, RemoveThing, UseBrush, fill
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.life import Nursery
from small_level import GRASS, MARCH, herd, objects, properties, tiles

TILED = shutil.which("tiled")
FRONT = shipped().get("front").source.decode()


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


# saving -----------------------------------------------------------------------------------------------------------


def test_saved_elsewhere_it_takes_along_what_it_needs(meadow, tmp_path_factory):
    living = Living(meadow)
    living.do(Paint("cap", 0.37, 60.0, 20.0, 74.0, 22.0, 6.0))
    away = tmp_path_factory.mktemp("away") / "mine.tmj"
    living.editor.save(away)
    assert sorted(os.listdir(away.parent)) == ["mine-playground.png", "mine.tmj", "tilesets"]
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


def test_saved_beside_files_of_others_with_the_same_names_it_leaves_them_and_does_not_use_them(
    meadow, tmp_path_factory
):
    away = tmp_path_factory.mktemp("away") / "mine.tmj"
    (away.parent / "tilesets").mkdir(parents=True)
    for name in ("terrain.tsj", "terrain.png"):
        (away.parent / "tilesets" / name).write_bytes(b"of another project")
    living = Living(meadow)
    living.editor.save(away)
    assert {(away.parent / "tilesets" / name).read_bytes() for name in ("terrain.tsj", "terrain.png")} == {
        b"of another project"
    }
    assert sorted(os.listdir(away.parent / "tilesets" / "mine")) == ["terrain.png", "terrain.tsj"]
    same_place(living, build(read_level(away), library=living.library))


def test_the_picture_of_the_playground_shows_its_tiles(meadow):
    import cv2

    living = Living(meadow)
    living.do(Paint("cap", 0.37, 60.0, 20.0, 74.0, 22.0, 6.0), Paint("cap", 0.39, 60.0, 40.0, 74.0, 42.0, 6.0))
    living.editor.save()
    picture = cv2.imread(str(meadow.parent / "meadow-playground.png"), cv2.IMREAD_UNCHANGED)
    assert picture.shape == (32, 256, 4)
    assert [bool(picture[:, 32 * k : 32 * k + 32, 3].any()) for k in range(3)] == [True, True, False]


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
