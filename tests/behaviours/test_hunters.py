"""Hunters and their prey."""

from types import SimpleNamespace

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import Kinds, _all_dangers, behaviours
from flockbrush.behaviours.models.herd import Params
from small_herd import brush, meadow, put, xy_of
from small_scenes import HERD, frozen, rows_, scene, steer

FLEE, HUNT = behaviours()["flee"], behaviours()["hunt"]


def wolf_and_deer(distance, wolf_first=False, **more):
    rows = np.array([1, 0] if wolf_first else [0, 1])
    return scene(
        [(0, 0), (0, distance)], 0.0, species=rows.astype(np.int32), danger=(rows == 1).astype(np.uint8), **more
    )


def test_prey_turns_away_from_a_wolf_the_sooner_the_nearer_it_is_and_runs():
    calm = HERD.steer(wolf_and_deer(11.0), rows_([0]), Params()).direction[0]
    turned, paces = [], []
    for distance in (13.0, 11.0, 6.0, 2.0):
        wish = steer(FLEE, wolf_and_deer(distance), [0], flight_distance=12.0, panic_pace=3.0)
        turned.append(wish.direction[0, 1])
        paces.append(wish.pace[0])
    assert turned[0] == pytest.approx(calm[1])
    assert paces[0] == 1.0
    assert turned == sorted(turned, reverse=True)
    assert turned[-1] < -0.3
    assert paces == pytest.approx([1.0, 1 + 2 * (1 / 12), 2.0, 1 + 2 * (10 / 12)])


def test_haste_is_caught_from_ones_kind():
    still, running = np.zeros((3, 3)), np.array([(0, 0, 0), (3.6, 0, 0), (3.6, 0, 0)], float)
    xy = [(0, 0), (2, 0), (0, 2)]
    assert steer(FLEE, scene(xy, 0.0, velocity=still), [0]).pace[0] == 1.0
    caught = steer(FLEE, scene(xy, 0.0, velocity=running), [0], contagion=0.5).pace[0]
    assert caught == pytest.approx(1 + 0.5 * (3.0 - 1.0))  # they run three times as fast as they would
    assert steer(FLEE, scene(xy, 0.0, velocity=running), [0], contagion=0.0).pace[0] == 1.0


def test_wolves_do_not_flee_from_their_own_kind():
    pack = {"danger": np.ones(2, np.uint8)}
    assert steer(FLEE, scene([(0, 0), (0, 2)], 0.0, **pack), [0]).pace[0] == 1.0


def test_a_wolf_heads_for_prey_in_sight_and_faster_in_the_last_rush():
    def chase(distance):
        return steer(HUNT, wolf_and_deer(distance, True), [0], chase_distance=30.0, charge_distance=8.0)

    nobody = steer(HUNT, scene([(0, 0)], 0.0, danger=np.ones(1, np.uint8)), [0])
    assert nobody.direction[0].tolist() == [1.0, 0.0, 0.0]
    assert nobody.pace[0] == 1.0
    assert chase(31.0).pace[0] == 1.0
    assert chase(20.0).pace[0] == 1.5
    assert 0.1 < chase(20.0).direction[0, 1] < 0.9
    rush = chase(5.0)
    assert rush.pace[0] == 2.5
    # where the prey will be: it walks east at 1.2 m/s while the wolf covers 5 m at 3 m/s
    soon = np.array([1.2 * 5 / 3, 5.0])
    assert rush.direction[0, :2] == pytest.approx(soon / np.hypot(*soon))


def test_a_wolf_singles_out_the_stray():
    # a deer alone at 6 m to the left, three together at 5 m to the right
    xy = [(0, 0), (0, 6), (0, -5), (1, -5.5), (-1, -5.5)]
    s = scene(xy, 0.0, danger=np.array([1, 0, 0, 0, 0], np.uint8), velocity=np.zeros((5, 3)))
    near = [[1, 2, 3, 4], [0], [0, 3, 4], [0, 2, 4], [0, 2, 3]]
    xy = np.array(xy, float)
    seen = {
        "first": np.cumsum([0] + [len(row) for row in near]),
        "near": np.array([j for row in near for j in row], np.int32),
        "offset": np.array([xy[j] - xy[i] for i, row in enumerate(near) for j in row]),
    }
    s = frozen(s, **seen)
    assert steer(HUNT, s, [0], crowd_penalty=1.0).direction[0, 1] > 0.9
    assert steer(HUNT, s, [0], crowd_penalty=0.0).direction[0, 1] < -0.9


def test_wolves_catch_up_with_a_stray():
    deer = brush("deer", "flee", mean=1.0, vision={"range": 8.0}, flight_distance=6.0, panic_pace=1.5)
    wolf = brush("wolf", "hunt", mean=1.2, vision={"range": 40.0})
    simulation = meadow(deer, wolf, width=600, height=600)
    prey = put(simulation, [(300, 300)], 0.3, brush="deer", species="deer")
    pack = put(simulation, [(280, 300), (280, 303), (280, 297)], 0.0, brush="wolf", species="wolf")
    distances = []
    for _ in range(20):
        simulation.run(32)
        distances.append(min(distance_to_herd(simulation, w, prey) for w in pack))
    assert distances[-1] < 1.2  # body to body
    assert distances[0] > 10
    assert np.mean(distances[10:]) < np.mean(distances[:5])


def rows_of(simulation, entities):
    return [simulation.agents.row(e) for e in entities]


def distance_to_herd(simulation, entity, herd):
    xy = xy_of(simulation)
    return np.hypot(*(xy[rows_of(simulation, herd)] - xy[simulation.agents.row(entity)]).T).min()


def test_without_lists_of_dangers_each_fears_all_that_its_kind_fears():
    rng = np.random.default_rng(5)
    xyz, kind = rng.normal(size=(30, 3)), rng.integers(0, 4, 30)
    fears = np.zeros((4, 4), bool)
    fears[0, 2] = fears[1, 2] = fears[1, 1] = True
    scene = SimpleNamespace(ids=np.arange(30), xyz=xyz, relations=Kinds(kind, fears, ~fears), wrap=(0.0, 0.0))
    first, offset = _all_dangers(scene)
    for i in range(30):
        feared = [xyz[j] - xyz[i] for j in range(30) if j != i and fears[kind[i], kind[j]]]
        np.testing.assert_array_equal(offset[first[i] : first[i + 1]], np.reshape(feared, (-1, 3)))
