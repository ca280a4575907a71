"""People who know nothing: whatever hands do to mouse, keys and window, nothing breaks and nothing is lost."""

import pygame
import pytest
from random_hands import RandomHands
from small_pasture import pasture, verified
from window import Window

from flockbrush.studio.tools import TOOLS

TROUBLES = ("right button", "delete", "escape", "ctrl+z", "another tool", "dialog")


@pytest.fixture(autouse=True)
def at_work(tmp_path, monkeypatch):
    """Pictures and recordings go nowhere else."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pygame.display, "toggle_fullscreen", lambda: None)


@pytest.mark.parametrize(("boundary", "seed"), [("wall", 1), ("wrap", 2)])
def test_random_hands_break_nothing_and_all_they_did_can_be_taken_back_and_replayed(tmp_path, boundary, seed):
    window = RandomHands(pasture(tmp_path, boundary=boundary), seed, size=(640, 480))
    window.act(60)
    assert window.broken == []
    for name in list(window.session.branches):
        window.session.switch(name)
        assert window.session.export_recording(f"{name}.flock")
        verified(tmp_path / f"{name}.flock")
    assert window.not_taken_back() == []
    window.close()


def test_what_comes_between_press_and_release_breaks_nothing(tmp_path):
    window = Window(pasture(tmp_path, script=False), (640, 480))
    for tool in TOOLS:
        for trouble in TROUBLES:
            window.take_tool(tool.name)
            window.press((12, 3))
            window.move((13, 3))
            _make(window, trouble)
            window.move((14, 4))
            window.release((14, 4))
            document = window.session.editor.text()
            window.move((20, 12))
            assert window.session.editor.text() == document, (tool.name, trouble)
    assert [text for text in window.said() if "this failed" in text] == []
    window.close()


def _make(window, trouble):
    if trouble == "right button":
        window.click((13, 3), button=3)
    elif trouble == "another tool":
        window.take_tool("select" if window.tool.name != "select" else "brush")
    elif trouble == "dialog":
        window.ask("?", "Really?", [("Yes", None)])
        window.key("return")
    else:
        window.key(trouble)
