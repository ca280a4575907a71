"""Bodies that never overlap and never enter an obstacle, whatever their owners wish."""

from types import SimpleNamespace

import numpy as np
import pytest
from flockbrush.components import Heading, Position
from flockbrush.systems.contact import move
from flockbrush.systems.contact_candidates import contacts_within
from flockbrush.systems.grid import sort_into_cells
from flockbrush.systems.visibility import edges_by_cell, no_edges
from hypothesis import given
from hypothesis import strategies as st
from small_herd import box, gaps, gaps_of, meadow, obstacle, put, straight, wall_gaps, xy_of

DT = 1 / 32
ROUNDING = 1e-6  # m


def crowd(xy, heading, length=1.0, radius=0.2, speed=2.0, max_turn=10.0, walls=()):
    """Animals without a mind: `tick` moves them by the wishes it is given."""
    n = len(xy)
    size, radius = (np.broadcast_to(np.asarray(v, float), n).copy() for v in (length, radius))
    forward = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(n)])
    ends = np.asarray(walls, float).reshape(-1, 4)
    speed, max_turn = (np.broadcast_to(np.asarray(v, float), n).copy() for v in (speed, max_turn))
    return SimpleNamespace(
        xyz=np.column_stack([xy, np.zeros(n)]), forward=forward, length=size, radius=radius,
        half=np.maximum(0.5 * size - radius, 0), speed=speed, max_turn=max_turn, ends=ends,
    )  # fmt: skip


def tick(c, wish):
    """One move; ``wish`` (n, 2) need not be of unit length."""
    wish = np.column_stack([wish / np.maximum(np.hypot(*wish.T), 1e-12)[:, None], np.zeros(len(wish))])
    reach = float(c.length.max() + 4 * DT * c.speed.max())
    edges = edges_by_cell(c.ends, reach) if len(c.ends) else no_edges()
    cells = sort_into_cells(c.xyz, c.forward, c.length, c.radius, 4.0)
    step, heading = move(cells, c.forward, wish, c.speed, c.max_turn, edges, DT)
    c.xyz[:, :2] += step
    c.forward[:, :2] = heading
    return step


def apart(c):
    """The smallest room between any two bodies, m."""
    return gaps(c.xyz[:, :2], c.forward, c.half, c.radius).min()


@pytest.mark.parametrize("wrap", [None, (9.0, 7.0)])
@pytest.mark.parametrize("reach", [0.4, 1.0, 2.5])  # from 1 m on more bodies than fit into the first lists
def test_whoever_is_within_reach_could_be_met(reach, wrap):
    xy = np.random.default_rng(5).uniform((0, 0), (9, 7), (300, 2))
    xyz, forward = np.column_stack([xy, np.zeros(300)]), np.tile([1.0, 0.0, 0.0], (300, 1))
    cells = sort_into_cells(xyz, forward, np.full(300, 0.4), np.full(300, 0.2), 2.5, wrap)
    met = contacts_within(reach, cells)
    far = np.hypot(cells.x[:, None] - cells.x, cells.y[:, None] - cells.y)
    np.fill_diagonal(far, np.inf)
    assert len(met.order) == 300 and not cells.ghost[met.order].any()
    assert (met.count[met.order] > 16).any() == (reach >= 1.0)
    for s in met.order:
        assert met.near[s, : met.count[s]].tolist() == np.flatnonzero(far[s] < reach).tolist()


def scattered(n, side, seed, length=1.0, radius=0.2, heading=None):
    """Places and headings at random, nobody touching anybody."""
    rng = np.random.default_rng(seed)
    length, radius = (np.broadcast_to(np.asarray(v, float), n) for v in (length, radius))
    half = np.maximum(0.5 * length - radius, 0)
    xy, chance = np.empty((n, 2)), rng.uniform(0, 2 * np.pi, n)
    heading = chance if heading is None else heading
    for k in range(n):
        while True:
            xy[k] = rng.uniform(0, side, 2)
            near = np.flatnonzero(np.hypot(*(xy[:k] - xy[k]).T) < 0.5 * (length[:k] + length[k]))
            rows = [*near, k]
            f = np.column_stack([np.cos(heading[rows]), np.sin(heading[rows])])
            if not len(near) or gaps(xy[rows], f, half[rows], radius[rows]).min() > 1e-3:
                break
    return xy, heading


def to(c, x, y):
    return np.array([x, y]) - c.xyz[:, :2]


def test_mice_and_cattle_pressed_together_never_overlap():
    rng = np.random.default_rng(1)
    length = rng.choice([0.3, 1.0, 2.5], 60)
    c = crowd(*scattered(60, 16, 2, length, 0.2 * length), length, 0.2 * length, speed=3.0)
    for _ in range(120):
        tick(c, to(c, 8, 8))
        assert apart(c) > -ROUNDING
    assert np.hypot(*to(c, 8, 8).T).mean() < 5.5  # they really are pressed together


@pytest.mark.parametrize("speed", [0.0, 8.0, 25.0, 50.0])
def test_running_through_one_another_nobody_overlaps(speed):
    c = crowd(*scattered(50, 12, 3), speed=speed)
    rng = np.random.default_rng(4)
    aim = rng.uniform(0, 12, (50, 2))
    for k in range(60):
        if k % 20 == 19:
            aim = rng.uniform(0, 12, (50, 2))
        tick(c, aim - c.xyz[:, :2])
        assert apart(c) > -ROUNDING


def test_long_animals_that_spin_on_the_spot_do_not_sweep_through_one_another():
    c = crowd(*scattered(40, 8, 5, 1.6, 0.15), 1.6, 0.15, speed=0.5, max_turn=200.0)
    for k in range(80):
        angle = 1.3 * k + np.arange(40)
        tick(c, np.column_stack([np.cos(angle), np.sin(angle)]))
        assert apart(c) > -ROUNDING


def test_two_streams_head_on_pass_and_do_not_overlap():
    xy, heading = scattered(60, 10, 6, heading=np.zeros(60))
    west = np.arange(60) < 30
    xy[~west, 0] += 11
    heading[~west] = np.pi
    c = crowd(xy, heading, speed=3.0)
    for _ in range(300):
        tick(c, np.column_stack([np.where(west, 1.0, -1.0), np.zeros(60)]))
        assert apart(c) > -ROUNDING
    assert (c.xyz[west, 0] > 10.5).mean() > 0.9
    assert (c.xyz[~west, 0] < 10.5).mean() > 0.9


def test_discs_standing_shoulder_to_shoulder_are_not_shoved_into_those_beyond():
    # rows of discs nearly touching: each row pushes the next, and all stand still
    for seed in range(6):
        rng = np.random.default_rng(seed)
        xy = np.array([(0.5002 * i + 0.25 * (j % 2), 0.434 * j) for i in range(8) for j in range(8)])
        xy += rng.normal(0, 1e-5, xy.shape)
        c = crowd(xy, rng.uniform(0, 6.28, 64), 0.5, 0.25, speed=0.0)
        for _ in range(10):
            tick(c, c.forward[:, :2])
            assert apart(c) > -ROUNDING


@pytest.mark.parametrize("seed", [24, 28])
def test_slow_long_animals_shove_nobody_into_those_they_had_not_looked_at(seed):
    # scenes in which a shove reached farther than neighbours were looked for
    xy, heading = scattered(60, 7.0, seed, 1.0, 0.1)
    c = crowd(xy, heading, 1.0, 0.1, speed=0.0, max_turn=30.0)
    for k in range(4):
        tick(c, np.column_stack([np.cos(heading + k), np.sin(heading + k)]))
        assert apart(c) > -ROUNDING


PEN = np.array([(0, 0, 10, 0), (10, 0, 10, 10), (10, 10, 0, 10), (0, 10, 0, 0)], float)


@pytest.mark.parametrize("speed", [2.0, 50.0])
def test_pressed_into_a_corner_nobody_leaves_the_pen(speed):
    xy, heading = scattered(50, 8.6, 7)
    c = crowd(xy + 0.7, heading, speed=speed, walls=PEN)
    for k in range(80):
        tick(c, to(c, 10, 10) if k < 50 else to(c, -5, 3))
        assert apart(c) > -ROUNDING
        assert wall_gaps(c.xyz[:, :2], c.forward, c.half, c.radius, PEN).min() > -ROUNDING
        assert ((c.xyz[:, :2] > 0) & (c.xyz[:, :2] < 10)).all()


@pytest.mark.parametrize("speed", [1.0, 12.0, 50.0])
def test_nobody_tunnels_through_a_wall_of_two_centimetres(speed):
    thin = box(5.0, -500, 5.02, 500)
    walls = np.hstack([thin, np.roll(thin, -1, axis=0)])
    xy, heading = scattered(30, 8, 8)
    xy[:, 0] = np.where(xy[:, 0] < 4, xy[:, 0], xy[:, 0] + 2.5)
    west = xy[:, 0] < 5
    c = crowd(xy, heading, speed=speed, walls=walls)
    c.speed[:3] = 0.1  # the slow are shoved by the fast
    for _ in range(60):
        tick(c, np.column_stack([np.where(west, 1.0, -1.0), np.zeros(30)]))
        assert ((c.xyz[:, 0] < 5) == west).all()
        assert wall_gaps(c.xyz[:, :2], c.forward, c.half, c.radius, walls).min() > -ROUNDING
        assert apart(c) > -ROUNDING


@pytest.mark.parametrize("length", [0.2, 1.0])
def test_in_a_level_too_a_thin_fence_holds_at_fifty_metres_a_second(length):
    # a mouse of 20 cm looks 80 cm ahead and goes 1.6 m in a tick
    run = straight(mean=100.0, body={"length": 0.5, "radius": 0.1})
    simulation = meadow(run, obstacles=[obstacle(box(20, 2, 20.02, 38))], boundary="wall")
    xy = [(10 + 0.7 * k, 6 + 0.9 * k) for k in range(12)]
    put(simulation, xy, np.linspace(-0.5, 0.5, 12), speed=50.0, length=length)
    for _ in range(60):
        simulation.tick()
        here = xy_of(simulation)
        fence = (here[:, 1] > 2) & (here[:, 1] < 38)
        assert not (fence & (here[:, 0] > 20) & (here[:, 0] < 20.02)).any()
        assert gaps_of(simulation).min() > -ROUNDING
        assert ((here >= 0) & (here <= 40)).all()


def test_who_runs_at_a_wall_goes_along_it():
    c = crowd(np.array([(5.0, 1.0)]), np.array([-1.2]), walls=PEN)
    for _ in range(64):
        tick(c, np.array([(0.3, -1.0)]))
    assert c.forward[0, 0] == pytest.approx(1.0)
    assert c.xyz[0, 0] > 7.0
    assert 0.2 < c.xyz[0, 1] < 0.4  # about half its width away from the wall


@pytest.mark.parametrize("max_turn", [0.5, 3.0, 40.0])
def test_a_lone_animal_turns_no_faster_than_it_can(max_turn):
    c = crowd(np.zeros((1, 2)), np.zeros(1), max_turn=max_turn)
    for _ in range(40):
        before = c.forward[0].copy()
        tick(c, np.array([(-1.0, -0.2)]))
        assert np.hypot(*c.forward[0, :2]) == pytest.approx(1.0, abs=1e-12)
        turned = np.arccos(min(1.0, before @ c.forward[0]))
        assert turned <= max_turn * DT + 1e-7
    if max_turn * DT * 40 > np.pi:
        assert c.forward[0, :2] == pytest.approx(np.array([-1.0, -0.2]) / np.hypot(1, 0.2))


def test_a_lone_animal_goes_as_far_as_its_speed_says():
    c = crowd(np.zeros((1, 2)), np.zeros(1), speed=3.0)
    tick(c, np.array([(1.0, 0.0)]))
    assert c.xyz[0, :2] == pytest.approx((3.0 * DT, 0.0), abs=1e-12)


def test_who_cannot_step_anywhere_stands_firm():
    # a cell barely wider than its prisoner, and four big neighbours outside who press against the walls
    cell = box(-0.201, -0.201, 0.201, 0.201)
    walls = np.hstack([cell, np.roll(cell, -1, axis=0)])
    xy = np.array([(0, 0), (-1.3, 0), (1.3, 0), (0, -1.3), (0, 1.3)], float)
    c = crowd(xy, np.zeros(5), [0.4, 2.0, 2.0, 1.0, 1.0], [0.2, 0.5, 0.5, 0.4, 0.4], speed=5.0, walls=walls)
    for _ in range(40):
        tick(c, to(c, 0, 0) + (0.01, 0.02))
        assert np.abs(c.xyz[0, :2]).max() < 0.0011
        assert wall_gaps(c.xyz[:, :2], c.forward, c.half, c.radius, walls).min() > -ROUNDING
        assert apart(c) > -ROUNDING


def test_a_standing_animal_is_pushed_aside_and_never_run_over():
    c = crowd(np.array([(0.0, 0.0), (3.0, 0.1)]), np.array([0.0, np.pi / 2]), speed=[2.0, 0.0])
    for _ in range(80):
        tick(c, np.array([(1.0, 0.0), (0.0, 1.0)]))
        assert apart(c) > -ROUNDING
    assert c.xyz[0, 0] > 3.5  # got by
    assert 0.0 < np.hypot(*(c.xyz[1, :2] - (3.0, 0.1))) < 1.5


def test_who_is_far_away_is_not_disturbed():
    c = crowd(np.array([(0.0, 0.0), (6.0, 0.0)]), np.zeros(2), speed=[2.0, 0.0])
    for _ in range(40):
        tick(c, np.array([(1.0, 0.0), (1.0, 0.0)]))
    assert c.xyz[1].tolist() == [6.0, 0.0, 0.0]


def test_two_face_to_face_stop_each_other_by_the_same_way():
    c = crowd(np.array([(-2.0, 0.0), (2.0, 0.0)]), np.array([0.0, np.pi]), speed=1.0)
    for _ in range(100):
        tick(c, np.array([(1.0, 0.0), (-1.0, 0.0)]))
        assert c.xyz[0, :2] == pytest.approx(-c.xyz[1, :2], abs=1e-9)


def test_animals_put_into_one_another_come_apart_and_are_never_deeper_inside():
    walk = straight(mean=0.5)
    simulation = meadow(walk)
    rng = np.random.default_rng(9)
    entities = put(simulation, 15 + np.arange(24)[:, None] * (0.4, 0.0) + (0, 5), rng.uniform(0, 6.28, 24))
    for k, entity in enumerate(entities):  # through the window, as a designer's tool would
        simulation.world.component_for_entity(entity, Position).xyz = (20 + rng.uniform(-1, 1), 20 + 0.1 * k, 0)
    before = gaps_of(simulation)
    assert before.min() < -0.3
    for _ in range(300):
        simulation.tick()
        now = gaps_of(simulation)
        overlapping = before < 0
        assert (now[overlapping] >= before[overlapping] - ROUNDING).all()
        assert (now[~overlapping] > -ROUNDING).all()
        before = now
    assert now.min() > -ROUNDING


def test_two_animals_on_the_very_same_spot_come_apart():
    simulation = meadow(straight(mean=0.0))
    put(simulation, [(20, 20), (20, 20), (20, 20)], [0.3, 0.3, 1.0])
    simulation.run(120)
    assert gaps_of(simulation).min() > -ROUNDING
    assert np.isfinite(xy_of(simulation)).all()


def pairs_that_meet(seed, count=20):
    """Twos that run into each other, far from the other twos."""
    rng = np.random.default_rng(seed)
    middle = np.repeat([(8.0 * (k % 5), 8.0 * (k // 5)) for k in range(count)], 2, axis=0)
    angle = np.repeat(rng.uniform(0, 2 * np.pi, count), 2) + np.tile([0, np.pi], count)
    away = np.column_stack([np.cos(angle), np.sin(angle)])
    heading = angle + np.pi + rng.uniform(-0.4, 0.4, 2 * count)
    return middle + 1.1 * away + rng.uniform(-0.1, 0.1, (2 * count, 2)), heading


MIRROR = np.array([(1.0, 0.0), (0.0, -1.0)])
TURN = np.array([(np.cos(0.7), -np.sin(0.7)), (np.sin(0.7), np.cos(0.7))])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("change", [MIRROR, TURN, MIRROR @ TURN], ids=["mirrored", "turned", "both"])
def test_the_mirrored_or_turned_or_shifted_scene_moves_likewise(change, seed):
    xy, heading = pairs_that_meet(seed)
    wish = np.column_stack([np.cos(heading), np.sin(heading)])
    one, other = crowd(xy, heading, speed=4.0), crowd(xy @ change.T + (70, -30), heading, speed=4.0)
    other.forward[:, :2] = one.forward[:, :2] @ change.T
    closest = np.inf
    for _ in range(16):
        tick(one, wish)
        tick(other, wish @ change.T)
        closest = min(closest, apart(one))
        assert other.xyz[:, :2] == pytest.approx(one.xyz[:, :2] @ change.T + (70, -30), abs=1e-7)
        assert other.forward[:, :2] == pytest.approx(one.forward[:, :2] @ change.T, abs=1e-7)
    assert closest < 0.1 + ROUNDING  # they did meet: a quarter of the radii is kept free


@pytest.mark.parametrize("change", [MIRROR, TURN, -np.eye(2)], ids=["mirrored", "turned", "half turned"])
def test_a_crush_as_a_whole_is_not_pushed_by_the_order_in_which_it_is_looked_at(change):
    xy, heading = scattered(80, 8, 33)
    one, other = crowd(xy, heading, speed=2.0), crowd(xy @ change.T, heading, speed=2.0)
    other.forward[:, :2] = one.forward[:, :2] @ change.T
    for _ in range(10):
        tick(one, to(one, 4, 4))
        tick(other, np.array([4, 4]) @ change.T - other.xyz[:, :2])
    apart_now = other.xyz[:, :2] @ change - one.xyz[:, :2]
    assert np.hypot(*apart_now.T).mean() < 0.05  # m, after 0.6 m of way
    assert np.abs(apart_now.mean(0)).max() < 0.01


size, shape = st.sampled_from([0.3, 1.0, 2.0]), st.sampled_from([0.1, 0.25, 0.5])
place, angle = st.floats(0, 4), st.floats(0, 6.3)
animals = st.lists(st.tuples(place, place, angle, size, shape, st.floats(0, 50), angle), min_size=2, max_size=10)


@given(animals)
def test_whatever_the_scene_the_free_stay_free_and_the_overlapping_get_no_deeper(herd):
    x, y, heading, length, shape, speed, wish = map(np.array, zip(*herd, strict=True))
    c = crowd(np.column_stack([x, y]), heading, length, shape * length, speed, max_turn=30.0, walls=PEN - 3.0)
    for _ in range(3):
        before = gaps(c.xyz[:, :2], c.forward, c.half, c.radius)
        wall_before = wall_gaps(c.xyz[:, :2], c.forward, c.half, c.radius, c.ends)
        tick(c, np.column_stack([np.cos(wish), np.sin(wish)]))
        now = gaps(c.xyz[:, :2], c.forward, c.half, c.radius)
        wall_now = wall_gaps(c.xyz[:, :2], c.forward, c.half, c.radius, c.ends)
        assert np.isfinite(c.xyz).all()
        assert np.isfinite(c.forward).all()
        assert (now > np.minimum(before, 0.0) - ROUNDING).all()
        assert (wall_now > np.minimum(wall_before, 0.0) - ROUNDING).all()


def test_nobody_is_nobody():
    c = crowd(np.zeros((0, 2)), np.zeros(0))
    cells = sort_into_cells(c.xyz, c.forward, c.length, c.radius, 4.0)
    step, heading = move(cells, c.forward, c.forward, c.speed, c.max_turn, no_edges(), DT)
    assert step.shape == heading.shape == (0, 2)


def test_headings_stay_unit_vectors_in_a_long_crush():
    simulation = meadow(straight(mean=3.0), boundary="wall", width=8, height=8)
    xy, heading = scattered(40, 7, 40)
    put(simulation, xy * 0.98 + 0.6, heading)
    simulation.run(150)
    assert np.linalg.norm(simulation.agents[Heading.forward], axis=1) == pytest.approx(1.0, abs=1e-12)
