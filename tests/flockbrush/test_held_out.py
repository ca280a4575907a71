"""What is held out of a clip is unknown to the brush that is judged by it."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import herd_film
from benchmarks.foreign_herds import herd
from benchmarks.herd_film import Appearance, CameraDrift, shoot
from flockbrush.film.observations import SIGHT_COLUMNS
from flockbrush.film.open_clip import Looking, look_at, looked_apart, training_begun
from flockbrush.learning.helpers import Helpers
from flockbrush.learning.recipe import SearchSettings, learn

FRAMES = 40


@pytest.fixture(scope="module")
def mill(tmp_path_factory):
    """A mill filmed without loss, and the same film with its second half replaced, backwards."""
    folder = tmp_path_factory.mktemp("mill")
    truth = herd("mill", count=14, seconds=FRAMES / 25, fps=25, seed=4)
    film = shoot(truth, None, (256, 256), 13.0, CameraDrift(), look=Appearance(crf=0), seed=2)
    half = FRAMES // 2
    paths = folder / "one.mp4", folder / "other.mp4"
    backwards = film.frames[:half] + film.frames[: half - 1 : -1]
    for path, pictures in zip(paths, (film.frames, backwards), strict=True):
        writer = herd_film._Writer(path, 25, film.size, 0)
        for picture in pictures:
            writer.write(picture)
        writer.close()
    return paths


@pytest.fixture(scope="module")
def wholes(mill):
    return [look_at(path, Looking()) for path in mill]


@pytest.fixture(scope="module")
def parts(mill, wholes):
    return [looked_apart(path, Looking(), whole, 0.5)[0] for path, whole in zip(mill, wholes, strict=True)]


def test_held_out_frames_change_nothing_of_the_brush_that_they_judge(parts):
    (one, held), (other, replaced) = parts
    assert not np.array_equal(held.fields.density, replaced.fields.density)
    for name in ("density", "velocity", "speed", "angular_variance", "seen", "count"):
        assert np.array_equal(getattr(one.fields, name), getattr(other.fields, name), equal_nan=True), name
    for name in SIGHT_COLUMNS:
        assert np.array_equal(getattr(one.sightings, name), getattr(other.sightings, name), equal_nan=True), name
    brushes = [
        learn(clip, SearchSettings(seed=1, starts=1, budget_s=0.05, brushes=False, quick=True)) for clip in (one, other)
    ]
    first, second = ((b.theta.tolist(), b.extras, b.speed, b.body, b.vision) for b in brushes)
    assert first == second


def test_a_part_that_a_helper_observes_is_the_same(mill, wholes, parts):
    path, whole, how = mill[0], wholes[0], Looking()
    with Helpers(2) as helpers:
        begun = training_begun(path, how, 0.5, True, helpers)
        both = looked_apart(path, how, whole, 0.5, True, begun)
    here = [parts[0], *looked_apart(path, how, whole, 0.5, True)[1:]]
    assert len(both) == len(begun) == 2
    for (there, _), (one, _) in zip(both, here, strict=True):
        assert there.fields.frames.tolist() == one.fields.frames.tolist()
        assert np.array_equal(there.fields.density, one.fields.density, equal_nan=True)
        assert np.array_equal(there.sightings.xy, one.sightings.xy)


def test_both_parts_are_measured_in_the_same_body_length(parts):
    training, held = parts[0]
    assert training.fields.frames.tolist() == list(range(FRAMES // 2))
    assert held.fields.frames.tolist() == list(range(FRAMES // 2, FRAMES))
    zoomed = held.clip_body_px / training.clip_body_px
    assert zoomed == pytest.approx(np.sqrt(abs(np.linalg.det(held.camera[0][:, :2]))) ** -1, rel=0.02)


def test_another_unit_of_length_changes_no_herd(parts):
    training = parts[0][0]
    twice = training.in_lengths_of(training.clip_body_px / 2)
    assert twice.clip_body_px == pytest.approx(training.clip_body_px / 2)
    assert twice.fields.count is training.fields.count
    area = training.fields.cell**2, twice.fields.cell**2
    assert np.nansum(twice.fields.density) * area[1] == pytest.approx(np.nansum(training.fields.density) * area[0])
    points = [e.sightings.xy @ e.to_pixels[:, :2].T + e.to_pixels[:, 2] for e in (training, twice)]
    assert np.allclose(*points)
    assert twice.speed.mean == pytest.approx(2 * training.speed.mean)
    assert replace(training, name="same").in_lengths_of(training.clip_body_px).fields is training.fields
