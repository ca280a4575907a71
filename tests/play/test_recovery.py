"""Sessions that end badly: what a crash leaves is found, and one goes on from there."""

import pytest
from crashed_session import crashed, sessions, thrown_away
from flockbrush.behaviours.brush import shipped
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.recording import RecordingError
from flockbrush.engine.state import state_hash
from flockbrush.systems.commands import AddAnimals, AddObstacle
from flockbrush.systems.undo import UseBrush
from small_pasture import by_hand, straight_run, stroke, texts, verified

from flockbrush.studio.recovery import leftovers
from flockbrush.studio.session import Session
from flockbrush.studio.session_folders import state_folder


def test_a_session_that_ends_well_leaves_nothing(level, state):
    session = Session.open(level, state_folder=state)
    assert len(list(state.iterdir())) == 1
    session.step(3)
    session.close()
    assert list(state.iterdir()) == [] and Session.recoverable(level, state) == []


def test_a_session_that_runs_is_not_to_be_recovered(level, state):
    session = Session.open(level, state_folder=state)
    session.autosave()
    assert Session.recoverable(level, state) == [] and len(list(state.iterdir())) == 1
    session.close()


def test_a_level_that_does_not_open_leaves_nothing(level, state, tmp_path):
    with pytest.raises(Exception, match="folder"):
        Session.open(level, record=tmp_path / "nowhere" / "walk.flock", state_folder=state)
    with pytest.raises(Exception, match="animals"):
        Session.open(level, agents=0, state_folder=state)
    assert not state.exists() or list(state.iterdir()) == []
    with pytest.raises(ProblemsError, match="my walk.flock: name it my-walk.flock"):
        Session.open(level, record=tmp_path / "my walk.flock", state_folder=state)


def test_what_a_crash_left_goes_on_where_it_stood(level, state):
    session = Session.open(level, state_folder=state)
    session.step(5)
    session.do("paint", [stroke("swarm", 8, 8, 3)])
    session.step(20)
    session.do("add", [AddAnimals("march", 4, 4, 2, 3, "sheep")])
    there = state_hash(session.simulation.world)
    crashed(session)
    (left,) = Session.recoverable(level, state)
    assert left.level == level and str(left).startswith("pasture.tmj, ")
    again = Session.recover(left, state)
    assert again.tick == again.last_tick == 25 and state_hash(again.simulation.world) == there
    assert again.path == level and not left.folder.exists() and Session.recoverable(level, state) == []
    again.scrub(3)
    again.scrub(25)
    again.step(5)
    assert again.timeline.current.hashes == straight_run(level, by_hand(again), 30) and texts(again) == []
    again.close()


def test_all_branches_come_back(level, state):
    session = Session.open(level, state_folder=state)
    session.step(12)
    session.scrub(6)
    session.do("paint", [stroke("swarm", 8, 8, 3)])
    session.step(3)
    session.restart()
    session.step(2)
    session.switch("pasture-2")
    crashed(session)
    again = Session.recover(leftovers(root=state)[0], state)
    assert list(again.branches) == ["pasture", "pasture-2", "pasture-3"]
    assert (again.branch_name, again.tick) == ("pasture-2", 9)
    assert [(b.parent, b.left, b.last_tick) for b in again.branches.values()] == [
        ("", 0, 12), ("pasture", 6, 9), ("", 0, 2),
    ]  # fmt: skip
    for name in ("pasture-3", "pasture", "pasture-2"):
        again.switch(name)
        again.step(4)
        assert again.export_recording(state / "again.flock")
        assert verified(state / "again.flock").last_tick == again.tick
    crashed(again)  # and once more
    assert Session.recover(leftovers(root=state)[0], state).tick == 13


def test_a_recording_cut_off_in_the_middle_is_recovered_up_to_there(level, state):
    session = Session.open(level, state_folder=state)
    session.step(30)
    crashed(session)
    (file,) = state.glob("*/pasture.flock")
    with open(file, "r+b") as cut:
        cut.truncate(file.stat().st_size - 100)
    again = Session.recover(leftovers(root=state)[0], state)
    assert 20 < again.tick < 30
    again.step(5)
    assert again.timeline.current.hashes == straight_run(level, [], again.tick)
    again.close()


def test_a_recording_without_a_beginning_is_refused_and_stays(level, state):
    session = Session.open(level, state_folder=state)
    crashed(session)
    (file,) = state.glob("*/pasture.flock")
    file.write_bytes(file.read_bytes()[:50])
    (left,) = leftovers(root=state)
    with pytest.raises(RecordingError, match="header"):
        Session.recover(left, state)
    assert left.folder.exists()
    left.discard()
    assert leftovers(root=state) == []


def test_edits_come_back_with_their_undo_and_in_every_branch(level, state):
    session = Session.open(level, state_folder=state)
    session.do("paint", [stroke("march", 8, 8, 2)])
    session.step(4)
    session.do("rock", [AddObstacle("rock", [[3, 3], [4, 3], [4, 4], [3, 4]], id=session.editor.new_id())])
    session.undo()
    session.step(4)
    session.scrub(2)
    session.do("paint", [stroke("swarm", 12, 8, 2)])
    session.restart()
    session.do("paint", [stroke("march", 4, 8, 2)])
    session.switch("pasture-2")
    known = {name: told_of(branch.editor) for name, branch in session.branches.items()}
    crashed(session)
    again = Session.recover(leftovers(root=state)[0], state)
    assert {name: told_of(branch.editor) for name, branch in again.branches.items()} == known
    assert again.branch_name == "pasture-2" and again.dirty
    assert again.undo() and again.undo() and not again.undo() and texts(again) == []
    again.switch("pasture")
    assert again.redo() and texts(again) == []
    assert again.save() == level and again.changed_on_disk() == ""
    again.close()


def told_of(editor):
    """An editor in short."""
    labels = [[step.label for step in steps] for steps in (editor.done, editor.undone)]
    return editor.text(), labels, editor.dirty


def test_a_lost_journal_costs_the_edits_and_not_the_run(level, state):
    session = Session.open(level, state_folder=state)
    session.do("paint", [stroke("march", 8, 8, 2)])
    session.step(4)
    crashed(session)
    (file,) = state.glob("*/*.journal")
    file.write_text("nonsense")
    again = Session.recover(leftovers(root=state)[0], state)
    assert again.tick == 4 and "the changes of the level are lost" in texts(again)[0]
    again.step(3)
    assert again.timeline.current.hashes == straight_run(level, by_hand(again), 7)
    again.close()


def test_brushes_of_ones_own_are_there_after_a_crash(level, state):
    session = Session.open(level, state_folder=state)
    mine = shipped().get("march").model_copy(update={"name": "mine"})
    session.save_brush(mine)
    session.do("use", [UseBrush("mine", mine.source.decode())])
    session.do("paint", [stroke("mine", 6, 8, 6)])
    session.step(4)
    crashed(session)
    again = Session.recover(leftovers(root=state)[0], state)
    assert "mine" in again.library.names() and "mine" in again.palette.names
    again.restart()
    again.step(5)
    assert "mine" in again.chart.counts and texts(again) == []
    again.close()


def test_who_only_looked_on_is_not_asked(level, state):
    session = Session.open(level, state_folder=state)
    session.step(4)
    crashed(session)
    assert Session.recoverable(level, state) == [] and sessions(state) == [] and len(thrown_away(state)) == 1


def test_what_was_saved_before_the_crash_is_not_offered_and_what_came_later_is(level, state):
    session = Session.open(level, state_folder=state)
    session.do("paint", [stroke("march", 8, 8, 2)])
    session.save()
    crashed(session)
    assert Session.recoverable(level, state) == []
    session = Session.open(level, state_folder=state)
    session.do("paint", [stroke("march", 8, 8, 2)])
    session.save()
    session.undo()
    crashed(session)
    assert len(Session.recoverable(level, state)) == 1


def test_a_session_that_is_stopped_from_outside_keeps_what_is_not_saved(level, state):
    session = Session.open(level, state_folder=state)
    assert not session.close(keep=True) and list(state.iterdir()) == []
    session = Session.open(level, state_folder=state)
    session.do("paint", [stroke("march", 8, 8, 2)])
    session.step(4)
    text = session.editor.text()
    assert session.close(keep=True)
    (left,) = Session.recoverable(level, state)
    again = Session.recover(left, state)
    assert again.tick == 4 and again.editor.text() == text and again.dirty and texts(again) == []
    again.close()


def test_sessions_of_an_early_version_are_told_of_and_found_once_they_are_moved(level, tmp_path, monkeypatch):
    """They lay in $FLOCKBRUSH_STATE itself, with a lock that carried no mark."""
    monkeypatch.setenv("FLOCKBRUSH_STATE", str(tmp_path / "home"))
    session = Session.open(level)
    session.step(3)
    session.do("paint", [stroke("swarm", 8, 8, 3)])
    crashed(session)
    (now,) = state_folder().iterdir()
    early = tmp_path / "home" / now.name
    now.rename(early)
    (early / "lock").write_text("")
    (tmp_path / "home" / "thesis-1-1").mkdir()  # of somebody else
    told = []
    assert leftovers(tell=told.append) == []
    assert told == [
        f"{tmp_path / 'home'} has sessions of an older version ({now.name}); to recover them, move them to"
        f" {state_folder()}"
    ]
    early.rename(now)
    told.clear()
    (left,) = Session.recoverable(tell=told.append)
    assert (left.folder, told) == (now, [])
    again = Session.recover(left)
    assert again.tick == 3
    again.close()
    assert (tmp_path / "home" / "thesis-1-1").is_dir()
