"""Turns tell brushes apart that order and distances do not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from benchmarks.learning_models import evidence_of, tracks_of, truths
from flockbrush.film.track_evidence import evidence_of_tracks
from flockbrush.film.track_files import Trajectories
from flockbrush.learning import response as module
from flockbrush.learning.battery import MEASURES
from flockbrush.learning.response import RESPONSE, SCATTER, response
from flockbrush.learning.rollout import HerdStart, rollout, theta_of
from flockbrush.learning.simulate import simulated
from flockbrush.learning.turns import predicted, residuals, turns_of

TRUTH = shipped().get("column")


@pytest.fixture(scope="module")
def clip():
    """Four seconds of sixty animals under a shipped brush, seen as uncertainly as blobs are."""
    exact, rng = evidence_of_truth(herd("own:column", 60, 4.0, 25.0, 4)), np.random.default_rng(1)
    seen, place, heading = exact.sightings, 0.02, 0.03
    angle = np.arctan2(seen.forward[:, 1], seen.forward[:, 0]) + heading * rng.normal(size=len(seen.xy))
    xy = seen.xy + place * rng.normal(size=seen.xy.shape)
    noisy = replace(seen, xy=xy, forward=np.column_stack([np.cos(angle), np.sin(angle)]))
    return replace(exact, sightings=noisy, place_noise=place, heading_noise=heading)


def changed(**params):
    return TRUTH.model_copy(update={"params": TRUTH.params.model_copy(update=params)})


def rows_of(clip, brush, runs=4):
    found = response(clip, brush, [simulated(clip, brush, seed, True) for seed in range(runs)])
    return {row.name: row for row in found}


def test_the_truth_turns_as_the_clip_does(clip):
    rows = rows_of(clip, TRUTH)
    assert rows[RESPONSE].met and rows[SCATTER].met
    assert rows[RESPONSE].clip == pytest.approx(rows[RESPONSE].herd, rel=0.15)


@pytest.mark.parametrize("weight", ["cohesion_weight", "alignment_weight"])
def test_who_hardly_minds_its_neighbours_is_told_by_its_turns(clip, weight):
    row = rows_of(clip, changed(**{weight: 0.1 * getattr(TRUTH.params, weight)}))[RESPONSE]
    assert row.far > 1.5


def test_who_wanders_is_told_by_the_scatter_of_turns(clip):
    assert not rows_of(clip, changed(wander=1.5))[SCATTER].met


def test_of_a_large_herd_fewer_moments_say_the_same(clip, monkeypatch):
    whole = len(module.turns_seen(clip, clip.sightings, TRUTH).rows)
    monkeypatch.setattr(module, "MANY", 1500)
    assert len(module.turns_seen(clip, clip.sightings, TRUTH).rows) == pytest.approx(whole / 2, rel=0.05)
    assert rows_of(clip, TRUTH)[RESPONSE].met
    assert rows_of(clip, changed(cohesion_weight=0.1 * TRUTH.params.cohesion_weight))[RESPONSE].far > 1.5


def test_what_a_clip_asks_for_is_the_least_squares_change_of_the_numbers(clip):
    turns = turns_of(clip, TRUTH.body, TRUTH.vision, TRUTH.params)
    turn, slope = predicted(turns, theta_of(TRUTH.params), TRUTH.params)
    off, share, _ = residuals(turns, turn)
    root, weight = np.sqrt(share)[:, None], share / share.sum()
    wished = slope[:, :9] @ np.linalg.lstsq(root * slope[:, :9], root[:, 0] * off, rcond=1e-3)[0]
    gram, pull = (slope[:, :9] * weight[:, None]).T @ slope[:, :9], (slope[:, :9] * weight[:, None]).T @ off
    values, vectors = np.linalg.eigh(gram)
    told = values > module.FAINTEST**2 * values.max()
    asked = np.linalg.norm(pull @ vectors[:, told] / np.sqrt(values[told]))
    assert asked == pytest.approx(np.sqrt(weight @ wished**2), rel=1e-3)


@pytest.mark.parametrize(("changes", "met"), [({}, True), ({"orientation": 0.2, "attraction": 0.3}, False)])
def test_zones_are_told_by_the_numbers_of_their_likelihood(changes, met):
    truth = truths()["zones"][1]
    clip = evidence_of(tracks_of(truth, 40, 4.0))
    brush = SimpleNamespace(
        params=truth.params.model_copy(update=changes), speed=truth.speed, body=truth.body, vision=truth.vision
    )
    rows = rows_of(clip, brush)
    assert rows[RESPONSE].met == met


def test_nothing_is_said_of_models_without_a_likelihood_and_of_fields_alone(clip):
    fields = replace(clip, sightings=None)
    assert response(fields, TRUTH, [simulated(fields, TRUTH, seed) for seed in (1, 2)]) == []
    assert response(clip, shipped().get("geese"), [simulated(clip, TRUTH, seed) for seed in (1, 2)]) == []


def test_a_difference_that_nobody_sees_is_none():
    """Of exact tracks turns scatter by a tenth of a degree, and a half of that is no difference."""
    rng, graze = np.random.default_rng(0), shipped().get("graze")
    angle = rng.uniform(-3, 3, 30)
    start = HerdStart(4.0 * rng.normal(size=(30, 2)), np.column_stack([np.cos(angle), np.sin(angle)]))
    run = rollout(start, graze.params, graze.speed, graze.body, graze.vision, seconds=12.0, fps=10, seed=3)
    xy = run.xy.reshape(len(run), 30, 2)[60:]
    exact = evidence_of_tracks(Trajectories(xy, tuple(map(str, range(30))), 10.0, "m"), 1.0)
    rows = rows_of(exact, graze, 2)
    for name in (RESPONSE, SCATTER):
        assert rows[name].limit >= MEASURES[name].floor > 0.0
    assert rows[SCATTER].clip < 0.006 and rows[SCATTER].met


def test_that_changes_nothing_where_sights_are_uncertain(clip, monkeypatch):
    rows = rows_of(clip, TRUTH, 2)
    without = {name: replace(measure, floor=0.0) for name, measure in MEASURES.items()}
    monkeypatch.setattr(module, "MEASURES", without)
    assert rows_of(clip, TRUTH, 2) == rows
