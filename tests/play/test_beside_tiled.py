"""The playground beside Tiled: levels come anew when Tiled saves, brushes reach its project, checks are seen."""

import json

import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.levels.tile_pictures import BRUSHES_FILE, known_brushes
from flockbrush.levels.tiled import init
from small_pasture import pasture
from typer.testing import CliRunner
from window import Window

from flockbrush.cli.main import app as cli
from flockbrush.studio import message
from flockbrush.studio.session import Session


@pytest.fixture
def window(tmp_path):
    window = Window(pasture(tmp_path, script=False))
    yield window
    assert window.said("error") == []
    window.close()


def written_by_tiled(path, seed=77):
    """Change the level's seed as another program would."""
    level = json.loads(path.read_text())
    next(p for p in level["properties"] if p["name"] == "seed")["value"] = seed
    path.write_text(json.dumps(level))


def test_a_level_that_tiled_saves_comes_anew_and_goes_on_playing(window):
    window.session.play()
    window.frames(5)
    written_by_tiled(window.session.path)
    window.frames(40)
    assert window.dialog is None
    assert window.session.level.seed == 77 and window.session.playing
    assert any("another program changed the level" in text for text in window.said())
    assert len(window.session.branches) == 2


def test_a_brush_saved_here_gets_its_tile_and_its_name_in_tiled(tmp_path):
    folder = tmp_path / "my herds"
    init(folder, shipped())
    session = Session.open(folder / "first.tmj")
    brush = shipped().get("march").model_copy(update={"name": "my-march"})
    assert session.save_brush(brush)
    project = json.loads((folder / "flockbrush.tiled-project").read_bytes())
    listed = next(t for t in project["propertyTypes"] if t["name"] == "BrushAsset")
    assert "my-march" in listed["values"]
    assert known_brushes(folder / BRUSHES_FILE)[-1] == "my-march"
    assert any("Tiled" in notice.text for notice in session.notices())
    session.close()


def test_the_result_of_a_check_is_shown_in_a_window(tmp_path, monkeypatch):
    seen = []
    monkeypatch.setattr(message, "show_message", lambda *told: seen.append(told))
    good = pasture(tmp_path)
    assert CliRunner().invoke(cli, ["level", "check", str(good)]).exit_code == 0 and seen == []
    assert CliRunner().invoke(cli, ["level", "check", "--window", str(good)]).exit_code == 0
    bad = tmp_path / "bad.tmj"
    bad.write_text("{")
    assert CliRunner().invoke(cli, ["level", "check", "--window", str(bad)]).exit_code != 0
    (title, text, wrong), (other, why, worse) = seen
    assert "No problems" in title and f"{good}: ok" in text and not wrong
    assert "Problems" in other and "bad.tmj" in why and worse


def test_a_long_message_says_how_much_is_missing():
    text = "\n".join("x" * 300 for _ in range(40))
    lines = message.shortened(text).splitlines()
    assert len(lines) == message.MOST_LINES + 1 and max(map(len, lines)) <= message.LONGEST
    assert lines[-1].startswith("and 15 more lines")
    assert message.shortened("one\ntwo") == "one\ntwo"
