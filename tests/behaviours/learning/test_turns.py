"""How animals turn tells their parameters."""

from dataclasses import replace

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.models.herd import Params

from benchmarks.foreign_herds import herd
from benchmarks.herd_film import evidence_of_truth
from flockbrush.learning import turns as learning_turns
from flockbrush.learning.normal_equations import normal_equations
from flockbrush.learning.perceive import perceive
from flockbrush.learning.rollout import LEAST, Walls, theta_of
from flockbrush.learning.turn_kernels import _limited
from flockbrush.learning.turns import (
    TurnFit,
    Turns,
    _at_liberty,
    all_turns,
    best_fit,
    cramer_rao,
    fit_turns,
    predicted,
    theta_seen,
    thinned,
    turns_of,
)

WALLS = Walls(np.array([(2, 2, 3, 2), (3, 2, 3, 3), (3, 3, 2, 3), (2, 3, 2, 2)], float), np.zeros(4, np.int32))


def some_turns(seed, ticks, n=40, side=7.0, walls=None, radius=0.0):
    """Animals at random who turned by nothing."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-np.pi, np.pi, n)
    forward = np.column_stack([np.cos(angle), np.sin(angle)])
    percept = perceive(rng.uniform(0, side, (n, 2)), forward, params=Params(leader_neighbours=-1), walls=walls)
    velocity, spin = rng.normal(0, 1, (n, 2)), rng.normal(0, 1, n)
    rows = np.arange(n)
    return Turns(percept, velocity, spin, rows, np.full(n, ticks), np.zeros(n), np.ones(n), 0.3, radius)


def test_normal_equations_are_products_of_matrices():
    chance = np.random.default_rng(3)
    slopes, share, off = chance.normal(size=(400, 12)), chance.uniform(size=400), chance.normal(size=400)
    pull, information = normal_equations(slopes[:, :9], share, off)
    assert np.allclose(information, (slopes[:, :9] * share[:, None]).T @ slopes[:, :9])
    assert np.allclose(pull, slopes[:, :9].T @ (share * off))


@pytest.mark.parametrize("ticks", [1.0, 1.28, 3.0])
def test_slopes_are_finite_differences(ticks):
    turns = some_turns(1, ticks, walls=WALLS)
    theta = np.random.default_rng(2).uniform(0.1, 0.9, 12)
    slope = predicted(turns, theta, Params(max_turn=200.0))[1]
    assert np.abs(slope[:, 9:]).max() > 0  # walls are seen
    for q in range(12):
        step = np.eye(12)[q] * 1e-6
        ahead, behind = (predicted(turns, theta + way * step, Params(max_turn=200.0))[0] for way in (1, -1))
        assert np.allclose(slope[:, q], (ahead - behind) / 2e-6, atol=1e-6)


@pytest.mark.parametrize("radius", [0.0, 0.2])
def test_turns_of_one_tick_are_those_of_torch(radius):
    torch = pytest.importorskip("torch")
    from torch_turns import angle_between, contacts_of, turned

    from flockbrush.learning.torch_herd import headings, sight_of, theta_tensor

    turns, theta = some_turns(3, 1.0, radius=radius), np.random.default_rng(4).uniform(0.1, 0.9, 12)
    leaf, sight = theta_tensor(theta, "cpu", True), sight_of(turns.percept, device="cpu")
    contacts = contacts_of(turns.percept, 0.3, radius, "cpu") if radius else None
    ours, slope = predicted(turns, theta)
    angle = angle_between(sight.forward, turned(sight.forward, headings(leaf, sight), 10 / 32, contacts))
    assert np.abs(angle.detach().numpy() - ours).max() < 1e-9
    theirs = torch.stack([torch.autograd.grad(a, leaf, retain_graph=True)[0] for a in angle])
    assert np.abs(theirs.numpy() - slope).max() < 1e-8


def test_derivatives_hold_for_animals_that_prefer_a_side_and_turns_alone_are_the_same():
    turns, theta = some_turns(6, 2.0), np.random.default_rng(7).uniform(0.1, 0.9, 12)
    params = Params(max_turn=200.0, turn_bias=1.5)
    turn, slope = predicted(turns, theta, params)
    assert np.abs(turn - predicted(turns, theta, Params(max_turn=200.0))[0]).max() > 0.02
    step = np.eye(12)[3] * 1e-6
    ahead, behind = (predicted(turns, theta + way * step, params, False)[0] for way in (1, -1))
    assert np.allclose(slope[:, 3], (ahead - behind) / 2e-6, atol=1e-6)
    assert np.array_equal(turn, predicted(turns, theta, params, False)[0])


def test_neighbours_walk_on_between_the_ticks():
    """Two side by side, the other goes ahead: after some ticks who follows him turns another way."""
    turns = some_turns(5, 3.0)
    moved = predicted(turns._replace(velocity=np.zeros_like(turns.velocity)), np.full(12, 0.5))[0]
    assert np.abs(predicted(turns, np.full(12, 0.5))[0] - moved).max() > 1e-3


@pytest.mark.parametrize("change", [-0.3, 0.0, 0.05, 0.2])
def test_a_turn_that_wanders_is_limited_on_average(change):
    tries = np.clip(change + 0.1 * np.random.default_rng(0).standard_normal(400_000), -0.12, 0.12)
    mean, slope = _limited(change, 0.12, 0.1)
    assert abs(mean - tries.mean()) < 1e-3
    assert abs(slope - (_limited(change + 1e-6, 0.12, 0.1)[0] - mean) / 1e-6) < 1e-5


@pytest.mark.parametrize("name", ["swarm", "column", "mill-hollow"])
def test_turns_that_are_seen_tell_the_parameters(name):
    brush = shipped().get(name)
    truth = theta_of(brush.params)
    turns = turns_of(
        evidence_of_truth(herd(f"own:{name}", 80, 1.5, 32, seed=1, warmup=3)), brush.body, brush.vision, brush.params,
        span=1 / 32,
    )  # fmt: skip
    fit = best_fit(turns, brush.params, seed=1, starts=12, rows=1500)
    known = fit.deviation < 0.1
    assert known.sum() >= 6
    assert np.abs(fit.theta - truth)[known].mean() < 0.1
    assert (fit.theta[9:] == theta_of(Params())[9:]).all()  # no wall was seen: what is usual


def test_a_force_that_vanished_stays_so():
    """Turns tell nothing of a force that reaches nobody; those of obstacles get defaults where none is seen."""
    theta, usual = np.full(12, 0.3), theta_of(Params())
    theta[1] = LEAST
    told = np.ones(12)
    told[[0, 1, 2, 9, 10, 11]] = 0.0
    fit, turns = TurnFit(theta, np.zeros(1), 0.1, np.diag(told)), march()
    assert (theta_seen(fit, turns) == np.concatenate([theta[:9], usual[9:]])).all()
    assert (theta_seen(fit, turns, free=np.arange(12) < 9) == theta).all()
    at, n = turns.rows[3], turns.percept.animals
    for seen, alone in ((at, False), (np.setdiff1d(np.arange(n), turns.rows)[:1], True)):  # by who turns, by others
        first = np.concatenate([[0], np.cumsum(np.isin(np.arange(n), seen))])
        walls = turns.percept._replace(walls_first=first, walls_offset=np.ones((first[-1], 2)))
        assert (theta_seen(fit, turns._replace(percept=walls)) == theta).all() != alone


def march(**more):
    brush = shipped().get("march")
    film = herd("own:march", 40, 0.5, 32, seed=2, warmup=2)
    return turns_of(evidence_of_truth(film, **more), brush.body, brush.vision, brush.params, span=1 / 32)


def test_an_ablated_number_stays():
    free = np.ones(12, bool)
    free[2::3] = False
    held = np.ones(12)
    fit = best_fit(march(), seed=0, starts=3, free=free, held=held)
    assert (fit.theta[2::3] == 1).all()
    assert np.isfinite(fit.loss).all()


def test_the_best_so_far_is_kept_when_it_is_stopped(monkeypatch):
    turns, before, steps = march(), np.full(12, 0.5), []
    first = fit_turns(turns, before, steps=0)

    def ctrl_c(*now):
        steps.append(now)
        if len(steps) > 4:
            raise KeyboardInterrupt
        return step(*now)

    step = learning_turns._step
    monkeypatch.setattr(learning_turns, "_step", ctrl_c)
    second = fit_turns(turns, before)
    assert second.interrupted and second.loss[-1] < first.loss[-1]


def test_who_is_not_told_apart_tells_no_turns():
    assert march(sight=False) is None


@pytest.mark.parametrize("reach", [4.0, 16.0])
def test_a_film_that_holds_the_whole_herd_tells_all_turns_wherever_the_camera_never_looked(reach):
    seen = evidence_of_truth(herd("school", 40, 2.0, seed=4))
    params = Params(neighbour_range=reach, leader_neighbours=-1)
    ground = seen.fields.seen.copy()
    ground[:, :, 0] = False
    kinds = {"whole": np.zeros(len(seen.fields)), "cut": np.full(len(seen.fields), 0.2), "region": None}
    found = {}
    for kind, at_edge in kinds.items():
        fields = replace(seen.fields, seen=ground, at_edge=at_edge)
        found[kind] = len(turns_of(replace(seen, fields=fields), params=params).rows)
    assert found["whole"] == len(turns_of(seen, params=params).rows) > 0
    assert found["cut"] <= found["region"] < found["whole"]


@pytest.mark.parametrize("reach", [4.0, 8.0, 16.0])
def test_a_film_of_part_of_a_herd_leaves_turns_to_animals_that_see_far(reach):
    """Of 16 body lengths around nobody all would be in the picture."""
    seen = evidence_of_truth(herd("school", 60, 2.0, seed=4))
    xy = seen.sightings.xy
    ground = np.zeros_like(seen.fields.seen)
    at = np.floor((np.quantile(xy, [0.2, 0.8], axis=0) - seen.fields.origin) / seen.fields.cell).astype(int)
    ground[:, at[0, 1] - 5 : at[1, 1] + 5, at[0, 0] - 5 : at[1, 0] + 5] = True
    cut = replace(seen, fields=replace(seen.fields, seen=ground, at_edge=None))
    turns = turns_of(cut, params=Params(neighbour_range=reach, leader_neighbours=-1))
    assert len(turns.rows) > 0.25 * len(turns_of(seen, params=Params(leader_neighbours=-1)).rows)


def test_several_clips_are_learned_as_one():
    one = march()
    both = all_turns([one, None, one])
    turn, slope = predicted(both, np.full(12, 0.5))
    alone, _ = predicted(one, np.full(12, 0.5))
    assert np.array_equal(turn, np.concatenate([alone, alone]))
    assert len(thinned(both, 10).rows) == 10


def test_what_is_never_seen_is_not_known():
    information = np.diag([4.0, 0.0, 100.0])
    assert cramer_rao(information).tolist() == [0.5, np.inf, 0.1]
    twins = np.array([[1.0, 1.0], [1.0, 1.0]])  # only their sum is seen
    assert (cramer_rao(twins) > 1e5).all()


def test_who_is_wedged_between_others_says_nothing():
    """Three discs in a row that touch, and one alone: who does not turn at all and is touched is not asked."""
    xy, east = np.array([(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (5.0, 5.0)]), np.tile([1.0, 0.0], (4, 1))
    percept, turn = perceive(xy, east), np.array([0.0, 0.0, 0.1, 0.0])
    assert _at_liberty(percept, np.arange(4), turn, 0.0, 0.25, enough=1).round(3).tolist() == [0, 0, 1, 1]
    assert _at_liberty(percept, np.arange(4), turn, 0.0, 0.25, enough=9).min() == 0.1  # or nobody would be left


def test_animals_held_fast_do_not_spoil_what_the_others_say():
    turns = march()
    rng = np.random.default_rng(0)
    mad = turns._replace(turn=np.where(rng.random(len(turns.turn)) < 0.2, 0.5, turns.turn))
    begin = theta_of(shipped().get("march").params)
    fit = fit_turns(mad, np.clip(begin + 0.1, 0, 1), shipped().get("march").params)
    assert np.abs(fit.theta - begin)[:9].max() < 0.05
