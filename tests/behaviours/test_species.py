"""Species files: they say everything that is wrong at once, and the most specific relation counts."""

import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.drive import drives
from flockbrush.behaviours.species import SpeciesLibrary, load_species, shipped_species
from flockbrush.engine.problems import ProblemsError

SHEEP = b"""schema = "flockbrush.species/1"
media = ["walk"]
tags = ["grazer"]

[body]
length = 1.2
radius = 0.24

[relations]
wolf = { fear = 1.0, notice = "40 m" }
hunter = { fear = 0.5, notice = "0.02 km" }
"*" = { avoid = 1.0 }
"""


def problems(text):
    with pytest.raises(ProblemsError) as caught:
        load_species(text.encode() if isinstance(text, str) else text, "sheep.species.toml")
    return [str(problem) for problem in caught.value.problems]


def test_the_most_specific_relation_counts():
    sheep = load_species(SHEEP, "sheep.species.toml")
    assert sheep.relation_to("wolf", ["hunter"]).weight == 1.0
    assert sheep.relation_to("lion", ["hunter"]).notice == 20.0  # km are metres too
    assert sheep.relation_to("ant").verb == "avoid"


def test_every_mistake_of_a_file_is_told_with_its_line():
    text = SHEEP.decode().replace("fear = 1.0", "fear = 2.0").replace('media = ["walk"]', 'media = ["wade"]')
    text = text.replace('"0.02 km"', '"near"').replace("length", "lenght")
    told = problems(text)
    assert [line.split(": ")[0] for line in told] == [
        "sheep.species.toml:2", "sheep.species.toml:6", "sheep.species.toml:10", "sheep.species.toml:11"
    ]  # fmt: skip
    assert "did you mean 'length'?" in told[1]
    assert 'must be a distance such as "30 m"' in told[3]


@pytest.mark.parametrize(
    ("relation", "message"),
    [
        ('{ fear = 1.0, hunt = 1.0, notice = "3 m" }', "exactly one of"),
        ("{ fear = 1.0 }", "needs a distance"),
        ('{ avoid = 1.0, notice = "3 m" }', "notice can only be used with"),
        ('{ fear = 1.0, notice = "3 m", catch = "remove" }', "catch can only be used with hunt"),
    ],
)
def test_a_relation_that_says_too_much_or_too_little_is_refused(relation, message):
    assert message in problems(SHEEP.decode().replace('"*" = { avoid = 1.0 }', f"ant = {relation}"))[0]


def test_limits_of_a_medium_that_it_cannot_move_in_are_refused():
    assert "media does not name" in problems(SHEEP.decode() + "[fly]\nspeed = 3.0\n")[0]


def test_another_schema_is_refused_as_it_is_in_brushes():
    told = problems(SHEEP.decode().replace("species/1", "species/9") + "unknown = 3\n")
    assert [line.partition("schema: ")[2] for line in told] == [
        "'flockbrush.species/9' is of a newer Flockbrush; this one reads 'flockbrush.species/1': update Flockbrush"
    ]


def test_a_species_is_found_beside_a_level_before_the_shipped_ones(tmp_path):
    (tmp_path / "sheep.species.toml").write_bytes(SHEEP)
    library = SpeciesLibrary([tmp_path, *shipped_species().folders])
    assert library.get("sheep").tags == ("grazer",)
    assert library.find("unicorn") is None
    with pytest.raises(ProblemsError, match="did you mean 'sheep'"):
        library.get("shep")
    assert SpeciesLibrary(files={"species/sheep.species.toml": SHEEP}).names() == ["sheep"]


def test_the_shipped_species_are_sound_and_name_only_what_there_is():
    library = shipped_species()
    wanted = "sheep wolf reindeer ant fish goose crane pelican starling sparrow falcon elephant dog human zebra lion"
    assert set(wanted.split()) <= set(library.names())
    known = set(library.names()) | {tag for name in library.names() for tag in library.get(name).tags}
    for name in library.names():
        species = library.get(name)
        assert set(species.relations) - {"*"} <= known, name
        for medium in species.media:
            assert getattr(species, medium).flee <= getattr(species, medium).speed, (name, medium)


def test_every_shipped_brush_is_made_for_species_that_can_do_it():
    library, models = shipped_species(), behaviours()
    for name in shipped().names():
        brush = shipped().get(name)
        flies = models[brush.model].flight is not None and not models[brush.model].flight(brush.params).grounded
        for key in brush.made_for:
            found = library.named(key)
            assert found, (name, key)
            assert any(one.can("fly") if flies else one.can("walk") or one.can("swim") for one in found), (name, key)


def test_a_changed_copy_of_a_species_has_no_file_and_says_so():
    sheep = shipped_species().get("sheep")
    assert sheep.source == sheep.model_copy().source
    with pytest.raises(ValueError, match="sheep was changed in Python and has no file: write one"):
        sheep.model_copy(update={"calm": 1.0}).source  # noqa: B018


def test_every_drive_has_a_unit_bounds_and_a_meaning_for_each_parameter():
    assert "flee" in drives()
    ours = [one for one in drives().values() if one.urge.__module__.startswith("flockbrush.")]
    assert len(ours) >= 10
    for one in ours:
        assert len(one.doc) > 100, f"{one.name}: the module's docstring says in a sentence or two what the drive does"
        for name, p in one.Params.model_json_schema()["properties"].items():
            assert p.get("unit"), (one.name, name)
            assert "enum" in p or {"minimum", "maximum"} <= set(p), (one.name, name)
