"""NEAR and SENSE in a world: who is seen, which obstacles are felt, and where."""

import numpy as np
import pytest
from flockbrush.components import Body, Vision
from flockbrush.levels.terrain_kinds import Terrain
from flockbrush.systems.senses import Near, ObstaclesInSight, Sight
from hypothesis import given
from hypothesis import strategies as st
from small_herd import box, brush, meadow, obstacle, put, straight, xy_of

WALK = straight("walk", mean=0.0)


def seen_by(simulation, row=0):
    return sorted(simulation.world.resource(Sight).lists.of(row).tolist())


def felt_by(simulation, row=0):
    seen = simulation.world.resource(ObstaclesInSight)
    return seen.offset[seen.first[row] : seen.first[row + 1]]


def test_animals_see_in_range_ahead_and_past_one_another():
    narrow = straight("walk", mean=0.0, vision={"field_of_view": 180.0}, body={"radius": 0.2})
    simulation = meadow(narrow)
    # ahead; behind; hidden behind the first; to the side; out of range
    put(simulation, [(20, 20), (22, 20), (18, 20), (23.5, 20), (21, 22), (20.5, 26)], 0.0)
    simulation.tick()
    assert seen_by(simulation) == [1, 4]


def test_a_brush_without_occlusion_sees_through_everybody():
    open_eyed = straight("walk", mean=0.0, vision={"occlusion": False})
    simulation = meadow(open_eyed)
    put(simulation, [(20, 20), (22, 20), (23.5, 20)], 0.0)
    simulation.tick()
    assert seen_by(simulation) == [1, 2]


def test_a_goose_hidden_behind_a_rock_is_not_seen_and_a_fence_hides_nobody():
    for hides in (True, False):
        simulation = meadow(WALK, obstacles=[obstacle(box(21, 19, 21.5, 21), blocks_view=hides)])
        put(simulation, [(20, 20), (23, 20), (20, 22)], 0.0)
        simulation.tick()
        assert seen_by(simulation) == ([2] if hides else [1, 2])


def test_animals_see_one_another_across_the_seam_at_the_short_offset():
    simulation = meadow(WALK, boundary="wrap")
    put(simulation, [(0.5, 0.5), (39.0, 39.5), (20, 20)], 0.0)
    simulation.tick()
    lists = simulation.world.resource(Sight).lists
    assert seen_by(simulation, 0) == [1]
    assert seen_by(simulation, 1) == [0]
    assert lists.offset[lists.first[0]] == pytest.approx((-1.5, -1.0), abs=1e-12)


def nearest_on(polygon, point):
    """The point of an outline nearest to another, by brute force along the edges."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    t = np.clip(((point - a) * (b - a)).sum(1) / ((b - a) ** 2).sum(1), 0, 1)
    near = a + t[:, None] * (b - a)
    return near[np.argmin(np.hypot(*(near - point).T))]


@given(seed=st.integers(0, 10_000), count=st.integers(1, 5))
def test_the_nearest_point_of_every_obstacle_in_range_is_felt(seed, count):
    rng = np.random.default_rng(seed)
    rocks = []
    for k in range(count):
        angle = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 8)))
        shape = rng.uniform(5, 35, 2) + rng.uniform(0.5, 4) * np.column_stack([np.cos(angle), np.sin(angle)])
        rocks.append(obstacle(shape, f"rock {k}"))
    simulation = meadow(WALK, obstacles=rocks)
    put(simulation, rng.uniform(0, 40, (20, 2)), 0.0)
    here = xy_of(simulation)
    simulation.tick()
    for row, xy in enumerate(here):
        expected = [nearest_on(rock.polygon, xy) - xy for rock in rocks]
        expected = sorted(tuple(off) for off in expected if np.hypot(*off) < 4.0)
        assert np.array(sorted(map(tuple, felt_by(simulation, row)))) == pytest.approx(np.array(expected), abs=1e-9)


def test_each_wall_of_the_map_and_the_shore_are_felt_as_one_obstacle_each():
    shape = (40, 40)
    walkable = np.ones(shape, bool)
    walkable[0:4, 4:6] = False
    kinds = np.zeros(shape, np.int16)
    ground = Terrain({**Terrain.blank(shape).values, "walkable": walkable}, kinds, ["x"], ["#000000"])
    simulation = meadow(WALK, boundary="wall", terrain=ground)
    put(simulation, [(2.0, 1.5)], 0.0)
    simulation.tick()
    assert sorted(map(tuple, felt_by(simulation).round(9))) == [(-2.0, 0.0), (0.0, -1.5), (2.0, 0.0)]


def test_more_obstacles_than_expected_are_all_felt():
    posts = [obstacle(box(20 + 0.3 * k, 22, 20.1 + 0.3 * k, 22.1), f"post {k}") for k in range(-6, 6)]
    simulation = meadow(WALK, obstacles=posts)
    put(simulation, [(20, 20), (5, 5)], 0.0)
    simulation.tick()
    assert len(felt_by(simulation, 0)) == 12
    assert len(felt_by(simulation, 1)) == 0


def test_everybody_is_in_the_cells_once_and_on_a_wrapped_map_with_ghosts():
    for boundary, wrapped in (("open", False), ("wrap", True)):
        simulation = meadow(WALK, boundary=boundary)
        put(simulation, np.random.default_rng(1).uniform(0, 40, (50, 2)))
        simulation.tick()
        near = simulation.world.resource(Near)
        cells = near.cells
        assert sorted(cells.row[~cells.ghost].tolist()) == list(range(50))
        assert cells.ghost.any() == wrapped
        assert np.isfinite(near.ghosts) == wrapped


def test_nobody_sees_himself_and_sight_is_empty_in_an_empty_world():
    simulation = meadow(brush("walk"))
    simulation.tick()
    assert len(simulation.world.resource(Sight).lists.near) == 0
    put(simulation, [(20, 20)])
    simulation.tick()
    assert seen_by(simulation) == []
    assert simulation.agents[Vision.range][0] == 4.0
    assert simulation.agents[Body.length][0] == 1.0
