"""Rollouts are the herds of a level, without the level; and a picture that sees a part of a herd keeps its number."""

import time
from dataclasses import replace

import numpy as np
import pytest
from flockbrush.behaviours import behaviour as behaviour_module
from flockbrush.behaviours.behaviour import behaviours
from flockbrush.behaviours.brush import SpeedSpec, VisionSpec, shipped
from flockbrush.behaviours.models.zones import Params as ZonesParams
from flockbrush.components import Heading, Position, Speed, Velocity
from flockbrush.components.level_things import Obstacle
from flockbrush.levels.build import plane
from flockbrush.systems.landscape import Landscape

from benchmarks.learning_models import truths
from flockbrush.film.observations import Fields
from flockbrush.learning.rollout import (
    NAMES,
    ClipGuide,
    Gates,
    HerdStart,
    PlaneHerd,
    Surroundings,
    Walls,
    params_of,
    rollout,
    theta_of,
)

CALM = SpeedSpec(mean=1.0)
ALONE = {"leader_neighbours": -1}


def start_of(simulation):
    agents = simulation.agents
    drawn = agents[Speed.drawn].copy()
    return HerdStart(agents[Position.xyz][:, :2].copy(), agents[Heading.forward][:, :2].copy(), drawn)


@pytest.mark.parametrize("name", ["march", "mill-filled", "swarm", "column"])
def test_a_herd_here_and_the_same_herd_in_a_level_are_the_same_bits(name):
    brush = shipped().get(name)
    simulation = plane(brush, 60, seed=5)
    herd = PlaneHerd(start_of(simulation), brush.params, brush.speed, brush.body, brush.vision, seed=5)
    for _ in range(64):
        simulation.tick()
        herd.tick()
    agents = simulation.agents
    assert np.array_equal(agents[Position.xyz], herd.xyz)
    assert np.array_equal(agents[Heading.forward], herd.forward)
    assert np.array_equal(agents[Velocity.xyz][:, :2], herd.velocity)


@pytest.mark.parametrize("obstacle", [False, True])
@pytest.mark.parametrize("name", ["zones", "zones, seen", "morse", "force_map", "topological, 6", "voronoi"])
def test_a_herd_of_any_model_on_the_ground_is_that_of_a_level(name, obstacle):
    """With a choice among those in view, paces that the model asks for, and random turns that last."""
    known = truths()
    brush = known[name][1] if name in known else known["topological, 6"][1].model_copy(
        update={"vision": VisionSpec(range=20.0, sight="voronoi")}
    )  # fmt: skip
    brush = brush.model_copy(update={"params": brush.params.model_copy(update={"wander": 0.3, "wander_time": 0.2})})
    simulation = plane(brush, 40, seed=3, heading=0.0)
    begin, walls = start_of(simulation), None
    if obstacle:
        walls = block_before(simulation, begin)
    around = Surroundings(walls)
    herd = PlaneHerd(begin, brush.params, brush.speed, brush.body, brush.vision, seed=3, around=around)
    for _ in range(64):
        simulation.tick()
        herd.tick()
    agents = simulation.agents
    assert np.array_equal(agents[Position.xyz], herd.xyz) and np.array_equal(agents[Speed.effort], herd.effort)
    assert np.array_equal(agents[Heading.forward], herd.forward)


def test_a_model_sees_here_what_it_sees_in_a_level(monkeypatch):
    """The columns of the scenes are the same in the same tick."""
    zones, seen = behaviours()["zones"], []
    brush = truths()["zones, seen"][1]

    def steer(scene, rows, params):
        columns = {name: np.copy(getattr(scene, name)) for name in names}
        seen.append(columns | {"when": (scene.tick, scene.dt, scene.key("x"))})
        return zones.steer(scene, rows, params)

    names = (
        "ids", "xyz", "velocity", "forward", "speed", "effort", "length", "species", "danger", "first", "near",
        "offset", "obstacle_first", "obstacle_offset", "guidance", "slope", "memory", "known", "order",
    )  # fmt: skip
    monkeypatch.setitem(behaviour_module._registry, "zones", replace(zones, steer=steer))
    simulation = plane(brush, 12, density=0.05, seed=3)  # so far apart that some lose the others
    herd = PlaneHerd(start_of(simulation), brush.params, brush.speed, brush.body, brush.vision, seed=3)
    for _ in range(8):
        simulation.tick()
        herd.tick()
    here, there = seen[-1], seen[-2]
    assert here.pop("when") == there.pop("when")
    for name, column in here.items():
        np.testing.assert_array_equal(column, there[name], err_msg=name)


def test_a_crowd_slows_here_as_it_does_in_a_level():
    march = shipped().get("march")
    slow = SpeedSpec(mean=3.0, deviation=0.2, reversion=2.0, by_density=((0.2, 1.0), (1.0, 0.3)))
    brush = march.model_copy(update={"speed": slow})
    simulation = plane(brush, 40, seed=2)
    herd = PlaneHerd(start_of(simulation), brush.params, slow, brush.body, brush.vision, seed=2)
    for _ in range(32):
        simulation.tick()
        herd.tick()
    assert np.array_equal(simulation.agents[Position.xyz], herd.xyz)
    assert np.array_equal(simulation.agents[Speed.target], herd.target)


def block_before(simulation, begin):
    """Put an obstacle in the way of a herd in a level; the same as `Walls`."""
    x, y = begin.xy.max(0)[0] + 1.0, begin.xy[:, 1].mean()
    block = np.array([(x, y - 2), (x + 2, y - 2), (x + 2, y + 2), (x, y + 2)])
    land = simulation.world.resource(Landscape)
    land.obstacles.append(Obstacle(0, "", block))
    land.rebuild(navigation=False)
    return Walls(np.hstack([block, np.roll(block, -1, 0)]), np.zeros(4, np.int32))


def test_an_obstacle_here_and_in_a_level_turns_animals_the_same_way():
    brush = shipped().get("march")
    simulation = plane(brush, 40, seed=3, heading=0.0)
    begin = start_of(simulation)
    walls = block_before(simulation, begin)
    block = walls.ends[:, :2]
    herd = PlaneHerd(begin, brush.params, brush.speed, brush.body, brush.vision, seed=3, around=Surroundings(walls))
    for _ in range(48):
        simulation.tick()
        herd.tick()
    inside = ((herd.xyz[:, :2] > block[0]) & (herd.xyz[:, :2] < block[2])).all(1)
    assert not inside.any()
    assert np.abs(simulation.agents[Position.xyz] - herd.xyz).max() < 1e-9


def test_frames_lie_where_the_animals_were_between_two_ticks():
    lonely = HerdStart(np.array([[0.0, 0.0]]), np.array([[1.0, 0.0]]), np.array([1.0]))
    run = rollout(lonely, params_of(np.full(12, 0.5), ALONE), CALM, seconds=2.0, fps=25.0)
    assert len(run) == 51
    assert np.allclose(run.xy[:, 0], run.times, atol=1e-9)
    assert np.allclose(run.speed, 1.0)


def test_the_same_seed_gives_the_same_run_and_another_seed_another():
    simulation = plane(shipped().get("swarm"), 30, seed=1)
    begin, speed = start_of(simulation), SpeedSpec(mean=1.3, deviation=0.2)
    params = shipped().get("swarm").params
    a, b, c = (rollout(begin, params, speed, seconds=1.0, seed=s) for s in (1, 1, 2))
    assert np.array_equal(a.xy, b.xy)
    assert not np.array_equal(a.xy, c.xy)


def test_theta_names_the_twelve_numbers_in_the_order_of_the_loss():
    theta = np.linspace(0.1, 0.9, 12)
    assert NAMES[:4] == ("avoidance_weight", "avoidance_radial", "avoidance_angular", "cohesion_weight")
    assert np.allclose(theta_of(params_of(theta)), theta)
    assert params_of(np.full(12, -1.0)).cohesion_radial == 1e-3


def band(frames=30, seen=(2, 8), count=12, velocity=(2.0, 0.0)):
    """Fields of a picture of 10 x 10 cells of one BL: a stream of animals from the left to the right."""
    shape = (frames, 10, 10)
    density = np.zeros(shape)
    density[:, 4:6, seen[0] : seen[1]] = count / (2 * (seen[1] - seen[0]))
    inside = np.zeros(shape, bool)
    inside[:, :, seen[0] : seen[1]] = True
    flow = np.where(density[..., None] > 0, velocity, np.nan)
    return Fields(
        fps=10.0, cell=1.0, origin=np.zeros(2), density=density, velocity=flow, speed_variance=np.zeros(shape),
        angular_variance=np.zeros(shape), seen=inside, obstacle=np.zeros((10, 10), bool),
        region=np.zeros((10, 10), np.uint8), count=np.full(frames, float(count)), frames=np.arange(frames),
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["herd", "zones"])
def test_who_leaves_the_picture_is_taken_out_and_others_come_in_on_the_side_where_animals_came_in(kind):
    gates = Gates.of(band())
    rng = np.random.default_rng(1)
    begin = HerdStart(
        np.column_stack([rng.uniform(2.5, 7.5, 12), np.linspace(4.0, 6.0, 12)]), np.tile([1.0, 0.0], (12, 1))
    )
    straight = params_of(np.full(12, 1e-3), ALONE) if kind == "herd" else ZonesParams(repulsion=0.0, orientation=8.0)
    run = rollout(begin, straight, SpeedSpec(mean=2.0), seconds=2.9, fps=10.0, around=Surroundings(gates=gates))
    numbers = np.diff(run.first)
    assert 9 <= numbers[10:].mean() <= 13
    last = run.xy[run.of(len(run) - 1)]
    assert (last[:, 0] >= 1.9).all() and (last[:, 0] <= 8.3).all()
    newcomers = run.ids > 12
    assert newcomers.any() and (run.forward[newcomers, 0] > 0.9).all()


def test_a_picture_that_holds_the_whole_herd_has_no_gates():
    whole = band()
    whole.seen[:] = True
    assert Gates.of(whole) is None


def test_leaders_follow_the_motion_of_the_clip():
    lonely = HerdStart(np.array([[5.0, 5.0]]), np.array([[0.0, 1.0]]), np.array([1.0]))
    guide = ClipGuide.of(band(velocity=(0.0, -2.0)))
    run = rollout(lonely, params_of(np.full(12, 0.5)), CALM, seconds=1.0, fps=10.0, around=Surroundings(guide=guide))
    assert run.forward[-1, 1] < -0.99


def test_two_hundred_animals_for_a_hundred_frames_take_a_fraction_of_a_second():
    brush = shipped().get("march")
    begin = start_of(plane(brush, 200, seed=1))
    rollout(begin, brush.params, brush.speed, seconds=0.1)
    clock = time.process_time()
    rollout(begin, brush.params, brush.speed, seconds=4.0, fps=25.0)
    assert time.process_time() - clock < 1.5  # of CPU; .1 s on a quiet machine
