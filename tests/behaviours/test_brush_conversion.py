"""Brushes of before there were species: converted they say whom they are made for, and move the same animals."""

import pytest
from flockbrush.behaviours.brush import load_brush, shipped
from flockbrush.behaviours.brush_conversion import convert
from flockbrush.behaviours.species import load_species, shipped_species
from flockbrush.engine.files import held, holder
from flockbrush.engine.problems import ProblemsError
from typer.testing import CliRunner

from flockbrush.cli.main import app

BODY = '[body]\nlength = {}  # nose to tail\nradius = {}\ncontact = "{}"\n\n'


def old(name, length, radius, contact="capsule"):
    """A shipped brush as it was: with a body, and made for nobody in particular."""
    text = shipped().get(name).source.decode()
    text = "".join(line for line in text.splitlines(True) if not line.startswith("made_for"))
    return text.replace("[vision]", BODY.format(length, radius, contact) + "[vision]").encode()


@pytest.mark.parametrize(
    ("name", "body", "made_for"),
    [
        ("geese", (0.8, 0.16, "disc"), ("goose",)),
        ("wolf-hunt", (1.5, 0.3), ("wolf",)),
        ("march", (1.0, 0.2), ("herd",)),
    ],
)
def test_a_brush_with_the_body_of_a_species_is_made_for_it(name, body, made_for):
    source = old(name, *body)
    made = convert(source, f"{name}.brush.toml", shipped_species())
    assert made.made_for == made_for and not made.species
    assert "[body]" not in made.text
    before, now = load_brush(source, f"{name}.brush.toml"), load_brush(made.text.encode(), f"{name}.brush.toml")
    assert now == before.model_copy(update={"made_for": made_for})
    assert convert(made.text.encode(), f"{name}.brush.toml", shipped_species()) is None


def test_a_body_that_no_species_has_becomes_one():
    made = convert(old("march", 3.3, 0.7), "march.brush.toml", shipped_species())
    yak = load_species(made.species.encode(), "march.species.toml")
    assert (yak.body.length, yak.body.radius, yak.media) == (3.3, 0.7, ("walk",))
    assert load_brush(made.text.encode(), "march.brush.toml").made_for == ("march",)


def test_one_may_say_for_whom():
    made = convert(old("march", 3.3, 0.7), "march.brush.toml", shipped_species(), "elephant")
    assert load_brush(made.text.encode(), "march.brush.toml").body.length == 5.0
    with pytest.raises(ProblemsError, match="did you mean 'elephant'"):
        convert(old("march", 3.3, 0.7), "march.brush.toml", shipped_species(), "elefant")


def test_the_command_rewrites_files_wholly_and_leaves_damaged_ones_alone(tmp_path):
    (tmp_path / "geese.brush.toml").write_bytes(old("geese", 0.8, 0.16, "disc"))
    (tmp_path / "march.brush.toml").write_bytes(old("march", 3.3, 0.7))
    (tmp_path / "bad.brush.toml").write_text("nonsense")
    files = [str(tmp_path / f"{name}.brush.toml") for name in ("geese", "march", "bad")]
    said = CliRunner().invoke(app, ["brush", "convert", *files])
    assert said.exit_code != 0
    assert "made for goose" in said.output and "march.species.toml" in said.output
    assert (tmp_path / "bad.brush.toml").read_text() == "nonsense"
    assert load_brush(tmp_path / "geese.brush.toml").made_for == ("goose",)
    assert load_species(tmp_path / "march.species.toml").body.length == 3.3
    again = CliRunner().invoke(app, ["brush", "convert", files[0]])
    assert again.exit_code == 0 and "nothing to convert" in again.output
    assert "brush convert" not in CliRunner().invoke(app, ["brush", "check", files[0]]).output
    (tmp_path / "march.brush.toml").write_bytes(old("march", 3.3, 0.7))
    assert "brush convert" in CliRunner().invoke(app, ["brush", "check", files[1]]).output.replace("\n", " ")


def test_the_command_converts_no_file_that_somebody_writes(tmp_path, monkeypatch):
    brush, before, holders = tmp_path / "geese.brush.toml", old("geese", 0.8, 0.16, "disc"), []
    brush.write_bytes(before)
    with held(brush):
        said = CliRunner().invoke(app, ["brush", "convert", str(brush)])
    assert said.exit_code == 1 and "this program is already writing it" in said.output
    assert brush.read_bytes() == before
    monkeypatch.setattr("flockbrush.cli.convert_brushes._written", lambda *given: holders.append(holder(brush)))
    assert CliRunner().invoke(app, ["brush", "convert", str(brush)]).exit_code == 0
    assert holders == ["this program is already writing it"] and holder(brush) == ""
