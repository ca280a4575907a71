"""A level that is saved elsewhere, or under another name: the files it names are found, and no others are replaced."""

import json
from dataclasses import replace

import numpy as np
import pytest
from edited_level import done, small
from flockbrush.behaviours.brush import shipped
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.adopt import adopt
from flockbrush.levels.build import build
from flockbrush.levels.document_nodes import file_references
from flockbrush.levels.editor import Editor
from flockbrush.levels.level_writer import write_level
from flockbrush.levels.libraries import brush_library
from flockbrush.levels.reader import read_level, read_level_text
from flockbrush.systems.edits import MarkSpawn, Paint, RemoveThing
from flockbrush.systems.mark_commands import PlaceKey
from small_level import herd, objects, png, properties, thing, tiles

PICTURE = png(np.full((16, 16, 3), 200, np.uint8))
ART = {"type": "imagelayer", "name": "sky", "image": "../img/sky.png", "opacity": 1}
TILES = {"name": "stones", "tilewidth": 16, "tileheight": 16, "tilecount": 2, "columns": 0, "margin": 0, "spacing": 0}
SHEET = {"name": "walls", "tilewidth": 16, "tileheight": 16, "tilecount": 1, "columns": 1, "image": "../img/walls.png"}
MARCH = shipped().get("march").source


def written(path, *things, **more):
    """A level with artwork in a game's folder, with files of the game beside it."""
    layers = [tiles(), tiles("houses", [6] * 50 + [8] * 50), ART, objects("spawns", herd(count=2), *things)]
    document = small(*layers, **more)
    pictures = [{"id": 0, "image": "../img/stone.png"}, {"id": 1, "image": "../img/rock.png"}]
    document["tilesets"] += [{"firstgid": 6, **TILES, "tiles": pictures}, {"firstgid": 8, "source": "../ts/walls.tsj"}]
    game = path.parent.parent
    for folder in ("maps", "img", "ts"):
        (game / folder).mkdir(parents=True, exist_ok=True)
    for name in ("sky", "stone", "rock", "walls"):
        (game / "img" / f"{name}.png").write_bytes(PICTURE)
    (game / "ts" / "walls.tsj").write_text(json.dumps(SHEET))
    (game / "flockbrush.tiled-project").write_text("{}")
    return write_level(document, path)


def names(path):
    """Every file that a level names."""
    return sorted(node[key] for node, key in file_references(json.loads(path.read_bytes())))


@pytest.fixture
def level(tmp_path):
    return written(tmp_path / "game" / "maps" / "isle.tmj")


def test_artwork_is_copied_below_the_new_folder(level, tmp_path):
    to = tmp_path / "away" / "deep" / "new.tmj"
    to.parent.mkdir(parents=True)
    Editor.open(level).save(to)
    assert names(to) == ["rock.png", "sky.png", "stone.png", "tilesets/ts/walls.tsj"]
    made = {file.relative_to(tmp_path).as_posix() for file in tmp_path.rglob("*") if file.is_file()}
    assert {name for name in made if not name.startswith("game/")} == {
        f"away/deep/{name}" for name in ("new.tmj", *names(to), "tilesets/img/walls.png")
    }
    found = read_level(to)
    assert found.warnings == [] and found.art.picture.all()


def test_a_picture_of_others_is_not_replaced(level, tmp_path):
    to = tmp_path / "away" / "new.tmj"
    to.parent.mkdir()
    (to.parent / "sky.png").write_bytes(b"mine")
    Editor.open(level).save(to)
    assert names(to)[0] == "new-sky.png" and (to.parent / "sky.png").read_bytes() == b"mine"


def test_what_is_outside_of_the_project_is_not_copied(level, tmp_path):
    (tmp_path / "secret.png").write_bytes(PICTURE)
    text = level.read_text().replace("..\\/img\\/sky.png", "..\\/..\\/secret.png")
    level.write_text(text)
    to = tmp_path / "away" / "new.tmj"
    to.parent.mkdir()
    Editor.open(level).save(to)
    assert "../secret.png" in names(to) and not (to.parent / "secret.png").exists()


def test_what_only_a_game_needs_is_named_from_the_new_folder(tmp_path):
    scream = {"name": "scream", "type": "file", "value": "../sounds/scream.ogg"}
    goblin = {"id": 15, "template": "goblin.tx", "x": 1, "y": 1}
    layers = [tiles(), objects("spawns", herd()), {**ART, "properties": [scream]}, objects("notes", goblin)]
    path = tmp_path / "game" / "maps" / "isle.tmj"
    written(path)
    write_level(small(*layers), path)
    to = tmp_path / "new.tmj"
    Editor.open(path).save(to)
    assert names(to) == ["game/maps/goblin.tx", "game/sounds/scream.ogg", "sky.png"]


def test_adoption_in_another_folder_names_all_files_from_there(tmp_path):
    path = tmp_path / "game" / "maps" / "isle.tmj"
    written(path)
    layers = [tiles("houses", [0] * 100), objects("things", {"id": 1, "template": "goblin.tx", "x": 1, "y": 1})]
    music = [{"name": "music", "type": "file", "value": "theme.ogg"}]
    write_level({**small(*layers), "properties": music, "tilesets": []}, path)
    (tmp_path / "game" / "levels").mkdir()
    document = adopt(path, tmp_path / "game" / "levels" / "isle.tmj").document
    assert sorted(node[key] for node, key in file_references(document)) == ["../maps/goblin.tx", "../maps/theme.ogg"]


def with_own_brush(path):
    """A level whose herd has a brush that is named as a file, and an editor and a command that moves the herd."""
    written(path)
    own = path.parent.parent / "own" / "own.brush.toml"
    own.parent.mkdir()
    own.write_bytes(MARCH)
    path.write_text(path.read_text().replace('"value":"march"', '"value":"..\\/own\\/own.brush.toml"'))
    spawn = read_level(path).spawns[0]
    points = (spawn.polygon - 1).tolist()
    return Editor.open(path), MarkSpawn(id=1, name="herd A", points=points, brush="own", species="sheep", count=2)


def test_a_brush_that_is_a_file_stays_one_when_its_herd_is_moved(tmp_path):
    editor, move = with_own_brush(tmp_path / "game" / "maps" / "isle.tmj")
    for brush in ("own", "graze", "own"):
        done(editor, replace(move, brush=brush))
        assert read_level_text(editor.text().encode(), editor.path).spawns[0].brush == brush
    assert '"value":"..\\/own\\/own.brush.toml"' in editor.text()


def test_after_undo_a_brush_is_named_from_the_new_folder(tmp_path):
    editor, move = with_own_brush(tmp_path / "game" / "maps" / "isle.tmj")
    done(editor, move)
    to = tmp_path / "away" / "new.tmj"
    to.parent.mkdir()
    editor.save(to)
    editor.undo()
    assert (to.parent / "own" / "own.brush.toml").read_bytes() == MARCH
    again = read_level_text(editor.text().encode(), to)
    assert again.spawns[0].brush == "own" and "own/own.brush.toml" in again.files


def test_what_undo_brings_back_is_copied_too(tmp_path):
    own = tmp_path / "a" / "own" / "own.brush.toml"
    own.parent.mkdir(parents=True)
    own.write_bytes(MARCH)
    zone = thing(7, "Zone", 16, 16, 64, 64, brush="own/own.brush.toml")
    path = write_level(small(tiles(), objects("spawns", herd()), objects("zones", zone)), tmp_path / "a" / "a.tmj")
    editor = done(Editor.open(path), RemoveThing("zone", 7))
    to = tmp_path / "b" / "b.tmj"
    to.parent.mkdir()
    editor.save(to)
    editor.undo()
    editor.save()
    assert read_level(to).zones[0].brush == "own"


def test_a_key_may_name_a_brush_as_a_file_and_keeps_it(tmp_path):
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "mine.brush.toml").write_bytes(MARCH)
    (tmp_path / "own" / "bad.brush.toml").write_text("schema = 1\n")

    def with_key(brush):
        key = thing(2, "Key", 16, 16, extra={"point": True}, at=1.0, command="SwitchBrush", brush=brush)
        document = small(tiles(), objects("spawns", herd(count=2)), objects("script", key))
        return write_level(document, tmp_path / "small.tmj", backup=False)

    path = with_key("own/mine.brush.toml")
    found = read_level(path)
    assert found.script[0].args["brush"] == "mine" and "own/mine.brush.toml" in found.files
    build(found, library=brush_library(path, found.files)).close()
    edit = Editor.open(path)
    done(edit, PlaceKey(2, "", 2.0, "SwitchBrush", {"brush": "mine"}, 2.0, 18.0))
    (tmp_path / "away").mkdir()
    assert read_level(edit.save(tmp_path / "away" / "small.tmj")).script[0].args["brush"] == "mine"
    assert '"value":"own\\/mine.brush.toml"' in edit.text()
    for wrong, told in (("own/none.brush.toml", "brush: "), ("own/bad.brush.toml", "bad.brush.toml:1: schema")):
        with pytest.raises(ProblemsError) as caught:
            read_level(with_key(wrong))
        assert [str(tmp_path) in str(problem) for problem in caught.value.problems if told in str(problem)]
        assert not any("there is no brush" in str(problem) for problem in caught.value.problems)


# the picture of what was painted in the playground -------------------------------------------------------------------


def cap(value):
    return Paint("cap", value, 5.0, 5.0, 5.0, 5.0, 2.0)


def playground(path):
    """The picture of a level's own tiles: (name, bytes)."""
    entry = next(one for one in json.loads(path.read_bytes())["tilesets"] if one.get("name") == "playground")
    return entry["image"], (path.parent / entry["image"]).read_bytes()


def test_each_level_has_a_picture_of_its_own(tmp_path):
    a = write_level(small(), tmp_path / "a.tmj")
    editor = Editor.open(a)
    done(editor, cap(3.3)).save()
    before = playground(a)
    b = tmp_path / "b.tmj"
    done(editor, cap(7.7)).save(b)
    assert playground(a) == before and before[0] == "a-playground.png"
    assert playground(b)[0] == "b-playground.png" and playground(b)[1] != before[1]
    editor.undo()
    editor.save()
    assert playground(b) == ("b-playground.png", before[1]) and playground(a) == before
    other = Editor.open(a)
    done(other, cap(0.9)).save()
    assert playground(a)[0] == "a-playground.png" and playground(b)[1] == before[1]


def test_a_picture_of_others_with_its_name_stays(tmp_path):
    a = write_level(small(), tmp_path / "a.tmj")
    (tmp_path / "a-playground.png").write_bytes(b"drawn by hand")
    editor = Editor.open(a)
    for value in (3.3, 7.7):
        done(editor, cap(value)).save()
        assert playground(a)[0] == "a-playground2.png"
    assert (tmp_path / "a-playground.png").read_bytes() == b"drawn by hand"


@pytest.mark.parametrize("other", [{"properties": properties(fun=True)}, {"animation": [{"tileid": 0}]}])
def test_what_was_painted_can_be_erased_where_a_tile_was_added_to_the_tileset_of_the_playground(tmp_path, other):
    a = write_level(small(), tmp_path / "a.tmj")
    done(Editor.open(a), cap(3.3)).save()
    assert read_level(a).cap.values.min() == 3.3
    document = json.loads(a.read_bytes())
    document["tilesets"][1]["tiles"].append({"id": 1, **other})
    a.write_text(json.dumps(document))
    done(Editor.open(a), cap(0)).save()
    assert read_level(a).cap is None


def test_artwork_that_is_called_as_the_picture_is_copied_and_stays(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    (tmp_path / "a" / "b-playground.png").write_bytes(PICTURE)
    art = {**ART, "image": "b-playground.png"}
    a = write_level(small(tiles(), objects("spawns", herd()), art), tmp_path / "a" / "a.tmj")
    b = tmp_path / "b" / "b.tmj"
    editor = done(Editor.open(a), cap(3.3))
    for _ in range(2):
        editor.save(b)
        assert names(b) == ["b-playground.png", "b-playground2.png"] and playground(b)[0] == "b-playground2.png"
        assert (tmp_path / "b" / "b-playground.png").read_bytes() == PICTURE


def test_a_tileset_of_a_game_is_not_taken_for_ours(tmp_path):
    own = {"name": "playground", "image": "slide.png", "columns": 1, "tilecount": 1, "tilewidth": 16, "tileheight": 16}
    document = small()
    document["tilesets"].append({"firstgid": 6, **own, "tiles": [{"id": 0, "properties": properties(fun=True)}]})
    (tmp_path / "slide.png").write_bytes(PICTURE)
    a = write_level(document, tmp_path / "a.tmj")
    done(Editor.open(a), cap(3.3)).save()
    assert (tmp_path / "slide.png").read_bytes() == PICTURE
    assert [one.get("image") for one in json.loads(a.read_bytes())["tilesets"]][1:] == [
        "slide.png",
        "a-playground2.png",
    ]
