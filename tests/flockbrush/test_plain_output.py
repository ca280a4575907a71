"""What comes out of files and names cannot command a terminal, nor pass for a line of ours."""

import ast
import io
import json
import os
import re
from pathlib import Path

import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.engine.plain_text import one_line, plain, plain_json
from pens import pen

from flockbrush.runs import terminal

HOUSE = Path(__file__).parents[2]
EVIL = "ev\x1b]0;owned\x07il \x1b[8mhidden\x9b31m\u202egnp.x\u2066"
SPELLED = r"ev\x1b]0;owned\x07il \x1b[8mhidden\x9b31m\u202egnp.x\u2066"
CONTROLS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")
unix = pytest.mark.skipif(os.name != "posix", reason="no such names on Windows")


def harmless(done):
    """Whether nothing in the output of a command is a control character."""
    return CONTROLS.search(done.out + done.err) is None


def test_control_characters_are_spelled_and_all_letters_stay():
    assert plain(EVIL) == SPELLED
    assert plain("Gänse über Öland\n\t日本 – é ‍ ±") == "Gänse über Öland\n\t日本 – é ‍ ±"
    assert one_line("a\nmeadow.tmj: ok\t!") == r"a\nmeadow.tmj: ok\t!"
    for code in range(0x110000):
        text = plain(chr(code))
        assert CONTROLS.search(text) is None
        assert text == chr(code) or text.startswith("\\")


def test_json_stays_the_same_data():
    data = {"name": EVIL, "path": 'a\\b"c', "letters": "äöü 鳥"}
    text = plain_json(json.dumps(data, ensure_ascii=False))
    assert json.loads(text) == data and CONTROLS.search(text) is None and "äöü 鳥" in text


@unix
@pytest.mark.parametrize(
    "words",
    [
        ("run", "{}.tmj"),
        ("run", "meadow", "--ticks", "{}"),
        ("run", "meadow", "--ticks", "1", "--export", "{}.csv", "--export", "{}.csv"),
        ("replay", "{}"),
        ("level", "check", "{}.tmj", "{}\nmeadow.tmj: ok"),
        ("brush", "show", "{}.brush.toml"),
        ("brush", "show", "{}"),
        ("sweep", "{}"),
        ("formation", "detect", "{}.png", "--out", "a.csv"),
        ("learn", "{}.mp4", "--out", "a.brush.toml"),
        ("play", "{}.csv"),
        ("{}",),
    ],
    ids=" ".join,
)
def test_a_name_of_a_file_in_a_mistake_is_harmless(cli, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    done = cli(*(word.format(EVIL) for word in words))
    assert done.code in (1, 2) and harmless(done)


@unix
def test_a_name_with_a_line_feed_is_one_line(cli, tmp_path):
    done = cli("level", "check", tmp_path / "x.tmj: ok\nmeadow.tmj")
    assert done.code == 1 and len(done.out.splitlines()) == 1 and r"ok\nmeadow.tmj: there is no such file" in done.out


@unix
def test_names_of_levels_recordings_and_outputs_in_results_are_harmless(cli, tmp_path):
    level = pen(tmp_path, name=f"[red]{EVIL}[zz]")
    recording, table = tmp_path / f"{EVIL}.flock", tmp_path / f"{EVIL}.csv"
    done = cli("run", level, "--ticks", 2, "--record", recording, "--export", table)
    assert done.code == 0 and harmless(done), done.err
    assert f"[red]{SPELLED}[zz]: 24" in done.out
    assert f"wrote {tmp_path}/{SPELLED}.csv" in done.out
    for words in (("replay", recording, "--verify"), ("level", "check", level), ("measure", recording)):
        done = cli(*words)
        assert done.code == 0 and harmless(done), done.err
    done = cli("run", level, "--ticks", 2, "--json")
    assert harmless(done) and json.loads(done.out)["level"] == f"[red]{EVIL}[zz]"


def test_versions_in_the_header_of_a_recording_are_harmless(cli, tmp_path):
    from flockbrush.engine.recording import Recording, open_recording

    assert cli("run", pen(tmp_path), "--ticks", 2, "--record", tmp_path / "a.flock").code == 0
    run = open_recording(tmp_path / "a.flock")
    names = ("format", "packages", "assets")
    header = {name: value for name, value in run.header.items() if name not in names}
    monkeyed = {"esper": EVIL, EVIL: "1"}
    import flockbrush.engine.recording as recording

    before, recording.package_versions = recording.package_versions, lambda: monkeyed
    try:
        with Recording.create(tmp_path / "b.flock", header, run.assets) as copy:
            for tick, digest in run.hashes.items():
                copy.hash(tick, digest)
    finally:
        recording.package_versions = before
    done = cli("replay", tmp_path / "b.flock", "--verify")
    assert "owned" in done.err + done.out and harmless(done)


def test_words_of_a_brush_are_harmless_and_no_markup(cli, tmp_path):
    text = brush_to_toml(shipped().get("march").model_copy(update={"name": "x", "title": "[bold]T[/bold] [/nothing]"}))
    (tmp_path / "x.brush.toml").write_text(text)
    done = cli("brush", "show", tmp_path / "x.brush.toml")
    assert done.code == 0 and "[bold]T[/bold] [/nothing]" in done.out
    (tmp_path / "y.brush.toml").write_text(text.replace('"x"', '"y"').replace("[bold]", "\\u001b[8m"))
    done = cli("brush", "check", tmp_path / "y.brush.toml")
    assert done.code == 1 and harmless(done)


def test_tables_and_texts_are_no_markup(capsys):
    made = terminal.table("[red]a[/red]", "b", title="[/x] :smile:")
    made.add_row("[bold]1[/bold]", terminal.styled("[bold]{}[/]", "[2]"))
    terminal.show(made)
    terminal.show("[/x]")
    said = capsys.readouterr().out
    assert all(text in said for text in ("[red]a[/red]", "[/x] :smile:", "[bold]1[/bold]", "[2]"))
    assert "[bold][2]" not in said


def test_a_progress_bar_shows_a_name_as_it_is(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    screen = Terminal()
    monkeypatch.setattr(terminal.sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with terminal.progress(f"[/x]{EVIL}", 3) as bar:
        bar(1, f"[/y]{EVIL}")
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", screen.getvalue())
    assert "[/x]ev" in text and "\x07" not in text and "\x9b" not in text


def prints(path):
    """Lines of a file that print around `terminal`."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return [call.lineno for call in calls if ast.unparse(call.func) in ("print", "sys.stdout.write", "typer.echo")]


@pytest.mark.parametrize("path", sorted((HOUSE / "flockbrush").rglob("*.py")), ids=lambda path: path.name)
def test_results_are_printed_by_one_file(path):
    assert prints(path) == [] or path.name == "terminal.py"
