"""What holds in every world: the same bits whatever the order of systems, the threads, and a snapshot on the way."""

import functools

import numpy as np
import pytest
from flockbrush.engine import parallel
from flockbrush.engine.columns import Table
from flockbrush.engine.parallel import set_threads
from flockbrush.engine.state import restore, snapshot, state_hash
from flockbrush.engine.world import World
from flockbrush.levels.schema import Exit, Goal, PaintBounds, Zone
from flockbrush.systems.commands import AddAnimals, AddObstacle, Migrate, PaintBrush, SwitchBrush
from small_herd import boids, box, brush, meadow, obstacle, put, put_aloft, spawn
from test_fear import herd_and_wolf
from test_mixed_paint import herd as painted
from test_mixed_paint import layer
from test_programs import stampede
from test_skeins import sky


def lively(seed=5, **more):
    """A small world in which everything happens: births, exits, goals, zones, prey, a wolf, commands."""
    deer = brush("deer", "flee", mean=1.0, speed={"deviation": 0.3, "by_density": ((0.0, 1.0), (0.5, 0.5))})
    wolf = brush("wolf", "hunt", mean=1.4, speed={"deviation": 0.2}, vision={"range": 20.0}, body={"length": 1.5})
    march = brush("march", mean=2.0, transition=1.0, speed={"deviation": 0.1})
    simulation = meadow(
        deer, march, wolf,
        boundary="wall", seed=seed, **more,
        obstacles=[obstacle(box(18, 18, 22, 20))],
        goals=[
            Goal(1, "there", np.array([35.0, 35.0]), 2.0, "next", "gate"),
            Goal(2, "gate", np.array([5.0, 35.0]), 2.0, "despawn", ""),
        ],
        zones=[Zone(1, "field", box(20, 22, 30, 40), "march", np.inf, 0.7, 1.0)],
        exits=[Exit(1, "hole", box(0, 18, 2, 22))],
        spawns=[
            spawn(box(5, 5, 15, 15), "deer", 20, None, "deer", 1),
            spawn(box(24, 3, 36, 8), "march", 12, 1.6, "sheep", 2, start=0.3, rate=8.0),
            spawn(box(35, 10, 38, 13), "wolf", 1, None, "wolf", 3),
        ],
    )  # fmt: skip
    simulation.submit(PaintBrush("march", 10.0, 20.0, 4.0), 10)
    simulation.submit(AddObstacle("log", [[28.0, 12.0], [30.0, 12.0], [29.0, 15.0]]), 20)
    simulation.submit(AddAnimals("deer", 30.0, 30.0, 3.0, 3, "deer"), 30)
    simulation.submit(SwitchBrush("march", "deer", 10.0, 10.0, 4.0), 40)
    return simulation


def flock(**more):
    """Sheep, sparrows with occlusion, a falcon and obstacles in the air."""
    sheep = brush("sheep", mean=1.5, speed={"deviation": 0.2})
    sparrow = brush(
        "sparrow", "boids", 40.0, {"length": 0.15, "radius": 0.035, "contact": "disc"},
        {"range": 30.0, "field_of_view": 300.0}, speed={"deviation": 3.0}, height=4.0,
    )  # fmt: skip
    falcon = boids("falcon", 30.0, "raptor")
    hoop = obstacle(box(20, 10, 21, 30), "hoop")
    hoop.z_min, hoop.z_max, hoop.shape = 6.0, 8.0, "box"
    pole = obstacle(box(26, 18, 28, 20), "pole")
    pole.shape = "cylinder"
    simulation = meadow(sheep, sparrow, falcon, boundary="wall", obstacles=[hoop, pole], **more)
    rng = np.random.default_rng(6)
    put(simulation, rng.uniform(3, 37, (20, 2)), np.arange(20.0), brush="sheep", species="sheep")
    put_aloft(simulation, rng.uniform(3, 12, (40, 3)), brush="sparrow", species="sparrow")
    put_aloft(simulation, (35, 35, 15), (-1, -1, 0), brush="falcon", species="falcon")
    simulation.submit(Migrate(30.0, 20.0, 5.0, species="sparrow"), 5)
    simulation.submit(Migrate(10.0, 30.0, 5.0, seconds=1.0, species="sparrow"), 20)
    simulation.submit(Migrate(20.0, 20.0, 5.0, species="falcon"), 10)
    return simulation


def mixed(**more):
    """A herd on ground that is painted in part, with a soft edge."""
    return painted(layer(weight=0.3, bounds=PaintBounds(blend="mix", edge=8.0), west=10), many=30, **more)


SCENES = {  # name: (world, ticks)
    "herd": (lively, 60),
    "flock": (flock, 60),
    "programs": (stampede, 90),
    "skeins": (functools.partial(sky, (5, 0, 0, 80), (4, 150, 30, 100)), 120),
    "fear": (herd_and_wolf, 50),
    "mixed paint": (mixed, 16),
}


@pytest.fixture(scope="module", params=SCENES)
def scene(request):
    """(maker of a world, ticks, its hash after half of them, and after all)."""
    make, ticks = SCENES[request.param]
    simulation, hashes = make(), []
    for _ in range(2):
        simulation.run(ticks // 2)
        hashes.append(state_hash(simulation.world))
    return make, ticks, *hashes


@pytest.mark.parametrize("shuffle", range(3))
def test_the_order_inside_a_stage_does_not_matter(scene, shuffle):
    make, ticks, _, last = scene
    simulation = make(shuffle_seed=shuffle)
    simulation.run(ticks)
    assert state_hash(simulation.world) == last


@pytest.mark.parametrize("threads", [1, 3])
def test_the_number_of_threads_changes_no_bit(scene, threads, monkeypatch):
    make, ticks, half, _ = scene
    monkeypatch.setattr(parallel, "WORTH", 0)
    monkeypatch.setattr(parallel, "SMALL", 8)
    monkeypatch.setattr(parallel, "PROBE", 4)
    before = set_threads(threads)
    try:
        simulation = make()
        simulation.run(ticks // 2)
    finally:
        set_threads(before)
    assert state_hash(simulation.world) == half


def test_a_world_goes_on_from_a_snapshot_and_every_system_writes_only_what_it_says(scene):
    make, ticks, half, last = scene
    simulation, fresh = make(), make()
    for _ in range(5):
        assert simulation.schedule.undeclared_writes(simulation.world) == []
        simulation.clock.tick += 1
    simulation.run(ticks // 2 - 5)
    assert state_hash(simulation.world) == half
    restore(fresh.world, snapshot(simulation.world))
    fresh.run(ticks - ticks // 2)
    assert state_hash(fresh.world) == last
    for _ in range(5):
        assert simulation.schedule.undeclared_writes(simulation.world) == []
        simulation.clock.tick += 1


def test_every_system_asks_the_world_only_for_what_it_declares(scene, monkeypatch):
    """Else a schedule that refuses ambiguity would overlook one."""
    simulation, asked = scene[0](), set()
    for kind, name in ((Table, "__getitem__"), (World, "resource")):
        plain = getattr(kind, name)
        monkeypatch.setattr(kind, name, lambda self, what, plain=plain: (asked.add(what), plain(self, what))[1])
    of = {field: kind for kind in simulation.agents.kinds for field in kind.fields.values()}
    for _ in range(scene[1]):
        for system in simulation.schedule.systems:
            asked.clear()
            system.process(simulation.world)
            declared = (*system.reads, *system.writes)
            strange = [kind for kind in (of.get(what, what) for what in asked) if not issubclass(kind, declared)]
            assert strange == [], type(system).__name__
        simulation.world.flush()
        simulation.clock.tick += 1


def test_another_seed_gives_another_run():
    one, other = lively(), lively(seed=6)
    one.run(10)
    other.run(10)
    assert state_hash(one.world) != state_hash(other.world)
