"""Hills: ways to goals cost what animals lose on slopes, and nobody is faster than its species on any ground."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.species import shipped_species
from flockbrush.components import BrushBinding, Position, Velocity
from flockbrush.engine.raster import Raster
from flockbrush.levels.build import build
from flockbrush.levels.schema import Goal
from flockbrush.systems.commands import SwitchBrush
from flockbrush.systems.hill_marching import STEEPEST
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.navigation import goal_field
from flockbrush.systems.palette import Palette
from flockbrush.systems.terrain import slope_factor_
from small_herd import box, level, spawn, xy_of

SHAPE = (31, 41)
FREE = np.zeros(SHAPE, bool)
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]] + 0.5


def goal_at(iy, ix):
    goal = np.zeros(SHAPE, bool)
    goal[iy, ix] = True
    return goal


def test_on_level_ground_ways_are_straight_and_cost_their_length():
    direction, time = goal_field(goal_at(15, 20), None, FREE, 2.0, np.full(SHAPE, 7.0))
    x, y = 2 * (20.5 - X), 2 * (15.5 - Y)
    far = np.hypot(x, y)
    assert np.abs(time - far).max() < 0.6
    away = far > 0
    error = np.arccos(np.clip((direction[..., 0] * x + direction[..., 1] * y)[away] / far[away], -1, 1))
    assert np.degrees(error).max() < 8


@pytest.mark.parametrize("rise", [0.2, -0.2, -0.05])
def test_a_metre_costs_as_much_more_as_animals_are_slower_up_or_down(rise):
    _, time = goal_field(goal_at(15, 40), None, FREE, 2.0, 2 * rise * X)
    assert time[15, 0] == pytest.approx(80 / slope_factor_(rise), rel=1e-9)


def test_along_a_hillside_a_way_costs_its_length():
    _, time = goal_field(goal_at(15, 40), None, FREE, 2.0, 1.5 * 2 * Y)
    assert time[15, 0] == pytest.approx(80, rel=1e-9)


def test_a_cliff_is_no_way_and_a_ramp_through_it_is():
    height = np.where(X > 20, 4 * STEEPEST, 0.0)
    direction, time = goal_field(goal_at(15, 38), None, FREE, 1.0, height)
    assert np.isinf(time[:, :20]).all() and not direction[:, :20].any()
    height[2:6] = np.clip(X - 14, 0, 12)[2:6] / 12 * 4 * STEEPEST
    direction, time = goal_field(goal_at(15, 38), None, FREE, 1.0, height)
    assert np.isfinite(time).all()
    assert direction[15, 16, 1] < -0.5  # to the ramp in the south


def test_a_blocked_cell_on_a_hill_is_gone_round_and_corners_are_closed():
    blocked = FREE.copy()
    np.fill_diagonal(blocked[:, :31], True)  # cells that touch at their corners
    _, time = goal_field(goal_at(25, 5), None, blocked, 1.0, 0.1 * X)
    assert np.isinf(time[5, 25]) and np.isfinite(time[25, 2])
    assert np.isinf(time[blocked]).all()


def before_a_ridge(count=12):
    """A herd in the west, its goal in the east, a ridge of 60 m between, and a pass in the north."""
    y, x = (np.mgrid[:60, :80] + 0.5) * 2.5
    height = 60 * np.exp(-(((x - 100) / 20) ** 2)) * (1 - 0.95 * np.exp(-(((y - 120) / 14) ** 2)))
    goal = Goal(1, "pasture", np.array([180.0, 40.0]), 10.0, "stay", "")
    herd = spawn(box(20, 30, 44, 50), "to-goal", count, species="reindeer")
    ground = level(200, 150, "wall", 2.5, goals=[goal], spawns=[herd], height_map=Raster(2.5, height))
    return build(ground, 3, library=shipped())


def test_a_herd_before_a_ridge_takes_the_pass_although_the_straight_way_is_shorter():
    scene = before_a_ridge()
    high, there = 0.0, 0.0
    while scene.clock.now < 120 and there < 0.9:
        scene.run(64)
        high = max(high, scene.agents[Position.xyz][:, 2].max())
        there = (np.hypot(*(xy_of(scene) - (180, 40)).T) < 40).mean()
    assert there > 0.9 and high < 15


@pytest.mark.parametrize(("up", "cell"), [(15.0, 0.125), (-15.0, 0.125), (3.0, 0.5)])
def test_a_crowd_that_streams_over_an_edge_is_nowhere_faster_than_its_species(up, cell):
    y, x = (np.mgrid[: round(20 / cell), : round(20 / cell)] + 0.5) * cell
    goal = Goal(1, "out", np.array([18.0, 10.0]), 1.0, "stay", "")
    crowd = spawn(box(4, 5, 11.9, 15), "evacuate", 60, species="human")
    height = 20 + up * (x > 12 + 0.3 * np.sin(2 * y))
    ground = level(20, 20, "wall", 0.5, goals=[goal], spawns=[crowd], height_map=Raster(cell, height))
    scene = build(ground, 4, library=shipped())
    top, fastest = shipped_species().get("human").walk.speed, 0.0
    for _ in range(160):
        scene.tick()
        fastest = max(fastest, np.linalg.norm(scene.agents[Velocity.xyz], axis=1).max())
    assert 0.5 < fastest <= 1.01 * top + 1e-9


@pytest.mark.parametrize("rise", [-0.6, -0.1, 0.6])
@pytest.mark.parametrize(("brush", "species"), [("starlings", "starling"), ("skein", "goose")])
def test_birds_land_on_slopes_that_they_fly_down_or_up(rise, brush, species):
    height = rise * (np.arange(200) + 0.5)[None, :].repeat(200, 0) * 5.0
    birds = spawn(box(300, 480, 320, 500), brush, 3, species=species, altitude=20.0)
    there = spawn(box(0, 0, 1, 1), "rest", 0, species=species, id=2)
    ground = level(1000, 1000, "open", 5.0, spawns=[birds, there], height_map=Raster(5.0, height - height.min()))
    scene = build(ground, 1, library=shipped())
    scene.run(32)
    scene.submit(SwitchBrush("rest"))
    limits = shipped_species().get(species).fly
    while scene.clock.now < 30 and flying(scene).any():
        scene.tick()
        assert above(scene).min() > -1e-9 and scene.agents[Velocity.xyz][:, 2].max() < limits.climb + 1e-9
    assert not flying(scene).any()
    scene.run(48)
    assert above(scene).max() < 1e-6  # on their feet


def above(scene):
    """(n,) m above the ground."""
    land = scene.world.resource(Landscape)
    return scene.agents[Position.xyz][:, 2] - [land.ground(xy) for xy in xy_of(scene)]


def flying(scene):
    """(n,) bool, who has a brush of the air."""
    return scene.world.resource(Palette).flies_free[scene.agents[BrushBinding.brush]]
