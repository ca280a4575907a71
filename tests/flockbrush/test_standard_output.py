"""Whatever standard output, the disk and the working folder are, a command says in a sentence what is wrong."""

import io
import json
import os
import subprocess
import sys

import pytest
from processes import environment

LINUX = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="only Linux has a device that is always full")


def shell(line, cwd=None, **variables):
    """A line of the shell in which FLOCKBRUSH is the command."""
    line = line.replace("FLOCKBRUSH", f"'{sys.executable}' -m flockbrush")
    return subprocess.run(
        line, shell=True, cwd=cwd, env=environment(**variables), capture_output=True, timeout=300, check=False
    )


@pytest.mark.skipif(os.name != "posix", reason="shells of other systems close nothing")
def test_without_standard_output_a_command_says_so():
    done = shell("FLOCKBRUSH brush list >&-")
    assert (done.returncode, done.stderr) == (1, b"standard output: the stream is closed\n")


@pytest.mark.skipif(os.name != "posix", reason="shells of other systems close nothing")
def test_without_standard_error_nothing_else_goes_to_standard_output(tmp_path):
    done = shell("FLOCKBRUSH brush show nothing 2>&-")
    assert (done.returncode, done.stdout) == (1, b"")


@pytest.mark.skipif(os.name != "posix", reason="shells of other systems close nothing")
def test_a_file_never_becomes_standard_output(tmp_path):
    """The lowest free number of a file is that of standard output, when that is closed."""
    done = shell("FLOCKBRUSH brush preview march --seconds 0 -o a.png >&-", cwd=tmp_path)
    assert done.stderr.endswith(b"standard output: the stream is closed\n")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


@LINUX
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_disk_behind_standard_output_is_named(unbuffered):
    done = shell("FLOCKBRUSH brush list >/dev/full", PYTHONUNBUFFERED=unbuffered)
    assert (done.returncode, done.stderr) == (1, b"standard output: No space left on device\n")


@pytest.fixture
def printed(monkeypatch):
    """``printed("ascii", "brush", "list")``: what standard output of this encoding gets."""
    from flockbrush.cli.main import called
    from flockbrush.runs import streams

    def run(encoding, *words):
        with monkeypatch.context() as patch:
            patch.setenv("COLUMNS", "200")
            patch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding))
            patch.setattr(sys, "__stdout__", sys.stdout)
            streams.prepare()
            assert called(list(words)) == 0
            sys.stdout.flush()
            return sys.stdout.buffer.getvalue().decode(encoding)

    return run


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "latin-1", "utf-8"])
def test_every_encoding_can_be_printed_to(printed, encoding):
    for words in (("brush", "list"), ("brush", "show", "march"), ("--help",), ("level", "list"), ("run", "--help")):
        assert "March" in printed(encoding, *words) or words[-1] != "march"


def test_what_an_encoding_lacks_is_spelled(printed):
    assert "180 degrees" in printed("ascii", "brush", "show", "march")
    assert "(Phi_FV)" in printed("cp1252", "brush", "show", "march") and "180°" in printed(
        "cp1252", "brush", "show", "march"
    )
    assert "(Φ_FV)" in printed("utf-8", "brush", "show", "march")


def test_json_in_ascii_holds_the_same_as_in_unicode(printed):
    plain, whole = (printed(encoding, "brush", "list", "--json") for encoding in ("ascii", "utf-8"))
    assert json.loads(plain) == json.loads(whole)


def test_bytes_of_a_file_name_that_are_no_text_are_spelled():
    stream = io.TextIOWrapper(io.BytesIO(), "utf-8", "flockbrush")
    stream.write(b"a\xff.tmj".decode("utf-8", "surrogateescape"))
    stream.flush()
    assert stream.buffer.getvalue() == b"a\\udcff.tmj"


@pytest.mark.skipif(os.name != "posix", reason="other systems do not let go of a folder that is in use")
@pytest.mark.parametrize("words", ["level check x.tmj", "run meadow --ticks 1 --export a.csv"])
def test_a_working_folder_that_is_gone_is_named(tmp_path, words):
    (tmp_path / "gone").mkdir()
    done = shell(f"rmdir ../gone; FLOCKBRUSH {words}", cwd=tmp_path / "gone")
    assert done.returncode == 1
    assert b"the current folder was deleted; change to another folder" in done.stderr
    assert b"bug" not in done.stderr


@pytest.mark.parametrize("seconds", ["1e308", "1e300", "40000000"])
def test_a_run_that_would_never_end_is_refused(cli, level, seconds):
    done = cli("run", level, "--seconds", seconds)
    assert done.code == 2
    assert "a run can have at most 1,000,000,000 ticks" in " ".join(done.err.split())


@pytest.fixture
def full_disk(tmp_path):
    """A folder on a disk of a few hundred kilobytes, where this user may mount one."""
    folder = tmp_path / "small"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=100k", "none", folder], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("this user may not mount a small disk")
    yield folder
    subprocess.run(["umount", "-l", folder], check=True)


@LINUX
@pytest.mark.parametrize("ending", ["csv", "parquet", "usdc", "usda", "mp4", "png"])
def test_a_full_disk_is_said_of_the_file_that_was_asked_for(cli, level, full_disk, ending):
    pytest.importorskip({"parquet": "pyarrow", "usdc": "pxr", "usda": "pxr"}.get(ending, "numpy"))
    if ending == "png":
        (full_disk / "other").write_bytes(bytes(95_000))
    path = full_disk / f"a.{ending}"
    done = cli("run", level, "--ticks", 300, "--export", path)
    assert done.code == 1
    assert done.err.splitlines()[-1] == f"{path}: cannot be written: No space left on device"
    assert [name for name in os.listdir(full_disk) if name != "other"] == []
