"""Files are written whole or not at all, by one program at a time, and what a killed program left is cleared."""

import errno
import os
import signal
import stat
import subprocess
import sys
import textwrap
import types

import pytest
from flockbrush.engine import files
from flockbrush.engine.files import NotWritten, clear_leftovers, hold, holder, whole, work_folder, write_bytes
from flockbrush.engine.locks import FAR, MARKER, Advice, Lock, is_held, is_marked

unix = pytest.mark.skipif(os.name != "posix", reason="kill -9 is of Unix")


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    """A process that has not looked into any folder yet."""
    monkeypatch.setattr(files, "_cleared", set())


def other_process(code, *arguments):
    """A process that runs this code and has said "ready"."""
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(code), *map(str, arguments)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout.readline() == "ready\n"
    return process


def killed(process):
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    process.stdin.close()
    process.stdout.close()


WRITES = """
    import sys
    from flockbrush.engine.files import whole
    with whole(sys.argv[1]) as new:
        new.write_text("half")
        print("ready", flush=True)
        sys.stdin.readline()
        new.write_text("whole")
"""
HOLDS = """
    import sys
    from flockbrush.engine.files import hold
    work = hold(sys.argv[1])
    work.new.write_text("half")
    print("ready", flush=True)
    sys.stdin.readline()
    work.close()
"""


def names(folder):
    return sorted(path.name for path in folder.iterdir())


# whole files -----------------------------------------------------------------------


def test_a_file_appears_whole_and_nothing_is_left_beside_it(tmp_path):
    with whole(tmp_path / "herd.csv") as new:
        new.write_text("a,b\n")
        assert new.suffix == ".csv" and not (tmp_path / "herd.csv").exists()
    assert (tmp_path / "herd.csv").read_text() == "a,b\n" and names(tmp_path) == ["herd.csv"]


def test_when_writing_fails_the_file_before_stays(tmp_path):
    path = write_bytes(tmp_path / "herd.csv", b"before")
    with pytest.raises(KeyboardInterrupt), whole(path) as new:
        new.write_text("half")
        raise KeyboardInterrupt
    assert path.read_bytes() == b"before" and names(tmp_path) == ["herd.csv"]


@pytest.mark.parametrize("call", ["os.fsync", "os.replace"])
def test_a_disk_that_fails_at_the_last_moment_changes_nothing_and_the_error_names_the_file(tmp_path, monkeypatch, call):
    path = write_bytes(tmp_path / "herd.csv", b"before")

    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(call, fail)
    with pytest.raises(NotWritten, match="herd.csv: cannot be written: No space left") as caught:
        write_bytes(path, b"after")
    assert caught.value.filename == str(path) and caught.value.errno == errno.ENOSPC
    monkeypatch.undo()
    assert path.read_bytes() == b"before" and names(tmp_path) == ["herd.csv"]


@pytest.mark.parametrize("name", ["nowhere/herd.csv", "folder"])
def test_an_error_names_the_file_that_was_asked_for(tmp_path, name):
    (tmp_path / "folder").mkdir()
    with pytest.raises(NotWritten) as caught:
        write_bytes(tmp_path / name, b"after")
    assert caught.value.filename == str(tmp_path / name) and names(tmp_path) == ["folder"]


def test_an_error_while_writing_names_the_file_that_was_asked_for(tmp_path):
    with pytest.raises(NotWritten) as caught, whole(tmp_path / "herd.csv") as new:
        raise OSError(errno.ENOSPC, "No space left on device", str(new))
    assert caught.value.filename == str(tmp_path / "herd.csv")


def test_a_name_that_is_taken_is_not_overwritten_when_that_was_not_asked_for(tmp_path):
    path = write_bytes(tmp_path / "herd.csv", b"before", overwrite=False)
    with pytest.raises(NotWritten, match="already exists"):
        write_bytes(path, b"after", overwrite=False)
    assert path.read_bytes() == b"before" and names(tmp_path) == ["herd.csv"]


@unix
def test_a_file_keeps_its_rights_and_a_new_one_has_those_that_are_usual(tmp_path):
    before = os.umask(0o027)
    try:
        path = write_bytes(tmp_path / "herd.csv", b"")
        assert stat.S_IMODE(path.stat().st_mode) == 0o640
        path.chmod(0o604)
        write_bytes(path, b"again")
        assert stat.S_IMODE(path.stat().st_mode) == 0o604
    finally:
        os.umask(before)


@pytest.mark.parametrize("name", ["n" * 251 + ".csv", "鳥" * 84, "lock", "..x", "new.csv"])
def test_every_name_that_the_disk_takes_can_be_written(tmp_path, name):
    with whole(tmp_path / name) as new:
        new.write_text("x")
    work = hold(tmp_path / name)
    work.close()
    assert names(tmp_path) == [name]


# one writer ------------------------------------------------------------------------


@unix
def test_a_second_writer_is_refused_and_told_who_the_first_is(tmp_path):
    path = tmp_path / "run.flock"
    first = other_process(HOLDS, path, "--seed", "3")
    with pytest.raises(NotWritten) as caught:
        hold(path)
    said = f"process {first.pid} on "
    assert caught.value.strerror.startswith(said) and holder(path).startswith(said)
    assert f"(-c {path} --seed 3) has been writing it since 20" in caught.value.strerror
    assert caught.value.filename == str(path)
    first.communicate("go on\n")
    assert holder(path) == ""
    hold(path).close()
    assert names(tmp_path) == []


def test_the_same_program_cannot_write_a_file_twice_either(tmp_path):
    (tmp_path / "x").mkdir()
    work = hold(tmp_path / "run.flock")
    with pytest.raises(NotWritten, match="this program is already writing it"):
        hold(tmp_path / "x" / ".." / "run.flock")
    work.close()
    hold(tmp_path / "run.flock").close()


@unix
def test_a_killed_writer_holds_nothing_and_what_it_wrote_is_cleared(tmp_path):
    path = tmp_path / "run.flock"
    killed(other_process(HOLDS, path))
    assert names(tmp_path) == [".run.flock.flockbrush"] and holder(path) == ""
    work = hold(path)
    assert not work.new.exists()
    work.close()
    assert names(tmp_path) == []


def test_closing_twice_does_not_take_the_next_writers_lock(tmp_path):
    first = hold(tmp_path / "run.flock")
    first.close()
    second = hold(tmp_path / "run.flock")
    first.close()
    assert holder(tmp_path / "run.flock")
    second.close()


@unix
def test_of_many_that_want_the_same_file_one_at_a_time_has_it(tmp_path):
    """Four processes that each hold the file forty times never meet."""
    code = """
        import os, sys, time
        from flockbrush.engine.files import NotWritten, hold
        print("ready", flush=True)
        sys.stdin.readline()
        had = 0
        while had < 40:
            try:
                work = hold(sys.argv[1])
            except NotWritten:
                continue
            os.close(os.open(sys.argv[2], os.O_CREAT | os.O_EXCL | os.O_WRONLY))
            os.unlink(sys.argv[2])
            work.close()
            had += 1
        print(had)
    """
    racing = [other_process(code, tmp_path / "run.flock", tmp_path / "one-at-a-time") for _ in range(4)]
    for process in racing:
        process.stdin.write("go\n")
        process.stdin.flush()
    assert [process.communicate(timeout=60)[0] for process in racing] == ["40\n"] * 4
    assert names(tmp_path) == []


class Windows:
    """The module msvcrt as far as locks go: one byte of a file belongs to one open file."""

    LK_NBLCK = 2

    def __init__(self):
        self.held = {}

    def locking(self, handle, mode, count):
        place = os.fstat(handle).st_ino, os.lseek(handle, 0, os.SEEK_CUR)
        owner = self.held.get(place)
        if owner is not None and owner != handle and _is_open(owner, place[0]):
            raise PermissionError(errno.EACCES, "Permission denied")
        assert (mode, count) == (self.LK_NBLCK, 1)
        self.held[place] = handle


def _is_open(handle, inode):
    try:
        return os.fstat(handle).st_ino == inode
    except OSError:
        return False


def test_where_there_is_no_fcntl_one_writer_at_a_time_is_allowed_too(tmp_path, monkeypatch):
    windows = Windows()
    monkeypatch.setitem(sys.modules, "fcntl", None)
    monkeypatch.setitem(sys.modules, "msvcrt", types.SimpleNamespace(LK_NBLCK=2, locking=windows.locking))
    work = hold(tmp_path / "run.flock")
    assert [place[1] for place in windows.held] == [FAR]  # others can read what the file says
    with pytest.raises(NotWritten, match="this program"):
        hold(tmp_path / "run.flock")
    work.close()
    hold(tmp_path / "run.flock").close()
    assert names(tmp_path) == []


def test_a_disk_without_locks_is_spoken_of_and_written_to(tmp_path, monkeypatch):
    import fcntl

    def none(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", none)
    with pytest.warns(Advice, match="this file system has no locks"):
        write_bytes(tmp_path / "herd.csv", b"x")
    assert names(tmp_path) == ["herd.csv"]


# what is left ----------------------------------------------------------------------


@unix
def test_what_a_killed_program_left_goes_when_the_next_one_writes_there(tmp_path):
    victims = other_process(WRITES, tmp_path / "film.mp4"), other_process(HOLDS, tmp_path / "run.flock")
    for victim in victims:
        killed(victim)
    assert len(names(tmp_path)) == 2
    write_bytes(tmp_path / "other.csv", b"x")
    assert names(tmp_path) == ["other.csv"]


@unix
def test_what_is_being_written_stays(tmp_path):
    writer = other_process(WRITES, tmp_path / "film.mp4")
    keeper = other_process(HOLDS, tmp_path / "run.flock")
    clear_leftovers(tmp_path)
    assert len(names(tmp_path)) == 2
    writer.communicate("go on\n")
    keeper.communicate("go on\n")
    assert names(tmp_path) == ["film.mp4"] and (tmp_path / "film.mp4").read_text() == "whole"


def leftover(folder, marker=MARKER + "\n"):
    folder.mkdir()
    (folder / "lock").write_text(marker)
    (folder / "new.csv").write_text("half")
    return folder


def test_only_what_carries_our_name_and_our_marker_is_removed(tmp_path):
    thesis = tmp_path / "elsewhere"
    thesis.mkdir()
    kept = [
        leftover(tmp_path / "herd.csv.flockbrush"),  # not hidden
        leftover(tmp_path / ".thesis"),
        leftover(tmp_path / ".thesis.flockbrush", "my own lock\n"),
        leftover(tmp_path / ".more.flockbrush", MARKER + "0\n"),
        leftover(thesis / ".real.flockbrush"),
    ]
    (tmp_path / ".link.flockbrush").symlink_to(kept[-1], target_is_directory=True)
    inside = leftover(tmp_path / ".herd.csv.flockbrush")
    (inside / "notes").mkdir()
    (inside / "notes" / "mine.txt").write_text("mine")
    gone = leftover(tmp_path / ".herd.csv.0123abcd.flockbrush")
    clear_leftovers(tmp_path)
    assert not gone.exists() and (inside / "notes" / "mine.txt").read_text() == "mine"
    assert all((folder / "new.csv").read_text() == "half" for folder in kept)
    assert (tmp_path / ".link.flockbrush").is_symlink()


@unix
def test_what_belongs_to_somebody_else_stays(tmp_path, monkeypatch):
    folder = leftover(tmp_path / ".herd.csv.flockbrush")
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    clear_leftovers(tmp_path)
    assert folder.exists()


def test_a_folder_made_by_a_program_that_was_killed_at_once_goes_when_it_is_empty(tmp_path):
    (tmp_path / ".herd.csv.0123abcd.flockbrush").mkdir()
    clear_leftovers(tmp_path)
    assert names(tmp_path) == []


def test_a_lock_file_tells_whether_it_is_ours_and_held(tmp_path):
    lock = Lock(tmp_path / "lock")
    assert is_marked(lock.path) and is_held(lock.path)
    lock.release()
    assert is_marked(lock.path) and not is_held(lock.path) and not is_held(tmp_path / "none")
    (tmp_path / "other").write_text("something else")
    assert not is_marked(tmp_path / "other") and not is_marked(tmp_path) and not is_marked(tmp_path / "none")


@pytest.mark.parametrize("note", ["", "[" * 100_000, '{"process": 3}', "\udcff", '"x"'])
def test_a_lock_file_with_nonsense_in_it_is_no_reason_to_stop(tmp_path, note):
    work = hold(tmp_path / "run.flock")
    lock = work_folder(tmp_path / "run.flock") / "lock"
    lock.write_bytes(f"{MARKER}\n{note}\n".encode(errors="surrogateescape"))
    assert holder(tmp_path / "run.flock") == "another program is writing it"
    work.close()
