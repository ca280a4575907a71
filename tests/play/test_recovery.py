"""Sessions that end badly: what a crash leaves is found, and one goes on from there."""

import hashlib
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest
from small_pasture import by_hand, pasture, straight_run, stroke, verified

from behaviours.brush import shipped
from engine.recording import RecordingError
from engine.state import state_hash
from flockbrush.play.recovery import leftovers, state_folder
from flockbrush.play.session import Session
from levels.writer import Document, dump
from systems.commands import AddAnimals, AddObstacle
from systems.taking_back import UseBrush

HOUSE = Path(__file__).parents[2]


@pytest.fixture
def level(tmp_path):
    return pasture(tmp_path / "levels")


@pytest.fixture
def state(tmp_path):
    return tmp_path / "state"


def crashed(session):
    """End a session as a crash does: the operating system has what was handed to it, and the lock is free."""
    session.timeline.flush()
    session._shelter._lock.close()
    session.simulation.close()


def texts(session):
    return [notice.text for notice in session.notices()]


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


def test_rubbish_in_the_folder_is_cleared_away(level, state):
    (state / "odd").mkdir(parents=True)
    (state / "odd" / "session.json").write_text('{"level": 3')
    (state / "a-file").write_text("hello")
    assert len(leftovers(root=state)) == 0 and (state / "odd").exists()  # it may just begin
    os.utime(state / "odd", (1, 1))
    assert leftovers(root=state) == [] and not (state / "odd").exists()


def test_a_folder_that_may_not_be_written_is_said_and_one_plays_on(level, tmp_path):
    blocked = tmp_path / "blocked"
    blocked.write_text("a file where a folder should be")
    session = Session.open(level, state_folder=blocked)
    session.step(3)
    assert "a crash would lose your work" in texts(session)[0]
    session.close()


def test_where_a_users_state_lies(monkeypatch, tmp_path):
    for name in ("FLOCKBRUSH_STATE", "XDG_STATE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert state_folder() == tmp_path / ".local" / "state" / "flockbrush" / "sessions"
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "x"))
    assert state_folder() == tmp_path / "x" / "flockbrush" / "sessions"
    monkeypatch.setattr(sys, "platform", "darwin")
    assert state_folder() == tmp_path / "Library" / "Application Support" / "flockbrush" / "sessions"
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "local"))
    assert state_folder() == tmp_path / "local" / "flockbrush" / "sessions"
    monkeypatch.setenv("FLOCKBRUSH_STATE", str(tmp_path / "own"))
    assert state_folder() == tmp_path / "own"


VICTIM = """
    import hashlib, sys, time
    from flockbrush.play.session import Session
    from systems.commands import AddAnimals
    from systems.edits import Paint

    session = Session.open(sys.argv[1], state_folder=sys.argv[2])
    session.play()
    last, deeds = time.monotonic(), 0
    while True:
        now = time.monotonic()
        session.advance(now - last, 0.01)
        last = now
        if session.tick > 3 * deeds:
            deeds += 1
            if deeds % 7 == 0:
                session.undo()
            elif deeds % 3 == 0:
                session.do("add", [AddAnimals("march", 4, 4, 2, 1, "sheep")])
            else:
                x = 4 + deeds % 16
                session.do("paint", [Paint("brush", "march", x, 8, x + 1, 8, 1.5)], join=f"stroke {deeds // 4}")
        session.autosave()
        text = hashlib.sha256(session.editor.text().encode()).hexdigest()
        steps = "/".join(step.label for step in session.editor._done)
        print(session.tick, deeds, time.time(), text, steps, flush=True)
        time.sleep(0.005)
"""


@pytest.mark.skipif(os.name != "posix", reason="kill -9 is of Unix")
def test_killed_in_the_middle_nothing_older_than_a_second_is_lost(level, state):
    victim = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(VICTIM), level, state],
        env=os.environ | {"PYTHONPATH": str(HOUSE)}, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    told = []
    for line in victim.stdout:
        told.append(line.split())
        if int(told[-1][0]) >= 100:
            break
    os.kill(victim.pid, signal.SIGKILL)
    killed = time.time()
    told += [line.split() for line in victim.stdout if line.endswith("\n")]
    victim.wait()
    (left,) = leftovers(level, state)
    again = Session.recover(left, state)
    early = [moment for moment in told if float(moment[2]) <= killed - 1]
    assert early and again.tick >= int(early[-1][0])
    text = hashlib.sha256(again.editor.text().encode()).hexdigest()
    steps = "/".join(step.label for step in again.editor._done)
    recent = told[len(early) - 1 :]
    assert (text, steps) in [(moment[3], moment[4]) for moment in recent], texts(again)
    assert again.dirty and again.undo_label == steps.rsplit("/", 1)[-1]
    assert again.timeline.current.hashes == straight_run(level, by_hand(again), again.tick)
    while again.undo():
        pass
    assert again.editor.text() == dump(Document.load(level).data) and texts(again) == []
    again.close()


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
    labels = [[step.label for step in steps] for steps in (editor._done, editor._undone)]
    return editor.text(), labels, editor.dirty


def test_a_lost_journal_costs_the_edits_and_not_the_run(level, state):
    session = Session.open(level, state_folder=state)
    session.do("paint", [stroke("march", 8, 8, 2)])
    session.step(4)
    crashed(session)
    (file,) = state.glob("*/*.journal")
    file.write_text("nonsense")
    again = Session.recover(leftovers(root=state)[0], state)
    assert again.tick == 4 and "what was done to the level is lost" in texts(again)[0]
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
    assert "mine" in again.library.names() and "mine" in again.names()[1]
    again.restart()
    again.step(5)
    assert "mine" in again.chart.counts and texts(again) == []
    again.close()


def test_who_only_looked_on_is_not_asked(level, state):
    session = Session.open(level, state_folder=state)
    session.step(4)
    crashed(session)
    assert Session.recoverable(level, state) == [] and list(state.iterdir()) == []


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
