"""Sliders in plain words: each moves several numbers of a brush, live, undone in one step, saved as any tuned brush."""

import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import SpeedSpec, load_brush, shipped
from flockbrush.behaviours.sliders import Range
from small_pasture import pasture
from small_window import SmallWindow

from benchmarks.macros import EFFECTS, FORMATIONS, IN_FORMATION, with_slider
from flockbrush.studio.panels.brush_panel import BrushPanel
from flockbrush.studio.panels.knobs import SENTENCE, knobs_of
from flockbrush.studio.panels.macros import SURE, macros_of, measured_sliders, reaches_goal
from flockbrush.studio.panels.tuning import changes, turned, use

MARCH = shipped().get("march")
MOVES = ("polarization", "milling", "nnd", "group_spread", "largest_part", "speed_mean")


def macro(brush, name):
    return next(one for one in macros_of(brush) if one.name == name)


@pytest.mark.parametrize("name", shipped().names())
def test_every_shipped_brush_goes_from_end_to_end_of_every_slider(name):
    brush = shipped().get(name)
    for one in macros_of(brush):
        for share in (0.0, 0.3, 1.0):
            made = one.turned(brush, share)
            assert one.value(made) == pytest.approx(share, abs=1e-3)
            assert load_brush(made.source, f"{name}.brush.toml") == made


@pytest.mark.parametrize("model", behaviours().values(), ids=lambda model: model.name)
def test_a_model_has_four_to_six_sliders_of_its_own_numbers(model):
    assert 4 <= len(model.Params.sliders) <= 6
    for slider in model.Params.sliders.values():
        for part in slider.ranges:
            fields = (model.Params if part.table == "params" else SpeedSpec).model_fields
            assert part.name in fields


def test_more_order_aligns_more_and_leaves_the_rest_alone():
    one = macro(MARCH, "order")
    more = turned(MARCH, one, min(1.0, one.value(MARCH) + 0.2))
    assert more.params.alignment_weight > MARCH.params.alignment_weight
    assert {knob.name for knob, *_ in changes(more, MARCH)} <= {part.name for part in one.ranges}
    assert use(more).source == more.source.decode()


def test_a_brush_goes_by_its_own_ranges_and_others_by_the_general_rule():
    entry = {"polarization": [0.1, 1.0], "moves": dict.fromkeys(MOVES, 1.0) | {"polarization": 9.0}}
    own = [["params", "alignment_weight", 0.2, 0.7], ["params", "avoidance_weight", 0.9, 0.6]]
    table = {"order": {"march": entry | {"ranges": own}}}
    one = next(one for one in macros_of(MARCH, table) if one.name == "order")
    more = one.turned(MARCH, 1.0)
    assert one.ranges == tuple(Range(*part) for part in own) and one.note == ""
    assert more.params.alignment_weight == 0.7 and more.params.avoidance_weight < MARCH.params.avoidance_weight
    other = next(one for one in macros_of(shipped().get("graze"), table) if one.slider == "order")
    assert other.ranges == MARCH.params.sliders["order"].ranges


def test_a_number_may_go_from_end_to_end_within_a_part_of_the_slider():
    own = [["params", "alignment_weight", 0.0, 1.0], ["params", "wander", 2.0, 0.0, False, 0.25]]
    one = next(one for one in macros_of(MARCH, {"order": {"march": {"ranges": own}}}) if one.slider == "order")
    at = one.value(MARCH)
    turned_to = [one.turned(MARCH, place).params.wander for place in (0.0, at - 0.125, at, 1.0)]
    assert turned_to == pytest.approx([2.0, 1.0, 0.0, 0.0])


def test_what_was_measured_stands_below_a_slider_that_does_less_or_more_and_its_name_goes_by_it():
    def order(course, **moves):
        table = {"order": {"march": {"polarization": course, "moves": dict.fromkeys(MOVES, 0.1) | moves}}}
        one = next(one for one in macros_of(MARCH, table) if one.slider == "order")
        return one.name, one.kind == SENTENCE, one.note

    assert order([0.1, 0.9], polarization=9.0, nnd=2.9) == ("order", False, "")
    also = "also changes speed and spacing"
    assert order([0.1, 0.9], polarization=9.0, nnd=3.1, speed_mean=4.0) == ("alignment", False, also)
    assert order([0.5, 0.9], polarization=9.0) == ("alignment", False, "")
    said = "weak effect: polarization 0.30 to 0.80"
    assert order([0.3, 0.8], polarization=1.0) == ("alignment", True, said)
    assert [one.name for one in macros_of(MARCH, {}) if one.slider == "order"] == ["alignment"]  # nothing measured


@pytest.mark.parametrize("name", shipped().names())
def test_every_shipped_brush_has_four_to_six_sliders_that_act(name):
    brush = shipped().get(name)
    assert 4 <= sum(one.kind != SENTENCE for one in macros_of(brush)) <= 6


def test_what_is_called_order_moves_polarization_three_times_as_far_as_any_other_measure():
    named = {one.name for one in map(shipped().get, shipped().names()) for m in macros_of(one) if m.name == "order"}
    table = measured_sliders()["order"]
    assert len(named) >= 18
    for name in named:
        far, *others = table[name]["moves"].values()
        assert next(iter(table[name]["moves"])) == "polarization" and far >= 3.0 * max(others)
        assert table[name]["ratio"][0] >= 2.95 and max(table[name]["polarization"]) > 0.5 + min(
            table[name]["polarization"]
        )
    # and no herd that reaches it is called less
    assert named == {name for name, entry in table.items() if reaches_goal(entry)}


def test_the_table_has_every_slider_that_has_a_measure_and_what_acts_acts_as_named():
    table = measured_sliders()
    assert set(table["order"]) == set(with_slider("order"))
    for name in shipped().names():
        brush = shipped().get(name)
        named = EFFECTS | (IN_FORMATION if brush.model in FORMATIONS else {})
        for one in macros_of(brush):
            if one.slider in named:
                measure, sign = named[one.slider]
                entry = table[one.slider][name]
                low, _, high = entry[measure]
                assert list(entry["moves"]) == [measure]
                assert one.kind == SENTENCE if entry["moves"][measure] < SURE else sign * (high - low) > 0


def test_own_ranges_of_shipped_brushes_contain_the_brush():
    for slider, brushes in measured_sliders().items():
        for name, entry in brushes.items():
            brush = shipped().get(name)
            one = next(one for one in macros_of(brush) if one.slider == slider)
            own = one.turned(brush, one.value(brush))
            for part in entry.get("ranges", ()):
                numbers = [getattr(getattr(made, part[0]), part[1]) for made in (own, brush)]
                assert numbers[0] == pytest.approx(numbers[1], abs=2e-3)


def test_herds_have_six_sliders_and_their_symbols_stand_in_the_tooltip():
    names = [one.name for one in macros_of(MARCH)]
    assert names == ["tightness", "order", "personal space", "nerve", "wander", "pace"]
    assert "cohesion_weight" in macro(MARCH, "tightness").help


def test_a_turned_slider_changes_the_running_herd_and_is_one_step_of_undo(tmp_path):
    window = SmallWindow(pasture(tmp_path), BrushPanel, brush="march")

    def running():
        palette = window.session.palette
        return palette.brushes[palette.named("march")]

    try:
        before = running()
        assert [row.knob.name for row in window.panel.rows] == [one.name for one in macros_of(before)]
        row = next(row for row in window.panel.rows if row.knob.name == "pace")
        window.drag(row.slider.sliding_button.rect.center, (40, 0))
        assert running().speed.mean > before.speed.mean
        window.session.undo()
        assert running() == before
        window.click(window.panel.mode)
        assert [row.knob.name for row in window.panel.rows] == [one.name for one in knobs_of(before)]
    finally:
        window.close()


def test_a_sentence_stands_where_a_slider_hardly_acts(tmp_path, monkeypatch):
    flat = {"polarization": [0.63, 0.7], "moves": dict.fromkeys(MOVES, 1.0)}
    monkeypatch.setattr("flockbrush.studio.panels.macros.measured_sliders", lambda: {"order": {"march": flat}})
    window = SmallWindow(pasture(tmp_path), BrushPanel, brush="march")
    try:
        rows = {row.knob.name: row for row in window.panel.rows}
        assert not hasattr(rows["alignment"], "slider") and hasattr(rows["pace"], "slider")
        assert [row.top for row in rows.values()] == sorted(row.top for row in rows.values())
    finally:
        window.close()
