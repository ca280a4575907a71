"""Whom a brush takes into account: exact, metric, hidden points, topological, Voronoi; and whom a species ignores."""

import numpy as np
import pytest
from flockbrush.behaviours.species import SpeciesLibrary, shipped_species
from flockbrush.components import Heading
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.senses import FindNeighbours, See, SeeInSpace, Sight, SightInSpace
from scipy.spatial import Delaunay
from small_herd import boids, brush, meadow, put, put_aloft
from test_hidden_points import by_qhull


def scattered(count=40, seed=5):
    return np.random.default_rng(seed).uniform(5, 35, (count, 2))


def seen(simulation):
    """[rows that each takes into account]."""
    for system in (FindNeighbours(), See(), SeeInSpace()):
        system.process(simulation.world)
    lists = simulation.world.resource(Sight).lists
    return [sorted(lists.of(i).tolist()) for i in range(len(simulation.agents))]


def herd(sight, xy, occlusion=True, neighbours=7, **vision):
    own = {"range": 60.0, "sight": sight, "occlusion": occlusion, "neighbours": neighbours} | vision
    simulation = meadow(brush("walk", vision=own, neighbour_range=20.0))
    put(simulation, xy)
    return simulation


def nearest_first(xy, i):
    return np.argsort(np.hypot(*(xy - xy[i]).T), kind="stable")[1:].tolist()


def test_topological_sight_takes_the_nearest_of_those_in_view():
    xy = scattered()
    exact, chosen = seen(herd("exact", xy)), seen(herd("topological", xy, neighbours=4))
    for i in range(len(xy)):
        assert chosen[i] == sorted([j for j in nearest_first(xy, i) if j in exact[i]][:4])


def test_metric_sight_sees_whom_bodies_hide():
    xy = scattered()
    everybody = [[j for j in range(len(xy)) if j != i] for i in range(len(xy))]
    assert seen(herd("metric", xy)) == everybody
    assert seen(herd("exact", xy)) != everybody


def test_voronoi_sight_takes_the_first_shell_as_delaunay_has_it():
    xy = scattered()
    first, near = Delaunay(xy).vertex_neighbor_vertices
    shells = [sorted(near[first[i] : first[i + 1]].tolist()) for i in range(len(xy))]
    assert seen(herd("voronoi", xy, occlusion=False)) == shells


def test_hidden_points_are_the_corners_of_the_flipped_hull():
    xy = scattered()
    expected = []
    for me in range(len(xy)):
        others = np.delete(np.arange(len(xy)), me)
        expected.append(others[by_qhull(xy[others] - xy[me])].tolist())
    assert seen(herd("hidden_points", xy)) == expected


def test_two_brushes_side_by_side_perceive_each_in_its_own_way():
    line = [(5, 20), (10, 20), (15, 20), (20, 20)]
    simulation = meadow(brush("all", vision={"range": 60.0, "sight": "metric"}), brush("some", vision={"range": 60.0}))
    put(simulation, line[:1], brush="all")
    put(simulation, line[1:], brush="some")
    assert seen(simulation) == [[1, 2, 3], [0, 2], [1, 3], [2]]


def test_others_stay_in_view_whatever_the_sight():
    simulation = herd("topological", [(10, 10), (11, 10), (10, 11)], neighbours=1)
    put(simulation, [(20, 20)], species="wolf")
    assert 3 in seen(simulation)[0]
    assert len(seen(simulation)[0]) == 2


@pytest.mark.parametrize(("sight", "count"), [("exact", 9), ("topological", 3)])
def test_it_holds_in_the_air_as_well(sight, count):
    asset = boids(min_speed=5.0)
    vision = asset.vision.model_copy(update={"sight": sight, "neighbours": 3, "field_of_view": 360.0, "range": 100.0})
    simulation = meadow(asset.model_copy(update={"vision": vision}))
    rng = np.random.default_rng(2)
    put_aloft(simulation, rng.uniform(10, 14, (10, 3)), species="starling")
    seen(simulation)
    lists = simulation.world.resource(SightInSpace).lists
    assert np.diff(lists.first).tolist() == [count] * 10


def test_who_is_ignored_is_taken_into_account_by_no_model():
    text = shipped_species().get("sheep").source.decode()
    text = text.replace('dog = { fear = 0.6, notice = "15 m" }', "dog = { ignore = 1.0 }")
    files = {f"{name}.species.toml": shipped_species().get(name).source for name in ("dog", "wolf")}
    library = SpeciesLibrary(files=files | {"sheep.species.toml": text.encode()})
    simulation = meadow(brush("walk", vision={"range": 60.0}))
    simulation.world.insert(SpeciesList([], library))
    put(simulation, [(10, 10)], species="sheep")
    put(simulation, [(12, 10)], species="dog")
    put(simulation, [(10, 12)], species="wolf")
    assert seen(simulation) == [[2], [0, 2], [0, 1]]


@pytest.mark.parametrize("sight", ["metric", "hidden_points", "topological", "voronoi"])
def test_a_herd_moves_by_those_it_takes_into_account(sight):
    hashes = []
    for way in ("exact", sight):
        simulation = herd(way, scattered(), neighbours=2)
        simulation.run(8)
        hashes.append(simulation.agents[Heading.forward].tobytes())
    assert hashes[0] != hashes[1]
