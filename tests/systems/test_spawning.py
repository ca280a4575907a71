"""Where newborn animals stand: inside their area, on free ground, touching nobody."""

import time

import numpy as np
import pytest
from flockbrush.components import Body, Heading, Individual, Position
from flockbrush.engine.noise import Noise
from flockbrush.engine.problems import ProblemsError
from flockbrush.levels.terrain_kinds import Terrain
from flockbrush.systems import population
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.life import inside_polygon
from flockbrush.systems.population import give_birth
from flockbrush.systems.spawning import NoRoom, free_ground, place
from flockbrush.systems.visibility import no_edges
from hypothesis import given
from hypothesis import strategies as st
from small_herd import box, gaps, gaps_of, level, meadow, obstacle, put, spawn, straight, wall_gaps, xy_of

WALK = straight("walk")
OPEN = free_ground(no_edges(), np.zeros((1, 1), bool), 1e9)
STREAM = Noise(3).key("birth", 0)


def born(polygon, count, length=1.0, radius=0.2, heading=None, formation="scatter", key=STREAM):
    return place(np.asarray(polygon, float), count, length, radius, heading, formation, key, OPEN)


def apart(xy, forward, length=1.0, radius=0.2):
    n = len(xy)
    return gaps(xy, forward, np.full(n, max(0.5 * length - radius, 0)), np.full(n, radius)).min()


@pytest.mark.parametrize("formation", ["scatter", "grid", "ring", "line"])
@pytest.mark.parametrize("heading", [None, 0.7])
def test_newborns_stand_inside_and_apart(formation, heading):
    area = box(10, 10, 40, 30)
    xy, forward = born(area, 60, heading=heading, formation=formation)
    assert len(xy) == 60
    assert inside_polygon(xy, area).all()
    assert apart(xy, forward) > 0
    assert np.hypot(*forward.T) == pytest.approx(1.0)


@given(
    seed=st.integers(0, 10_000), count=st.integers(1, 25), length=st.sampled_from([0.2, 1.0, 3.0]),
    heading=st.one_of(st.none(), st.floats(-7, 7)), formation=st.sampled_from(["scatter", "grid", "ring", "line"]),
)  # fmt: skip
def test_whatever_is_asked_they_stand_inside_and_apart_or_it_is_refused(seed, count, length, heading, formation):
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 7))
    area = 20 + rng.uniform(4, 9, (7, 1)) * np.column_stack([np.cos(angle), np.sin(angle)])
    try:
        xy, forward = born(area, count, length, 0.2 * length, heading, formation, Noise(seed).key("birth", 0))
    except NoRoom as full:
        assert 0 <= full.fitted < count == full.wanted
        return
    assert inside_polygon(xy, area).all()
    assert count == 1 or apart(xy, forward, length, 0.2 * length) > 0


def test_a_heading_is_kept_and_without_one_each_has_its_own():
    _, forward = born(box(0, 0, 30, 30), 40, heading=2.0)
    assert forward == pytest.approx(np.tile([np.cos(2.0), np.sin(2.0)], (40, 1)))
    _, forward = born(box(0, 0, 30, 30), 200)
    assert np.hypot(*forward.mean(0)) < 0.2


def test_a_ring_turns_counter_clockwise_about_its_middle():
    xy, forward = born(box(0, 0, 30, 30), 80, formation="ring")
    away = xy - 15
    distance = np.hypot(*away.T)
    assert ((distance >= 6) & (distance <= 15)).all()
    turning = away[:, 0] * forward[:, 1] - away[:, 1] * forward[:, 0]
    assert turning == pytest.approx(distance)


def test_a_line_stands_abreast_across_the_heading():
    xy, _ = born(box(0, 0, 40, 40), 20, heading=np.pi / 2, formation="line")
    assert np.ptp(xy[:, 1]) < 1e-9  # all at the front
    assert xy[:, 1].min() > 38
    assert np.diff(np.sort(xy[:, 0])) == pytest.approx(2.0)


def test_a_line_of_ants_on_a_large_field_is_quick():
    begin = time.perf_counter()
    xy, _ = born(box(0, 0, 2000, 2000), 300, 0.02, 0.004, 0.0, "line")
    assert time.perf_counter() - begin < 5  # 10^10 spots are not looked at
    assert len(xy) == 300


def test_a_grid_fills_its_area_evenly():
    xy, _ = born(box(0, 0, 30, 30), 100, heading=0.0, formation="grid")
    counts = np.histogram2d(*xy.T, bins=2, range=[(0, 30), (0, 30)])[0]
    assert counts.min() >= 20


def test_too_many_are_refused_with_the_number_that_fits():
    with pytest.raises(NoRoom, match=r"only \d+ of 500 animals fit"):
        born(box(0, 0, 5, 5), 500)


def test_the_same_seed_puts_them_on_the_same_places_and_another_elsewhere():
    area = box(0, 0, 20, 20)
    assert born(area, 20)[0].tobytes() == born(area, 20)[0].tobytes()
    assert born(area, 20)[0].tobytes() != born(area, 20, key=Noise(4).key("birth", 0))[0].tobytes()


def test_one_more_animal_leaves_the_others_where_they_were():
    assert born(box(0, 0, 20, 20), 20)[0].tolist() == born(box(0, 0, 20, 20), 21)[0][:20].tolist()


def test_nobody_is_born_in_a_rock_however_coarse_the_map():
    # the cells are 10 m wide, and the rock lies between their centres
    rock = box(11, 11, 14, 14)
    simulation = meadow(WALK, cell=10.0, obstacles=[obstacle(rock)], spawns=[spawn(box(10, 10, 15, 15), "walk", 6)])
    assert not simulation.world.resource(Landscape).blocked.any()
    agents = simulation.agents
    xy = xy_of(simulation)
    assert not inside_polygon(xy, rock).any()
    edges = np.hstack([rock, np.roll(rock, -1, axis=0)])
    assert wall_gaps(xy, np.tile([1.0, 0.0], (6, 1)), agents[Body.axis], agents[Body.radius], edges).min() > 0
    assert gaps_of(simulation).min() > 0


def test_a_spawn_full_of_rock_is_a_problem_with_its_name():
    full = spawn(box(10, 10, 15, 15), "walk", 6, id=12, name="herd A")
    with pytest.raises(ProblemsError, match=r"object 12 'herd A' in layer 'spawns': only 0 of 6 animals fit"):
        meadow(WALK, obstacles=[obstacle(box(9, 9, 16, 16))], spawns=[full])


def test_nobody_is_born_in_the_water():
    shape = (40, 40)
    walkable = np.ones(shape, bool)
    walkable[:, 20:] = False
    kinds = np.zeros(shape, np.int16)
    ground = Terrain({**Terrain.blank(shape).values, "walkable": walkable}, kinds, ["x"], ["#000000"])
    simulation = meadow(WALK, terrain=ground, spawns=[spawn(box(15, 5, 25, 35), "walk", 40)])
    assert (xy_of(simulation)[:, 0] < 20).all()


@pytest.mark.parametrize("boundary", ["wall", "wrap", "despawn"])
def test_births_at_the_edge_of_the_map_stay_on_it(boundary):
    simulation = meadow(WALK, boundary=boundary)
    give_birth(simulation.world, spawn(box(-6, -6, 6, 6), "walk", 20, None), 20)
    xy = xy_of(simulation)
    assert ((xy >= 0) & (xy <= 6)).all()
    simulation.run(2)
    assert len(simulation.agents) == 20 if boundary == "wall" else True
    assert gaps_of(simulation).min() > -1e-6


def test_nobody_is_born_into_those_across_the_seam():
    simulation = meadow(WALK, boundary="wrap")
    put(simulation, [(0.05, y) for y in np.arange(1.0, 40, 1.1)], 0.0)  # their tails are on the eastern side
    count = len(simulation.agents)
    give_birth(simulation.world, spawn(box(37, 0, 40, 40), "walk", 40, None), 40)
    agents = simulation.agents
    forward = np.array([(1.0, 0.0)] * count + [(0, 0)] * 40)
    forward[count:] = simulation.agents.arrays[next(f for f in agents.arrays if repr(f) == "Heading.forward")][
        count : count + 40, :2
    ]
    xy = xy_of(simulation)
    xy[:count, 0] += 40
    assert gaps(xy, forward, agents[Body.axis], agents[Body.radius]).min() > 0


def test_no_two_are_born_into_each_other_across_the_seam():
    simulation = meadow(WALK, boundary="wrap", width=9, height=9)
    give_birth(simulation.world, spawn(box(0, 0, 9, 9), "walk", 70, heading=0.0), 70)
    agents, xy = simulation.agents, xy_of(simulation)
    n, east = len(xy), np.tile([1.0, 0.0], (140, 1))
    half, radius = np.tile(agents[Body.axis], 2), np.tile(agents[Body.radius], 2)
    i, j = np.triu_indices(2 * n, 1)
    for shift in ((9, 0), (0, 9), (9, 9), (9, -9)):
        across = gaps(np.vstack([xy, xy + shift]), east, half, radius)[(i < n) & (j >= n)]
        assert across.min() > 0


def test_large_herds_are_numbered_where_they_stand_with_the_same_bodies(monkeypatch):
    herds = []
    for many in (1000, 300):
        monkeypatch.setattr(population, "MANY", many)
        simulation = meadow(WALK)
        give_birth(simulation.world, spawn(box(0, 0, 40, 40), "walk", 300, None, species="sheep"), 300)
        agents = simulation.agents
        columns = agents[Position.xyz], agents[Heading.forward], agents[Body.length], agents[Individual.pace]
        herds.append(np.column_stack(columns))
    drawn, ordered = herds
    assert len(np.unique(drawn[:, 6])) > 200  # of many sizes
    assert sorted(map(tuple, drawn)) == sorted(map(tuple, ordered))
    steps = [np.median(np.hypot(*np.diff(herd[:, :2], axis=0).T)) for herd in herds]
    assert steps[0] > 10 and steps[1] < 4


def test_nobody_is_born_into_those_who_are_there_already():
    simulation = meadow(WALK)
    put(simulation, [(10 + 1.5 * i, 10 + 1.5 * j) for i in range(8) for j in range(8)], 0.4, length=1.2)
    give_birth(simulation.world, spawn(box(9, 9, 24, 24), "walk", 60, None, body_length=0.6), 60)
    assert len(simulation.agents) == 124
    assert gaps_of(simulation).min() > 0
    assert level().cell == 1.0


def test_when_they_do_not_fit_nobody_is_born():
    simulation = meadow(WALK)
    with pytest.raises(NoRoom):
        give_birth(simulation.world, spawn(box(9, 9, 11, 11), "walk", 60, None), 60)
    assert len(simulation.agents) == 0
    assert simulation.world.next_entity == 1
