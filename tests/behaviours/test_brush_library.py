"""Where brushes are looked for, and what the shipped ones say of themselves."""

import math
import re
from pathlib import Path

import pytest
from flockbrush.behaviours.brush import BrushLibrary, shipped
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.engine.problems import ProblemsError
from small_brush import EXPECTED, GOOD, HERD, replaced

# libraries


@pytest.fixture
def folders(tmp_path):
    for folder, names in {"mine": ["march", "trot"], "theirs": ["march", "rest"]}.items():
        (tmp_path / folder).mkdir()
        for name in names:
            (tmp_path / folder / f"{name}.brush.toml").write_text(GOOD + f"notes = '{folder}'\n")
    return [tmp_path / "mine", tmp_path / "theirs"]


def test_the_first_folder_with_a_name_wins(folders):
    assert BrushLibrary(folders).get("march").provenance.notes == "mine"
    assert BrushLibrary(folders[::-1]).get("march").provenance.notes == "theirs"
    assert BrushLibrary(folders).path("march") == folders[0] / "march.brush.toml"


def test_a_library_names_each_brush_once_in_order(folders):
    (folders[0] / "notes.txt").touch()
    (folders[0] / ".hidden.brush.toml").touch()
    assert BrushLibrary(folders).names() == ["march", "rest", "trot"]


def test_the_brushes_inside_a_recording_come_before_all_folders(folders):
    library = BrushLibrary(folders, files={"brushes/march.brush.toml": GOOD.encode(), "level.tmj": b"{}"})
    assert library.get("march").provenance.notes == ""
    assert library.names() == ["march", "rest", "trot"]
    assert BrushLibrary(files={"a.brush.toml": GOOD.encode()}).get("a").name == "a"


def test_an_unknown_brush_is_answered_with_the_nearest(folders):
    with pytest.raises(ProblemsError) as error:
        BrushLibrary(folders).get("marsh")
    assert str(error.value) == "marsh.brush.toml: there is no brush 'marsh'; did you mean 'march'?"


@pytest.mark.parametrize(
    "name",
    ["../mine/march", "..", "/etc/passwd", "a/b", "a\\b", "C:x", "", "nul\0", "a" * 65, "é", "march\n", ".x", None],
)
def test_no_name_leads_out_of_the_folder(folders, name):
    with pytest.raises(ProblemsError, match="invalid brush name"):
        BrushLibrary(folders[1:]).get(name)


def test_a_name_with_the_ending_of_the_file_gets_a_hint(folders):
    with pytest.raises(ProblemsError, match=re.escape("leave out '.brush.toml'")):
        BrushLibrary(folders).get("march.brush.toml")


def test_an_edited_file_is_read_anew(folders):
    library = BrushLibrary(folders)
    before = library.get("trot")
    assert library.get("trot") is before
    (folders[0] / "trot.brush.toml").write_text(GOOD)
    assert library.get("trot").provenance.notes == ""


def test_a_library_lists_the_problems_of_all_its_brushes(folders):
    (folders[0] / "bad.brush.toml").write_text(replaced("mean = 2", "mean = -2"))
    (folders[1] / "worse.brush.toml").mkdir()
    told = [str(problem) for problem in BrushLibrary(folders).problems()]
    assert len(told) == 2
    assert told[0].endswith("bad.brush.toml:10: speed.mean: must be from 0 to 100 BL/s, got -2")
    assert told[1].endswith("worse.brush.toml: is a folder, not a file")


def test_a_folder_that_is_not_there_is_said(tmp_path):
    with pytest.raises(ProblemsError, match="there is no such folder"):
        BrushLibrary([tmp_path / "none"])


def test_the_shipped_brushes_are_there_and_without_problems():
    assert set(EXPECTED) <= set(shipped().names())
    assert shipped().problems() == []


@pytest.mark.parametrize("name", EXPECTED)
def test_a_shipped_brush_says_what_it_does_and_where_its_numbers_come_from(name):
    brush = shipped().get(name)
    assert brush.title and brush.description
    assert len(brush.provenance.notes) > 100
    assert brush.provenance.kind in ("published", "hand-set", "searched", "learned")


@pytest.mark.parametrize("name", EXPECTED)
def test_a_shipped_brush_is_as_the_program_would_write_it_but_for_comments(name):
    def bare(text):
        return [line.split("  # ")[0].rstrip() for line in text.splitlines() if not line.startswith("#")]

    brush = shipped().get(name)
    assert set(brush.parameters) == set(HERD.model_fields)
    written = bare(brush.source.decode())
    assert set(written) <= set(bare(brush_to_toml(brush)))


def test_shipped_brushes_can_be_told_apart_by_colour():
    def rgb(name):
        return [int(shipped().get(name).colour[i : i + 2], 16) for i in (1, 3, 5)]

    pairs = [(a, b) for a in EXPECTED for b in EXPECTED if a < b]
    assert min(math.dist(rgb(a), rgb(b)) for a, b in pairs) > 40


def test_sheep_narrow_has_the_published_numbers():
    """Gong et al. 2025: the parameters learned from the clip sheep-narrow."""
    p = shipped().get("sheep-narrow").params
    assert (p.avoidance_weight, p.avoidance_radial, p.avoidance_angular) == (0.742, 0.526, 1)
    assert (p.cohesion_weight, p.cohesion_radial, p.cohesion_angular) == (0.505, 1, 0.965)
    assert (p.alignment_weight, p.alignment_radial, p.alignment_angular) == (0.499, 1, 1)
    assert (p.obstacle_weight, p.obstacle_radial, p.obstacle_angular) == (0.153, 1, 0.5)


def test_sheep_drone_says_which_film_it_was_learned_from_and_how_well():
    papers = shipped().get("sheep-drone").provenance
    assert papers.kind == "learned" and papers.licence.startswith("public domain")
    assert re.fullmatch("[0-9a-f]{64}", papers.clip_sha256) and papers.frames == (11, 41) and papers.seed == 0
    assert "flockbrush learn sheep_0043.mp4 --frames 11:72" in " ".join(papers.notes.split())
    told = papers.report
    for name in ("polarization", "milling"):  # within two deviations of the clip, in frames it was not learned from
        assert told[f"held-out {name}, error"] < max(2 * told[f"held-out {name}, clip deviation"], 0.05)


@pytest.mark.parametrize("name", ["sheep-gps", "zebrafish"])
def test_a_brush_from_tracks_says_which_and_how_it_was_judged(name):
    papers = shipped().get(name).provenance
    notes = " ".join(papers.notes.split())
    assert papers.kind == "learned" and "GPL-3.0" in papers.licence and re.fullmatch("[0-9a-f]{64}", papers.clip_sha256)
    assert f"learning.py tracks --data DIR --only {name} " in notes
    page = (Path(__file__).parents[2] / "docs" / "benchmark-tracks.md").read_text(encoding="utf-8")
    assert notes.split("The verdict: ")[1].split(". ")[0] in " ".join(page.split())
