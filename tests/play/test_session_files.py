"""What a designer does to a level: undone and done again, saved, reloaded, and never lost."""

import errno
import os
import re
import shutil

import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.components import BrushBinding
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.state import state_hash
from flockbrush.levels.level_writer import Document
from flockbrush.levels.reader import read_level
from flockbrush.systems.commands import AddAnimals, AddObstacle, RemoveAnimals, SetParameter
from flockbrush.systems.edits import DrawGuide, MarkSpawn, RemoveThing
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.life import Nursery
from flockbrush.systems.mark_commands import PlaceKey
from flockbrush.systems.palette import Palette
from flockbrush.systems.undo import UseBrush
from small_pasture import of_ones_own, pasture, stroke, texts, verified

from flockbrush.cli.main import called
from flockbrush.studio.history import History
from flockbrush.studio.recorded_session import open_recorded
from flockbrush.studio.session import Session


@pytest.fixture
def level(tmp_path):
    return pasture(tmp_path / "levels", script=False)


def brushes(session):
    """Names of the brushes that animals have, by entity."""
    names = session.palette.names
    binding = session.simulation.agents[BrushBinding.brush]
    return dict(zip(session.simulation.agents.ids.tolist(), [names[k] for k in binding], strict=True))


def rock(number=0):
    return AddObstacle("rock", [[3, 3], [4, 3], [4, 4], [3, 4]], id=number)


# undo and redo --------------------------------------------------------------------


def test_a_stroke_changes_sheep_and_level_and_undo_takes_it_back(session):
    before = session.editor.text()
    assert session.undo_label is None and not session.undo()
    for x in (5, 6, 7):
        assert session.do("paint swarm", [stroke("graze" if x < 0 else "march", x, 8, 3)], join="stroke 1")
    assert session.undo_label == "paint swarm" and session.dirty
    painted = session.editor.text()
    assert session.undo() and session.editor.text() == before and not session.dirty
    assert session.undo_label is None and session.redo_label == "paint swarm"
    assert session.redo() and session.editor.text() == painted
    assert not session.redo() and texts(session) == []


def test_painted_sheep_take_up_the_brush_and_after_undo_their_own(tmp_path):
    level = pasture(tmp_path, script=True)  # loosened after a quarter second, so that the palette has two brushes
    session = Session.open(level, state_folder=tmp_path / "state")
    session.do("paint", [stroke("swarm", 6, 8, 6)])
    session.step(2)
    assert set(brushes(session).values()) == {"swarm"}
    session.undo()
    session.step(2)
    assert set(brushes(session).values()) == {"march"}
    session.close()


def test_animals_that_come_back_are_the_same_animals(session):
    session.do("add", [AddAnimals("march", 4, 12, 2, 3, "sheep")])
    session.step(3)
    ids, xyz = session._after.ids.copy(), session._after.xyz.copy()
    session.undo()
    assert len(session._after) == 9
    session.redo()
    assert session._after.ids.tolist() == ids.tolist() and (session._after.xyz == xyz).all()


def test_undo_in_the_past_is_another_course_of_events(session):
    session.do("rock", [rock(session.editor.new_id())])
    session.step(4)
    session.do("add", [AddAnimals("march", 4, 12, 2, 3, "sheep")])
    session.step(4)
    session.scrub(2)
    assert session.undo()  # the rock: the animals are not there yet
    assert session.branch_name == "pasture-2" and session.undo_label is None and not session.dirty
    assert session.redo_label == "rock"
    session.step(2)
    session.switch("pasture")
    assert session.undo_label == "add" and session.dirty and len(session._after) == 12


def test_undo_of_nothing_in_the_past_begins_no_branch(session):
    session.step(4)
    session.do("rock", [rock()])
    session.scrub(2)
    assert not session.undo()
    assert list(session.branches) == ["pasture"] and session.in_past


def test_undo_goes_on_where_the_herd_cannot_follow(session, monkeypatch):
    session.do("rock", [rock(session.editor.new_id())])
    before = session.editor.text()
    session.do("guide", [DrawGuide(session.editor.new_id(), "way", [[2, 2], [9, 2]])])
    monkeypatch.setattr(session.editor.done[-1], "back", [RemoveAnimals(6, 8, 1, "cow")])
    assert session.undo() and session.editor.text() == before
    assert "undone in the level, but not in the running herd: there is no species 'cow'" in texts(session)[0]


def test_an_edit_the_file_cannot_take_changes_nothing(session):
    here, before = state_hash(session.simulation.world), session.editor.text()
    assert not session.do("goal", [DrawGuide(session.editor.new_id(), "way", [[2, 2]])])
    assert len(texts(session)) == 1
    assert state_hash(session.simulation.world) == here and session.editor.text() == before
    assert session.undo_label is None


# branches and beginnings ---------------------------------------------------------------


def test_every_branch_has_its_own_level(session):
    session.do("rock", [rock(session.editor.new_id())])
    one = session.editor.text()
    session.step(4)
    session.do("paint", [stroke("march", 8, 8, 2)])
    two = session.editor.text()
    session.step(4)
    session.scrub(2)
    assert session.editor.text() == two  # looking back changes nothing
    session.branch("other")
    assert session.editor.text() == one
    session.switch("pasture")
    assert session.editor.text() == two
    assert session.save()
    session.switch("other")
    assert session.dirty  # the file is the other branch's


def test_a_run_begins_anew_with_what_was_painted_and_tuned(session):
    session.step(5)
    session.do("rock", [rock(session.editor.new_id())])
    session.do("spawn", [MarkSpawn(session.editor.new_id(), "more", [[2, 12], [6, 12], [6, 15], [2, 15]], "march",
                                   "sheep", 4)])  # fmt: skip
    session.do("tune", [SetParameter("march", "cohesion_weight", 0.25)])
    session.step(5)
    session.ground_changes()
    world, label = session.simulation, session.undo_label
    session.restart()
    assert session.tick == 0 and session.simulation is not world and list(session.branches) == ["pasture", "pasture-2"]
    assert "rock" in [barrier.name for barrier in session.level.obstacles] or len(session.level.obstacles) == 2
    assert len(session._after) == 13 and session.ground_changes() == ["all"]
    brush = session.simulation.world.resource(Palette).brushes[0]
    assert brush.name == "march" and brush.parameters["cohesion_weight"] == 0.25
    assert session.undo_label == label and session.dirty
    session.step(5)
    assert session.undo() and session.undo()
    session.step(2)
    assert texts(session) == []


def test_a_restarted_run_is_a_recording_of_its_own(session, tmp_path):
    session.do("paint", [stroke("graze", 6, 8, 3)]) if "graze" in session.palette.names else None
    session.do("rock", [rock(session.editor.new_id())])
    session.step(4)
    session.restart()
    session.step(6)
    session.do("tune", [SetParameter("march", "cohesion_weight", 0.25)])
    session.step(3)
    session.restart()
    session.step(3)
    assert session.export_recording(tmp_path / "third.flock")
    assert verified(tmp_path / "third.flock").last_tick == 3
    session.switch("pasture-2")
    assert session.export_recording(tmp_path / "second.flock")
    assert verified(tmp_path / "second.flock").last_tick == 9


def test_a_run_of_more_animals_than_the_map_holds_can_be_painted_but_not_saved(level, tmp_path):
    session = Session.open(level, agents=300, state_folder=tmp_path / "state")
    assert isinstance(session.editor, History) and "the map was enlarged for 300 animals" in texts(session)[0]
    session.do("paint", [stroke("march", 8, 8, 2)], join="s")
    session.do("paint", [stroke("march", 9, 8, 2)], join="s")
    session.step(2)
    assert session.undo() and session.undo_label is None and session.redo_label == "paint"
    assert session.redo() and session.undo_label == "paint" and not session.dirty
    assert not session.save() and "the map was enlarged" in texts(session)[0]
    session.step(2)
    session.scrub(1)
    session.branch()
    assert session.undo_label == "paint" or session.redo_label == "paint"
    session.restart()
    session.close()


def test_an_infinite_map_plays_and_is_not_edited(level, tmp_path):
    text = level.read_text().replace('"infinite":false', '"infinite":true')
    other = level.with_name("endless.tmj")
    document = Document.load(level)
    document.data["infinite"] = True
    for layer in document.data["layers"]:
        if layer["type"] == "tilelayer":
            data = layer.pop("data")
            layer["chunks"] = [{"data": data, "x": 0, "y": 0, "width": layer["width"], "height": layer["height"]}]
            layer.pop("compression", None), layer.pop("encoding", None)
    assert text and document.save(other)
    session = Session.open(other, state_folder=tmp_path / "state")
    session.step(3)
    assert session.tick == 3 and "an infinite map cannot be edited here" in texts(session)[0]
    session.close()


# saving -----------------------------------------------------------------------------------


def test_what_was_saved_is_read_again(session, level):
    session.do("paint", [stroke("march", 8, 8, 2)])
    session.do("rock", [rock(session.editor.new_id())])
    before = level.read_bytes()
    assert session.save() == level and not session.dirty and session.changed_on_disk() == ""
    assert level.with_name("pasture.tmj.bak").read_bytes() == before
    saved = read_level(level)
    assert "rock" in [o.name for o in saved.obstacles] and saved.brush_layers
    assert session.undo() and session.dirty


def test_a_level_saved_in_another_folder_has_all_it_needs(session, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    mine = shipped().get("march").model_copy(update={"name": "mine"})
    assert session.save_brush(mine) == session.path.parent / "brushes" / "mine.brush.toml"
    assert "mine" in session.library.names()
    session.do("use", [UseBrush("mine", mine.source.decode())])
    session.do("paint", [stroke("mine", 8, 8, 2)])
    to = tmp_path / "elsewhere" / "walk.tmj"
    assert session.save(to) == to and session.path == to, texts(session)
    assert any("mine" in layer.assets for layer in read_level(to).brush_layers)
    again = Session.open(to, state_folder=tmp_path / "state")
    again.step(2)
    again.close()


def test_a_brush_that_the_level_names_as_a_file_goes_along_in_silence(tmp_path):
    level = pasture(tmp_path / "levels", script=False, brush="own/march.brush.toml")
    own = shipped().get("march").with_parameters(alignment_weight=0.2).source
    (level.parent / "own").mkdir()
    (level.parent / "own" / "march.brush.toml").write_bytes(own)
    (tmp_path / "elsewhere").mkdir()
    session = Session.open(level, state_folder=tmp_path / "state")
    assert session.save(tmp_path / "elsewhere" / "walk.tmj") and texts(session) == []
    session.close()
    assert (tmp_path / "elsewhere" / "own" / "march.brush.toml").read_bytes() == own


def test_a_brush_that_the_level_names_as_a_file_can_be_painted_and_saved(tmp_path):
    level = pasture(tmp_path / "levels", script=False, brush="own/mine.brush.toml")
    (level.parent / "own").mkdir()
    (level.parent / "own" / "mine.brush.toml").write_bytes(shipped().get("march").source)
    session = Session.open(level, state_folder=tmp_path / "state")
    assert session.do("paint", [stroke("mine", 6, 8, 3)])
    assert session.save() and texts(session) == []
    session.close()
    assert any("mine" in layer.assets for layer in read_level(level).brush_layers)


NEEDS = {  # a key, what is removed that it names, and what is said
    "species": (("SwitchBrush", {"brush": "march", "species": "wolf"}), "spawn", "there is no species 'wolf'"),
    "obstacle": (("MoveObstacle", {"name": "stone", "x": 12.0, "y": 4.0}), "obstacle", "there is no obstacle 'stone'"),
    "program": (("Event", {"name": "alarm"}), "spawn", "no program of this world listens for an event"),
}


@pytest.mark.parametrize("what", NEEDS)
def test_a_level_whose_script_names_what_was_removed_is_not_written(tmp_path, what):
    (command, args), kind, told = NEEDS[what]
    level = of_ones_own(tmp_path / "own", script=False)
    session = Session.open(level, state_folder=tmp_path / "state")
    number, key = session.editor.new_id(), session.editor.new_id()
    program, species = ("wary", "sheep") if what == "program" else ("", "wolf")
    corners, places = [[18, 12], [22, 12], [22, 15], [18, 15]], [[2, 12], [6, 12], [6, 15], [2, 15]]
    flock = MarkSpawn(number, "others", corners, "swarm", species, 2, program=program)
    assert session.do("spawn", [MarkSpawn(session.editor.new_id(), "sheep", places, "march", "sheep", 1), flock])
    assert session.do("key", [PlaceKey(key, "later", 60.0, command, args, 4.0, 4.0)]), texts(session)
    assert session.save() == level and texts(session) == []
    things = {
        "spawn": session.simulation.world.resource(Nursery).spawns,
        "obstacle": session.simulation.world.resource(Landscape).obstacles,
    }[kind]
    gone = [thing.id for thing in things if thing.name in ("others", "flock", "stone")]
    before = level.read_bytes()
    for number in gone:
        assert session.do("remove", [RemoveThing(kind, number)])
    for to in (None, tmp_path / "copy.tmj"):
        assert session.save(to) is False
        (text,) = texts(session)
        assert told in text and f"object {key} 'later'" in text and "undo what is missing" in text
    assert level.read_bytes() == before and not (tmp_path / "copy.tmj").exists() and session.dirty
    assert session.do("key", [RemoveThing("key", key)]) and session.save() == level and read_level(level)
    session.close()


def test_a_brush_is_not_replaced_unasked(session):
    mine = shipped().get("march").model_copy(update={"name": "mine"})
    assert session.save_brush(mine) and session.save_brush(mine) is None
    told, refused = texts(session)
    assert "Tiled shows the brush" in told and "already exists" in refused
    assert session.save_brush(mine, overwrite=True)


def test_a_shipped_level_stays_as_it_is(tmp_path):
    session = Session.open("meadow", agents=20, state_folder=tmp_path / "state")
    assert session.save() is False and "is part of Flockbrush" in texts(session)[0]
    with pytest.raises(ProblemsError, match="first save the level elsewhere"):
        session.brush_folder()
    session.close()


@pytest.mark.parametrize("where", ["os.fsync", "os.replace"])
def test_a_full_disk_loses_nothing(session, level, monkeypatch, where):
    session.do("rock", [rock(session.editor.new_id())])
    before, text = level.read_bytes(), session.editor.text()

    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(where, full)
    assert session.save() is False
    monkeypatch.undo()
    (text_told,) = texts(session)
    assert "No space left on device" in text_told and "your changes are kept in this window" in text_told
    assert "pasture.tmj" in text_told
    assert level.read_bytes() == before and session.dirty and session.editor.text() == text
    assert not [p for p in level.parent.iterdir() if p.name.startswith(".")]
    assert session.save() and read_level(level)


# other programs -----------------------------------------------------------------------------


def touched(level, seed):
    """Another program changes the level's seed."""
    document = Document.load(level)
    next(p for p in document.data["properties"] if p["name"] == "seed")["value"] = seed
    document.save(backup=False)


def test_a_level_that_another_program_wrote_is_noticed(session, level):
    assert session.changed_on_disk() == ""
    os.utime(level, (1, 1))
    assert session.changed_on_disk() == ""  # touched, but the same
    touched(level, 77)
    assert session.changed_on_disk() == "changed" == session.changed_on_disk()
    level.unlink()
    assert session.changed_on_disk() == "deleted"


def test_taking_the_other_version_keeps_mine(session, level):
    session.do("rock", [rock(session.editor.new_id())])
    session.step(3)
    mine = session.editor.text()
    touched(level, 77)
    assert session.reload()
    assert session.level.seed == 77 and session.tick == 0 and not session.dirty and session.changed_on_disk() == ""
    assert level.with_name("pasture.tmj.mine.bak").read_text() == mine
    assert f"kept as {level}.mine.bak" in texts(session)[0]
    assert session.undo_label is None
    session.switch("pasture")
    assert session.editor.text() == mine and session.tick == 3


def test_each_reload_keeps_its_own_version_of_mine(session, level):
    versions = []
    for number in (77, 78):
        session.do("rock", [rock(session.editor.new_id())])
        session.do("paint", [stroke("march", number - 70, 8, 2)])
        versions.append(session.editor.text())
        assert session.reload()
    kept = [level.with_name(f"pasture.tmj.{name}.bak") for name in ("mine", "mine-2")]
    assert [path.read_text() for path in kept] == versions and str(kept[1]) in texts(session)[1]


@pytest.mark.parametrize("of", ["shipped", "recording"])
def test_a_level_that_is_not_the_designers_is_not_reloaded_over_changes(tmp_path, monkeypatch, of):
    if of == "shipped":
        monkeypatch.setattr("flockbrush.runs.run.SHIPPED", tmp_path / "shipped")
    session = Session.open(pasture(tmp_path / "shipped"), state_folder=tmp_path / "state")
    if of == "recording":
        assert session.export_recording(tmp_path / "walk.flock")
        session.close()
        session = open_recorded(tmp_path / "walk.flock", tmp_path / "state")
    assert session.lent and session.reload() and session.do("rock", [rock(session.editor.new_id())])
    text, branches = session.editor.text(), list(session.branches)
    texts(session)
    assert session.reload("mine") and not session.reload()
    (told,) = texts(session)
    assert "save your changes elsewhere" in told and "is not changed" in told
    assert (session.editor.text(), list(session.branches)) == (text, branches)
    assert not list(tmp_path.rglob("*.bak"))
    session.close()


def test_keeping_mine_keeps_the_other_version(session, level):
    session.do("rock", [rock(session.editor.new_id())])
    touched(level, 77)
    theirs = level.read_bytes()
    assert session.reload("mine") and session.changed_on_disk() == "" and session.dirty
    assert session.save() and session.save()
    assert level.with_name("pasture.tmj.theirs.bak").read_bytes() == theirs
    assert read_level(level).seed == 3


def test_a_broken_version_is_not_taken(session, level):
    session.do("rock", [rock(session.editor.new_id())])
    level.write_text('{"type": "map"')
    assert not session.reload()
    (text,) = texts(session)
    assert "pasture.tmj:1" in text and "is not changed" in text
    assert session.undo_label == "rock" and session.changed_on_disk() == "changed"


def test_a_level_deleted_while_open_can_be_saved_again(session, level):
    session.do("rock", [rock(session.editor.new_id())])
    level.unlink()
    assert not session.reload() and texts(session)
    session.step(2)
    session.restart()
    assert session.reload("mine") and session.dirty and session.changed_on_disk() == ""
    assert session.save() == level and "rock" in [o.name for o in read_level(level).obstacles]


def test_a_folder_that_is_not_there_is_not_made(session, tmp_path):
    assert session.save(tmp_path / "typo" / "mine.tmj") is False
    assert "there is no folder" in texts(session)[-1] and not (tmp_path / "typo").exists()


def test_a_folder_deleted_while_open_loses_nothing(session, level, tmp_path):
    session.do("rock", [rock(session.editor.new_id())])
    shutil.rmtree(level.parent)
    session.restart()
    session.step(3)
    assert session.tick == 3 and len(session.level.obstacles) == 2
    assert session.save() is False and "your changes are kept in this window" in texts(session)[-1]
    level.parent.mkdir()
    assert session.save() == level and len(read_level(level).obstacles) == 2
    (tmp_path / "new").mkdir()
    assert session.save(tmp_path / "new" / "pasture.tmj"), texts(session)
    assert len(read_level(tmp_path / "new" / "pasture.tmj").obstacles) == 2


# recordings ------------------------------------------------------------------------------------


def test_a_run_and_its_branches_are_recorded_where_one_says(level, tmp_path):
    session = Session.open(level, record=tmp_path / "walk.flock", state_folder=tmp_path / "state")
    session.step(6)
    session.scrub(3)
    session.do("rock", [rock(session.editor.new_id())])
    session.step(2)
    session.close()
    assert sorted(path.name for path in tmp_path.glob("*.flock")) == ["walk-2.flock", "walk.flock"]
    assert verified(tmp_path / "walk.flock").last_tick == 6
    assert verified(tmp_path / "walk-2.flock").last_tick == 5
    assert called(["replay", str(tmp_path / "walk-2.flock"), "--verify"]) == 0  # as a designer would


def test_where_a_recording_begins_its_size_is_said(level, tmp_path, monkeypatch):
    session = Session.open(level, record=tmp_path / "walk.flock", state_folder=tmp_path / "state")
    (said,) = [text for text in texts(session) if "walk.flock" in text]
    session.step(round(20 / session.simulation.clock.dt))
    session.close()
    megabytes = float(re.search(r"about (\S+) MB per minute", said)[1])
    assert megabytes == pytest.approx(3 * (tmp_path / "walk.flock").stat().st_size / 1e6, rel=0.5)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: shutil._ntuple_diskusage(0, 0, round(5e6 * megabytes)))
    session = Session.open(level, record=tmp_path / "run.flock", state_folder=tmp_path / "state")
    assert "the disk has room for 5 minutes" in texts(session)[-1]
    session.close()


def test_a_recording_that_cannot_be_written_is_said(session, tmp_path):
    session.step(2)
    assert not session.export_recording(tmp_path / "nowhere" / "walk.flock")
    assert "there is no folder" in texts(session)[0]
    assert session.export_recording(tmp_path / "walk.flock") and "wrote" in texts(session)[0]
