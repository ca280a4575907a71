"""Random turns of a clip: how far they go and how long they last, and the answer to neighbours that they hide."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.components import Heading, Position
from flockbrush.levels.build import plane

from benchmarks.foreign_herds import Truth
from benchmarks.herd_film import evidence_of_truth
from flockbrush.learning.response import correction, turns_seen
from flockbrush.learning.rollout import HerdStart, rollout, theta_of
from flockbrush.learning.trials import USE, SearchSettings, Setting, simulate, wandering

ANIMALS, FPS = 120, 25.0


def seen(brush, seconds=2.0, seed=4):
    """A herd with everything known."""
    agents = plane(brush, ANIMALS, density=0.1, seed=3).agents
    start = HerdStart(agents[Position.xyz][:, :2].copy(), agents[Heading.forward][:, :2].copy())
    run = rollout(start, brush.params, brush.speed, brush.body, brush.vision, seconds=seconds, fps=FPS, seed=seed)
    shape = len(run), ANIMALS
    return evidence_of_truth(
        Truth("turns", FPS, run.xy.reshape(*shape, 2), run.forward.reshape(*shape, 2), run.speed.reshape(shape))
    )


def given(clip, brush):
    return Setting.of((clip,), SearchSettings(speed=brush.speed, body=brush.body))


def wanderers(wander, wander_time, **more):
    """A brush of animals that turn at random, and what it says besides its twelve numbers and chance."""
    more |= {"wander": wander, "wander_time": wander_time, "leader_neighbours": -1}
    brush = shipped().get("graze").with_parameters(**more)
    return brush, {"neighbour_range": brush.params.neighbour_range, "leader_neighbours": -1}


@pytest.mark.parametrize(("wander", "wander_time"), [(0.4, 0.125), (0.4, 0.4), (0.8, 0.25)])
def test_a_clip_tells_how_far_and_how_long_animals_turn_at_random(wander, wander_time):
    brush, sight = wanderers(wander, wander_time)
    found = wandering(given(seen(brush), brush), theta_of(brush.params), sight, 1)
    assert found["wander"] == pytest.approx(wander, rel=0.15)
    assert found["wander_time"] == pytest.approx(wander_time, rel=0.25)  # of long ones too short, by .23 in the mean
    assert np.abs(np.array(found["theta"]) - theta_of(brush.params)).max() < 0.1


def test_a_clip_without_random_turns_tells_none():
    brush, sight = wanderers(0.0, 0.0)
    assert wandering(given(seen(brush), brush), theta_of(brush.params), sight, 1)["wander"] < 0.01


@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_numbers_that_random_turns_hide_are_corrected(factor):
    """A weight of alignment that is half as large or half as large again; other numbers take a part of the step."""
    brush, sight = wanderers(0.3, 0.3, alignment_weight=0.1)
    clip, setting, theta = seen(brush), given(seen(brush), brush), theta_of(brush.params)
    off = (factor - 1.0) * theta[6]
    theta[6] += off
    wrong = setting.brush(theta, sight | {"wander": 0.3, "wander_time": 0.3})
    runs = [simulate(clip, wrong.params, brush.speed, brush.body, wrong.vision, seed) for seed in range(3)]
    step = correction(clip, wrong, runs, lambda: turns_seen(clip, clip.sightings, wrong))
    assert abs(off + step[6]) < 0.6 * abs(off)


def test_numbers_that_an_ablation_holds_stay_as_they_are():
    brush, sight = wanderers(0.4, 0.3)
    theta, clip = theta_of(brush.params), seen(brush)
    for use, held in ((USE, False), (USE - {"angular"}, True)):
        setting = Setting.of((clip,), SearchSettings(speed=brush.speed, body=brush.body, use=use))
        found = np.array(wandering(setting, theta, sight, 1)["theta"])
        assert (found[2:9:3] == theta[2:9:3]).all() == held and found[0] != theta[0]
