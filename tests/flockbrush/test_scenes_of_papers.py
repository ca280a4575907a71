"""The command that judges the papers' scenes runs what it is told to."""

import sys

import numpy as np
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


def test_a_mill_lasts_from_where_it_is_whole_until_it_is_lost():
    never, always = [0.1] * 6, [0.9] * 6
    now_and_then = [0.9, 0.6, 0.4, 0.7, 0.8, 0.9]  # lost after 2 s, formed again after 2 s, then 1 s more
    milling = np.array([never, always, now_and_then]).T
    assert scenes.stays(milling) == ((5 + 2 + 1, 1), (5 + 2, 1))


def test_lifetimes_are_measured_of_all_sizes_of_both_mills_unless_told(monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(scenes, "mills", lambda *told: (asked.append(told), np.full((110, told[2]), 0.9))[1])
    monkeypatch.setattr(sys, "argv", ["scenes.py", "lifetimes", "--seeds", "11:13", "--brush", "mill-hollow"])
    scenes.main()
    assert asked == [("mill-hollow", ducks, 3, 11, 11, 120) for ducks in (30, 50, 70, 100)]
    assert "     30     0       over 327             0         -  1.00" in capsys.readouterr().out
