"""A level reads what lies in its project, and nothing else."""

import json
import os
import re
import time

import pytest
from flockbrush.engine import limits
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.reader import read_level, read_level_files
from flockbrush.levels.schema import PROJECT_FILE
from small_level import Gust, Shelf, herd, level, objects, properties, thing, tiles, tileset


def save(folder, source="kinds.tsj"):
    path = folder / "small.tmj"
    path.write_text(json.dumps(level(tilesets=[{"firstgid": 1, "source": source}])))
    return path


def read(path):
    return read_level(path, library=Shelf(), commands={"Gust": Gust})


def refused(path):
    with pytest.raises(ProblemsError) as caught:
        read(path)
    return str(caught.value.problems[0])


@pytest.fixture
def project(tmp_path):
    """A project with a folder of levels, the tiles beside them, and a neighbour."""
    (tmp_path / "ours" / "levels").mkdir(parents=True)
    (tmp_path / "ours" / PROJECT_FILE).write_text("{}")
    (tmp_path / "ours" / "kinds.tsj").write_text(json.dumps(tileset()))
    (tmp_path / "secret.tsj").write_text(json.dumps(tileset()))
    return tmp_path / "ours" / "levels"


def test_a_level_may_use_the_tiles_of_its_project(project):
    found = read(save(project, "../kinds.tsj"))
    assert found.terrain.names == ["grass"]
    assert list(found.files) == ["small.tmj", "../kinds.tsj"]


def test_without_a_project_the_levels_own_folder_is_the_limit(project):
    (project.parent / PROJECT_FILE).unlink()
    assert "'../kinds.tsj' is outside of the project folder; copy it beside the level" in refused(
        save(project, "../kinds.tsj")
    )


def test_the_neighbours_files_are_out_of_reach(project):
    assert "is outside of the project folder" in refused(save(project, "../../secret.tsj"))
    assert "is outside of the project folder" in refused(save(project, "x/../../../secret.tsj"))


@pytest.mark.parametrize("name", ["/etc/passwd", "C:\\secret.tsj", "\\\\host\\secret.tsj", "file:///secret.tsj"])
def test_absolute_paths_are_refused(project, name):
    assert "is an absolute path; name the file relative to the level" in refused(save(project, name))


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="this system has no symbolic links")
def test_a_link_out_of_the_project_is_refused(project):
    (project / "kinds.tsj").symlink_to(project.parent.parent / "secret.tsj")
    assert "is outside of the project folder" in refused(save(project))
    (project / "kinds.tsj").unlink()
    (project / "kinds.tsj").symlink_to(project.parent / "kinds.tsj")
    assert read(save(project)).terrain.names == ["grass"]


def test_a_link_in_a_ring_is_refused(project):
    (project / "kinds.tsj").symlink_to(project / "kinds.tsj")
    assert "kinds.tsj" in refused(save(project))


@pytest.mark.parametrize(
    "name, message", [("", "is not the name of a file"), ("a\0b", "is not the name of a file"), (".", "is a folder")]
)
def test_what_names_no_file_is_refused(project, name, message):
    assert message in refused(save(project, name))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no pipes")
def test_a_pipe_does_not_hang(project):
    os.mkfifo(project / "kinds.tsj")
    start = time.monotonic()
    assert "is not a regular file" in refused(save(project))
    assert time.monotonic() - start < 5


def test_a_level_that_is_not_there_says_so(tmp_path):
    assert refused(tmp_path / "no.tmj") == f"{tmp_path / 'no.tmj'}: there is no such file"
    assert "is a folder, not a file" in refused(tmp_path)


def test_too_large_a_file_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("flockbrush.engine.limits.LEVEL_FILE_BYTES", limits.Limit(2**20, "bytes", "a file"))
    (tmp_path / "big.tmj").write_bytes(b" " * (2**20 + 1))
    assert "is larger than 1 MiB" in refused(tmp_path / "big.tmj")


def test_a_problem_in_a_tileset_names_its_file_and_line(project):
    kinds = tileset()
    kinds["tiles"][0]["properties"][0] = {"name": "cots", "type": "float", "value": 1}
    (project / "kinds.tsj").write_text(json.dumps(kinds, indent=1))
    message = refused(save(project))
    assert message.startswith(f"{project / 'kinds.tsj'}:")
    assert "tile 0 of tileset 'kinds': Terrain has no property 'cots'; did you mean 'cost'?" in message


def test_what_was_read_reads_again_from_memory(project):
    from_disk = read(save(project, "../kinds.tsj"))
    again = read_level_files(from_disk.files, library=Shelf())
    assert again.agents == from_disk.agents
    assert (again.terrain.index == from_disk.terrain.index).all()
    assert again.files == from_disk.files


def test_a_brush_may_be_a_file_beside_the_level(project, monkeypatch):
    from flockbrush.behaviours.brush import shipped

    source = shipped().path("march").read_text().replace('name = "march"', 'name = "mine"')
    (project / "brushes").mkdir()
    (project / "brushes" / "mine.brush.toml").write_text(source)
    for name in ("mine", "brushes/mine.brush.toml"):
        path = project / "small.tmj"
        document = level(tiles(), objects("spawns", herd(brush=name)))
        document["tilesets"][0]["tiles"][2]["properties"][0]["value"] = "march"
        path.write_text(json.dumps(document))
        found = read_level(path)
        assert found.spawns[0].brush == "mine"
    assert list(found.files) == ["small.tmj", "brushes/mine.brush.toml"]
    assert read_level_files(found.files).spawns[0].brush == "mine"


def test_a_brush_that_is_named_as_a_file_is_known_by_its_name_everywhere(project):
    from flockbrush.behaviours.brush import shipped

    (project / "own").mkdir()
    (project / "own" / "mine.brush.toml").write_bytes(shipped().get("march").source)
    key = thing(2, "Key", 16, 16, extra={"point": True}, at=1.0, command="SwitchBrush", brush="mine")
    mix = tiles("brush", [3] * 100, opacity=0.5, properties=properties(blend="mix"))
    herds = [herd(brush="own/mine.brush.toml", count=2), {**herd(brush="graze", count=2), "id": 3}]
    layers = [mix, objects("spawns", *herds), objects("script", key)]
    document = level(tiles(), *layers)
    asset = document["tilesets"][0]["tiles"][2]["properties"][0]
    asset["value"] = "mine"
    path = project / "small.tmj"
    path.write_text(json.dumps(document))
    found = read_level(path)
    assert (found.brush_layers[0].assets, found.script[0].args["brush"]) == (["mine"], "mine")
    assert ["from 'graze' to 'mine'" in str(told) for told in found.warnings] == [True]
    asset["value"] = "mien"
    path.write_text(json.dumps(document))
    with pytest.raises(ProblemsError) as caught:
        read_level(path)
    assert ["there is no brush 'mien'; did you mean 'mine'?" in str(told) for told in caught.value.problems] == [True]


def of_two_brushes(project, *names):
    """A level whose two herds have these brushes; ``quick`` has other numbers than the shipped brush and ``slow``."""
    from flockbrush.behaviours.brush import shipped

    march = shipped().get("march")
    for folder, weight in (("quick", 0.2), ("slow", 0.3), ("copy", 0.2)):
        (project / folder).mkdir()
        (project / folder / "march.brush.toml").write_bytes(march.with_parameters(alignment_weight=weight).source)
    herds = herd(brush=names[0], count=2), {**herd(brush=names[1], count=2), "id": 2, "name": "herd B"}
    path = project / "small.tmj"
    path.write_text(json.dumps(level(tiles(), objects("spawns", *herds)), indent=1))
    return path


def test_two_brushes_of_one_name_are_a_problem(project):
    path = of_two_brushes(project, "quick/march.brush.toml", "slow/march.brush.toml")
    with pytest.raises(ProblemsError) as caught:
        read_level(path)
    (problem,) = map(str, caught.value.problems)
    assert re.match(r".*small\.tmj:\d+: object 2 'herd B' in layer 'spawns': brush: slow/march", problem)
    assert "slow/march.brush.toml and quick/march.brush.toml are different brushes of one name" in problem


@pytest.mark.parametrize(
    ("names", "warned"),
    [
        (("march", "quick/march.brush.toml"), ["brush 'march' is that of quick/march.brush.toml in this level"]),
        (("copy/march.brush.toml", "quick/march.brush.toml"), []),
        (("graze", "quick/march.brush.toml"), []),
    ],
)
def test_a_brush_that_hides_one_of_the_library_is_a_warning(project, names, warned):
    found = read_level(of_two_brushes(project, *names))
    assert len(found.warnings) == len(warned)
    assert all(said in str(told) for said, told in zip(warned, found.warnings, strict=True))


def test_a_broken_brush_file_is_told_with_its_own_lines(project):
    (project / "mine.brush.toml").write_text("schema = 1\n")
    path = project / "small.tmj"
    path.write_text(json.dumps(level(tiles(), objects("spawns", herd(brush="mine.brush.toml")))))
    with pytest.raises(ProblemsError) as caught:
        read_level(path)
    assert any("mine.brush.toml:1: schema" in str(p) for p in caught.value.problems)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("walk.flock", "is a recording, for flockbrush replay"), ("walk.CSV", "is a table of tracks"),
        ("walk.mp4", "is a film"), ("walk.png", "is a picture"), ("march.brush.toml", "is a brush"),
    ],
)  # fmt: skip
def test_files_of_another_kind_are_called_by_it(tmp_path, name, words):
    (tmp_path / name).write_bytes(b"\xff\x00")
    message = refused(tmp_path / name)
    assert words in message and message.endswith("a level is a .tmj or .tmx file of Tiled")
