"""What the errors of the paper say of small herds one can draw."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from flockbrush.behaviours.models.herd import Params
from torch_turns import contacts_of, heading_rollout

from flockbrush.film.observations import Fields
from flockbrush.learning.perceive import perceive
from flockbrush.learning.rollout import params_of
from flockbrush.learning.torch_herd import headings, sight_of, theta_tensor
from flockbrush.learning.torch_losses import (
    aims,
    density_of,
    error_mean,
    error_var,
    towards_density,
    variance_by_animal,
)
from flockbrush.learning.turns import Turns, predicted

EAST, NORTH, WEST = (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)
ALL = torch.tensor([True, True])


def fields(velocity=EAST, variance=0.0, density=None):
    """Four cells of 2 BL in a square, everybody at one velocity."""
    shape = (1, 2, 2)
    density = np.full(shape, 0.25) if density is None else np.reshape(density, shape).astype(float)
    return Fields(
        fps=25.0, cell=2.0, origin=np.zeros(2), density=density, velocity=np.tile(np.array(velocity), (*shape, 1)),
        speed_variance=np.zeros(shape), angular_variance=np.full(shape, float(variance)), seen=np.ones(shape, bool),
        obstacle=np.zeros(shape[1:], bool), region=np.zeros(shape[1:], np.uint8), count=np.array([4.0]),
        frames=np.arange(1),
    )  # fmt: skip


def vectors(*rows):
    return torch.tensor(rows, dtype=torch.float64)


def test_an_animal_goes_where_the_clip_has_more():
    """Too many in the west, too few in the east: to the east (eq. 10)."""
    simulated = density_of(np.array([(0.5, 0.5), (0.6, 0.5), (0.5, 2.5), (0.5, 2.6)]), fields())
    assert simulated.tolist() == [[0.5, 0.0], [0.5, 0.0]]
    assert (towards_density(simulated, fields().density[0], 2.0) @ np.array(EAST) > 0).all()


def test_density_and_velocity_are_blended():
    """The clip moves north and has more animals in the east: half and half is north-east (eq. 11)."""
    xy = np.array([(0.5, 0.5), (0.6, 0.5), (0.5, 2.5), (0.5, 2.6)])
    aim = aims(fields(NORTH), 0, xy, 0.5)
    assert torch.allclose(aim.direction, vectors(*[(2**-0.5, 2**-0.5)] * 4))
    assert torch.equal(aims(fields(NORTH), 0, xy, 0.0).direction, vectors(*[NORTH] * 4))


def test_the_error_of_the_mean_is_the_length_between_headings():
    """One as asked, one at right angles: half of the root of two (eq. 7); a leader is not counted."""
    aim = aims(fields(EAST), 0, np.array([(0.5, 0.5), (3.0, 3.0)]), 0.0)
    assert abs(float(error_mean(vectors(EAST, NORTH), aim, ALL)) - 0.5 * 2**0.5) < 1e-5
    assert float(error_mean(vectors(EAST, NORTH), aim, torch.tensor([True, False]))) < 1e-5


def test_nobody_asked_is_no_error():
    aim = aims(fields(), 0, np.array([(-9.0, -9.0)]), 0.5)
    assert float(error_mean(vectors(EAST), aim, ALL[:1])) == 0
    assert float(error_var(vectors(EAST), aim, ALL[:1], 4)) == 0


def test_disorder_is_the_variance_of_unsigned_angles():
    """East, north-east, north: 45, 0 and 45 degrees from their mean."""
    diagonal = 2**-0.5, 2**-0.5
    variance, number = variance_by_animal(vectors(EAST, diagonal, NORTH), torch.zeros(3, dtype=torch.int64), 4)
    assert torch.allclose(variance, torch.full((3,), np.var([45.0, 0.0, 45.0]), dtype=torch.float64))
    assert number.tolist() == [3, 3, 3]


def test_chance_is_the_disorder_of_animals_that_lie_any_way():
    angle = torch.linspace(-torch.pi, torch.pi, 2001, dtype=torch.float64)[1:] + 1e-3
    any_way = torch.stack([torch.cos(angle), torch.sin(angle)], 1)
    any_way[0] = vectors(EAST)[0] * 3  # so that there is a mean direction
    variance, _ = variance_by_animal(any_way, torch.zeros(2000, dtype=torch.int64), 1)
    assert abs(float(variance[0]) - 2700) < 10


def test_the_errors_have_slopes():
    """Gradients of both errors are finite differences."""
    xy = np.random.default_rng(0).uniform(0, 4, (12, 2))
    angle = np.random.default_rng(1).uniform(-np.pi, np.pi, 12)
    percept = perceive(xy, np.column_stack([np.cos(angle), np.sin(angle)]), params=Params(leader_neighbours=-1))
    sight, aim = sight_of(percept, device="cpu"), aims(fields(variance=900.0), 0, xy, 0.5)

    def both(theta):
        ahead = headings(theta, sight)
        return error_mean(ahead, aim, ~sight.leader) + error_var(ahead, aim, ~sight.leader, 4)

    assert torch.autograd.gradcheck(both, theta_tensor(np.full(12, 0.6), "cpu", True))


def test_turns_over_some_ticks_are_those_of_the_other_kernel():
    rng = np.random.default_rng(2)
    angle = rng.uniform(-np.pi, np.pi, 30)
    percept = perceive(
        rng.uniform(0, 6, (30, 2)), np.column_stack([np.cos(angle), np.sin(angle)]), params=Params(leader_neighbours=-1)
    )
    theta, still = np.full(12, 0.4), np.zeros((30, 2))
    turns = Turns(percept, still, np.zeros(30), np.arange(30), np.full(30, 2.5), np.zeros(30), np.ones(30), 0.3, 0.0)
    params = params_of(theta, {"max_turn": 3.0})
    ours = heading_rollout(theta_tensor(theta, "cpu"), sight_of(percept, device="cpu"), 2.5, limit=3.0)
    assert np.abs(ours.numpy() - predicted(turns, theta, params)[0]).max() < 1e-9


def test_bodies_without_a_radius_touch_nobody():
    percept = perceive(np.array([(0.0, 0.0), (0.0, 0.3)]), np.array([EAST, EAST]))
    assert contacts_of(percept, 0.0, 0.0).i == []
