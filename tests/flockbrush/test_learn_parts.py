"""The parts of learning that a person sees: comparisons, brushes, pages, photographs, regions."""

import base64
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from filmed import film_of, learn, observe
from flockbrush.behaviours.brush import load_brush, shipped
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.behaviours.models.zones import Params as ZonesParams
from flockbrush.engine.problems import ProblemsError
from flockbrush.systems.measures import compute_nnd

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import CameraDrift, evidence_of_truth
from flockbrush.cli.learning_commands import command_line
from flockbrush.film.observations import SIGHT_COLUMNS
from flockbrush.learning.axis_variance import RANDOM, variance_told
from flockbrush.learning.comparison import compared
from flockbrush.learning.group_size_test import with_other_numbers
from flockbrush.learning.html_page import ReportPage
from flockbrush.learning.initial_conditions import resized
from flockbrush.learning.learned_brush import brush_of, name_of, order_of
from flockbrush.learning.learning_charts import panels_of
from flockbrush.learning.likelihood import likelihoods
from flockbrush.learning.photo import angular_variance, standing
from flockbrush.learning.regions import regions_of, within
from flockbrush.learning.report import as_json, page_of, write_partial, write_report
from flockbrush.learning.report_parameters import add_parameters
from flockbrush.learning.result import Findings
from flockbrush.learning.rollout import HerdStart
from flockbrush.learning.side_by_side import ComparisonGround
from flockbrush.learning.simulate import simulated
from flockbrush.learning.verdict import judge


@pytest.fixture(scope="module")
def march(tmp_path_factory):
    """A film of a marching herd, and everything about it."""
    path = film_of(tmp_path_factory.mktemp("films") / "march.mp4", camera=CameraDrift(drift=(6.0, 3.0)))
    return path, observe(path)


def parsed(page):
    """A page as a tree: it would fail on anything that is not well-formed."""
    return ElementTree.fromstring(page.split("\n", 1)[1])


# comparing ---------------------------------------------------------------------------------


def test_a_herd_under_its_own_brush_is_like_the_clip_and_a_grazing_one_is_not(march):
    _, evidence = march
    own = compared(evidence, [simulated(evidence, shipped().get("march"))])
    other = compared(evidence, [simulated(evidence, shipped().get("graze"), seed) for seed in range(2)])
    assert own.met
    assert own.unlike < other.unlike
    assert own.verdict("polarization").herd == pytest.approx(1, abs=0.05)
    assert len(other.herds) == 2 and other.herd("polarization").shape == other.times.shape
    assert other.figures("x")["x velocity error at the end"] > own.figures("x")["x velocity error at the end"]


def test_a_herd_four_times_as_large_is_as_dense_and_heads_as_before():
    rng = np.random.default_rng(0)
    xy = np.stack(np.meshgrid(np.arange(8.0), np.arange(8.0)), -1).reshape(-1, 2)
    start = HerdStart(xy + rng.normal(0, 0.05, xy.shape), np.where(xy[:, :1] > 3.5, (1.0, 0.0), (0.0, 1.0)))
    large, small = resized(start, 4), resized(start, 0.25)
    assert (len(large), len(small)) == (256, 16)
    assert np.median(compute_nnd(large.xy)) == pytest.approx(1, abs=0.25)
    assert np.median(compute_nnd(small.xy)) == pytest.approx(1, abs=0.5)
    assert np.ptp(large.xy[:, 0]) == pytest.approx(2 * np.ptp(start.xy[:, 0]), rel=0.15)
    east = large.xy[:, 0] > large.xy[:, 0].mean() + 1
    assert (large.forward[east] == (1.0, 0.0)).all()


def test_other_numbers_of_animals_are_measured(march):
    _, evidence = march
    start = HerdStart(
        evidence.sightings.xy[evidence.sightings.of(0)], evidence.sightings.forward[evidence.sightings.of(0)]
    )
    rows = with_other_numbers(shipped().get("march"), start, factors=(0.5, 2.0), seconds=2.0)
    assert [row["animals"] for row in rows] == [15, 60]
    assert all(row["polarization"] > 0.9 and 0.3 < row["spacing"] < 3 for row in rows)


# the brush -----------------------------------------------------------------------------------


def test_a_learned_brush_says_where_it_is_from_and_what_the_clip_does_not_tell(march, tmp_path):
    _, evidence = march
    brush = brush_of(
        "lambs", learn([evidence]), [evidence], seed=7, figures={"loss": 0.5, "nothing": np.nan},
        length_m=1.2, licence="public domain",
    )  # fmt: skip
    (tmp_path / "lambs.brush.toml").write_text(brush_to_toml(brush))
    assert load_brush(tmp_path / "lambs.brush.toml") == brush
    told = brush.provenance
    assert (told.kind, told.clip, told.frames, told.seed) == ("learned", "march.mp4", (0, 19), 7)
    assert told.clip_sha256 == evidence.sha256
    assert told.licence == "public domain"
    assert told.report == {"loss": 0.5}
    assert "flockbrush" in told.versions and "torch" in told.versions
    assert (
        "Not identifiable from the clip (other values fit equally well): weight of obstacle, reach of obstacle"
        in told.notes
    )
    assert "in one direction" in brush.description
    assert brush.body.length == 1.2 and brush.body.radius <= 0.6


def test_a_file_that_can_be_no_brush_is_refused():
    for name in ("sheep.toml", ".brush.toml", "two words.brush.toml", "ü.brush.toml"):
        with pytest.raises(ProblemsError):
            name_of(name)
    assert name_of("some/where/sheep-2.brush.toml") == "sheep-2"


def test_a_mill_is_said_to_go_round():
    assert order_of(evidence_of_truth(herd("mill", 40, 0.6, 12.5, 0), grid=10))[1] > 0.6


# pictures and pages ------------------------------------------------------------------------------


def test_an_animal_of_the_clip_and_its_double_stand_at_the_same_pixel(march):
    path, evidence = march
    stage = ComparisonGround(evidence, shipped().get("march"))
    film = cv2.VideoCapture(str(path))
    frame = [film.read()[1] for _ in range(8)][7]
    rows = evidence.sightings.of(7)
    clip = stage.film(frame, 7).astype(int)
    bare = stage.herd(np.zeros((0, 2)), np.zeros((0, 2)), 0.0).astype(int)
    drawn = stage.herd(evidence.sightings.xy[rows], evidence.sightings.forward[rows], 0.0).astype(int)
    bodies = clip.min(-1) > 150  # white sheep on green
    doubles = np.abs(drawn - bare).sum(-1) > 60
    middles = [np.argwhere(mask).mean(0) for mask in (bodies, doubles)]
    assert np.abs(middles[0] - middles[1]).max() < 0.35 * stage.scale
    assert (bodies & doubles).sum() > 0.5 * min(bodies.sum(), doubles.sum())


def test_a_page_escapes_what_it_is_told():
    page = ReportPage('<sheep> & "goats"')
    page.say("<script>alert(1)</script>")
    page.table(["a<b", "n"], [[("x&y", "good"), 1]])
    text = page.text()
    assert "<script>" not in text
    assert parsed(text).find("head/title").text == '<sheep> & "goats"'


def test_the_report_is_one_well_formed_page_with_its_pictures_in_it(march, tmp_path):
    _, evidence = march
    learned = learn([evidence])
    brush = brush_of("lambs", learned, [evidence], seed=0)
    made = compared(evidence, [simulated(evidence, brush)])
    counts = [{"factor": 1, "animals": 30, "polarization": 1.0, "milling": 0.0, "spacing": 0.8, "together": 1.0}]
    judgement = judge(evidence, brush, {}, runs=2)
    found = Findings(brush, [evidence], evidence, learned, None, made, judgement, counts, command="flockbrush learn x")
    files = write_report(found, tmp_path)
    text = files[0].read_text(encoding="utf-8")
    tree = parsed(text)
    assert 'src="http' not in text and "<link" not in text
    images = [image.get("src") for image in tree.iter("img")]
    assert len(images) >= 5
    for image in images:
        data = np.frombuffer(base64.b64decode(image.split(",", 1)[1]), np.uint8)
        assert cv2.imdecode(data, cv2.IMREAD_COLOR) is not None
    said = " ".join(tree.itertext())
    for words in (
        "too short to hold out a part",
        "not identifiable",
        "all animals keep their velocity",
        "flockbrush learn x",
        evidence.sha256,
    ):
        assert words in said
    assert {"order.png", "parameters.png", "loss.png", "figures.json"} <= {file.name for file in files}


def page_saying(text):
    """A page with one sentence, as a tree."""
    page = ReportPage("lambs")
    page.say(text)
    return parsed(page.text())


def test_a_chart_shows_neighbours_who_face_one_another(march):
    _, evidence = march
    comparison = compared(evidence, [simulated(evidence, shipped().get("march"))])
    comparison.clip["order nearby"][:] = -0.3
    chart = next(c for c in panels_of(found_of(evidence, comparison))["crowd"] if c.title == "Order among neighbours")
    assert chart.span[0] <= -0.3


def found_of(evidence, comparison):
    """Findings of who knows the answer."""
    learned = learn([evidence])
    return Findings(brush_of("lambs", learned, [evidence], seed=0), [evidence], evidence, learned, None, comparison)


def test_a_deviation_that_says_nothing_is_no_number(march):
    _, evidence = march
    deviation = np.where(np.arange(12) < 9, 0.021, 1e6)
    found = found_of(evidence, None)
    found.learned = replace(found.learned, deviation=deviation)
    text = page_of(found, {}).text()
    assert "0.021" in text and "1000000" not in text


def test_parameters_of_another_model_are_explained_as_what_they_are(march):
    _, evidence = march
    names, herd = tuple(likelihoods()["zones"].numbers), learn([evidence])
    five = {name: np.full(5, 0.05) for name in ("theta", "spread", "deviation")} | {"identifiable": np.ones(5, bool)}
    zones = replace(herd, names=names, model="zones", params=ZonesParams(), starts=[], **five)
    said = {}
    for learned in (herd, zones):
        page = ReportPage("lambs")
        add_parameters(page, SimpleNamespace(learned=learned), lambda: None)
        said[learned.model] = " ".join(parsed(page.text()).itertext())
    assert "Gaussian" in said["herd"] and "Value: 0 to 1, as in the paper" in said["herd"]
    assert "the place in the range that is searched" in said["zones"] and "blind angle" in said["zones"]
    assert "Gaussian" not in said["zones"] and "Ω" not in said["zones"]


def test_a_page_is_dark_where_its_reader_is_in_the_dark_and_photographs_keep_their_colours():
    page = ReportPage("lambs")
    picture = np.full((4, 6, 3), 255, np.uint8)
    page.pictures([(picture, "a chart")])
    page.pictures([(picture, "a frame")], photograph=True)
    page.pictures([(picture, "a mask")], paper=False)
    tree = parsed(page.text())
    kinds = {image.get("alt"): image.get("class") for image in tree.iter("img")}
    assert kinds == {"a chart": "drawn", "a frame": "filmed", "a mask": "filmed"}
    style = tree.find("head/style").text
    assert "@media screen and (prefers-color-scheme: dark)" in style  # and never on paper
    named, used = set(re.findall(r"(--[a-z]+):", style)), set(re.findall(r"var\((--[a-z]+)\)", style))
    assert "--resume" in page_saying("continue with --resume").find("body/p/span[@class='option']").text
    assert used == named and "#" not in style.split("\n}\n", 1)[1]


def test_a_clip_that_tells_no_number_says_so(march):
    _, evidence = march
    learned = replace(learn([evidence]), identifiable=np.zeros(12, bool))
    found = Findings(brush_of("lambs", learned, [evidence], seed=0), [evidence], evidence, learned)
    assert any("constrains none of the 12 parameters" in words for _, words in found.checks())


def test_what_nobody_measured_is_left_out_of_the_page(march):
    _, evidence = march
    learned = replace(learn([evidence]), interrupted=True)
    brush = brush_of("lambs", learned, [evidence], seed=0)
    found = Findings(brush, [evidence], evidence, learned)
    assert "interrupted" in page_of(found, {}).text()
    assert as_json(found)["interrupted"] is True and "compared" not in as_json(found)


def test_of_a_clip_that_cannot_be_learned_from_the_page_shows_what_was_seen(tmp_path):
    mask = np.zeros((20, 30), bool)
    mask[5:9] = True
    picture = np.full((20, 30, 3), 90, np.uint8)
    seen = {"first_frame": 3, "pictures": {"first frame": picture, "mask": mask}}
    page = write_partial(tmp_path, "sky.mp4", "sky.mp4: no animals", seen)
    tree = parsed(page.read_text(encoding="utf-8"))
    assert len(list(tree.iter("img"))) == 2
    assert "first frame" in " ".join(tree.itertext())


def test_a_command_leaves_out_what_nobody_said():
    said = command_line("learn", ["a b.mp4"], {"--out": "x.brush.toml", "--quick": True, "--seed": 0, "--frames": None})
    assert said == "flockbrush learn 'a b.mp4' --out x.brush.toml --quick --seed 0"


# photographs --------------------------------------------------------------------------------------


def photo(headings):
    """A hundred animals on a lattice, in one picture."""
    truth = herd("own:graze", 100, 0.2, 12.5, 0)
    xy = np.stack(np.meshgrid(np.arange(10.0), np.arange(10.0)), -1).reshape(-1, 2) * 2
    truth.xy[:], truth.forward[:] = xy, np.stack([np.cos(headings), np.sin(headings)], -1)
    return evidence_of_truth(truth, grid=10).part(slice(0, 1))


def test_bodies_that_lie_alike_have_no_variance_whichever_end_the_head_is():
    heads = np.where(np.arange(100) % 2 == 0, 0.3, 0.3 + np.pi)
    variance, told = angular_variance(photo(heads))
    assert told and np.nanmax(variance) < 1


def test_bodies_that_lie_at_random_have_the_variance_of_chance():
    variance, told = angular_variance(photo(np.random.default_rng(0).uniform(-np.pi, np.pi, 100)))
    assert told and 1500 < np.nanmean(variance) < 3500


def test_a_photograph_stands_still_and_nobody_is_known_to_move():
    lying = photo(np.zeros(100))
    assert np.nanmax(standing(lying).fields.angular_variance) < 1
    still = standing(replace(lying, sightings=None), speed=0.7, seconds=2.0)
    fields = still.fields
    assert len(fields) == 25 and not fields.occupied.any()
    assert (fields.density == fields.density[0]).all()
    assert np.nanmin(fields.angular_variance) == RANDOM
    assert still.speed.mean == 0.7
    assert any("as given" in note for note in still.notes)


def test_how_animals_lie_is_told_by_those_whose_axes_are_seen():
    """In a heap nobody's axis is; chance is assumed there for learning, and not held against the others."""
    lying = photo(np.zeros(100))
    all_of_them = lying.sightings
    few = np.flatnonzero(all_of_them.xy[:, 0] < np.median(all_of_them.xy[:, 0]))
    of_few = {name: getattr(all_of_them, name)[few] for name in SIGHT_COLUMNS}
    some = replace(all_of_them, first=np.array([0, len(few)]), **of_few)
    seen = standing(replace(lying, sightings=some))
    assert np.nanmax(seen.fields.angular_variance) == RANDOM and variance_told(seen) < 1
    assert variance_told(standing(replace(lying, sightings=None))) == RANDOM


# regions ------------------------------------------------------------------------------------------


def painted(path, *colours, size=(40, 30)):
    """A mask with stripes, red, green, blue."""
    stripes = np.zeros((*size[::-1], 3), np.uint8)
    for k, colour in enumerate(colours):
        stripes[:, size[0] * k // len(colours) : size[0] * (k + 1) // len(colours)] = colour
    cv2.imwrite(str(path), stripes[:, :, ::-1])
    return path


def test_regions_have_the_words_of_their_colours(tmp_path):
    found = regions_of(painted(tmp_path / "m.png", (0, 0, 255), (0, 0, 0), (255, 0, 0), (10, 20, 30)))
    assert [(r.number, r.word) for r in found] == [(1, "blue"), (2, "2"), (3, "red")]


def test_a_mask_that_is_none_is_told_why(tmp_path):
    (tmp_path / "text.png").write_text("no picture")
    noise = np.random.default_rng(0).integers(0, 255, (30, 30, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "photo.png"), noise)
    for name, words in (
        ("text.png", "is not a readable picture"),
        ("photo.png", "colours"),
        ("none.png", "no such file"),
    ):
        with pytest.raises(ProblemsError, match=words):
            regions_of(tmp_path / name)
    with pytest.raises(ProblemsError, match="all black"):
        regions_of(painted(tmp_path / "black.png", (0, 0, 0)))


def test_a_region_has_only_its_own_animals(march, tmp_path):
    path, _ = march
    mask = painted(tmp_path / "m.png", *[(255, 0, 0), (0, 0, 255)] * 6, size=(320, 240))
    evidence = observe(path, regions=mask)
    parts = [within(evidence, region) for region in regions_of(mask)]
    assert all(part is not None for part in parts)
    assert sum(len(part.sightings.xy) for part in parts) == len(evidence.sightings.xy)
    for part in parts:
        row, column, inside = part.fields.cells_of(part.sightings.xy)
        assert len(set(part.fields.region[row, column])) == 1
        assert part.fields.count.mean() == pytest.approx(len(part.sightings.xy) / len(part.sightings), rel=0.01)
