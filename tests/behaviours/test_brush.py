"""Brushes: what they say, what is refused, and that nothing is lost on the way to a file and back."""

import datetime
import hashlib
import re
from types import SimpleNamespace

import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import SUFFIX, Brush, SpeedSpec, load_brush, save_brush
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.behaviours.validation import bounds
from flockbrush.engine.files import write_bytes
from flockbrush.engine.problems import ProblemsError
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from small_brush import GOOD, HERD, line, quick, replaced, text


def read(text, file="meadow.brush.toml"):
    return load_brush(text.encode() if isinstance(text, str) else text, file)


def complaints(text, file="f.brush.toml"):
    with pytest.raises(ProblemsError) as error:
        read(text, file)
    return [str(problem) for problem in error.value.problems]


# what a brush says


def test_a_brush_has_the_name_of_its_file():
    assert read(GOOD, "some/where/meadow.brush.toml").name == "meadow"
    assert read(GOOD, "C:\\herds\\meadow.brush.toml").name == "meadow"


def test_a_brush_says_model_parameters_and_speed():
    brush = read(GOOD)
    assert brush.model == "herd"
    assert brush.params == HERD(avoidance_weight=0.5, unled="keep")
    assert brush.parameters["avoidance_weight"] == 0.5
    assert brush.speed == SpeedSpec(mean=2.0)
    assert brush.provenance.date == datetime.date(2026, 11, 21)


def test_whole_numbers_will_do_where_fractions_are_meant():
    speed = read(GOOD).speed.mean
    assert speed == 2 and isinstance(speed, float)


def test_a_brush_does_not_change_under_the_hand():
    brush = read(GOOD)
    with pytest.raises(ValidationError):
        brush.colour = "#000000"
    with pytest.raises(ValidationError):
        brush.params.avoidance_weight = 0.1


def test_the_hash_is_that_of_the_file():
    assert read(GOOD).sha256 == hashlib.sha256(GOOD.encode()).hexdigest()
    assert read(GOOD).source == GOOD.encode()


def test_a_comment_changes_the_file_but_not_the_brush():
    remarked = read(GOOD + "# a remark\n")
    assert remarked == read(GOOD) and hash(remarked) == hash(read(GOOD))
    assert remarked.sha256 != read(GOOD).sha256


def test_a_changed_brush_forgets_the_file_it_came_from():
    brush = read(GOOD)
    changed = brush.with_parameters(avoidance_weight=0.25)
    assert changed != brush and changed.params.avoidance_weight == 0.25
    assert read(changed.source) == changed
    assert brush.model_copy().sha256 == brush.sha256


def test_a_changed_brush_keeps_to_the_bounds():
    with pytest.raises(ProblemsError) as error:
        read(GOOD).with_parameters(avoidance_weight=2, avoidence_radial=1)
    assert str(error.value).splitlines() == [
        "meadow: parameters.avoidence_radial: unknown name; did you mean 'avoidance_radial'?",
        "meadow: parameters.avoidance_weight: must be from 0 to 1, got 2",
    ]


def test_a_slider_may_set_a_whole_number():
    assert read(GOOD).with_parameters(leader_neighbours=3.0).parameters["leader_neighbours"] == 3
    with pytest.raises(ProblemsError, match="leader_neighbours: must be a whole number, got 2.5"):
        read(GOOD).with_parameters(leader_neighbours=2.5)


def test_a_brush_can_be_made_in_python():
    brush = Brush(
        name="mine", model="herd", parameters={"cohesion_weight": 1}, speed=SpeedSpec(mean=1), provenance=HAND
    )
    assert brush.params == HERD(cohesion_weight=1)
    with pytest.raises(ValidationError, match="there is no model 'heard'; did you mean 'herd'"):
        Brush(name="mine", model="heard", parameters={}, speed=SpeedSpec(mean=1), provenance=HAND)


HAND = read(GOOD).provenance


# what is refused


def test_everything_wrong_with_a_file_is_said_at_once_with_its_line():
    text = """\
schema = "flockbrush.brush/1"
model = "herd"
colour = "red"
[parameters]
avoidence_weight = 0.5
cohesion_weight = 1.4
"obstacle_weight" = true
unled = "stay"
leader_neighbours = 2.0
max_turn = "10 rad/s"
sensitivity = nan
transition = 3
[speed]
mean = "fast"
deviation = -inf
by_density = [[0.0, 1.0],
  [0.5, 30.0]]
[body]
radius = 0.7
[vison]
range = 3
[provenance]
kind = "guess"
date = "2026"
source = ""
"""
    assert complaints(text) == [
        "f.brush.toml:3: colour: must look like #c9a24b, got 'red'",
        "f.brush.toml:5: parameters.avoidence_weight: unknown name; did you mean 'avoidance_weight'?",
        "f.brush.toml:6: parameters.cohesion_weight: must be from 0 to 1, got 1.4",
        "f.brush.toml:7: parameters.obstacle_weight: must be a number, got true",
        "f.brush.toml:8: parameters.unled: must be return or keep, got 'stay'",
        "f.brush.toml:9: parameters.leader_neighbours: must be a whole number, got 2.0",
        (
            "f.brush.toml:10: parameters.max_turn: must be a number (rad/s), got '10 rad/s'; "
            "write the number alone, without quotes or unit"
        ),
        "f.brush.toml:11: parameters.sensitivity: must be a finite number, got nan",
        (
            "f.brush.toml:12: parameters.transition: unknown name here; "
            "'transition' belongs at the top, before the first [table]"
        ),
        "f.brush.toml:14: speed.mean: must be a number (BL/s), got 'fast'",
        "f.brush.toml:15: speed.deviation: must be a finite number, got -inf",
        "f.brush.toml:17: speed.by_density[1][1]: must be at most 10, got 30.0",
        "f.brush.toml:18: body: radius must be at most half the length (0.5 m), got 0.7",
        "f.brush.toml:20: vison: unknown name; did you mean 'vision'?",
        "f.brush.toml:22: provenance.by: is missing; it takes the person or tool that made it",
        "f.brush.toml:23: provenance.kind: must be published, hand-set, searched or learned, got 'guess'",
        "f.brush.toml:24: provenance.date: must be a date such as 2026-11-21, got '2026'",
        "f.brush.toml:25: provenance.source: must not be empty",
    ]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[parameters]", "[parameters]\navoidance = { weight = 1 }", "6: parameters.avoidance: parameters are written"),
        ('model = "herd"', 'model = "hurd"', "2: model: there is no model 'hurd'; did you mean 'herd'?"),
        ('model = "herd"', "model = 3", "2: model: must be text, got 3"),
        ('model = "herd"', "model = [{}]", "2: model: must be text, got an array of 1"),
        ('model = "herd"\n', "", "1: model: is missing"),
        ('colour = "#c9a24b"', 'colour = "#c9a24"', "3: colour: must look like #c9a24b, got '#c9a24'"),
        ('colour = "#c9a24b"', 'name = "x"', "3: name: the name of a brush is its file name; remove this line"),
        ('colour = "#c9a24b"', "params = 1", "3: params: unknown name; did you mean 'parameters'?"),
        ('colour = "#c9a24b"', 'title = "\\u001b[31m"', "3: title: must not have control characters, got '\\x1b[31m'"),
        ('colour = "#c9a24b"', 'title = "a\\nb"', "3: title: must be one line, got 'a\\nb'"),
        ('colour = "#c9a24b"', "transition = -0.5", "3: transition: must be from 0 to 60 s, got -0.5"),
        ('colour = "#c9a24b"', "transition = false", "3: transition: must be a number (s), got false"),
        (
            'colour = "#c9a24b"',
            "avoidance_weight = 0.5",
            "3: avoidance_weight: unknown name here; 'avoidance_weight' be",
        ),
        ('colour = "#c9a24b"', "body = 3", "3: body: must be a table, got 3"),
        ('colour = "#c9a24b"', "vision.occlusion = 1", "3: vision.occlusion: must be true or false, got 1"),
        ('colour = "#c9a24b"', "vision.range = inf", "3: vision.range: must be a finite number, got inf"),
        (
            'colour = "#c9a24b"',
            f"transition = 1{'0' * 30}",
            "3: transition: whole numbers go up to 9223372036854775807",
        ),
        ("mean = 2", "mean = 2\nreversion = 0", "11: speed.reversion: must be above 0 and at most 100 (1/s), got 0"),
        ("mean = 2", "men = 2", "9: speed.mean: is missing; it takes the mean speed; from 0 to 100 BL/s"),
        ("mean = 2", "mean = 1e400", "10: speed.mean: must be a finite number, got inf"),
        ("mean = 2", "mean = 2\nby_density = [[1, 1], [1, 2]]", "9: speed: the densities of by_density must rise"),
        ("mean = 2", "mean = 2\nby_density = [[1, 1, 1]]", "11: speed.by_density[0]: must have at most 2 items, got 3"),
        ("mean = 2", "mean = 2\nby_density = [[1, true]]", "11: speed.by_density[0][1]: must be a number, got true"),
        ("[speed]\nmean = 2", "", "1: speed: is missing; a table with mean is needed: how fast"),
        ("date = 2026-11-21", "date = 2026-11-21T10:00:00", "15: provenance.date: must be a date such as 2026-11-21"),
        ("/1", "/2", "1: schema: 'flockbrush.brush/2' is of a newer Flockbrush; this one reads 'flockbrush.brush/1'"),
        ("/1", "/x", "1: schema: must be 'flockbrush.brush/1', got 'flockbrush.brush/x'"),
        ('schema = "flockbrush.brush/1"\n', "", '1: schema: is missing; a brush starts with: schema = "flockbrush'),
    ],
)
def test_one_mistake_is_said_with_its_line_and_what_would_be_right(old, new, said):
    told = complaints(replaced(old, new))
    assert any(line.startswith(f"f.brush.toml:{said}") for line in told), told


def test_an_empty_file_is_no_brush():
    assert complaints("") == ['f.brush.toml:1: is empty; a brush starts with: schema = "flockbrush.brush/1"']


def test_a_file_of_another_name_is_no_brush():
    for file in ("meadow.toml", ".brush.toml", "my meadow.brush.toml", "..brush.toml"):
        (told,) = complaints(GOOD, file)
        assert "the name of a brush file must be NAME.brush.toml" in told


def test_a_model_without_strict_rules_still_gets_numbers_for_numbers():
    """Models come from third parties, too."""
    from pydantic import BaseModel

    class Params(BaseModel):
        push: float = 1.0

    models = {"lax": SimpleNamespace(Params=Params)}
    text = GOOD.replace("herd", "lax").replace('avoidance_weight = 0.5\nunled = "keep"', "push = {}\npul = 1")
    for value in ("true", '"2"', "nan", "-inf"):
        with pytest.raises(ProblemsError) as error:
            load_brush(text.format(value).encode(), "f.brush.toml", models)
        assert [problem.line for problem in error.value.problems] == [6, 7]
        assert "push" in str(error.value.problems[0])
        assert "unknown name" in str(error.value.problems[1])


def numbers(low, high):
    return st.floats(low, high)


def params():
    def of(field):
        if field.annotation is float:
            return numbers(bounds(field).least, bounds(field).most)
        if field.annotation is int:
            return st.integers(int(bounds(field).least), int(bounds(field).most))
        return st.sampled_from(field.annotation.__args__)

    return st.fixed_dictionaries({name: of(field) for name, field in HERD.model_fields.items()})


brushes = st.fixed_dictionaries(
    {
        "name": st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_-]{0,20}", fullmatch=True),
        "title": line,
        "description": text,
        "model": st.just("herd"),
        "colour": st.from_regex(r"#[0-9a-fA-F]{6}", fullmatch=True),
        "transition": numbers(0, 60),
        "parameters": params(),
        "speed": st.fixed_dictionaries(
            {
                "mean": numbers(0, 100),
                "deviation": numbers(0, 50),
                "reversion": numbers(1e-9, 100),
                "by_density": st.lists(
                    st.tuples(numbers(0, 100), numbers(0, 10)), max_size=5, unique_by=lambda p: p[0]
                ).map(lambda pairs: tuple(sorted(pairs))),
            }
        ),
        "body": st.fixed_dictionaries(
            {"length": numbers(0.5, 50), "radius": numbers(1e-6, 0.25), "contact": st.sampled_from(["capsule", "disc"])}
        ),
        "vision": st.fixed_dictionaries(
            {"range": numbers(1e-3, 100), "field_of_view": numbers(1e-3, 360), "occlusion": st.booleans()}
        ),
        "provenance": st.fixed_dictionaries(
            {
                "kind": st.sampled_from(["published", "hand-set", "searched", "learned"]),
                "source": line.filter(bool),
                "date": st.dates(),
                "by": line.filter(bool),
                "notes": text,
            },
            optional={
                "seed": st.integers(0, 2**63 - 1),
                "clip": line,
                "frames": st.tuples(st.integers(0, 9999), st.integers(0, 9999)),
                "clip_sha256": st.from_regex("[0-9a-f]{64}", fullmatch=True),
                "licence": line,
                "versions": st.dictionaries(line, line, max_size=3),
                "report": st.dictionaries(line, numbers(-1e9, 1e9), max_size=3),
            },
        ),
    }
).map(lambda values: Brush(**values))


@quick(60)
@given(brushes)
def test_what_is_written_reads_back_the_same(brush):
    written = brush_to_toml(brush)
    again = load_brush(written.encode(), brush.name + SUFFIX)
    assert again == brush
    assert brush_to_toml(again) == written


@pytest.mark.parametrize("model", behaviours())
def test_every_model_can_be_a_brush(model):
    brush = Brush(name="any", model=model, parameters={}, speed=SpeedSpec(mean=1), provenance=HAND)
    assert load_brush(brush_to_toml(brush).encode(), "any.brush.toml") == brush


@pytest.mark.parametrize(
    "notes",
    [
        "word " * 100,
        "word " * 100 + "end",
        " starts with a blank, " * 20,
        "two  blanks " * 20,
        'quotes "" and """ and """" ' * 10 + '"',
        '"' * 300,
        "back\\slash \\ " * 30 + "\\",
        "\n\nempty lines\n\n" * 10,
        "x" * 1000 + " " + "y" * 1000,
        "tab\tand\nline " * 20,
    ],
)
def test_long_notes_are_wrapped_and_not_changed(notes):
    brush = read(GOOD)
    brush = brush.model_copy(update={"provenance": brush.provenance.model_copy(update={"notes": notes})})
    assert read(brush_to_toml(brush)).provenance.notes == notes


def test_a_written_brush_explains_itself():
    written = brush_to_toml(read(GOOD))
    (at,) = re.findall("^cohesion_angular = .*$", written, re.MULTILINE)
    assert "in bearing" in at and "from 0.001 to 1 times 180°" in at
    assert all(len(re.findall(f"^{name} = .*  # ", written, re.MULTILINE)) == 1 for name in HERD.model_fields)


def test_a_brush_is_saved_under_its_name(tmp_path):
    brush = read(GOOD).with_parameters(cohesion_weight=0.75)
    path = save_brush(brush, tmp_path)
    assert path == tmp_path / "meadow.brush.toml"
    assert load_brush(path) == brush
    assert load_brush(path).sha256 == brush.sha256
    assert [file.name for file in tmp_path.iterdir()] == ["meadow.brush.toml"]


def test_a_brush_that_is_there_is_not_overwritten_unasked(tmp_path):
    save_brush(read(GOOD), tmp_path)
    changed = read(GOOD).with_parameters(cohesion_weight=0.75)
    with pytest.raises(ProblemsError, match="already exists"):
        save_brush(changed, tmp_path)
    assert load_brush(tmp_path / "meadow.brush.toml") == read(GOOD)
    save_brush(changed, tmp_path, overwrite=True)
    assert load_brush(tmp_path / "meadow.brush.toml") == changed
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("links", [True, False])
def test_a_disk_without_hard_links_overwrites_nothing_either(tmp_path, monkeypatch, links):
    if not links:
        monkeypatch.setattr("os.link", lambda *_: (_ for _ in ()).throw(PermissionError(1, "no links")))
    write_bytes(tmp_path / "a", b"first", overwrite=False)
    with pytest.raises(ProblemsError, match="already exists"):
        write_bytes(tmp_path / "a", b"second", overwrite=False)
    assert (tmp_path / "a").read_bytes() == b"first"


def test_a_save_that_fails_half_way_leaves_the_old_file_and_no_litter(tmp_path, monkeypatch):
    save_brush(read(GOOD), tmp_path)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(ProblemsError, match="No space left on device"):
        save_brush(read(GOOD).with_parameters(cohesion_weight=1), tmp_path, overwrite=True)
    assert load_brush(tmp_path / "meadow.brush.toml") == read(GOOD)
    assert len(list(tmp_path.iterdir())) == 1


def test_saving_where_there_is_no_folder_is_a_problem_not_a_crash(tmp_path):
    with pytest.raises(ProblemsError, match="cannot be written"):
        save_brush(read(GOOD), tmp_path / "none")
