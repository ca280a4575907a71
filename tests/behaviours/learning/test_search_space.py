"""Where a search begins when fields alone are known: herds of all kinds, and turning ones where they show a mill."""

import numpy as np
import pytest

from benchmarks.foreign_herds import Truth
from benchmarks.herd_film import evidence_of_truth
from flockbrush.learning.rollout import LEAST
from flockbrush.learning.search_space import begins, rotation_of

OMEGA = 0.8  # rad/s


def disc(omega, drift=(0.0, 0.0), frames=20, fps=20.0):
    """The evidence of a disc of animals that turns like a wheel and drifts, rad/s and BL/s."""
    rng = np.random.default_rng(5)
    far, angle = 6.0 * np.sqrt(rng.uniform(0.02, 1.0, 120)), rng.uniform(-np.pi, np.pi, 120)
    time = np.arange(frames)[:, None] / fps
    turned = angle + omega * time
    xy = np.stack([far * np.cos(turned), far * np.sin(turned)], -1)
    velocity = omega * np.stack([-xy[..., 1], xy[..., 0]], -1) + drift
    speed = np.linalg.norm(velocity, axis=-1)
    return evidence_of_truth(Truth("disc", fps, xy + time[..., None] * drift, velocity / speed[..., None], speed))


@pytest.mark.parametrize("omega", [OMEGA, -OMEGA])
def test_fields_say_how_fast_and_to_which_side_a_mill_turns(omega):
    assert rotation_of([disc(omega)]) == pytest.approx(omega, rel=0.1)


def test_a_herd_that_marches_and_mills_to_both_sides_have_no_rotation():
    assert rotation_of([disc(0.05, drift=(3.0, 0.0))]) == 0.0
    assert rotation_of([disc(OMEGA), disc(-OMEGA)]) == 0.0


def test_half_of_the_draws_turn_as_the_mill_does_and_at_most_as_fast():
    drawn = begins(1, 5, True, False, 64, rotation=-OMEGA)[5:]
    turns = [extras["turn_bias"] for _, _, extras in drawn if "turn_bias" in extras]
    assert len(drawn) == 64 and len(turns) == 32
    assert -OMEGA <= min(turns) < -0.7 * OMEGA and -0.3 * OMEGA < max(turns) <= 0.0
    assert not any("turn_bias" in extras for _, _, extras in begins(1, 5, True, False, 64))


def test_some_draws_lack_a_force_or_have_a_weak_one():
    weights = np.array([theta[0:9:3] for _, theta, _ in begins(1, 5, True, False, 200)[5:]])
    assert ((weights == LEAST).mean(0)[1:] > 0.03).all() and (weights[:, 0] > LEAST).all()
    assert (np.quantile(weights, 0.2, axis=0) < 0.1).all() and (np.quantile(weights, 0.8, axis=0) > 0.3).all()
