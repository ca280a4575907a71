"""A whole world: worlds apart, broken models, few animals; in shipped levels bodies stay apart."""

import functools
from pathlib import Path

import numpy as np
import pytest
from flockbrush.behaviours import behaviour as registry
from flockbrush.behaviours.behaviour import Parameters, Wishes, quantity
from flockbrush.components import BrushBinding, Heading, Position, Species, Speed, Velocity, Wish
from flockbrush.engine.plugins import PluginError
from flockbrush.engine.schedule import Ambiguity, Schedule
from flockbrush.engine.state import state_hash
from flockbrush.levels.build import build, systems
from flockbrush.levels.libraries import brush_library
from flockbrush.levels.reader import read_level
from flockbrush.systems.palette import Palette
from flockbrush.systems.steer import AskModels
from small_herd import brush, gaps_of, meadow, put, room_in_the_air, straight, xy_of
from test_laws import lively

from flockbrush import levels

SHIPPED = Path(levels.__file__).parent / "shipped"
NAMES = sorted(path.stem for path in SHIPPED.glob("*.tmj"))


@functools.cache
def level_of(name):
    path = SHIPPED / f"{name}.tmj"
    level = read_level(path)
    return level, brush_library(path, level.files)


def shipped(name, agents=None, **more):
    level, library = level_of(name)
    return build(level, agents=agents, library=library, **more)


# the same bits ----------------------------------------------------------------------------


def test_some_shuffles_do_change_the_order():
    orders = {tuple(type(s).__name__ for s in Schedule(systems(), seed).systems) for seed in range(8)}
    assert len(orders) > 1


def test_worlds_in_one_process_do_not_disturb_one_another():
    alone = lively()
    alone.run(45)
    one, other = lively(), lively(seed=9)
    for _ in range(45):
        other.tick()
        one.tick()
        other.world.agents[Position.xyz][:, 2] += 0.1
    assert state_hash(one.world) == state_hash(alone.world)


def test_no_systems_of_one_stage_touch_the_same_thing():
    assert Schedule(systems()).ambiguities() == []
    with pytest.raises(Ambiguity):
        Schedule([*systems(), AskModels()])


def test_a_system_that_lies_is_found():
    class Sleepwalk(AskModels):
        def process(self, world):
            super().process(world)
            world.agents[Position.xyz][:] += 1.0

    simulation = lively()
    simulation.schedule = Schedule([Sleepwalk() if isinstance(s, AskModels) else s for s in systems()])
    assert ("Sleepwalk", "Position") in simulation.schedule.undeclared_writes(simulation.world)


@pytest.mark.parametrize("name", NAMES)
def test_in_every_shipped_level_bodies_stay_apart_and_out_of_obstacles(name):
    agents = 150 if name in ("crowded", "gorge", "anthill") else None
    simulation = shipped(name, agents)
    from flockbrush.systems.landscape import Landscape
    from flockbrush.systems.life import inside_polygon

    world, land = simulation.world, simulation.world.resource(Landscape)
    for _ in range(12):
        simulation.run(8)
        aloft = world.resource(Palette).aloft(simulation.agents[BrushBinding.brush])
        aloft = np.zeros(len(simulation.agents), bool) if aloft is None else aloft
        assert gaps_of(simulation, ~aloft).min(initial=0.0) > -1e-6
        assert room_in_the_air(simulation)[aloft].min(initial=0.0) > -1e-5
        xy = xy_of(simulation)[~aloft]
        assert not any(inside_polygon(xy, polygon).any() for polygon in land.solids)
        if land.boundary == "wall":
            assert ((xy >= 0) & (xy <= (land.width, land.height))).all()
    assert np.isfinite(simulation.agents[Velocity.xyz]).all()


# few animals and odd ones -------------------------------------------------------------------------


@pytest.mark.parametrize("boundary", ["wall", "wrap", "open", "despawn"])
@pytest.mark.parametrize("n", [0, 1])
def test_nobody_and_somebody_alone_live_on(n, boundary):
    simulation = meadow(brush("walk", speed={"deviation": 0.5}), boundary=boundary)
    if n:
        put(simulation, [(20, 20)], 0.5)
    simulation.run(64)
    assert len(simulation.agents) == n
    assert simulation.measures()["animals"] == n


def test_an_animal_written_to_is_seen_by_the_kernels():
    walk = straight("walk", mean=2.0)
    simulation = meadow(walk)
    entity, other = put(simulation, [(10, 10), (30, 30)], 0.0)
    world = simulation.world
    world.component_for_entity(entity, Heading).forward = (0.0, 1.0, 0.0)
    world.component_for_entity(entity, Position).xyz = (25.0, 30.0, 0.0)
    world.component_for_entity(entity, Speed).drawn = 4.0
    simulation.tick()
    here = world.component_for_entity(entity, Position).xyz
    assert here[0] == pytest.approx(25.0, abs=1e-9)
    assert here[1] > 30.05
    assert world.component_for_entity(other, Position).xyz[0] == pytest.approx(30 + 2 / 32)


def test_all_on_one_spot_and_facing_all_ways_stay_finite():
    for model in ("herd", "flee", "hunt"):
        simulation = meadow(brush("walk", model), boundary="wall")
        put(simulation, np.full((30, 2), 20.0), np.arange(30.0))
        simulation.run(60)
        assert np.isfinite(simulation.agents[Position.xyz]).all()
        assert np.isfinite(simulation.agents[Heading.forward]).all()


# broken models --------------------------------------------------------------------------------------


class Strength(Parameters):
    """How ill the model is."""

    after: float = quantity(3.0, "ticks", "when it breaks", 0, 100)


@pytest.fixture
def ill(monkeypatch):
    """Register a model for one test."""

    def register(steer):
        made = registry.Behaviour("ill", steer, Strength, "ill")
        monkeypatch.setitem(registry._registry, "ill", made)
        return brush("sick", "ill", mean=1.0)

    registry.behaviours()
    return register


@pytest.mark.parametrize("what", ["direction", "pace"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_model_that_gives_no_number_is_named_with_tick_and_entity(ill, what, value):
    def steer(scene, rows, p):
        direction, pace = np.tile([1.0, 0.0, 0.0], (len(rows), 1)), np.ones(len(rows))
        if scene.tick >= p.after:
            (direction if what == "direction" else pace)[scene.ids[rows] == 3] = value
        return Wishes(direction, pace)

    simulation = meadow(ill(steer))
    put(simulation, [(10, 10), (15, 10), (20, 10), (25, 10)])
    simulation.run(3)
    with pytest.raises(PluginError, match=r"model 'ill' \(brush 'sick'\) .* for entity 3 in tick 3"):
        simulation.tick()
    for column in (Position.xyz, Heading.forward, Wish.direction, Wish.pace):
        assert np.isfinite(simulation.agents[column]).all()


def test_a_model_that_answers_for_too_few_is_named(ill):
    def steer(scene, rows, p):
        return Wishes(np.zeros((1, 3)), np.ones(1))

    simulation = meadow(ill(steer))
    put(simulation, [(10, 10), (15, 10)])
    with pytest.raises(PluginError, match=r"model 'ill' was asked for 2 animals"):
        simulation.tick()


def test_a_model_cannot_write_into_the_scene(ill):
    def steer(scene, rows, p):
        scene.xyz[:] = 0.0

    simulation = meadow(ill(steer))
    put(simulation, [(10, 10)])
    with pytest.raises(PluginError, match="read-only"):
        simulation.tick()


def test_many_brushes_in_one_herd_are_each_asked_for_their_own(ill):
    asked = []

    def steer(scene, rows, p):
        asked.append(sorted(scene.ids[rows].tolist()))
        return Wishes(np.tile([0.0, 1.0, 0.0], (len(rows), 1)), np.ones(len(rows)))

    simulation = meadow(ill(steer), straight("walk"))
    put(simulation, [(10, 10), (20, 10)], brush="walk")
    put(simulation, [(15, 10), (25, 10), (30, 10)], brush="sick")
    simulation.tick()
    assert asked == [[3, 4, 5]]
    assert simulation.agents[Wish.direction][:, 1].tolist() == [0, 0, 1, 1, 1]


# the shipped levels do what they are for ----------------------------------------------------------------


def test_through_the_gorge_everybody_comes_and_nobody_stays_behind():
    simulation = shipped("gorge", agents=160)
    before = len(simulation.agents)
    for _ in range(90):
        simulation.run(32)
        if not len(simulation.agents):
            break
    assert before == 160
    assert len(simulation.agents) == 0, f"left behind: {xy_of(simulation).round(1).tolist()}"


def test_in_the_valley_wolves_find_the_herd_and_the_deer_they_come_near_run():
    simulation = shipped("predators-valley")
    agents = simulation.agents

    def look():
        wolf = agents[Species.index] == 1
        xy, speed = xy_of(simulation), np.linalg.norm(agents[Velocity.xyz], axis=1)
        distance = np.hypot(*(xy[~wolf][:, None] - xy[wolf]).T).min(0)
        return distance, speed[~wolf]

    simulation.run(32 * 6)
    distance, calm = look()
    assert distance.min() > 40
    for _ in range(60):
        simulation.run(32)
        distance, speed = look()
        if speed[distance < 8].max(initial=0) > 2 * calm.max():
            break
    else:
        raise AssertionError("no deer ever ran")
    assert speed[distance > 40].mean() < 1.5 * calm.mean()  # those far away have noticed nothing
