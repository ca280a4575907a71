"""The folders of sessions: what is ours, what goes to the trash, and what is never touched."""

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
from crashed_session import crashed, sessions, thrown_away
from flockbrush.engine.recording import RecordingError
from flockbrush.levels.level_writer import Document, dump
from flockbrush.systems.commands import SetParameter
from small_pasture import by_hand, pasture, straight_run, stroke, texts

from flockbrush.cli.main import called
from flockbrush.studio import session_folders
from flockbrush.studio.recovery import leftovers
from flockbrush.studio.session import Session
from flockbrush.studio.session_folders import state_folder

HOUSE = Path(__file__).parents[2]


def crashed_with_work(level, state):
    """The folder of a session that crashed with something unsaved in it."""
    session = Session.open(level, state_folder=state)
    session.do("paint", [stroke("march", 8, 8, 2)])
    session.step(2)
    crashed(session)
    return session._recovery.folder


def test_a_level_that_was_opened_by_a_relative_path_is_recovered(level, state, monkeypatch):
    monkeypatch.chdir(level.parent)
    folder = crashed_with_work(Path(level.name), state)
    monkeypatch.chdir(state)
    (left,) = leftovers(level, state)
    assert left.folder == folder and left.unsaved and left.level == level


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
    folder = session._recovery.folder
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
    assert "your changes are not protected against a crash" in texts(session)[0]
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
        session.catch_up(now - last, 0.01)
        session.set_off(0.01)
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
        steps = "/".join(step.label for step in session.editor.done)
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
    steps = "/".join(step.label for step in again.editor.done)
    recent = told[len(early) - 1 :]
    assert (text, steps) in [(moment[3], moment[4]) for moment in recent], texts(again)
    assert again.dirty and again.undo_label == steps.rsplit("/", 1)[-1]
    assert again.timeline.current.hashes == straight_run(level, by_hand(again), again.tick)
    while again.undo():
        pass
    assert again.editor.text() == dump(Document.load(level).data) and texts(again) == []
    again.close()


def test_a_brush_that_was_changed_is_offered_though_the_level_was_saved_after_it(level, state):
    session = Session.open(level, state_folder=state)
    session.do("paint", [stroke("march", 8, 8, 2)])
    assert session.do("tune", [SetParameter("march", "max_turn", 1.25)]) and session.save()
    assert session.close(keep=True)
    (left,) = leftovers(level, state)
    assert left.unsaved and left.brushes == ("march",)
    (offered,) = Session.recoverable(level, state)
    assert offered == left
    left.discard()
