"""Charts: what they show, in which formats, and what is said where matplotlib is missing."""

from __future__ import annotations

import builtins
import importlib.util
import xml.etree.ElementTree as ET

import cv2
import numpy as np
import pytest

from flockbrush.output.figures import (
    FORMATS,
    ChartCurve,
    CurveChart,
    Maps,
    ParamRow,
    Rows,
    drawing_problems,
    figure_of,
    pixels_of,
    write_figure,
)
from flockbrush.render.style import THEMES

TIMES = np.arange(12.0)
GAP = np.where((TIMES > 3) & (TIMES != 6) & (TIMES < 9), np.nan, TIMES / 12)
WITH_GAP = CurveChart("share", "time, s", [ChartCurve("clip", TIMES, GAP)], span=(0.0, 1.0), note="of all animals")


def test_a_gap_interrupts_a_curve_and_a_number_alone_is_a_dot():
    (axes,) = figure_of([WITH_GAP]).axes
    line, dots = axes.lines
    np.testing.assert_array_equal(line.get_ydata(), GAP)
    assert dots.get_xdata().tolist() == [6.0] and dots.get_marker() == "o"
    assert axes.get_xlabel() == "time, s" and axes.texts[0].get_text() == "of all animals"
    low, high = axes.get_ylim()
    assert low <= 0.0 and high >= 1.0


def test_an_axis_begins_at_0_where_the_values_come_near_it_and_logarithms_only_where_told():
    def axis(values, **options):
        (axes,) = figure_of([CurveChart("m", "s", [ChartCurve("", TIMES, values)], **options)]).axes
        return *axes.get_ylim(), axes.get_yscale()

    assert axis(5.0 + TIMES)[0] == 0.0
    assert axis(500.0 + TIMES)[0] > 450
    low, high, kind = axis(np.full(12, 7.0))
    assert low < 7.0 < high and kind == "linear"
    assert axis(10.0**TIMES, logarithmic=True)[2] == "log"


def test_words_have_a_row_each_and_errors_lie_along_it():
    curve = ChartCurve("geese", np.arange(2), np.array([0.2, 0.6]), np.array([0.1, 0.1]), marker="o")
    (axes,) = figure_of([CurveChart("share", "", [curve], words=["V", "echelon"])]).axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["V", "echelon"]
    (bars,) = axes.collections
    np.testing.assert_allclose([path[:, 0] for path in bars.get_segments()], [[0.1, 0.3], [0.5, 0.7]])


def test_each_name_stands_once_in_the_legend_of_all_panels():
    figure = figure_of([WITH_GAP, WITH_GAP._replace(title="again")], "Two", columns=2)
    (legend,) = figure.legends
    assert [words.get_text() for words in legend.get_texts()] == ["clip"]


def test_the_heading_is_wrapped_where_the_figure_ends():
    figure = figure_of(
        [WITH_GAP], "Herds", "marks: means over seeds; bars: standard error of the mean\n" + "many words " * 20
    )
    lines = figure.get_suptitle().split("\n")
    assert lines[:3] == ["Herds", "marks: means over seeds; bars: standard error of", "the mean"]
    figure.draw_without_rendering()
    assert figure.get_tightbbox().x1 <= figure.get_size_inches()[0]


def test_a_parameter_lies_where_it_was_found_and_is_grey_where_the_clip_does_not_tell():
    rows = [ParamRow("alignment", 0.3, np.array([0.1])), ParamRow("noise", 0.8, np.array([0.4]), told=False, group="n")]
    (axes,) = figure_of([Rows("Parameters", rows)]).axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["alignment", "noise"]
    found = [line for line in axes.lines if line.get_markersize() == 6]
    assert [line.get_xdata()[0] for line in found] == [0.3, 0.8]
    assert found[0].get_color() != found[1].get_color()


def test_maps_share_one_scale_and_behind_is_below():
    squares = [np.arange(4.0).reshape(2, 2), np.full((2, 2), 9.0)]
    figure = figure_of([Maps("Where", ["clip", "simulation"], squares, 3.0, "per BL²")])
    images = [image for axes in figure.axes[0].child_axes for image in axes.images]
    assert [image.get_clim() for image in images] == [(0.0, 9.0)] * 2
    assert images[0].origin == "lower" and images[0].get_extent() == [-3.0, 3.0, -3.0, 3.0]


@pytest.mark.parametrize("theme", THEMES)
def test_a_chart_without_numbers_says_so_on_the_paper_of_its_theme(theme):
    nothing = ChartCurve("clip", np.arange(3), np.full(3, np.nan))
    figure = figure_of([CurveChart("none", "s", [nothing])], theme=theme)
    assert figure.axes[0].texts[0].get_text() == "no data"
    image = pixels_of(figure)
    assert image.dtype == np.uint8 and tuple(image[0, 0]) == THEMES[theme].paper


@pytest.mark.parametrize("ending", FORMATS)
def test_the_same_figure_gives_the_same_bytes(tmp_path, ending):
    files = [tmp_path / f"{k}{ending}" for k in range(2)]
    for file in files:
        write_figure(file, figure_of([WITH_GAP], "One"))
    first, second = (file.read_bytes() for file in files)
    assert first == second
    if ending == ".png":
        assert cv2.imread(str(files[0])) is not None
    elif ending == ".svg":
        assert ET.fromstring(first).tag.endswith("svg")
    else:
        assert first.startswith(b"%PDF-")


def test_charts_are_refused_before_the_work_where_matplotlib_is_missing(cli, tmp_path, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *rest: None if name == "matplotlib" else find(name, *rest)
    )
    assert 'pip install "flockbrush[report]"' in drawing_problems("a.png")[0].message
    (tmp_path / "a.flock").write_bytes(b"")
    done = cli("measure", tmp_path / "a.flock", "--plot", tmp_path / "a.svg")
    assert done.code != 0 and "charts need matplotlib" in done.err and not (tmp_path / "a.svg").exists()


def test_matplotlib_is_imported_only_to_draw(monkeypatch):
    real = builtins.__import__

    def watched(name, *arguments, **options):
        assert not name.startswith("matplotlib"), "imported before anything is drawn"
        return real(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", watched)
    spec = importlib.util.find_spec("flockbrush.output.figures")
    spec.loader.exec_module(importlib.util.module_from_spec(spec))  # as if for the first time
    assert not drawing_problems("a.png")
    with pytest.raises(AssertionError, match="imported before"):
        figure_of([WITH_GAP])


@pytest.mark.parametrize(("x", "own"), [((0.5, 1.0, 5.0), True), ((0.120692, 0.145771, 0.539296), False)])
def test_chosen_values_are_ticks_and_measured_ones_are_not(x, own):
    import matplotlib.pyplot as plt

    _, axes = plt.subplots()
    CurveChart("speed, m/s", "noise", [ChartCurve("", np.array(x), np.ones(3), marker="o")]).draw(axes, THEMES["light"])
    assert (list(axes.get_xticks()) == list(x)) == own
    plt.close()


def test_what_hardly_changes_is_drawn_from_zero():
    import matplotlib.pyplot as plt

    steady = 0.6 + 1e-9 * np.arange(4.0)
    for y, from_zero in ((steady, True), (steady + [0.0, 0.1, 0.0, 0.1], False)):
        _, axes = plt.subplots()
        chart = CurveChart("spread, m", "time, s", [ChartCurve("", np.arange(4.0), y)])
        chart.draw(axes, THEMES["light"])
        assert (axes.get_ylim()[0] == 0.0) == from_zero
        assert axes.get_ylim()[1] > y.max()
        plt.close()
