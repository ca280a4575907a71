"""Hills: ways to goals cost what animals lose on slopes, and nobody is faster than its species on any ground."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import shipped
from flockbrush.behaviours.species import SpeciesLibrary, shipped_species
from flockbrush.components import BrushBinding, Ground, Position, Species, Velocity
from flockbrush.engine.raster import Raster
from flockbrush.levels.build import build
from flockbrush.levels.schema import Goal, Guide
from flockbrush.systems.commands import AddAnimals, SwitchBrush
from flockbrush.systems.explain import explain
from flockbrush.systems.fauna import STEEPEST, SpeciesList
from flockbrush.systems.ground_height import Heights, Hills, height_of_ground, steepness_at
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.navigation import goal_field
from flockbrush.systems.palette import Palette
from flockbrush.systems.terrain import relief_of, slope_factor_, steepest_within, steepness_of
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
    direction, time = goal_field(goal_at(15, 38), None, too_steep(height), 1.0, height)
    assert np.isinf(time[:, :20]).all() and not direction[:, :20].any()
    height[2:6] = np.clip(X - 14, 0, 12)[2:6] / 12 * 4 * STEEPEST
    direction, time = goal_field(goal_at(15, 38), None, too_steep(height), 1.0, height)
    assert np.isfinite(time[~too_steep(height)]).all()
    assert direction[15, 16, 1] < -0.5  # to the ramp in the south


def too_steep(height, limit=STEEPEST):
    return steepest_within(steepness_of(height, 1.0), 1.0, height.shape, 1.0) > limit


@pytest.mark.parametrize("cell", [0.5, 1.0, 2.5, 7.0])
def test_the_slope_of_a_cell_is_the_steepest_of_the_ground_in_it(cell):
    height = np.random.default_rng(5).uniform(0, 3, (14, 21))
    hills = Hills(Heights(relief_of(height, 1.0), 1.0, (0.0, 0.0)), steepness_of(height, 1.0), np.zeros(0))
    shape = int(14 / cell), int(21 / cell)
    within = steepest_within(hills.steepness, 1.0, shape, cell)
    x, y = (np.arange(0.05, n, 0.1) for n in (shape[1] * cell, shape[0] * cell))
    at, east, north = (
        np.array([[f(a, b) for a in x] for b in y])
        for f in (
            lambda a, b: steepness_at(hills, a, b),
            lambda a, b: (height_of_ground(hills.heights, a + 1e-6, b) - ground(hills, a, b)) / 1e-6,
            lambda a, b: (height_of_ground(hills.heights, a, b + 1e-6) - ground(hills, a, b)) / 1e-6,
        )
    )
    assert (np.hypot(east, north) <= at + 1e-6).all()  # a bound of the slope everywhere, and close to it somewhere
    assert np.hypot(east, north).max() > 0.9 * at.max()
    iy, ix = (y / cell).astype(int), (x / cell).astype(int)
    greatest = np.zeros(shape)
    np.maximum.at(greatest, np.ix_(iy, ix), at)
    assert np.array_equal(greatest, within)


def ground(hills, x, y):
    return height_of_ground(hills.heights, x, y)


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


@pytest.mark.parametrize(("up", "cell"), [(8.0, 0.125), (-8.0, 0.125), (3.0, 0.5)])
def test_a_crowd_that_streams_over_an_edge_is_nowhere_faster_than_its_species(up, cell):
    y, x = (np.mgrid[: round(20 / cell), : round(20 / cell)] + 0.5) * cell
    goal = Goal(1, "out", np.array([18.0, 10.0]), 1.0, "stay", "")
    crowd = spawn(box(4, 5, 11.9, 15), "evacuate", 60, species="human")
    height = 20 + up * (x > 12 + 0.3 * np.sin(2 * y))
    ground = level(20, 20, "wall", 0.5, goals=[goal], spawns=[crowd], height_map=Raster(cell, height))
    scene = build(ground, 4, library=shipped())
    climber = shipped_species().get("human").source.replace(b"steepest = 1.0", b"steepest = 100.0")
    scene.world.resource(SpeciesList).library = SpeciesLibrary(files={"human.species.toml": climber})
    top, fastest = shipped_species().get("human").walk.speed, 0.0
    for _ in range(160):
        scene.tick()
        fastest = max(fastest, np.linalg.norm(scene.agents[Velocity.xyz], axis=1).max())
    assert np.ptp(scene.agents[Position.xyz][:, 2]) > 0.1 * abs(up)
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


def goats_and_sheep(brush, sheep=0.4, goat=5.0, count=12, goals=(), guides=(), height=None, names=("sheep", "goat")):
    """Both species begin in the south; sheep and goats differ in nothing but the steepest way that they walk."""
    herds = [spawn(box(22, 4, 38, 12), brush, count, np.pi / 2, species=name, id=k + 1) for k, name in enumerate(names)]
    ground = level(60, 60, "wall", 1.0, goals=[*goals], guides=[*guides], spawns=herds, height_map=Raster(1.0, height))
    scene = build(ground, 3, library=shipped())
    scene.world.resource(SpeciesList).library = walkers(sheep=sheep, goat=goat)
    return scene


BOTH = ("sheep", "goat")


def walkers(**steepest):
    """A library of species that are alike but for the steepest way that they walk."""
    text = 'schema = "flockbrush.species/1"\nmedia = ["walk"]\n[body]\nlength = 1.2\nradius = 0.24\n[walk]\n'
    return SpeciesLibrary(files={f"{k}.species.toml": f"{text}steepest = {v}\n".encode() for k, v in steepest.items()})


def bank(rise=0.7, up=2.8, south=28.0, ramp=0.0):
    """(60, 60) m: a bank across the map, ``up`` m high, and in the west a ramp through it, ``ramp`` m wide."""
    y, x = np.mgrid[:60, :60] + 0.5
    steep = np.clip((y - south) * rise, 0, up)
    return np.where(x < ramp, np.clip((y - 10) / 36 * up, 0, up), steep)


def underfoot(scene, name):
    """(k,) slope of the ground under the animals of a species."""
    hills = scene.world.resource(Landscape).hills_for(np.zeros(0))
    return np.array([steepness_at(hills, x, y) for x, y in xy_of(scene)[of(scene, name)]])


def of(scene, name):
    return scene.agents[Species.index] == scene.world.resource(SpeciesList).names.index(name)


def test_ways_of_each_species_are_as_if_it_were_alone():
    goal = Goal(1, "top", np.array([30.0, 56.0]), 2.0, "stay", "")
    both = goats_and_sheep("to-goal", goals=[goal], height=bank(ramp=8.0))
    xy = xy_of(both).copy()
    both.tick()
    land = both.world.resource(Landscape)
    assert land.slope_limits == (0.4, 5.0)
    for name, fields in zip(BOTH, np.split(land.navigation.fields, 2), strict=True):
        alone = goats_and_sheep("to-goal", goals=[goal], height=bank(ramp=8.0), names=[name])
        alone.tick()
        navigation = alone.world.resource(Landscape).navigation
        assert np.array_equal(navigation.fields, fields)
        assert np.array_equal(navigation.at(xy, 0)[of(both, name)], both.agents[Ground.guidance][of(both, name)])


def test_sheep_go_round_by_the_ramp_and_goats_go_straight_up():
    goal = Goal(1, "top", np.array([30.0, 56.0]), 4.0, "stay", "")
    scene, ramped, there = goats_and_sheep("to-goal", goals=[goal], height=bank(ramp=8.0)), np.zeros(24, bool), None
    while scene.clock.now < 90 and (there is None or not there.all()):
        scene.tick()
        assert underfoot(scene, "sheep").max() <= 0.4
        xy = xy_of(scene)
        ramped |= (xy[:, 0] < 8.0) & (xy[:, 1] > 24)
        there = xy[:, 1] > 44
    assert there.all()
    assert ramped[of(scene, "sheep")].all() and not ramped[of(scene, "goat")].any()


def test_sheep_do_not_climb_a_bank_that_a_guide_leads_up_nor_are_they_pushed_up():
    way = Guide(1, "up", np.array([(30.0, 2.0), (30.0, 58.0)]), 1.0, 30.0, 5.0, "", False)
    scene = goats_and_sheep("to-goal", guides=[way], height=bank(), count=20)
    for _ in range(32 * 60):
        scene.tick()
        assert underfoot(scene, "sheep").max() <= 0.4
    high = scene.agents[Position.xyz][:, 2] > 2.0
    assert high[of(scene, "goat")].mean() > 0.8 and not high[of(scene, "sheep")].any()


def test_who_comes_later_with_another_limit_gets_ways_of_its_own_and_undo_keeps_them():
    goal = Goal(1, "top", np.array([30.0, 56.0]), 4.0, "stay", "")
    scene = goats_and_sheep("to-goal", goals=[goal], height=bank(ramp=8.0), count=3)
    scene.world.resource(SpeciesList).library = walkers(sheep=0.4, goat=0.4, ibex=5.0)
    scene.run(2)
    land = scene.world.resource(Landscape)
    assert land.slope_limits == (0.4,)
    scene.submit(AddAnimals("to-goal", 30.0, 8.0, 3.0, 3, "ibex"))
    scene.run(2)
    assert land.slope_limits == (0.4, 5.0)
    fields = land.navigation.fields.copy()
    land.set_state(land.state())
    scene.tick()
    assert np.array_equal(land.navigation.fields, fields)


def test_an_explanation_says_how_steep_it_is_and_what_the_animal_walks():
    scene = goats_and_sheep("to-goal", height=np.mgrid[:60, :60][0] * 0.3)
    told = explain(scene.world, int(scene.agents.ids[0])).numbers
    assert told["slope ahead"][0] == pytest.approx(0.3)
    assert told["steepest slope it walks"][0] == 0.4
