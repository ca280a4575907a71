"""The forces in torch are the forces of a run, and their gradients are gradients."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from flockbrush.behaviours.behaviour import ByRow, frozen
from flockbrush.behaviours.brush import BodySpec, VisionSpec
from flockbrush.behaviours.models.herd import HerdState, Land, Params, forces_of, herd_kernel
from torch_turns import contacts_of, turned

from flockbrush.learning.perceive import Percept, perceive, together
from flockbrush.learning.rollout import Walls, params_of
from flockbrush.learning.torch_herd import forces, headings, sight_of, theta_tensor

DT = 1 / 32
LEADERLESS = Params(leader_neighbours=-1)
SQUARE = Walls(np.array([(2, 2, 3, 2), (3, 2, 3, 3), (3, 3, 2, 3), (2, 3, 2, 2)], float), np.zeros(4, np.int32))


def some_herd(seed, n=40, side=6.0):
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-np.pi, np.pi, n)
    return rng.uniform(0, side, (n, 2)), np.column_stack([np.cos(angle), np.sin(angle)])


def some_theta(seed):
    return np.random.default_rng(seed + 1000).uniform(0.05, 1, 12)


def by_kernel(percept: Percept, params):
    """Next headings by the kernel of a run, (n, 2)."""
    n = percept.animals
    rows = np.arange(n, dtype=np.int32)
    forward, direction = np.column_stack([percept.forward, np.zeros(n)]), np.zeros((n, 3))
    herd = HerdState(forward, np.ones(n), np.zeros(n, np.int32), percept.leader, percept.memory, percept.known)
    seen = frozen(ByRow(percept.first, percept.near, percept.offset))
    land = frozen(Land(percept.walls_first, percept.walls_offset, np.zeros((n, 2)), np.zeros((n, 2))))
    herd_kernel(0, n, rows, DT, frozen(herd), seen, land, forces_of(params), direction)
    return direction[:, :2]


@pytest.mark.parametrize("seed", range(8))
def test_an_animal_turns_in_torch_as_in_a_run(seed):
    xy, forward = some_herd(seed)
    view = VisionSpec(range=3.0 + seed % 3, occlusion=seed % 4 < 3)
    percept = perceive(xy, forward, BodySpec(), view, walls=SQUARE)
    ours = headings(theta_tensor(some_theta(seed)), sight_of(percept), DT)
    assert np.abs(ours.cpu().numpy() - by_kernel(percept, params_of(some_theta(seed)))).max() < 1e-9


def test_leaders_return_in_torch_as_in_a_run():
    percept = perceive(*some_herd(3, n=30, side=22.0))  # thin: most of them lead
    chance = np.random.default_rng(3)
    known, memory = chance.integers(0, 2, 30).astype(np.uint8), chance.uniform(-3, 3, (30, 2))
    percept = percept._replace(known=known, memory=memory)
    assert 5 < percept.leader.sum() <= 30
    ours = headings(theta_tensor(some_theta(3)), sight_of(percept), DT)
    assert np.abs(ours.cpu().numpy() - by_kernel(percept, params_of(some_theta(3)))).max() < 1e-9


def test_gradients_are_finite_differences():
    xy, forward = some_herd(5, n=9, side=4.0)
    sight = sight_of(perceive(xy, forward, params=LEADERLESS, walls=SQUARE), device="cpu")

    def of(theta, sensitivity, facing):
        return headings(theta, sight, DT, sensitivity=sensitivity, forward=facing)

    leaves = theta_tensor(some_theta(5), "cpu", True), torch.tensor(10.0, dtype=torch.float64), sight.forward.clone()
    assert torch.autograd.gradcheck(of, [leaf.requires_grad_(True) for leaf in leaves])


def test_animals_in_one_place_have_a_gradient():
    """Both stand on the same spot: no bearing, no distance, and no NaN."""
    percept = perceive(np.zeros((3, 2)), np.tile([1.0, 0.0], (3, 1)), params=LEADERLESS)
    percept = percept._replace(first=np.array([0, 1, 1, 1]), near=np.array([1], np.int32), offset=np.zeros((1, 2)))
    theta = theta_tensor(np.full(12, 0.5), requires_grad=True)
    headings(theta, sight_of(percept), DT).sum().backward()
    assert torch.isfinite(theta.grad).all()


def test_nobody_in_sight_is_no_force():
    percept = perceive(np.array([(0.0, 0.0), (90.0, 0.0)]), np.array([(1.0, 0.0), (0.0, 1.0)]))
    assert forces(theta_tensor(np.full(12, 0.5)), sight_of(percept)).abs().max() == 0
    assert percept.leader.all()


def test_a_batch_is_its_moments_side_by_side():
    percepts = [perceive(*some_herd(seed, n=10 + seed), walls=SQUARE if seed else None) for seed in range(3)]
    theta = theta_tensor(some_theta(0))
    alone = torch.cat([headings(theta, sight_of(p), DT) for p in percepts])
    assert torch.equal(headings(theta, sight_of(together(percepts)), DT), alone)


def test_bodies_that_touch_turn_a_heading_aside():
    """Side by side, a quarter of a body apart: who wants to walk into the other walks along him."""
    xy, east = np.array([(0.0, 0.0), (0.0, 0.41)]), np.tile([1.0, 0.0], (2, 1))
    contacts = contacts_of(perceive(xy, east), 0.3, 0.2)
    north = torch.tensor([(0.0, 1.0), (1.0, 0.0)], dtype=torch.float64)
    diagonal = torch.tensor([(2**-0.5, 2**-0.5), (1.0, 0.0)], dtype=torch.float64)
    forward = torch.as_tensor(east)
    assert turned(forward, diagonal, 9.0, contacts)[0, 1] < 0.5
    assert torch.equal(turned(forward, diagonal, 9.0, contacts)[1], forward[1])
    slow = turned(forward, north, 0.1)
    assert torch.allclose(slow[0], torch.tensor([np.cos(0.1), np.sin(0.1)]))


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
def test_a_graphics_card_gives_the_same_turns():
    percept = perceive(*some_herd(1, n=200, side=14.0))
    theta = some_theta(1)
    there = headings(theta_tensor(theta, "cuda"), sight_of(percept, device="cuda"), DT).cpu()
    assert torch.allclose(there, headings(theta_tensor(theta, "cpu"), sight_of(percept, device="cpu"), DT), atol=1e-9)
