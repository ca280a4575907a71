"""Sessions that end badly: what a crash leaves is found, and one goes on from there."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.engine.recording import RecordingError
from flockbrush.engine.state import state_hash
from flockbrush.levels.writer import Document, dump
from flockbrush.systems.commands import AddAnimals, AddObstacle
from flockbrush.systems.undo import UseBrush
from small_pasture import by_hand, pasture, straight_run, stroke, verified

from flockbrush.cli.main import called
from flockbrush.studio import session_folders
from flockbrush.studio.recovery import leftovers
from flockbrush.studio.session import Session
from flockbrush.studio.session_folders import state_folder

HOUSE = Path(__file__).parents[2]


@pytest.fixture
def level(tmp_path):
    return pasture(tmp_path / "levels")


@pytest.fixture
def state(tmp_path):
    return tmp_path / "state"


def crashed(session):
    """End a session as a crash does: the operating system has what was handed to it, and the locks are free."""
    session.timeline.flush()
    session._shelter._lock.release()
    for branch in session.branches.values():
        branch.scribe.recording._work._lock.release()
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


# folders ---------------------------------------------------------------------------


def sessions(state):
    """Names of the folders of sessions that run or that a crash left."""
    return [folder.name for folder in state.iterdir() if folder.name not in ("trash", "damaged")]


def thrown_away(state):
    """Folders in the trash."""
    return sorted((state / "trash").iterdir()) if (state / "trash").exists() else []


def crashed_with_work(level, state):
    """The folder of a session that crashed with something unsaved in it."""
    session = Session.open(level, state_folder=state)
    session.do("paint", [stroke("march", 8, 8, 2)])
    session.step(2)
    crashed(session)
    return session._shelter.folder


def aged(folder, seconds=1.0):
    """Make a folder and all in it as old as can be."""
    for path in [*folder.rglob("*"), folder]:
        if not path.is_symlink():
            os.utime(path, (seconds, seconds))


def test_folders_of_others_are_left_alone_however_they_are_called(level, state):
    thesis = state / "thesis"
    photos = state / "photos-2024-12"
    diary = state / "diary-2024-11"
    for folder in (thesis, photos, diary):
        folder.mkdir(parents=True)
        (folder / "chapter.md").write_text("three years of work")
    (photos / "session.json").write_text('{"camera": "mine"}')
    (diary / "lock").write_text("someone else's")
    (diary / "session.json").write_text("[[[")
    (state / "a-file").write_text("hello")
    elsewhere = state.parent / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "lock").write_text("flockbrush lock 1\n")
    (state / "linked-1-1").symlink_to(elsewhere, target_is_directory=True)
    for folder in (thesis, photos, diary, elsewhere):
        aged(folder)
    told = []
    assert leftovers(root=state, tell=told.append) == [] and Session.recoverable(level, state) == [] and told == []
    assert all((folder / "chapter.md").read_text() == "three years of work" for folder in (thesis, photos, diary))
    assert len(list(state.iterdir())) == 5 and (elsewhere / "lock").exists()


def test_a_folder_that_one_names_for_sessions_keeps_what_is_in_it(level, state, monkeypatch):
    (state / "thesis").mkdir(parents=True)
    (state / "thesis" / "chapter.md").write_text("three years of work")
    aged(state / "thesis")
    monkeypatch.setenv("FLOCKBRUSH_STATE", str(state))
    Session.recoverable(level)
    session = Session.open(level)
    assert [path.name for path in (state / "flockbrush" / "sessions").iterdir()] == [f"pasture-{os.getpid()}-1"]
    session.close()
    assert (state / "thesis" / "chapter.md").exists()


def test_unsaved_work_is_never_removed_unasked_however_old(level, state):
    folder = crashed_with_work(level, state)
    aged(folder)
    other = pasture(state.parent / "others")
    assert Session.recoverable(other, state) == [] and folder.exists()
    (left,) = Session.recoverable(level, state)
    assert left.folder == folder and "1970" not in str(left)
    again = Session.recover(left, state)
    assert again.tick == 2 and again.dirty
    again.close()


def test_what_is_discarded_goes_to_the_trash_and_after_thirty_days_it_is_gone(level, state):
    crashed_with_work(level, state)
    (left,) = Session.recoverable(level, state)
    left.discard()
    assert sessions(state) == [] and Session.recoverable(level, state) == []
    (gone,) = thrown_away(state)
    assert {"pasture.journal", "pasture.flock", "session.json"} <= {path.name for path in gone.iterdir()}
    (gone / "mine.txt").write_text("put here by hand")
    now = time.time()
    os.utime(gone, (now - 29 * 86400, now - 29 * 86400))
    leftovers(root=state)
    assert len(list(gone.iterdir())) >= 4
    os.utime(gone, (now - 31 * 86400, now - 31 * 86400))
    leftovers(root=state)
    assert [path.name for path in gone.iterdir()] == ["mine.txt"]


def test_a_trash_that_is_too_large_loses_its_oldest_first(level, state, monkeypatch):
    for _ in range(3):
        crashed_with_work(level, state)
    for left in leftovers(root=state):
        left.discard()
    folders = thrown_away(state)
    now = time.time()
    for age, folder in enumerate(folders):
        os.utime(folder, (now - age, now - age))
    each = max(sum(path.stat().st_size for path in folder.iterdir()) for folder in folders)
    monkeypatch.setattr(session_folders, "LARGEST_TRASH", 2.5 * each)
    leftovers(root=state)
    assert thrown_away(state) == folders[:2]


def test_work_that_one_does_not_want_to_save_goes_to_the_trash(level, state):
    session = Session.open(level, state_folder=state)
    session.do("paint", [stroke("march", 8, 8, 2)])
    session.close()
    assert sessions(state) == [] and len(thrown_away(state)) == 1


def test_what_was_recovered_is_in_the_trash_too(level, state):
    folder = crashed_with_work(level, state)
    Session.recover(leftovers(root=state)[0], state).close(keep=True)
    assert [path.name for path in thrown_away(state)] == [folder.name]


def test_files_that_one_puts_into_the_folder_of_a_session_stay(level, state):
    session = Session.open(level, state_folder=state)
    folder = session._shelter.folder
    (folder / "notes.txt").write_text("mine")
    session.close()
    assert [path.name for path in folder.iterdir()] == ["notes.txt"]


def test_a_session_of_an_earlier_version_is_offered_and_discarded_when_asked(level, state):
    folder = crashed_with_work(level, state)
    (folder / "lock").write_bytes(b"")  # as it was
    (left,) = leftovers(level, state)
    assert left.unsaved and folder.exists()
    left.discard()
    assert not folder.exists() and len(thrown_away(state)) == 1


def test_sessions_come_back_after_their_folder_was_moved(level, state, tmp_path):
    crashed_with_work(level, state)
    state.rename(tmp_path / "moved")
    (left,) = Session.recoverable(level, tmp_path / "moved")
    again = Session.recover(left, tmp_path / "moved")
    assert again.tick == 2 and again.dirty
    again.close()


NOTES = {
    "empty": b"", "cut off": b'{"level": 3', "no table": b"[]", "deep": b"[" * 100_000, "bytes": b"\xff\xfe\x00",
    "numbers": b'{"level": 3, "current": "a", "branches": {}}',
    "lists": b'{"level": "a", "current": "a", "branches": []}',
    "files": b'{"level": "a", "current": "a", "branches": {"a": {"recording": 1, "journal": true}}}',
    "a large number": b'{"level": "a", "current": "a", "branches": {"a": {"recording": null, "journal": null, "left": '
    + b"9" * 5000 + b"}}}",
}  # fmt: skip


@pytest.mark.parametrize("text", NOTES.values(), ids=NOTES)
def test_a_damaged_note_is_set_aside_and_said_and_one_goes_on(level, state, text):
    folder = crashed_with_work(level, state)
    (folder / "session.json").write_bytes(text)
    kept = crashed_with_work(level, state)
    told = []
    found = Session.recoverable(level, state, told.append)
    assert [left.folder for left in found] == [kept]
    aside = state / "damaged" / folder.name
    assert len(told) == 1 and told[0].startswith(f"{folder / 'session.json'} is damaged") and str(aside) in told[0]
    assert {"pasture.journal", "pasture.flock", "session.json"} <= {path.name for path in aside.iterdir()}
    assert called(["replay", str(aside / "pasture.flock")]) == 0
    assert len(Session.recoverable(level, state, told.append)) == 1 and len(told) == 1
    aged(state / "damaged")
    leftovers(root=state)
    assert aside.exists()


@pytest.mark.parametrize("paths", ['"\\u0000"', '"/dev/zero"', '"x"', "null"])
def test_a_note_with_odd_places_in_it_is_no_reason_to_stop(level, state, paths):
    folder = crashed_with_work(level, state)
    files = '{"recording": PATHS, "journal": null}'.replace("PATHS", paths)
    note = f'{{"level": {json.dumps(str(level))}, "current": "a", "branches": {{"a": {files}}}}}'
    (folder / "session.json").write_text(note)
    told = []
    for left in Session.recoverable(level, state, told.append):
        with pytest.raises(RecordingError):
            Session.recover(left, state)
    assert folder.exists() or (state / "damaged" / folder.name).exists()  # what was done is still there


def test_a_session_whose_note_was_never_written_keeps_its_edits(level, state):
    folder = crashed_with_work(level, state)
    (folder / "session.json").unlink()
    told = []
    assert Session.recoverable(level, state, told.append) == []
    assert "session.json is missing" in told[0] and (state / "damaged" / folder.name / "pasture.journal").exists()


def test_a_folder_of_sessions_that_cannot_be_read_is_said(level, state, monkeypatch):
    state.mkdir()

    def refuse(path):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "scandir", refuse)
    told = []
    assert Session.recoverable(level, state, told.append) == [] and "Permission denied" in told[0]


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
    assert state_folder() == tmp_path / "own" / "flockbrush" / "sessions"


VICTIM = """
    import hashlib, sys, time
    from flockbrush.studio.session import Session
    from flockbrush.systems.commands import AddAnimals
    from flockbrush.systems.edits import Paint

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
        f"{tmp_path / 'home'} has sessions of an early version ({now.name}); to recover them, move them to"
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
