"""Tuning: sliders change the living herd, undo brings it back, and what was tuned becomes a brush of its own."""

import datetime

import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import load_brush, shipped
from flockbrush.systems.commands import SetParameter
from small_herd import brush as made
from small_pasture import by_hand, pasture
from small_window import SmallWindow

from flockbrush.studio.panels.brush_panel import BrushPanel
from flockbrush.studio.panels.knobs import CHOICE, NUMBER, SWITCH, WHOLE, knobs_of
from flockbrush.studio.panels.tuning import as_new, changes, command_of, turned, use


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    return pasture(tmp_path_factory.mktemp("tuned"))


def advanced(level, **options):
    """The panel with all parameters of the brush."""
    window = SmallWindow(level, BrushPanel, **options)
    window.click(window.panel.mode)
    return window


@pytest.fixture
def window(level):
    made = advanced(level, brush="march")
    yield made
    made.close()


def running(window, name="march"):
    palette = window.session.palette
    return palette.brushes[palette.named(name)]


def row(window, name):
    return next(row for row in window.panel.rows if row.knob.name == name)


def drag_slider(window, name, by):
    knob = row(window, name).slider.sliding_button
    window.drag(knob.rect.center, (by, 0))


def test_a_drag_is_one_step_of_undo(window):
    before = running(window)
    drag_slider(window, "mean", 60)
    first = running(window).speed.mean
    drag_slider(window, "mean", -30)
    assert running(window).speed.mean != first
    window.session.undo()
    assert running(window).speed.mean == first
    window.session.undo()
    assert running(window) == before
    window.wait()
    assert row(window, "mean").slider.current_value == pytest.approx(
        row(window, "mean").scale.along(before.speed.mean), abs=0.02
    )
    window.session.redo()
    assert running(window).speed.mean == first


def test_a_parameter_of_the_model_is_turned_by_a_command_that_recordings_know(window):
    window.panel.turn(row(window, "avoidance_weight").knob, 0.4, True)
    assert running(window).params.avoidance_weight == 0.4
    assert by_hand(window.session)[-1] == (0, SetParameter("march", "avoidance_weight", 0.4))


def test_a_changed_value_is_shown_against_the_assets(window):
    asset = running(window)
    was = row(window, "avoidance_weight").knob.said(asset.params.avoidance_weight)
    plain = window.picture().copy()
    window.panel.turn(row(window, "avoidance_weight").knob, 0.4, True)
    window.wait()
    assert row(window, "avoidance_weight").shown == (0.4, asset.params.avoidance_weight)
    assert row(window, "avoidance_weight").against() == f"0.40, asset {was}"
    assert row(window, "mean").against() == ""
    assert (window.picture() != plain).any()


def test_one_value_goes_back_by_its_button_and_all_by_drop_changes(window):
    asset = running(window)
    window.panel.turn(row(window, "mean").knob, 3.0, True)
    window.panel.turn(row(window, "avoidance_weight").knob, 0.4, True)
    window.panel.turn(row(window, "deviation").knob, 0.7, True)
    window.click(row(window, "mean").reset)
    assert running(window).speed.mean == asset.speed.mean
    assert row(window, "mean").reset is None
    window.click(window.panel.drop)
    assert running(window) == asset
    assert not window.panel.drop.is_enabled
    window.session.undo()
    assert running(window).params.avoidance_weight == 0.4


def test_typing_a_number_sets_it_and_nonsense_is_answered(window):
    window.click(row(window, "mean").entry)
    row(window, "mean").entry.set_text("")
    window.type("2.5")
    assert running(window).speed.mean == 2.5
    window.click(row(window, "mean").entry)
    row(window, "mean").entry.set_text("")
    window.type("900")
    assert running(window).speed.mean == 2.5
    assert window.said == [("warning", "mean must be from 0 to 100; got 900")]
    assert row(window, "mean").entry.get_text() == "2.50"


def test_what_was_typed_counts_without_enter_once_one_clicks_elsewhere(window):
    window.click(row(window, "mean").entry)
    row(window, "mean").entry.set_text("")
    window.type("1.75", enter=False)
    window.wait()
    assert running(window).speed.mean != 1.75
    window.click(row(window, "deviation").entry)
    window.wait()
    assert running(window).speed.mean == 1.75


def test_a_check_box_and_a_drop_down_turn_switches_and_choices(window):
    window.panel.turn(row(window, "unled").knob, "keep", True)
    assert running(window).params.unled == "keep"
    box = row(window, "occlusion").box
    box.set_state(False)
    window.frames(2)
    assert running(window).vision.occlusion is False
    window.session.undo()
    assert running(window).vision.occlusion is True
    window.wait()
    assert box.is_checked


def test_what_was_tuned_is_saved_as_a_brush_that_says_where_it_is_from(window, level):
    window.panel.turn(row(window, "avoidance_weight").knob, 0.4, True)
    window.panel.turn(row(window, "mean").knob, 2.5, True)
    window.click(window.panel.save)
    title, question, default, answer = window.question
    assert default == "march-2" and "'march'" in question
    answer("shy-march")
    path = level.parent / "brushes" / "shy-march.brush.toml"
    saved = load_brush(path)
    assert (saved.params.avoidance_weight, saved.speed.mean) == (0.4, 2.5)
    assert saved.provenance.kind == "hand-set"
    assert "brush 'march'" in saved.provenance.source
    assert "avoidance weight" in saved.provenance.notes and "-> 0.40" in saved.provenance.notes
    assert window.brush == "shy-march" and window.panel.name == "shy-march"
    assert running(window, "shy-march") == saved
    assert window.session.library.get("shy-march") == saved


@pytest.mark.parametrize("name", ["", "../up", "march", "a b", "x" * 70])
def test_a_name_that_cannot_be_leaves_everything_as_it_is(window, name):
    window.panel.ask_name()
    assert window.question[3](name) is False
    assert window.said[-1][0] == "error"
    assert window.brush == "march"


def test_the_panel_follows_the_brush_in_hand(window):
    window.brush = "swarm"
    window.wait()
    assert window.panel.name == "swarm"
    assert row(window, "mean").shown[0] == running(window, "swarm").speed.mean


def test_animals_of_another_world_are_tuned_after_a_restart(window):
    window.session.restart()
    window.wait()
    drag_slider(window, "mean", 40)
    assert running(window).speed.mean != window.session.library.get("march").speed.mean


# every model, every brush ----------------------------------------------------------------


@pytest.mark.parametrize("model", sorted(behaviours()))
def test_every_model_makes_a_panel(window, model):
    brush = next((b for b in map(shipped().get, shipped().names()) if b.model == model), made("one", model))
    window.session.do("a brush", [use(brush)])
    window.brush = brush.name
    window.wait()
    assert [row.knob.name for row in window.panel.rows] == [knob.name for knob in knobs_of(brush)]
    for shown in window.panel.rows:
        tip = window.tip_of(shown.picture.element)
        assert shown.knob.words in tip
        if shown.knob.kind in (NUMBER, WHOLE):
            assert "Unit: " in tip and "Range: " in tip


@pytest.mark.parametrize("name", shipped().names())
def test_every_knob_of_every_brush_can_be_turned_and_turned_back(name):
    brush = shipped().get(name)
    for knob in knobs_of(brush):
        value = knob.value(brush)
        other = another(knob, value)
        changed = turned(brush, knob, other)
        assert knob.value(changed) == other
        assert [(k.name, now, was) for k, now, was in changes(changed, brush)] == [(knob.name, other, value)]
        assert turned(changed, knob, value) == brush
        command_of(brush, knob, other)


def another(knob, value):
    if knob.kind == SWITCH:
        return not value
    if knob.kind == CHOICE:
        return next(choice for choice in knob.choices if choice != value)
    return knob.high if value != knob.high else knob.low


def test_a_new_brush_of_nothing_changed_says_so():
    brush = shipped().get("march")
    made = as_new(brush, brush, "copy", datetime.date(2026, 11, 21))
    assert "Same parameters" in made.provenance.notes
    assert made.params == brush.params


def test_a_level_that_comes_with_flockbrush_keeps_its_folder_and_says_why():
    window = advanced("meadow", brush="march")
    window.panel.ask_name()
    window.question[3]("shy-march")
    window.frames(2)
    assert "part of Flockbrush or of a recording; first save the level elsewhere" in window.said[-1][1]
    assert window.brush == "march"
    window.close()


def test_a_brush_that_the_level_has_not_yet_is_brought_by_turning_a_knob(window):
    window.brush = "graze"
    window.wait()
    assert "graze" not in window.session.palette.names
    assert window.panel.name == "graze" and "not used here" in window.panel.about.said[0][0]
    window.panel.turn(row(window, "avoidance_weight").knob, 0.5, True)
    assert running(window, "graze").params.avoidance_weight == 0.5
    window.wait()
    assert row(window, "avoidance_weight").against().startswith("0.50, asset ")
    window.session.undo()
    window.wait()
    assert row(window, "avoidance_weight").against() == ""


def test_names_are_counted_on(window):
    assert window.session.free_brush_name("march") == window.session.free_brush_name("march-7") == "march-2"


def test_a_brush_that_nobody_knows_leaves_the_panel_as_it_is(window):
    window.brush = "unheard-of"
    window.wait()
    assert window.panel.name == "march" and window.panel.brush == running(window)
    window.brush = None
    window.wait()
    assert window.panel.name == "march"


def test_what_was_tuned_lasts_into_a_run_that_begins_anew_and_is_still_told_from_the_asset(window):
    window.panel.turn(row(window, "mean").knob, 3.0, True)
    window.session.step(8)
    window.session.restart()
    window.wait()
    assert running(window).speed.mean == 3.0
    assert row(window, "mean").against().startswith("3, asset ")
    window.click(window.panel.drop)
    assert running(window).speed.mean != 3.0


def test_a_learned_brush_says_from_which_clip_it_is_and_how_well_it_kept_to_it():
    from flockbrush.behaviours.brush import shipped

    from flockbrush.studio.brush_palette import whence

    march = shipped().get("march")
    report = {"held-out milling, clip": 0.9, "held-out milling, simulated": 0.85}
    changed = {"kind": "learned", "clip": "a&b.mp4", "frames": (0, 49), "report": report}
    lambs = march.model_copy(update={"provenance": march.provenance.model_copy(update=changed)})
    said = whence(lambs)
    assert said.startswith("learned: a&amp;b.mp4, frames 0 to 49<br>")
    assert "milling 0.90 in frames held out, 0.85 simulated" in said
    assert whence(march).startswith(f"{march.provenance.kind}: ")
