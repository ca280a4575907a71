"""Real flocks lifted: ten pigeons with GPS (Nagy et al. 2010), filmed by a camera that never was."""

import numpy as np
import pytest

from benchmarks.lift import PIGEONS, compute_depth, compute_flock, filmed, pigeon_films, seen, turned
from flockbrush.lifting.lift_solver import lift

pytestmark = pytest.mark.skipif(not PIGEONS.is_dir(), reason=f"there is no {PIGEONS}")


@pytest.fixture(scope="module")
def films():
    return [xyz for _, xyz in pigeon_films(8.0, 25)]


def test_pigeons_fly_as_one_and_circle(films):
    polarization, _, turn = np.median([compute_flock(xyz, 25) for xyz in films], axis=0)
    assert polarization > 0.98 and turn > 90


def test_the_depths_of_pigeons_are_known_better_than_by_one_constant_depth(films):
    told = []
    for k, xyz in list(enumerate(films))[::2]:
        truth, camera = filmed(turned(xyz, k), fps=25)
        told.append(compute_depth(truth, lift(seen(truth, camera, 0.5, k), camera)))
    error, constant, correlation, direction = (
        np.array([row[name] for row in told]) for name in ("error", "constant", "correlation", "direction")
    )
    assert error.mean() < 0.85 * constant.mean()
    assert np.median(correlation) > 0.75
    assert direction.mean() < 25
