"""Groups: who belongs together by mutual perception, and numbers for each."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.engine.state import state_hash
from flockbrush.levels.build import build
from flockbrush.systems.commands import RemoveAnimals
from flockbrush.systems.groups import groups_of
from flockbrush.systems.measures import herd_measures
from small_herd import boids, box, brush, level, meadow, obstacle, put, put_aloft, spawn


def numbers(simulation):
    return groups_of(simulation.world).tolist()


def test_two_clusters_out_of_sight_are_two_groups_and_one_between_them_joins_them():
    simulation = meadow(brush("walk", vision={"range": 4.0}))
    put(simulation, [(5, 5), (7, 5), (13, 5), (15, 5)])
    assert numbers(simulation) == [1, 1, 3, 3]
    put(simulation, [(10, 5)])
    assert numbers(simulation) == [1] * 5


def test_a_wall_parts_a_herd_and_a_species_is_not_of_a_group_of_another():
    simulation = meadow(brush("walk", vision={"range": 8.0}), obstacles=[obstacle(box(9, 0, 10, 40))])
    put(simulation, [(7, 5), (12, 5)])
    put(simulation, [(7, 7)], species="dog")
    assert numbers(simulation) == [1, 2, 3]


def test_who_is_only_followed_with_the_eyes_is_not_in_the_group():
    simulation = meadow(brush("walk", vision={"range": 8.0, "field_of_view": 120.0}))
    put(simulation, [(5, 5), (9, 5)], heading=0.0)
    assert numbers(simulation) == [1, 2]
    put(simulation, [(5, 20), (9, 20)], heading=[0.0, np.pi])  # eye to eye
    assert numbers(simulation) == [1, 2, 3, 3]


def test_birds_above_each_other_are_apart_by_what_they_see_in_space():
    simulation = meadow(boids(min_speed=5.0))
    put_aloft(simulation, [(10, 10, 20), (10, 11, 20), (10, 10, 40)], species="starling")
    assert numbers(simulation) == [1, 1, 3]


def test_deaths_and_late_birds_change_groups_and_no_number_of_others():
    simulation = meadow(brush("walk", vision={"range": 4.0}))
    put(simulation, [(5, 5), (7, 5), (30, 5), (32, 5)])
    simulation.submit(RemoveAnimals(5.0, 5.0, 1.0))
    simulation.tick()
    assert numbers(simulation) == [2, 3, 3]
    put(simulation, [(34, 5)])
    assert numbers(simulation) == [2, 3, 3, 3]


def test_looking_for_groups_changes_nothing_of_the_run():
    def run(look):
        here = spawn(box(5, 5, 20, 20), "march", 20, species="sheep")
        simulation = build(level(spawns=[here]), 3, library=shipped())
        for _ in range(20):
            simulation.tick()
            if look:
                simulation.parts()
        return state_hash(simulation.world)

    assert run(False) == run(True)


def test_parts_give_counts_and_measures_for_each_species_brush_and_group():
    simulation = meadow(brush("walk", vision={"range": 4.0}), brush("run"))
    put(simulation, [(5, 5), (7, 5), (5, 7)], species="sheep", brush="walk")
    put(simulation, [(30, 30)], species="dog", brush="run")
    told = simulation.parts()
    assert {name: here["animals"] for name, here in told["species"].items()} == {"sheep": 3, "dog": 1}
    assert {name: here["animals"] for name, here in told["brushes"].items()} == {"walk": 3, "run": 1}
    assert [(one["group"], one["animals"], one["species"]) for one in told["groups"]] == [
        (1, 3, ["sheep"]),
        (4, 1, ["dog"]),
    ]
    assert told["groups"][0]["nnd"] == pytest.approx(2.0)


def test_distances_of_what_flies_are_measured_in_space():
    simulation = meadow(boids(min_speed=5.0))
    put_aloft(simulation, [(10, 10, 20), (10.3, 10, 20.4)], species="starling")
    assert simulation.measures()["nnd"] == pytest.approx(0.5)
    assert simulation.measures()["group_spread"] == pytest.approx(0.25)


def test_in_space_a_herd_across_the_seam_is_one_piece():
    xyz = np.array([(0.1, 5.0, 3.0), (9.9, 5.0, 3.0), (0.2, 5.0, 4.0)])
    ahead = np.tile((1.0, 0.0, 0.0), (3, 1))
    told = herd_measures(xyz, ahead, ahead, 1.0, (10.0, 10.0), True)
    assert told["nnd"] == pytest.approx(np.mean([0.2, 0.2, np.hypot(0.1, 1.0)]))
    assert told["group_spread"] < 1.0
