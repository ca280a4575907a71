"""The command line as a whole: help, versions, mistakes, pipes."""

import json
import shutil
import subprocess
import sys

import pytest
from processes import environment, other_process

import flockbrush
from flockbrush import __main__ as entry

HEAVY = ("numba", "numpy", "scipy", "pygame", "cv2", "av", "esper", "pyarrow", "pxr")


def test_help_waits_for_nothing_heavy():
    program = f"""
import sys
from flockbrush.cli.main import called
codes = [called([*words, "--help"]) for words in ([], ["run"], ["level"], ["brush", "preview"])]
print([m for m in {HEAVY!r} if m in sys.modules], codes)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment(), capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[] [0, 0, 0, 0]"


def test_every_command_is_named_in_the_help(cli):
    out = cli("--help").out
    for name in ("demo", "run", "replay", "export", "measure", "bench", "doctor", "level", "brush"):
        assert f" {name} " in out


def test_the_version_is_the_one_of_the_package(cli):
    assert cli("--version").out == f"flockbrush {flockbrush.__version__}\n"


def test_commands_to_type_work_for_paths_with_spaces(cli, level, tmp_path):
    path = tmp_path / "a b.flock"
    out = cli("run", level, "--ticks", 1, "--record", path).out
    assert f"wrote {path}; verify it: flockbrush replay '{path}' --verify" in out.splitlines()
    out = cli("edit", path, "--look", "size=2", "--ids", 1).out
    assert f"; flockbrush export '{path}' applies it." in out


def test_the_module_is_the_command():
    done = other_process("--version")
    assert (done.returncode, done.stdout) == (0, f"flockbrush {flockbrush.__version__}\n")


@pytest.mark.parametrize(
    "words",
    [
        ["ruh"],
        ["run"],
        ["run", "meadow", "--tick", "3"],
        ["run", "meadow", "--ticks", "-1"],
        ["run", "meadow", "--ticks", "3", "--seconds", "1"],
        ["run", "meadow", "--seconds", "nan"],
        ["run", "meadow", "--seconds", "inf"],
        ["run", "meadow", "--seconds", "1e300"],
        ["run", "meadow", "--agents", "0"],
        ["run", "meadow", "--seed", "-4"],
        ["run", "meadow", "--threads", "0"],
        ["run", "meadow", "--theme", "pink"],
        ["demo", "--out", "demo.avi"],
        ["level", "render", "meadow", "-o", "meadow.jpg"],
        ["brush", "preview", "march", "-o", "march"],
    ],
    ids=" ".join,
)
def test_a_wrong_call_is_explained_with_code_2(cli, words):
    done = cli(*words)
    assert done.code == 2
    assert done.out == ""
    assert "Usage" in done.err or "Error" in done.err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["run", "meadwo"], "did you mean 'meadow'?"),
        (["run", "nowhere.tmj"], "nowhere.tmj: there is no such file"),
        (["run", "."], ".: is a folder, not a file"),
        (["run", "meadow", "--agents", "9999999"], "the number of animals must be 1 to 1000000"),
        (["run", "meadow", "--ticks", "1", "--export", "herd.avi"], ".mp4, .nc, .parquet, .png"),
        (["run", "meadow", "--ticks", "1", "--export", "no/such/herd.csv"], "there is no folder 'no/such'"),
        (["run", "meadow", "--ticks", "1", "--record", "no/such/herd"], "there is no folder 'no/such'"),
        (["run", "meadow", "--ticks", "1", "--record", "walk.mp4"], "walk.mp4: would be a recording, not a .mp4 file"),
        (["run", "meadow", "--ticks", "1", "--export", "a.csv", "--export", "a.csv"], "written twice"),
        (["run", "meadow", "--ticks", "1", "--export", "a.mp4", "--fps", "33"], "at most 32"),
        (["run", "meadow", "--ticks", "1", "--export", "a.mp4", "--fps", "nan"], "at most 32"),
        (["replay", "nothing.flock"], "nothing.flock: there is no such file"),
        (["replay", "."], ".: this is a folder, not a recording"),
        (["measure", "nothing.flock"], "there is no such file"),
        (["export", "nothing.flock", "--to", "a.csv"], "there is no such file"),
        (["level", "render", "meadwo", "-o", "a.png"], "did you mean 'meadow'?"),
        (["brush", "show", "marsh"], "did you mean 'march'?"),
        (["brush", "show", "../march"], "there is no"),
        (["brush", "preview", "marsh", "-o", "a.png"], "did you mean 'march'?"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_problem_is_one_line_with_code_1_and_leaves_no_file(cli, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    done = cli(*words)
    assert done.code == 1
    assert done.out == ""
    assert said in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_all_outputs_that_cannot_be_written_are_told_at_once(cli, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = cli("run", "meadow", "--ticks", "1", "--export", "a.txt", "--export", "no/b.csv", "--record", ".")
    told = done.err.strip().splitlines()
    assert [line.split(":")[0] for line in told] == ["a.txt", "no/b.csv", "."]


@pytest.mark.parametrize("content", [b"", b"\0\1\2\3", b"{", b"[1, 2]", b"not a level"], ids=repr)
def test_a_file_that_is_no_level_and_no_recording_is_refused(cli, tmp_path, content):
    path = tmp_path / "odd.tmj"
    path.write_bytes(content)
    for words in (["run", path], ["level", "render", path, "-o", tmp_path / "a.png"], ["replay", path, "--verify"]):
        done = cli(*words)
        assert done.code == 1
        assert done.err.startswith(str(path))
    assert path.read_bytes() == content
    assert [entry.name for entry in tmp_path.iterdir()] == ["odd.tmj"]


def test_writing_over_the_level_that_is_run_is_refused(cli, level):
    before = level.read_bytes()
    done = cli("run", level, "--ticks", "1", "--record", level)
    assert (done.code, level.read_bytes()) == (1, before)
    assert "is also an input file" in done.err


@pytest.mark.parametrize("how", [["--record"], ["--export", "a.csv", "--record"]], ids=" ".join)
def test_writing_over_a_file_that_the_level_reads_is_refused(cli, level, how, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    read = level.parent / "tilesets" / "terrain.tsj"
    before = read.read_bytes()
    done = cli("run", level, "--ticks", "1", *how, read)
    assert (done.code, read.read_bytes()) == (1, before)
    assert done.err == f"{read}: is also an input file; choose another name\n"
    assert list(tmp_path.glob("*")) == [] and not read.with_name(read.name + ".bak").exists()


def test_writing_over_a_picture_of_heights_is_refused(cli, tmp_path):
    from flockbrush.runs.run import find_level

    for name in ("ridge.tmj", "ridge-height.png"):
        shutil.copy(find_level("ridge").with_name(name), tmp_path / name)
    shutil.copytree(find_level("ridge").parent.parent / "tilesets", tmp_path / "tilesets")
    text = (tmp_path / "ridge.tmj").read_text(encoding="utf-8").replace("..\\/tilesets", "tilesets")
    (tmp_path / "ridge.tmj").write_text(text, encoding="utf-8")
    before = (tmp_path / "ridge-height.png").read_bytes()
    assert cli("run", tmp_path / "ridge.tmj", "--ticks", "1", "--record", tmp_path / "a.flock").code == 0
    for words in (
        ["run", tmp_path / "ridge.tmj", "--ticks", "1", "--export"],
        ["export", tmp_path / "a.flock", "--to"],
    ):
        done = cli(*words, tmp_path / "ridge-height.png")
        assert (done.code, (tmp_path / "ridge-height.png").read_bytes()) == (1, before)
        assert "ridge-height.png: is also an input file" in done.err


def test_a_bug_is_said_to_be_one_with_the_way_to_see_more(cli, monkeypatch):
    def broken(*_):
        raise KeyError("weights")

    monkeypatch.setattr("flockbrush.cli.level_commands.list_levels", broken)
    done = cli("level", "list")
    assert done.code == 1
    assert "this is a bug in Flockbrush: KeyError: 'weights'" in done.err
    assert "FLOCKBRUSH_DEBUG=1" in done.err


def test_whoever_wants_a_traceback_gets_it():
    done = other_process("run", "nowhere.tmj", FLOCKBRUSH_DEBUG="1")
    assert done.returncode == 1
    assert "Traceback" in done.stderr
    assert "nowhere.tmj: there is no such file" in done.stderr


@pytest.mark.parametrize("words", ["brush list", "run meadow --ticks 1 --json"])
def test_a_reader_who_leaves_early_breaks_nothing(words):
    command = f"{sys.executable} -m flockbrush {words} | exec true; echo ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", command], env=environment(), capture_output=True, text=True, check=True)
    assert done.stdout.strip() in ("0", "1", "141")
    assert "Traceback" not in done.stderr
    assert "Error" not in done.stderr


def test_what_is_printed_into_a_pipe_has_no_colours():
    done = other_process("brush", "list", NO_COLOR="")
    assert "\x1b" not in done.stdout + done.stderr
    assert "march" in done.stdout


def test_json_on_stdout_is_all_there_is_on_stdout(cli, level):
    done = cli("run", level, "--ticks", "2", "--json")
    assert json.loads(done.out)["ticks"] == 2


def test_paragraphs_of_a_help_are_broken_by_the_terminal_alone():
    from typer.main import get_command

    from flockbrush.cli.main import app

    known = get_command(app).commands
    assert "verified. Every" in known["edit"].help
    assert [name for name, one in known.items() for part in one.help.split("\n\n") if "\n" in part] == []


def test_ctrl_c_while_the_program_is_loaded_ends_it_in_one_word(monkeypatch, capsys):
    class Interrupting:
        def find_spec(self, name, path=None, target=None):
            if name == "flockbrush.cli.main":
                raise KeyboardInterrupt

    monkeypatch.delitem(sys.modules, "flockbrush.cli.main")
    monkeypatch.setattr(sys, "meta_path", [Interrupting(), *sys.meta_path])
    with pytest.raises(SystemExit) as ended:
        entry.main()
    assert ended.value.code == 130 and capsys.readouterr().err == "stopped\n"
