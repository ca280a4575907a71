"""The forces of D'Orsogna et al. 2006 by their equations, and the mill that such herds make."""

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import TAKES_UP, behaviours
from flockbrush.components import Position
from scipy.integrate import solve_ivp
from scipy.spatial import cKDTree
from small_herd import brush, forward_of, meadow, put
from small_scenes import scene, steer

MORSE = behaviours()["morse"]
NUMBERS = {
    "attraction": 3.0, "attraction_reach": 4.0, "repulsion": 5.0, "repulsion_reach": 0.8, "propulsion": 0.7,
    "max_turn": 200.0, "wander": 0.0,
}  # fmt: skip
DT, SPEED = 1 / 32, 1.2  # of `scene`


def turn_and_pace(xy, heading=0.0, **more):
    """What the first animal does: rad in a tick, and its pace."""
    numbers = NUMBERS | {name: more.pop(name) for name in list(more) if name in MORSE.Params.model_fields}
    wishes = steer(MORSE, scene(xy, heading, **more), [0], **numbers)
    return np.arctan2(*wishes.direction[0, 1::-1]), wishes.pace[0]


def moving(speed, count):
    return np.tile([speed, 0.0, 0.0], (count, 1))


def as_written(force):
    """The same of a force (2,), for an animal that heads to the right at its own speed."""
    rest = np.sqrt(np.clip(1 + force[0] / (0.7 * SPEED), 0.04, 4.0))
    return force[1] / SPEED * DT, 1 + 2 * 0.7 * TAKES_UP * (rest - 1)


def test_the_force_is_the_gradient_of_the_potential():
    """Attraction is the mean of the others' and repulsion their sum (eqs. 2 and 3)."""
    herd = np.vstack([np.zeros(2), np.random.default_rng(5).uniform(-3, 3, (20, 2))])

    def potential(at):
        far = np.hypot(*(herd[1:] - at).T)
        return (5.0 * 0.8 * np.exp(-far / 0.8)).sum() - (3.0 * 4.0 * np.exp(-far / 4.0)).mean()

    by = 1e-6
    force = -np.array([(potential(step) - potential(-step)) / (2 * by) for step in by * np.eye(2)])
    assert turn_and_pace(herd) == pytest.approx(as_written(force), abs=1e-7)


def test_as_many_again_in_the_same_places_attract_no_more():
    far = [(0, 0), (1, 12), (-2, 14)]
    assert turn_and_pace([*far, *far[1:]]) == pytest.approx(turn_and_pace(far), abs=1e-6)


def test_forces_along_the_heading_only_change_the_speed():
    turn, pace = turn_and_pace([(0, 0), (0.3, 0)])
    assert turn == 0.0 and pace < 1.0  # it brakes for the one in front
    assert turn_and_pace([(0, 0), (-0.3, 0)])[1] > 1.0 and turn_and_pace([(0, 0), (6, 0)])[1] > 1.0
    assert turn_and_pace([(0, 0), (0.3, 0)], propulsion=0.0) == (0.0, 1.0)
    crush = (
        turn_and_pace([(0, 0), (0.1, 0)], repulsion=900.0, propulsion=5.0)[1],
        turn_and_pace([(0, 0), (-0.1, 0)], repulsion=900.0, propulsion=5.0)[1],
    )
    assert crush == pytest.approx((0.2, 2.0))  # at once: it comes to rest sooner than animals change efforts


@pytest.mark.parametrize("alpha", [0.2, 0.5, 1.0])
@pytest.mark.parametrize("share", [0.1, -0.1])
def test_speeds_change_as_the_equation_of_the_paper_says(alpha, share):
    """dv/dt = (α - β v²) v + F (eq. 1) by another integrator, for a force along the heading that begins at once."""
    force = share * alpha * SPEED
    led = {"leader": [1], "guidance": (np.sign(force), 0.0), "guidance_weight": abs(force), "propulsion": alpha}
    effort, efforts = 1.0, []
    for _ in range(160):
        wanted = turn_and_pace([(0, 0)], effort=np.array([effort]), velocity=moving(SPEED * effort, 1), **led)[1]
        effort += (wanted - effort) * DT / TAKES_UP
        efforts.append(effort)
    beta = alpha / SPEED**2
    times = DT * np.arange(1, 161)
    paper = solve_ivp(lambda _, v: (alpha - beta * v * v) * v + force, (0, 5), [SPEED], t_eval=times, rtol=1e-9).y[0]
    assert np.abs(np.array(efforts) - paper / SPEED).max() < 0.05 * np.abs(paper / SPEED - 1).max()


def test_slow_animals_turn_more_but_no_faster_than_they_can():
    side = [(0, 0), (0, 5)]
    slow, slower, still = (turn_and_pace(side, velocity=moving(v, 2))[0] for v in (0.6, 0.05, 0.0))
    assert slow == pytest.approx(2 * turn_and_pace(side)[0]) and slower == still == pytest.approx(6 * slow)
    assert turn_and_pace(side, velocity=moving(0.0, 2), max_turn=0.5)[0] == pytest.approx(0.5 * DT)


def test_other_species_and_obstacles_repel():
    others = {"species": np.array([0, 1], np.int32)}
    repelled = as_written(np.array([0.0, -5.0 * np.exp(-0.5 / 0.8)]))
    assert turn_and_pace([(0, 0), (0, 0.5)], **others) == pytest.approx(repelled)
    assert turn_and_pace([(0, 0)], obstacles=[(0, 0.5)]) == pytest.approx(repelled)
    assert turn_and_pace([(0, 0), (0, 9)], **others)[0] < 0 < turn_and_pace([(0, 0), (0, 9)])[0]


def test_a_guide_is_one_more_force_on_a_leader():
    led = {"guidance": (0.0, 0.3), "guidance_weight": 2.0}
    assert turn_and_pace([(0, 0)], leader=[1], **led) == pytest.approx(as_written(np.array([0.0, 2.0])))
    assert turn_and_pace([(0, 0)], leader=[0], **led) == (0.0, 1.0)


def test_lengths_are_those_of_the_animal():
    herd = np.array([(0.0, 0.0), (1.0, 0.5), (-2.0, 1.5)])
    large = turn_and_pace(3.0 * herd, length=3.0, velocity=moving(3.6, 3))
    assert large == pytest.approx(turn_and_pace(herd), abs=1e-12)


def distances_of_a_mill(propulsion, count=60):
    """(milling, distances to the nearest neighbour) of animals 15 s after they began as a turning ring."""
    herd = brush(
        "mill", "morse", mean=3.0, speed={"deviation": 0.3}, vision={"range": 20.0, "sight": "metric"},
        body={"radius": 0.2}, propulsion=propulsion,
    )  # fmt: skip
    simulation = meadow(herd, width=100, height=100)
    k = np.arange(count)
    far, angle = np.sqrt(9.0 + 0.6 * k), 2.39996 * k
    put(
        simulation, 50 + far[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]), angle + np.pi / 2, brush="mill"
    )
    simulation.run(480)
    xy, forward = simulation.agents[Position.xyz][:, :2], forward_of(simulation)[:, :2]
    out = xy - xy.mean(0)
    turning = (out[:, 0] * forward[:, 1] - out[:, 1] * forward[:, 0]) / np.hypot(*out.T)
    return abs(turning.mean()), cKDTree(xy).query(xy, 2)[0][:, 1]


def test_a_ring_goes_on_milling_and_braking_keeps_even_distances_however_many_they_are():
    (milling, far), (without, uneven) = distances_of_a_mill(0.5), distances_of_a_mill(0.0)
    assert milling > 0.8 and without > 0.8
    spread = far.std() / far.mean()
    assert spread < 0.35 and spread < 0.7 * uneven.std() / uneven.mean()
    milling, of_many = distances_of_a_mill(0.5, 180)
    assert milling > 0.8 and of_many.mean() == pytest.approx(far.mean(), rel=0.15)
