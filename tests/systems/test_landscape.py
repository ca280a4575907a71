"""The ground as kernels want it: edges of obstacles and terrain, seams, and what of it is state."""

import numpy as np
import pytest
from edited_scene import land_of
from flockbrush.components import Heading
from flockbrush.engine.state import restore, snapshot, state_hash
from flockbrush.levels import terrain_kinds
from flockbrush.levels.build import build
from flockbrush.levels.schema import Goal, Key
from flockbrush.levels.terrain_kinds import Terrain, TerrainKind, terrain_property
from flockbrush.systems.commands import AddAnimals, AddObstacle, MoveGoal, PaintBrush, PaintCap, PaintCells
from flockbrush.systems.ground_edges import outline_edges
from flockbrush.systems.program_senses import WorldSenses
from flockbrush.systems.programs import Programs
from flockbrush.systems.steer import scene_of
from hypothesis import given
from hypothesis import strategies as st
from small_herd import Shelf, box, brush, level, meadow, obstacle, put, spawn, straight

WALK = straight("walk")


@given(st.lists(st.lists(st.booleans(), min_size=5, max_size=5), min_size=1, max_size=6))
def test_the_outline_of_a_mask_separates_inside_from_outside(rows):
    mask = np.array(rows)
    edges = outline_edges(mask)
    length = np.abs(edges[:, 2:] - edges[:, :2]).sum(1)
    padded = np.pad(mask, 1).astype(int)
    assert length.sum() == np.abs(np.diff(padded, axis=0)).sum() + np.abs(np.diff(padded, axis=1)).sum()
    for iy in range(mask.shape[0]):  # a ray to the east crosses the outline an odd number of times from inside
        for ix in range(mask.shape[1]):
            x, y = ix + 0.5, iy + 0.5
            upright = edges[edges[:, 0] == edges[:, 2]]
            crossed = (upright[:, 0] > x) & (upright[:, [1, 3]].min(1) < y) & (upright[:, [1, 3]].max(1) > y)
            assert crossed.sum() % 2 == mask[iy, ix]


def test_long_runs_are_one_edge():
    assert len(outline_edges(np.ones((7, 30), bool))) == 4


def test_a_wall_has_four_edges_round_the_map_and_an_open_map_none():
    assert len(land_of(meadow(WALK, boundary="wall")).solid.ends) == 4
    for boundary in ("open", "wrap", "despawn"):
        assert len(land_of(meadow(WALK, boundary=boundary)).solid.ends) == 0


def test_water_keeps_bodies_out_and_a_hedge_hides():
    shape = (40, 40)
    water, hedge = np.zeros(shape, bool), np.zeros(shape, bool)
    water[10:20, 25:30], hedge[10:20, 10:15] = True, True
    ground = Terrain(
        {**Terrain.blank(shape).values, "walkable": ~water, "blocks_view": hedge},
        np.zeros(shape, np.int16),
        ["grass"],
        ["#00ff00"],
    )
    land = land_of(meadow(WALK, terrain=ground))
    assert sorted(map(tuple, land.solid.ends.tolist())) == [
        (25, 10, 25, 20), (25, 10, 30, 10), (25, 20, 30, 20), (30, 10, 30, 20),
    ]  # fmt: skip
    assert land.opaque.ends[:, [0, 2]].max() == 15
    assert land.blocked.sum() == water.sum()
    simulation = meadow(straight("walk", mean=4.0), terrain=ground)
    put(simulation, [(20, 15)], 0.0)
    for _ in range(100):
        simulation.tick()
        x, y = simulation.agents.arrays and simulation.agents[next(iter(simulation.agents.arrays))][0, :2]
        assert not (25 < x < 30 and 10 < y < 20)


def test_a_further_property_of_the_ground_is_read_painted_and_undone(monkeypatch):
    monkeypatch.setattr(terrain_kinds, "PROPERTIES", list(terrain_kinds.PROPERTIES))
    terrain_property("depth", 0.5, "how deep animals sink in", "m", low=0, high=2)
    ground, mud, swamp = Terrain.blank((40, 40)), {"name": "mud", "colour": "#83705a"}, TerrainKind("swamp", "#333333")
    west = np.zeros((40, 40), bool)
    west[:, :20] = True
    ground.put(west, {**terrain_kinds.default_terrain(), **mud, "depth": 0.3})
    swamp.values["depth"] = 2.0
    simulation = meadow(WALK, terrain=ground, kinds=[swamp])  # no tileset has this mud: it is as it was read
    land, places = land_of(simulation), [(1.5, 1.5, 0.0), (30.0, 1.5, 0.0), (-9.0, 99.0, 0.0)]
    assert land.ground_at("depth", places).tolist() == [0.3, 0.5, 0.3]
    before = snapshot(simulation.world)
    PaintCells("surface", ["swamp"], [[1, 0, 40, 0]]).apply(simulation.world)
    assert land.ground_at("depth", places).tolist() == [2.0, 2.0, 0.3]
    restore(simulation.world, before)
    assert land.ground_at("depth", places).tolist() == [0.3, 0.5, 0.3]
    with pytest.raises(ValueError, match="rasters of the landscape"):
        land.ground_at("cost", places)
    with pytest.raises(ValueError, match="'dept' is no property of the ground; did you mean 'depth'"):
        land.ground_at("dept", places)


def test_models_drives_and_conditions_ask_for_the_ground_under_each_animal(monkeypatch):
    monkeypatch.setattr(terrain_kinds, "PROPERTIES", list(terrain_kinds.PROPERTIES))
    terrain_property("depth", 0.5, "how deep animals sink in", "m", low=0, high=2)
    ground, west = Terrain.blank((40, 40)), np.zeros((40, 40), bool)
    west[:, :20] = True
    ground.put(west, {**terrain_kinds.default_terrain(), "name": "mud", "colour": "#83705a", "depth": 0.3})
    simulation = meadow(WALK, terrain=ground)
    put(simulation, [(3, 5), (33, 5)])
    simulation.run(1)
    senses = WorldSenses(simulation.world, Programs(), [])
    for depth in (scene_of(simulation.world).ground("depth"), senses.ground("depth")):
        assert depth.tolist() == [0.3, 0.5]
        with pytest.raises(ValueError, match="read-only"):
            depth[0] = 1.0


def test_on_a_wrapped_map_obstacles_stand_beyond_the_seam_too():
    simulation = meadow(WALK, boundary="wrap", obstacles=[obstacle(box(0.5, 18, 2, 22))])
    ends = land_of(simulation).solid.ends
    assert (ends[:, 0] > 40).any()
    runner = meadow(straight("walk", mean=6.0), boundary="wrap", obstacles=[obstacle(box(0.5, 18, 2, 22))])
    put(runner, [(36, 20)], 0.0)
    for _ in range(60):
        runner.tick()
        x, y = runner.agents[next(f for f in runner.agents.arrays if repr(f) == "Position.xyz")][0, :2]
        assert not (0.5 < x < 2 and 18 < y < 22)
    assert abs(runner.agents[Heading.forward][0, 1]) > 0.1  # it was turned aside


def test_cattle_added_among_ants_see_the_walls_as_far_as_cattle_do():
    ant = brush("ant", body={"length": 0.02, "radius": 0.004})
    cow = brush("cow", body={"length": 2.0, "radius": 0.4})
    simulation = meadow(ant, cow, boundary="wall")
    simulation.run(1)
    before = land_of(simulation).reach
    simulation.submit(AddAnimals("cow", 20.0, 20.0, 10.0, 3))
    simulation.run(1)
    assert land_of(simulation).reach >= 8.0 >= before


def everything(simulation):
    simulation.submit(PaintBrush("other", 10.0, 10.0, 5.0))
    simulation.submit(PaintCap(0.5, 30.0, 30.0, 5.0))
    simulation.submit(AddObstacle("new", [[20.0, 30.0], [25.0, 30.0], [22.0, 35.0]]))
    simulation.submit(MoveGoal("there", 5.0, 35.0))
    simulation.submit(AddAnimals("other", 10.0, 25.0, 3.0, 4, "cow"))


def busy():
    goal = Goal(1, "there", np.array([35.0, 20.0]), 2.0, "stay", "", box(34, 19, 36, 21))
    other = brush("other", mean=1.5, body={"length": 2.0, "radius": 0.4}, speed={"deviation": 0.2})
    simulation = meadow(brush("walk", mean=1.0), other, goals=[goal], boundary="wall")
    put(simulation, np.random.default_rng(2).uniform(5, 18, (12, 2)), np.arange(12.0))
    return simulation


def test_paint_obstacles_goals_and_how_far_one_looks_come_back_with_a_snapshot():
    simulation = busy()
    everything(simulation)
    simulation.run(20)
    kept = snapshot(simulation.world)
    simulation.run(30)
    fresh = busy()
    restore(fresh.world, kept)
    one, two = land_of(simulation), land_of(fresh)
    assert two.reach == one.reach
    assert np.array_equal(two.brush, one.brush)
    assert np.array_equal(two.surface, one.surface)
    assert two.goals[0].xy.tolist() == [5.0, 35.0]
    assert two.goals[0].polygon.tolist() == one.goals[0].polygon.tolist()
    assert np.array_equal(two.navigation.fields, one.navigation.fields)
    fresh.run(30)
    assert state_hash(fresh.world) == state_hash(simulation.world)


def test_how_far_the_largest_looks_is_not_forgotten():
    ant, cow = brush("ant", body={"length": 0.02, "radius": 0.004}), brush("cow", body={"length": 2.0, "radius": 0.4})
    come = Key(
        1, "come", 0.1, "AddAnimals", {"brush": "cow", "x": 6.0, "y": 6.0, "radius": 5.0, "count": 5}, np.zeros(2)
    )

    def herd():
        ground = level(boundary="wall", spawns=[spawn(box(5, 5, 9, 9), "ant", 3)], script=[come])
        return build(ground, library=Shelf(ant, cow))

    simulation, fresh = herd(), herd()
    small = land_of(fresh).reach
    simulation.run(20)
    restore(fresh.world, snapshot(simulation.world))
    assert land_of(fresh).reach == land_of(simulation).reach == 8.0 > small
    simulation.run(40)
    fresh.run(40)
    assert state_hash(fresh.world) == state_hash(simulation.world)


def test_two_worlds_of_one_level_do_not_paint_each_other():
    from flockbrush.levels.build import build
    from small_herd import Shelf, level, spawn

    goal = Goal(1, "there", np.array([35.0, 20.0]), 2.0, "stay", "", box(34, 19, 36, 21))
    walk, other = brush("walk"), brush("other", body={"length": 2.0, "radius": 0.4})
    spawns = [spawn(box(5, 5, 20, 20), "walk", 8), spawn(box(5, 25, 20, 35), "other", 0)]
    ground = level(goals=[goal], boundary="wall", spawns=spawns)
    one, two, alone = (build(ground, library=Shelf(walk, other)) for _ in range(3))
    everything(one)
    for _ in range(20):
        one.tick()
        two.tick()
    alone.run(20)
    assert state_hash(two.world) == state_hash(alone.world) != state_hash(one.world)
    assert ground.goals[0].xy.tolist() == [35.0, 20.0]


@pytest.mark.parametrize("boundary", ["wall", "open", "wrap", "despawn"])
def test_bounds_are_the_map_or_nothing(boundary):
    bounds = land_of(meadow(WALK, boundary=boundary)).bounds
    assert bounds == ((-np.inf, -np.inf, np.inf, np.inf) if boundary == "open" else (0, 0, 40, 40))
