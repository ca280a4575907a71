"""Boids that are held to the ground: what stops them."""

from dataclasses import replace

import numpy as np
import pytest
from flockbrush.components import Position
from flockbrush.levels.terrain_kinds import Terrain
from flockbrush.systems.sky_solids import _rectangles
from hypothesis import given
from hypothesis import strategies as st
from small_herd import box, brush, meadow, obstacle, put


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere", "plane"])
def test_boids_held_to_the_ground_meet_what_walkers_meet(shape):
    body = {"length": 1.0, "radius": 0.25, "contact": "disc"}
    herd = brush("herd", "boids", 2.0, body, grounded=True, max_speed=3.0, min_speed=1.0, foresight=0.0)
    water = Terrain.blank((40, 40)).values["walkable"].copy()
    water[:, 30:] = False
    blank = Terrain.blank((40, 40)).values | {"walkable": water}
    ground = Terrain(blank, np.zeros((40, 40), np.int16), ["x"], ["#000000"])
    rock = replace(obstacle(box(14, 14, 20, 20)), shape=shape, z_max=3.0)
    simulation = meadow(herd, terrain=ground, obstacles=[rock], boundary="wall")
    put(simulation, [(5, 17), (5, 13.9), (5, 25), (21, 17), (5, 5)], 0.0)
    touched = np.zeros(5, bool)
    for _ in range(640):
        simulation.tick()
        x, y, z = simulation.agents[Position.xyz].T
        gap = np.hypot(np.maximum(abs(x - 17) - 3, 0), np.maximum(abs(y - 17) - 3, 0))
        assert (gap > 0.2499).all() and (x < 29.7501).all() and (z == 0).all()
        touched |= (gap < 0.26) | (x > 29.74)
    assert touched[[0, 2, 4]].all()


@given(st.integers(0, 2**32 - 1), st.integers(1, 9), st.integers(1, 9))
def test_rectangles_cover_a_mask_once(seed, ny, nx):
    mask = np.random.default_rng(seed).random((ny, nx)) < 0.6
    covered = np.zeros((ny, nx), int)
    for (x0, y0), _, (x1, y1), _ in _rectangles(mask):
        covered[int(y0) : int(y1), int(x0) : int(x1)] += 1
    assert np.array_equal(covered, mask)
