"""The command that judges the papers' scenes runs what it is told to."""

import sys

import pytest

from benchmarks import scenes


def judged(monkeypatch, *words):
    """The (seed, brush, animals) of lines that the command judges, and nothing else of them."""
    asked = []
    monkeypatch.setattr(scenes, "lines", lambda *told: (asked.append(told), ((1.0,), True))[1])
    monkeypatch.setattr(sys, "argv", ["scenes.py", "lines", *words])
    scenes.main()
    return asked


def test_lines_are_judged_for_the_brush_and_size_told(monkeypatch):
    told = judged(monkeypatch, "--seeds", "3:4", "--brush", "lanes", "--animals", "70")
    assert told == [(3, "lanes", 70), (4, "lanes", 70)]


def test_lines_are_judged_at_every_size_unless_told(monkeypatch):
    told = judged(monkeypatch, "--seeds", "3")
    assert told == [(3, brush, animals) for animals in (50, 200, 800) for brush in ("front", "lanes")]


def test_a_brush_of_no_lines_is_refused(monkeypatch, capsys):
    with pytest.raises(SystemExit):
        judged(monkeypatch, "--brush", "mill-filled")
    assert "lines has only front and lanes" in capsys.readouterr().err
