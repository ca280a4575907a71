"""What edits write into the text of a level, what they refuse, and that undo gives the same text to the byte."""

import base64
import json
import zlib

import numpy as np
import pytest
from edited_level import done, editor, names_on, read, small
from flockbrush.behaviours.brush import shipped
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.build import build
from flockbrush.levels.editor import EditError, Editor
from flockbrush.levels.level_writer import Document
from flockbrush.systems.commands import AddAnimals, AddObstacle, MoveGoal, PaintBrush, PaintCells, RemoveObstacle
from flockbrush.systems.edits import DrawGuide, MarkSpawn, Paint, PlaceExit, PlaceGoal, RemoveThing
from flockbrush.systems.leaders import Steer  # noqa: F401
from flockbrush.systems.mark_commands import DrawZone
from hypothesis import given, settings
from hypothesis import strategies as st
from small_level import GRASS, MARCH, SLOW, herd, objects, polyline, properties, thing, tiles

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
    steps = len(edit.done)
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


@pytest.mark.parametrize("boundary", ["wall", "wrap"])
def test_a_stroke_over_the_border_of_a_periodic_map_is_saved_on_both_sides(boundary):
    edit = editor(properties=properties(schema="flockbrush-level/1", metres_per_tile=2.0, boundary=boundary))
    stroke = Paint("brush", "march", 19.0, 5.0, 19.5, 5.0, 3.0)
    world = build(read(edit)).world
    done(edit, stroke)
    painted = read(edit).brush_layers[0].index >= 0
    assert painted[2].tolist() == [boundary == "wrap", *[False] * 7, True, True]
    assert sorted(zip(*np.nonzero(painted), strict=True)) == sorted(zip(*stroke.where(world)[:2], strict=True))


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


def test_new_tiles_begin_behind_the_gaps_of_a_collection_of_pictures():
    edit, gaps = editor(), {"firstgid": 6, "name": "things", "tilecount": 1, "columns": 0, "tiles": [{"id": 4}]}
    edit.document.data["tilesets"].append(gaps)
    edit = Editor(Document(json.loads(edit.text()), "small.tmj"), shipped())
    done(edit, Paint("cap", 0.35, 3.0, 5.0, 9.0, 5.0, 1.0))
    assert edit.document.data["tilesets"][-1]["firstgid"] == 11


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


@pytest.mark.parametrize(("alignment", "south"), [("center", 9.0), ("topleft", 8.0), ("unspecified", 10.0)])
def test_a_tile_that_stands_as_an_object_moves_from_where_its_tileset_puts_it(alignment, south):
    pond = thing(5, "Obstacle", 32, 80, 32, 16, "pond", {"gid": 6})
    edit = editor(tiles(), objects("spawns", herd()), objects("obstacles", pond))
    own = {"firstgid": 6, "name": "own", "tilecount": 1, "columns": 1, "objectalignment": alignment}
    edit.document.data["tilesets"].append(own)
    edit = Editor(Document(json.loads(edit.text()), "small.tmj"), shipped())
    found = read(edit).obstacles[0].polygon
    assert found.min(0)[1] == south
    done(edit, AddObstacle("pond", (found + (1.0, 0.0)).tolist(), True, True, 5))
    assert edit.document.object(5)[0]["gid"] == 6
    np.testing.assert_allclose(read(edit).obstacles[0].polygon, found + (1.0, 0.0))


def test_an_edit_is_in_the_metres_of_a_map_whose_properties_are_one_class():
    values = {"schema": "flockbrush-level/1", "metres_per_tile": 0.5}
    edit = editor(properties=[{"name": "level", "type": "class", "propertytype": "FlockbrushLevel", "value": values}])
    done(edit, PlaceGoal(5, "fold", 3.0, 1.5))
    assert read(edit).goals[0].xy.tolist() == [3.0, 1.5]


def test_objects_on_layers_of_notes_are_not_edited():
    old = objects("notes old", thing(5, "Goal", 16, 16, name="fold", extra={"point": True}))
    new = objects("goals", thing(6, "Goal", 32, 32, name="fold", extra={"point": True}))
    edit = editor(tiles(), objects("spawns", herd()), old, new)
    done(edit, MoveGoal("fold", 4.0, 6.0))
    assert read(edit).goals[0].xy.tolist() == [4.0, 6.0] and edit.document.object(5)[0]["x"] == 16


def test_an_area_goal_stays_an_area_when_it_moves():
    fold = thing(5, "Goal", 16, 16, 32, 32, "fold")
    edit = editor(tiles(), objects("spawns", herd()), objects("goals", fold))
    done(edit, PlaceGoal(5, "fold", 10.0, 10.0, 2.0))
    goal = read(edit).goals[0]
    assert goal.xy.tolist() == [10.0, 10.0]
    assert goal.polygon.max(0).tolist() == [12.0, 12.0]
    done(edit, MoveGoal("fold", 4.0, 6.0))
    assert read(edit).goals[0].xy.tolist() == [4.0, 6.0]
    done(edit, PlaceGoal(5, "fold", None, None, 3.0))
    assert read(edit).goals[0].polygon is not None
    done(edit, PlaceGoal(5, "fold", None, None, 3.0, points=None))
    assert (read(edit).goals[0].polygon, read(edit).goals[0].xy.tolist()) == (None, [4.0, 6.0])


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


def test_a_density_among_the_members_of_a_class_is_counted_too():
    pen = thing(1, "Spawn", 32, 32, 64, 64, "pen")
    members = {"brush": "march", "density": 0.25}
    pen["properties"] = [{"name": "Spawn", "type": "class", "propertytype": "Spawn", "value": members}]
    edit = editor(tiles(), objects("spawns", pen))
    found = read(edit).spawns[0]
    done(edit, MarkSpawn(1, "pen", found.polygon.tolist(), "march", count=found.count + 1))
    assert read(edit).spawns[0].count == found.count + 1


def test_an_obstacle_without_an_id_is_in_no_file_and_by_name_all_of_it_go():
    rocks = [thing(n, "Obstacle", 16 * n, 16, 8, 8, "rock") for n in (5, 6)]
    edit = editor(tiles(), objects("spawns", herd()), objects("obstacles", *rocks))
    start, rock = edit.text(), AddObstacle("rock", [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]])
    for change in (done, lambda edit, command: edit.recorded([command], 3)):
        with pytest.raises(EditError, match="obstacle 'rock' has no id, so no level file can hold it"):
            change(edit, rock)
        assert edit.text() == start
    done(edit, RemoveObstacle("rock"))
    assert read(edit).obstacles == []


def test_what_a_recorded_run_took_away_and_brought_back_stands_where_it_stood_and_loses_nothing():
    point, note = {"point": True, "studio_note": [1]}, {"studio_note": [2]}
    goals = [thing(n, "Goal", 16 * n, 16, name=name, extra=point, radius=2.0) for n, name in ((5, "gate"), (6, "well"))]
    zones = [thing(n, "Zone", 16, 16, 32, 32, f"zone {n}", note, brush="march", strength=0.5) for n in (7, 8, 9)]
    edit = editor(tiles(), objects("spawns", herd()), objects("goals", *goals), objects("zones", *zones))
    before, start = read(edit), edit.document.data["layers"][2:]
    start = [json.loads(json.dumps(layer)) for layer in start]
    first, middle = before.goals[0], before.zones[1]
    back = [
        PlaceGoal(5, "gate", *first.xy.tolist(), 2.0, points=None, at=0),
        DrawZone(8, "zone 8", middle.polygon.tolist(), "march", strength=0.5, at=1),
    ]
    for tick, command in enumerate([RemoveThing("goal", 5), RemoveThing("zone", 8), *back]):
        edit.recorded([command], tick)
    assert edit.document.data["layers"][2:] == start
    assert edit.at(9).document.data["layers"][2:] == start
    edit.recorded([DrawZone(40, "new", [[1.0, 1.0], [3.0, 1.0], [3.0, 3.0]], "graze", at=1)], 9)
    assert [zone.id for zone in read(edit).zones] == [7, 40, 8, 9]


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
        (PaintCells("surface", [None], [[1, 1, 1, 0]]), "has no earlier state of the ground"),
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


def test_a_tileset_that_is_gone_is_said(tmp_path):
    (tmp_path / "small.tmj").write_text(json.dumps(small(tilesets=[{"firstgid": 1, "source": "gone.tsj"}])))
    with pytest.raises(ProblemsError, match=r"gone\.tsj.*no such file"):
        Editor.open(tmp_path / "small.tmj")
