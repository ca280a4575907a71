"""A level that is edited and saved differs from what it was by the edit alone."""

import difflib
import json
import os

import pytest
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.level_writer import Document, dump, write_level
from flockbrush.levels.reader import read_level
from small_level import Gust, Shelf, herd, level, objects, polyline, thing, tiles


@pytest.fixture
def path(tmp_path):
    arrow = thing(2, "Guide", 16, 144, name="way", extra=polyline((0, 0), (128, -64)))
    document = level(tiles(), objects("spawns", herd()), objects("guides", arrow), nextobjectid=3, nextlayerid=4)
    document["layers"][1]["objects"][0]["studio_note"] = {"kept": [1, {"deep": None}]}
    path = tmp_path / "small.tmj"
    path.write_text(dump(document))
    return path


def read(path):
    return read_level(path, library=Shelf(), commands={"Gust": Gust})


def changes(before, after):
    lines = difflib.unified_diff(before.splitlines(), after.splitlines(), n=0, lineterm="")
    return [line for line in list(lines)[2:] if not line.startswith("@@")]


def test_saving_what_was_loaded_changes_nothing(path):
    before = path.read_bytes()
    Document.load(path).save()
    assert path.read_bytes() == before


def test_the_order_of_keys_is_always_the_same():
    one = {"b": 1, "a": {"d": 1.0, "c": [0.5, True, None]}}
    other = {"a": {"c": [0.5, True, None], "d": 1}, "b": 1}
    assert dump(one) == dump(other)
    assert dump(one).splitlines() == [
        '{ "a":',
        "    {",
        '     "c":[0.5, true, null],',
        '     "d":1',
        "    },",
        ' "b":1',
        "}",
    ]


def test_a_new_count_is_one_line_of_difference(path):
    before = path.read_text()
    document = Document.load(path)
    goats = document.object(1)[0]
    next(p for p in goats["properties"] if p["name"] == "count")["value"] = 30
    document.save()
    assert [line.strip('+- \n,"') for line in changes(before, path.read_text())] == ['value":12', 'value":30']
    assert read(path).spawns[0].count == 30


def test_what_we_do_not_know_survives(path):
    document = Document.load(path)
    document.move_object(1, (2, 18))
    document.save()
    saved = json.loads(path.read_text())["layers"][1]["objects"][0]
    assert saved["studio_note"] == {"kept": [1, {"deep": None}]}
    assert [p["name"] for p in saved["properties"]] == ["brush", "count"]


def test_an_object_moves_in_metres(path):
    document = Document.load(path)
    document.move_object(1, (2, 18))
    document.save()
    assert read(path).spawns[0].polygon.max(axis=0) == pytest.approx([18, 18])


def test_a_drawn_object_is_read_back_as_drawn(path):
    document = Document.load(path)
    rock = document.add_object("guides", "Obstacle", [(10, 2), (12, 2), (12, 4)], "rock", margin=0.5)
    wave = document.add_object("guides", "Guide", [(1, 1), (5, 1.5), (9, 1)], closed=False, loop=True)
    goal = document.add_object("guides", "Goal", [(18, 1)], "end", radius=1.0)
    document.save()
    found = read(path)
    assert (rock, wave, goal) == (3, 4, 5)
    assert found.obstacles[0].polygon.tolist() == [[10, 2], [12, 2], [12, 4]]
    assert found.obstacles[0].margin == 0.5
    assert found.guides[1].points.tolist() == [[1, 1], [5, 1.5], [9, 1]]
    assert found.goals[0].xy.tolist() == [18, 1]


def test_an_object_that_is_not_there_is_named(path):
    with pytest.raises(KeyError, match="no object 77"):
        Document.load(path).move_object(77, (1, 1))


def test_ground_is_painted_from_the_south_west(path):
    document = Document.load(path)
    document.paint("terrain", [(0, 0), (9, 3), (99, 0)], 2)
    document.save()
    ground = read(path).terrain
    assert not ground.walkable[0, 0]
    assert not ground.walkable[9, 3]
    assert ground.walkable.sum() == 98


def test_unknown_names_ask_did_you_mean(path):
    document = Document.load(path)
    with pytest.raises(KeyError, match="did you mean 'terrain'"):
        document.paint("terain", [(0, 0)], 1)
    with pytest.raises(KeyError, match="did you mean 'Obstacle'"):
        document.add_object("guides", "Obstacles", [(0, 0)])


def test_the_version_before_is_kept_and_nothing_is_left_lying_about(path):
    before = path.read_bytes()
    document = Document.load(path)
    document.move_object(1, (2, 18))
    document.save()
    assert (path.parent / "small.tmj.bak").read_bytes() == before
    assert sorted(os.listdir(path.parent)) == ["small.tmj", "small.tmj.bak"]


def test_a_number_that_is_none_is_not_written(path):
    before = path.read_bytes()
    document = Document.load(path)
    document.add_object("guides", "Obstacle", [(10, 2), (12, 2), (12, 4)], margin=float("nan"))
    with pytest.raises(ValueError, match="nan cannot be written"):
        document.save()
    assert path.read_bytes() == before


def test_what_cannot_be_edited_says_so(tmp_path):
    with pytest.raises(ProblemsError, match="cannot be read: No such file"):
        Document.load(tmp_path / "no.tmj")
    (tmp_path / "bad.tmj").write_text("{")
    with pytest.raises(ProblemsError, match=r"bad\.tmj:1: not valid JSON"):
        Document.load(tmp_path / "bad.tmj")
    (tmp_path / "infinite.tmj").write_text(json.dumps({**level(), "infinite": True}))
    with pytest.raises(ProblemsError, match="an infinite map cannot be edited here"):
        Document.load(tmp_path / "infinite.tmj")


def test_write_level_takes_a_plain_document(tmp_path):
    path = write_level(level(), tmp_path / "plain.tmj")
    assert read(path).agents == 12
