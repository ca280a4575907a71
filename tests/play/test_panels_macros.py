"""Sliders in plain words: each moves several numbers of a brush, live, undone in one step, saved as any tuned brush."""

import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import load_brush, shipped
from small_pasture import pasture
from small_window import SmallWindow

from flockbrush.studio.panels.brush_panel import BrushPanel
from flockbrush.studio.panels.macros import MACROS, macros_of
from flockbrush.studio.panels.panel import palette_of
from flockbrush.studio.panels.tuning import changes, turned, use

MARCH = shipped().get("march")


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


def test_the_numbers_of_a_slider_are_those_of_its_model():
    for model, sliders in MACROS.items():
        for _, ranges in sliders.values():
            for part in ranges:
                fields = behaviours()[model].Params.model_fields if part.table == "params" else {"mean", "deviation"}
                assert part.name in fields


def test_more_order_aligns_more_and_leaves_the_rest_alone():
    one = macro(MARCH, "order")
    more = turned(MARCH, one, min(1.0, one.value(MARCH) + 0.2))
    assert more.params.alignment_weight > MARCH.params.alignment_weight
    assert {knob.name for knob, *_ in changes(more, MARCH)} <= {"alignment_weight", "alignment_radial"}
    assert use(more).source == more.source.decode()


def test_herds_have_six_sliders_and_their_symbols_stand_in_the_tooltip():
    names = [one.name for one in macros_of(MARCH)]
    assert names == ["tightness", "order", "personal space", "nerve", "wander", "pace"]
    assert "cohesion_weight" in macro(MARCH, "tightness").help


def test_a_turned_slider_changes_the_running_herd_and_is_one_step_of_undo(tmp_path):
    window = SmallWindow(pasture(tmp_path), BrushPanel, brush="march")

    def running():
        palette = palette_of(window.session)
        return palette.brushes[palette.named("march")]

    try:
        before, all_numbers = running(), len(window.panel.rows)
        window.click(window.panel.mode)
        assert [row.knob.name for row in window.panel.rows] == [one.name for one in macros_of(before)]
        row = next(row for row in window.panel.rows if row.knob.name == "pace")
        window.drag(row.slider.sliding_button.rect.center, (40, 0))
        assert running().speed.mean > before.speed.mean
        window.session.undo()
        assert running() == before
        window.click(window.panel.mode)
        assert len(window.panel.rows) == all_numbers
    finally:
        window.close()
