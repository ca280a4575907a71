"""What a force map says, pair by pair, what becomes of a herd of it, and that tracks tell it."""

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.models.force_map import KNOTS
from flockbrush.components import BrushBinding, Position
from flockbrush.engine.state import restore, snapshot, state_hash
from flockbrush.levels.schema import BrushLayer, PaintBounds
from flockbrush.systems.palette import Palette
from small_herd import brush, forward_of, meadow, put

from tests.behaviours.test_models import scene

MAP = behaviours()["force_map"]
NOTHING = {name: 0.0 for name in MAP.Params.model_fields if name.startswith(("attraction", "alignment", "front"))}
EXACT = NOTHING | {"obstacle_repulsion": 0.0, "max_turn": 200.0, "wander": 0.0}


def rate(xy, heading=0.0, **more):
    """How fast the first animal turns to the left, rad/s; it faces along x."""
    parameters = EXACT | {name: more.pop(name) for name in list(more) if name in MAP.Params.model_fields}
    made = scene(xy, heading, **more)
    ahead = MAP.steer(made, np.array([0], np.int32), MAP.Params(**parameters)).direction[0]
    return np.arctan2(ahead[1], ahead[0]) / made.dt


@pytest.mark.parametrize("knot, far", KNOTS.items())
def test_a_number_of_the_map_is_the_rate_of_turning_to_whom_it_is_of(knot, far):
    assert rate([(0, 0), (0, far)], **{f"attraction_{knot}": 3.0}) == pytest.approx(3.0)
    assert rate([(0, 0), (0, -far)], **{f"attraction_{knot}": -3.0}) == pytest.approx(3.0)
    assert rate([(0, 0), (far, 0)], (0.0, np.pi / 2), **{f"alignment_{knot}": 2.0}) == pytest.approx(2.0)


def test_between_two_distances_it_is_linear_and_beyond_the_ends_constant():
    table = {"attraction_half": -6.0, "attraction_1": -2.0, "attraction_2": 1.0, "attraction_4": 3.0}
    distances, values = list(KNOTS.values()), [-6.0, -2.0, 1.0, 3.0, 0.0]
    for far in (0.1, 0.6, 0.9, 1.3, 2.5, 3.9, 6.0, 7.9):
        assert rate([(0, 0), (0, far)], **table) == pytest.approx(np.interp(far, distances, values))
    assert rate([(0, 0), (0, 15.0)], attraction_8=1.5) == pytest.approx(1.5)


def test_of_several_about_as_far_the_mean_counts():
    near, far = {"attraction_1": -2.0}, {"attraction_4": 1.0}
    crowd = [(0, 0), (0, 4), (0, -4), (0, 4), (0, 4)]
    assert rate(crowd, **far) == pytest.approx(0.5)
    assert rate([*crowd, (0, 1)], **near, **far) == pytest.approx(0.5 - 2.0)  # the far ones do not dilute it


def test_those_ahead_may_count_more():
    ahead, behind = [(0, 0), (2**0.5, 2**0.5)], [(0, 0), (-(2**0.5), 2**0.5)]
    one = {"attraction_2": 1.0, "front_attraction": 1.0}
    assert rate(ahead, **one) == pytest.approx(0.5**0.5 * (1 + 0.5**0.5))
    assert rate(behind, **one) == pytest.approx(0.5**0.5 * (1 - 0.5**0.5))
    turned = (0.0, np.pi / 2)
    aligned = {"alignment_2": 1.0, "front_alignment": -0.5}
    assert rate([(0, 0), (2, 0)], turned, **aligned) == pytest.approx(0.5)
    assert rate([(0, 0), (-2, 0)], turned, **aligned) == pytest.approx(1.5)


def test_strangers_and_obstacles_only_repel_and_a_leader_turns_to_the_guide():
    others = {"species": np.array([0, 1], np.int32), "attraction_1": 5.0, "alignment_1": 5.0}
    assert rate([(0, 0), (0, 1)], (0.0, 2.0), **others) == pytest.approx(0.0)
    assert rate([(0, 0), (0, 1)], obstacle_repulsion=8.0, **others) == pytest.approx(-2.0)
    assert rate([(0, 0)], obstacles=[(0, 0.5)], obstacle_repulsion=8.0) == pytest.approx(-4.0)
    led = {"leader": [1], "guidance": (0.0, 0.3), "guidance_weight": 2.5}
    assert rate([(0, 0)], **led) == pytest.approx(2.5)


def test_it_turns_no_faster_than_it_can():
    assert rate([(0, 0), (0, 2)], attraction_2=9.0, max_turn=0.7) == pytest.approx(0.7)


@pytest.mark.parametrize("weight", [1.0, 0.5])
def test_painted_on_ground_it_takes_animals_of_another_model_and_a_restored_run_goes_on_alike(weight):
    seen = {"mean": 2.0, "vision": {"range": 16.0}}
    painted = np.full((40, 40), -1)
    painted[:, 20:] = 0
    layer = BrushLayer("brush", weight, ["map"], painted, PaintBounds(blend="mix"))
    simulation = meadow(brush("walk", "herd", **seen), brush("map", "force_map", **seen), brush_layers=[layer])
    put(simulation, np.random.default_rng(1).uniform(1, 39, (60, 2)), brush="walk")
    simulation.run(48)
    names, bound = simulation.world.resource(Palette).names, simulation.agents[BrushBinding.brush]
    assert 10 < sum(names[k] == "map" for k in bound) < 50
    kept, hashes = snapshot(simulation.world), []
    for _ in range(2):
        restore(simulation.world, kept)
        simulation.run(32)
        hashes.append(state_hash(simulation.world))
    assert hashes[0] == hashes[1]


@pytest.mark.parametrize("alignment, ordered", [(0.0, False), (3.0, True)])
def test_alignment_makes_a_march_of_a_swarm_that_holds_together(alignment, ordered):
    herd = brush(
        "shoal", "force_map", mean=2.0, vision={"range": 16.0, "sight": "metric"}, wander=0.5,
        alignment_half=alignment, alignment_1=alignment, alignment_2=alignment, alignment_4=alignment,
    )  # fmt: skip
    simulation = meadow(herd, width=400, height=400)
    rng = np.random.default_rng(4)
    put(simulation, 200 + rng.uniform(-3, 3, (30, 2)), rng.uniform(0, 6.28, 30), brush="shoal")
    simulation.run(640)
    polarization = np.hypot(*forward_of(simulation).mean(0))
    assert polarization > 0.9 if ordered else polarization < 0.6
    places = simulation.agents[Position.xyz][:, :2]
    assert np.hypot(*(places - np.median(places, axis=0)).T).max() < 16.0
