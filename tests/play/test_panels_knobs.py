"""Knobs: every number, switch and choice of any model, found in its Params and nowhere else."""

from typing import Literal

import pytest
from flockbrush.behaviours.behaviour import Parameters, behaviours, quantity
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.validation import bounds
from pydantic import Field

from flockbrush.studio.panels.knobs import CHOICE, NUMBER, SWITCH, WHOLE, Scale, knob_of, knobs_of, written

BRUSHES = shipped().names()


class HoppingParams(Parameters):
    """Of a model that nobody has written yet."""

    leap: float = quantity(2.0, "m", "larger jumps farther", 0, 8)
    legs: int = Field(4, ge=1, le=12, description="how many feet", json_schema_extra={"unit": "feet"})
    shy: bool = Field(True, description="whether it hides")
    song: Literal["low", "high"] = Field("low", description="how it calls")
    weight: float = Field(3.0, description="without bounds", json_schema_extra={"unit": "kg"})
    names: tuple[str, ...] = ()


def knob(name, value=None):
    return knob_of("params", name, HoppingParams.model_fields[name], value)


def test_each_type_has_its_kind_of_knob():
    kinds = {name: knob(name).kind for name in HoppingParams.model_fields if knob(name)}
    assert kinds == {"leap": NUMBER, "legs": WHOLE, "shy": SWITCH, "song": CHOICE, "weight": NUMBER}


def test_a_knob_has_the_models_bounds_unit_and_help():
    leap = knob("leap")
    assert (leap.low, leap.high, leap.hard, leap.unit) == (0, 8, True, "m")
    assert leap.help == "Larger jumps farther. Unit: m. Range: from 0 to 8 m."
    assert knob("song").choices == ("low", "high")


def test_a_knob_without_bounds_reaches_beyond_its_value_and_takes_more_by_hand():
    weight = knob("weight", 3.0)
    assert weight.low == 0 and weight.high == 12 and not weight.hard
    assert weight.read("400") == 400


@pytest.mark.parametrize("name", sorted(behaviours()))
def test_every_number_of_every_model_is_a_knob_with_unit_and_range(name):
    fields = behaviours()[name].Params.model_fields
    for field_name, field in fields.items():
        knob = knob_of("params", field_name, field, field.default)
        assert knob is not None, f"{field_name} cannot be turned"
        if knob.kind in (NUMBER, WHOLE):
            assert f"Unit: {knob.unit or 'none'}" in knob.help
            assert "Range: " in knob.help
            assert knob.low <= field.default <= knob.high
            assert bounds(field).least in (None, knob.low) and bounds(field).most in (None, knob.high)


@pytest.mark.parametrize("name", BRUSHES)
def test_a_brush_has_knobs_for_speed_behaviour_and_sight(name):
    brush = shipped().get(name)
    names = [(knob.table, knob.name) for knob in knobs_of(brush)]
    assert names[:2] == [("speed", "mean"), ("speed", "deviation")]
    assert {("params", field) for field in type(brush.params).model_fields} <= set(names)
    assert ("vision", "occlusion") in names


@pytest.mark.parametrize("name", BRUSHES)
def test_the_assets_value_lies_well_inside_the_slider_and_comes_back_from_it(name):
    brush = shipped().get(name)
    for knob in knobs_of(brush):
        if knob.kind not in (NUMBER, WHOLE):
            continue
        value = knob.value(brush)
        scale = Scale.of(knob, value)
        along = scale.along(value)
        if knob.low + (knob.high - knob.low) / 1000 < value < knob.high:
            assert 0.05 < along <= 1, f"{knob.name}: {value} of {knob.low} to {knob.high} at {along}"
        assert scale.value(along) == pytest.approx(value, rel=0.05, abs=0.01 * (knob.high - knob.low))


def test_a_slider_reaches_both_ends_and_stays_between_them():
    scale = Scale.of(knob("leap"), 0.01)
    assert scale.bend > 1
    assert (scale.value(0), scale.value(1), scale.value(-3), scale.value(7)) == (0, 8, 0, 8)
    values = [scale.value(k / 200) for k in range(201)]
    assert values == sorted(values)


def test_a_whole_number_stays_whole():
    scale = Scale.of(knob("legs"), 4)
    assert {type(scale.value(k / 50)) for k in range(51)} == {int}
    assert knob("legs").read(" 6 ") == 6
    with pytest.raises(ValueError, match="legs must be a whole number"):
        knob("legs").read("2.5")


@pytest.mark.parametrize("text", ["", "much", "nan", "1e999", "9", "-1"])
def test_what_cannot_be_is_refused_in_words(text):
    with pytest.raises(ValueError, match="leap"):
        knob("leap").read(text)


def test_numbers_are_written_briefly():
    assert [written(n) for n in (0.4, 0.25, 12.5, 1000.0, 0.015, 0.0, 3.14159, 7)] == [
        "0.40", "0.25", "12.50", "1000", "0.015", "0.00", "3.142", "7",
    ]  # fmt: skip


def test_a_comma_is_a_point():
    assert knob("leap").read("2,5") == 2.5
