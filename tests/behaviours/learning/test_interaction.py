"""Herds that take no notice of each other are not learned from animals that do."""

import numpy as np
import pytest

from benchmarks.foreign_herds import Truth
from benchmarks.herd_film import evidence_of_truth
from flockbrush.learning import recipe, trials
from flockbrush.learning.interaction import LEAST, SHOWN, idle_ones, interaction_of
from flockbrush.learning.rollout import theta_of
from flockbrush.learning.turns import turns_of
from tests.behaviours.learning.test_recipe import swarm_of_graze

EXTRAS = {"neighbour_range": 4.0}


def of_nobody(animals=24, frames=40, fps=20.0):
    """A clip of animals that turn at random, each by itself."""
    rng = np.random.default_rng(5)
    angle = np.cumsum(rng.normal(0, 0.1, (frames, animals)), 0) + rng.uniform(-np.pi, np.pi, animals)
    ahead = np.stack([np.cos(angle), np.sin(angle)], -1)
    xy = rng.uniform(0, 8, (animals, 2)) + np.cumsum(ahead, 0) / fps
    return evidence_of_truth(Truth("strangers", fps, xy, ahead, np.ones((frames, animals))))


@pytest.fixture(scope="module")
def grazing():
    return swarm_of_graze()


def test_turns_show_whether_animals_answer_to_each_other(grazing):
    clip, brush = grazing
    theta = theta_of(brush.params)
    there = interaction_of(turns_of(clip, span=0.2), theta, EXTRAS, 4.0)
    assert there.evidence > SHOWN and there.strength > 0.01
    assert interaction_of(turns_of(of_nobody(), span=0.2), theta, EXTRAS, 4.0).evidence < 0
    nobody = theta.copy()
    nobody[0:9:3] = 1e-3
    assert interaction_of(turns_of(clip, span=0.2), nobody, EXTRAS, 4.0).strength < 0.1 * there.strength


def test_who_hardly_interacts_is_idle_only_where_the_clip_shows_interaction():
    fit, weak = {"strength": 0.2, "evidence": 2 * SHOWN}, {"strength": 0.19 * LEAST, "evidence": 0.0}
    assert idle_ones([fit], [fit, weak]) == [False, True]
    assert idle_ones([fit | {"evidence": 0.5 * SHOWN}], [fit, weak]) == [False, False]
    assert idle_ones([], [weak]) == [False] and idle_ones([{}], [{}]) == [False]


def test_a_herd_without_interaction_is_not_learned_though_its_trials_are_the_best(grazing, monkeypatch):
    """Some seconds of order and turning need no interaction: here every trial is better the less there is of it."""

    def judged(given, theta, extras, seed, held, lasting, begin=0):
        return [{"spread": float(sum(theta[0:9:3]))}]

    clip, brush = grazing
    nobody = theta_of(brush.params)
    nobody[0:9:3] = 1e-3
    begins = [("nobody", nobody, {"wander": 0.3, **EXTRAS}), ("random 1", theta_of(brush.params), EXTRAS)]
    monkeypatch.setattr(recipe, "trial", judged)
    monkeypatch.setattr(trials, "STAY", 3.0)
    found = recipe.learn(clip, recipe.SearchSettings(seed=1, budget_s=0.5, begins=begins))
    assert max(found.theta[0:9:3]) * found.extras.get("sensitivity", 10.0) > 1.0
    assert any("hardly react to neighbours" in note for note in found.notes)
