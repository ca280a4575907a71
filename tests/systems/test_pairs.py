"""Every brush with every other thing: a sample of the matrix, and that its judge sees what is wrong.

The whole matrix is ``python benchmarks/pairs.py``.
"""

import random

import numpy as np
import pytest
from flockbrush.components import BrushBinding, Heading, Leading, Position, Species, Velocity
from flockbrush.engine.commands import Commands
from flockbrush.engine.raster import Raster
from flockbrush.levels.build import build
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.palette import Palette
from small_herd import box, level, obstacle, spawn

from benchmarks.pairs import Pair, all_pairs, draw_level, library, run_alone, things
from benchmarks.pairs_watch import InvariantWatch
from flockbrush.runs.run import start

SEED, SAMPLE = 14, 4  # pairs


def watched():
    """(simulation of sheep and starlings, faults that a watch notes)."""
    things = [spawn(box(5, 5, 15, 15), "march", 3, species="sheep"),
              spawn(box(20, 20, 35, 35), "starlings", 3, species="starling", id=2, altitude=20.0)]  # fmt: skip
    simulation = build(level(spawns=things, obstacles=[obstacle(box(30, 5, 34, 9))]), 1)
    simulation.run(2)
    faults = []
    watch = InvariantWatch(simulation, lambda told, times=0.0: faults.append(told))
    watch.look()
    assert faults == []
    return simulation, watch, faults


def test_the_judge_of_pairs_sees_who_walks_onto_ground_that_is_too_steep():
    bank = Raster(1.0, np.where(np.arange(40) < 20, 0.0, 9.0)[None, :].repeat(40, 0))
    simulation = build(level(spawns=[spawn(box(5, 5, 15, 15), "march", 3, species="sheep")], height_map=bank), 1)
    faults = []
    watch = InvariantWatch(simulation, lambda told, times=0.0: faults.append(told))
    watch.look()
    put_into(simulation, Position.xyz, 0, (20.0, 10.0, 4.5))
    watch.look()
    assert "a sheep walks onto ground that is too steep for its species" in faults


def put_into(simulation, field, row, value):
    simulation.agents[field][row] = value


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda s: put_into(s, Position.xyz, 0, np.nan), "not finite"),
        (lambda s: put_into(s, Heading.forward, 0, (2.0, 0.0, 0.0)), "unit vector"),
        (lambda s: put_into(s, Velocity.xyz, 0, (100.0, 0.0, 0.0)), "sheep on the ground is faster"),
        (lambda s: put_into(s, Velocity.xyz, 3, (0.0, 100.0, 0.0)), "starling in the air is faster"),
        (lambda s: put_into(s, Heading.forward, 0, -s.agents[Heading.forward][0]), "turns faster"),
        (lambda s: put_into(s, Position.xyz, 1, (10.0, 10.0, 5.0)), "above the ground"),
        (lambda s: put_into(s, Position.xyz, 4, (25.0, 25.0, -1.0)), "under the ground"),
        (lambda s: put_into(s, Position.xyz, 0, (32.0, 7.0, 0.0)), "in an obstacle"),
        (lambda s: put_into(s, Position.xyz, 4, (32.0, 7.0, 5.0)), "flying animal is in an obstacle"),
        (lambda s: put_into(s, BrushBinding.brush, 0, s.world.resource(Palette).named("starlings")), "cannot do"),
    ],
)
def test_the_judge_of_pairs_sees_what_is_wrong(change, told):
    simulation, watch, faults = watched()
    change(simulation)
    watch.look()
    assert any(told in fault for fault in faults), faults


def test_the_judge_of_pairs_sees_a_bird_that_hovers():
    simulation, watch, faults = watched()
    for _ in range(40):
        put_into(simulation, Velocity.xyz, 4, 0.0)
        watch.look()
    assert set(faults) == {"a flying animal hovers"}


def test_the_matrix_has_every_brush_with_every_other():
    pairs = set(all_pairs())
    names = library().names()
    assert {"geese", "school", "topological"} <= set(names)
    assert all((a, f"paint {b}") in pairs for a in names for b in names if a != b)
    assert len(pairs) > 50 * len(names)


@pytest.mark.parametrize(("brush", "thing"), [("geese", "goal"), ("stampede", "program"), ("skein", "obstacle sphere"),
                                             ("evacuate", "cliff"), ("stampede", "leader on mixed paint"),
                                             ("boids-herd", "cliff"), ("march", "leader with a program"),
                                             ("graze", "mixed slope under birds"),
                                             ("geese", "leader on mixed paint"),
                                             ("school", "leader on mixed paint")])  # fmt: skip
def test_nothing_is_wrong_where_three_things_meet_or_where_limits_of_a_species_were_once_broken(brush, thing):
    assert run_alone(brush, thing, 3) == []


def test_pairs_of_three_things_are_what_they_are_called(tmp_path):
    pair = Pair("graze", "mixed slope under birds", 3, tmp_path)
    simulation = start(draw_level(pair))
    simulation.run(2)
    commands = things()[pair.thing](pair, simulation)
    simulation.world.resource(Commands).perform(simulation.world, commands)
    simulation.run(64)
    agents, names = simulation.agents, simulation.world.resource(Palette).names
    birds = agents[Species.index] == simulation.world.resource(SpeciesList).names.index("starling")
    assert birds.sum() == 5 and agents[Position.xyz][birds, 2].min() > 2.0  # they have taken off
    between = [names[b] for b in agents[BrushBinding.brush][~birds] if "--" in names[b]]
    assert between  # half of the way to another brush, and so only on the ground
    assert not any("--" in names[b] for b in agents[BrushBinding.brush][birds])
    led = Pair("march", "leader on mixed paint", 3, tmp_path / "led")
    led.folder.mkdir()
    simulation = start(draw_level(led))
    simulation.world.resource(Commands).perform(simulation.world, things()[led.thing](led, simulation))
    far = np.linalg.norm(simulation.agents[Position.xyz][0, :2] - (0.1 * led.side, 0.9 * led.side))
    simulation.run(10 * 32)
    near = np.linalg.norm(simulation.agents[Position.xyz][0, :2] - (0.1 * led.side, 0.9 * led.side))
    assert simulation.agents[Leading.appointed].sum() == 1 and near < 0.5 * far


@pytest.mark.slow
def test_nothing_is_wrong_in_a_sample_of_pairs():
    pairs = random.Random(SEED).sample(all_pairs(), SAMPLE)
    found = {pair: run_alone(*pair, SEED) for pair in pairs}
    assert {pair: faults for pair, faults in found.items() if faults} == {}
