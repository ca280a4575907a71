"""Clean films of the shipped levels are seen again as the herd was, or it is said why not."""

import numpy as np
import pytest

from benchmarks.own_films import film, seen
from flockbrush.film.body_outlines import BodySize
from flockbrush.film.clip_reader import silent
from flockbrush.film.ground_lines import lines_and_faces, without_lines
from flockbrush.film.observations import CannotObserve
from flockbrush.film.observe import Watch
from flockbrush.runs.run import shipped_levels

READ = ("anthill", "city", "gorge", "meadow", "sheep-pasture")
TWO_WAYS = ("anthill",)  # some swarm, some mill
TOO_SMALL = ("crowded", "predators-valley", "river", "skein")
RESTING = ("geese", "merino", "savanna")  # in so short a film
HARDLY = ("elephants",)  # most rest, and some walk a little
STAYING = ("lake",)  # outlines of the ground are taken for animals
MIXED = ("pillars", "ridge")  # several species; in pillars, specks and a whole flock in one blob are taken for these


def test_every_shipped_level_is_one_of_these():
    assert sorted((*READ, *TOO_SMALL, *RESTING, *HARDLY, *STAYING, *MIXED)) == shipped_levels()


@pytest.mark.parametrize("level", READ)
def test_a_clean_film_of_a_level_is_seen_as_the_herd_was(level, tmp_path):
    was, scale = film(level, tmp_path / "walk.mp4")
    now, told = seen(tmp_path / "walk.mp4", scale)
    assert not any("unreliable" in note or "never moves" in note for note in told.notes) and not told.doubt
    assert any("several species" in note for note in told.notes) == (level in TWO_WAYS)
    assert now.polarization == pytest.approx(was.polarization, abs=0.06)
    assert now.speed == pytest.approx(was.speed, rel=0.15)
    assert now.count == pytest.approx(was.count, rel=0.1)
    assert now.length == pytest.approx(was.length, rel=0.25)


@pytest.mark.parametrize(
    ("level", "why"),
    [*((level, "too small to separate") for level in TOO_SMALL), *((level, "nothing moves") for level in RESTING)],
)
def test_why_a_clean_film_of_a_level_cannot_be_read_is_said(level, why, tmp_path):
    film(level, tmp_path / "walk.mp4")
    try:
        said = "; ".join(Watch.of(tmp_path / "walk.mp4", None, (), "auto", None, 30, None, None, silent).notes)
    except CannotObserve as error:
        said = str(error)
    assert why in said


@pytest.mark.parametrize("level", HARDLY)
def test_that_most_animals_stand_and_are_taken_for_ground_is_said(level, tmp_path):
    _, scale = film(level, tmp_path / "walk.mp4")
    _, told = seen(tmp_path / "walk.mp4", scale)
    assert any(note.startswith("unreliable: animals move 0.") for note in told.notes)
    assert told.doubt.startswith(
        "animals move 0."
    )  # nothing is judged by it: tests/behaviours/learning/test_verdict.py


@pytest.mark.parametrize("level", STAYING)
def test_that_much_of_what_looks_like_animals_never_moves_is_said(level, tmp_path):
    _, scale = film(level, tmp_path / "walk.mp4")
    _, told = seen(tmp_path / "walk.mp4", scale)
    assert any("of what looks like animals never moves" in note for note in told.notes)


@pytest.mark.parametrize("level", MIXED)
def test_that_a_film_shows_several_kinds_of_animals_is_said(level, tmp_path):
    _, scale = film(level, tmp_path / "walk.mp4")
    _, told = seen(tmp_path / "walk.mp4", scale)
    assert any("several species" in note for note in told.notes)


BODY = BodySize(14.0, 6.0, 70.0, 20)


def ground():
    """A wall's outline, a letter, the face of a wall, and an animal that rests: its mask and where it is."""
    mask = np.zeros((120, 160), np.uint8)
    mask[10:12, 5:150] = mask[40:60, 20:22] = mask[58:60, 20:30] = 1
    mask[80:110, 100:150] = 1
    mask[70:76, 30:44] = 1
    return mask, np.s_[70:76, 30:44]


def test_lines_letters_and_plain_faces_are_no_animals_and_an_animal_that_rests_is_one():
    mask, animal = ground()
    found = lines_and_faces([mask] * 6, [np.full((120, 160, 3), 90, np.uint8)], BODY)
    left = mask & ~found & 1
    assert left[animal].all() and left.sum() == mask[animal].sum()


def test_a_crowd_that_rests_is_no_plain_face():
    mask, _ = ground()
    picture = np.random.default_rng(1).integers(0, 120, (120, 160, 3)).astype(np.uint8)
    assert not lines_and_faces([mask] * 6, [picture], BODY)[80:110, 100:150].any()


def test_a_body_that_crosses_a_line_stays_whole():
    lines = np.zeros((40, 60), np.uint8)
    lines[19:21] = 1
    mask = lines.copy()
    mask[12:27, 20:27] = 1
    left = without_lines(mask, lines)
    assert left[12:27, 20:27].all() and not left[:, :15].any() and not left[:, 32:].any()
