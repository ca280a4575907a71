"""How boids steer past obstacles, on the ground and in the air."""

from dataclasses import replace

import numpy as np
import pytest
from flockbrush.components import Position, Velocity
from flockbrush.levels.terrain_kinds import Terrain
from flockbrush.systems.commands import Migrate, MoveObstacle
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.sky_solids import _rectangles
from hypothesis import given
from hypothesis import strategies as st
from small_flock import only, wishes_of
from small_herd import boids, box, brush, gaps_to_solid, meadow, obstacle, put, put_aloft, room_in_the_air, spawn

LENGTH = 0.2


CRYSTAL = [(-2, 0, 8), (0, -3, 7), (3, 1, 9), (0, 2.5, 6), (0, 0, 0), (0.5, -0.5, 16)]  # m; no two faces alike


def head_on(avoid, shape, y=20.0, **more):
    """(least room, sideways way, least speed) of a bird that flies at an obstacle, m and m/s."""
    thing = obstacle(box(38, 17, 42, 23) if shape == "box" else box(37.9, 17.9, 42.1, 22.1), "thing")
    thing.shape, thing.z_max = shape, 100.0
    if shape == "hull":
        thing.corners, thing.z_min = np.array(CRYSTAL), 42.0
    simulation = meadow(boids(**only("obstacle", avoid=avoid, **more)), width=80, obstacles=[thing])
    put_aloft(simulation, (22, y, 50), (1, 0, 0))
    room, slowest = np.inf, np.inf
    for _ in range(110):
        simulation.tick()
        room = min(room, room_in_the_air(simulation)[0])
        slowest = min(slowest, np.linalg.norm(simulation.agents[Velocity.xyz][0]))
    return room, np.abs(simulation.agents[Position.xyz][0] - (22, y, 50))[1:].max(), slowest


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere", "hull"])
def test_a_bird_that_flies_straight_at_an_obstacle_steers_past_it_by_half_a_length_or_more(shape):
    room, aside, slowest = head_on("steer", shape)
    assert room > 0.5 * LENGTH
    assert aside > 1.0
    assert slowest > 5.0


def test_a_force_field_met_head_on_does_not_turn_a_bird():
    """The paper's first complaint about force fields: it slows, and turns no way."""
    room, aside, slowest = head_on("field", "box", field_range=40.0)
    assert aside < 1e-6
    assert slowest < 5.0


def test_a_force_field_bends_the_way_of_one_who_comes_from_the_side():
    _, aside, _ = head_on("field", "sphere", y=21.5, field_range=30.0)
    assert aside > 0.5


@pytest.mark.parametrize("rise", [-1.0, 1.0])
def test_a_bird_that_dives_at_a_lake_or_climbs_to_a_ceiling_turns_along_it(rise):
    floor, roof = obstacle(box(1, 1, 2, 2), "lake"), obstacle(box(1, 1, 2, 2), "ceiling")
    floor.shape, floor.z_min, floor.z_max = "plane", -1.0, 30.0
    roof.shape, roof.z_min, roof.z_max = "plane", 50.0, 51.0
    simulation = meadow(boids(**only("obstacle")), width=200, obstacles=[floor, roof])
    put_aloft(simulation, (5, 20, 40), (1, 0, rise))
    room = []
    for _ in range(150):
        simulation.tick()
        room.append(room_in_the_air(simulation)[0])
    assert min(room) > 0.5 * LENGTH
    assert simulation.agents[Velocity.xyz][0, 0] > 5


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere", "hull", "plane"])
def test_a_force_field_pushes_straight_off_the_surface_by_the_square_of_the_share_of_its_range(shape):
    thing = obstacle(box(28, 28, 32, 32), "thing")
    thing.shape, thing.z_min, thing.z_max = shape, 0.0 if shape == "plane" else 20.0, 36.0
    thing.corners = np.array(CRYSTAL) if shape == "hull" else None
    simulation = meadow(boids(**only()), width=60, height=60, obstacles=[thing])
    xyz = np.random.default_rng(5).uniform(-4.5, 4.5, (60, 3)) + (30, 30, 28)
    xyz = xyz[_gaps(simulation, xyz) > 0.1] if shape != "plane" else xyz + (0, 0, 13)
    put_aloft(simulation, xyz, (0, 1, 0))
    simulation.tick()
    here = simulation.agents[Position.xyz] - simulation.agents[Velocity.xyz] / 32  # where the tick began
    asked = wishes_of(simulation, tick=False, **only("obstacle", avoid="field", field_range=20.0))
    step = 1e-6 * np.eye(3)
    gap = _gaps(simulation, here)
    slope = np.stack([(_gaps(simulation, here + e) - _gaps(simulation, here - e)) / 2e-6 for e in step], axis=1)
    push = np.maximum(1 - gap / LENGTH / 20.0, 0.0)[:, None] ** 2 * slope
    near = (np.linalg.norm(slope, axis=1) > 0.99) & (gap > 0.3)  # not on a ridge between two faces, and flown straight
    assert near.sum() > 20
    assert asked[near] == pytest.approx(push[near], abs=1e-5)


def _gaps(simulation, xyz):
    """(n,) m to the nearest face of any solid, in plain numpy."""
    sky = simulation.world.resource(Landscape).sky
    return np.min([gaps_to_solid(sky, k, xyz) for k in range(len(sky.kind))], axis=0)


def test_a_flock_that_parts_about_a_pillar_does_not_brush_along_it():
    """The wishes of the others do not press those who pass an edge onto what lies behind it."""
    pillar = obstacle(box(57, 97, 63, 103), "pillar")
    pillar.shape = "cylinder"
    simulation = meadow(boids(separation=5.0), width=200, height=200, cell=2.0, obstacles=[pillar])
    put_aloft(simulation, np.random.default_rng(4).uniform(-4, 4, (60, 3)) + (40, 100, 40))
    simulation.submit(Migrate(150.0, 100.0, 40.0))
    room = np.full(60, np.inf)
    for _ in range(200):
        simulation.tick()
        room = np.minimum(room, room_in_the_air(simulation))
    assert (simulation.agents[Position.xyz][:, 0] > 65).all()
    assert (room < 2.0).sum() > 20  # they did pass close by
    assert (room < 1e-3).mean() < 0.05


def test_a_bird_steers_past_a_pillar_that_the_script_moves_into_its_way():
    pillar = obstacle(box(38, 8, 40, 10), "pillar")
    pillar.shape = "cylinder"
    simulation = meadow(boids(**only("obstacle")), width=80, obstacles=[pillar])
    put_aloft(simulation, (12, 20, 50))
    simulation.submit(MoveObstacle("pillar", 39.0, 20.0, 2.0))  # it is there, 11 m further on, when the bird is at 30 m
    room = np.inf
    for _ in range(150):
        simulation.tick()
        room = min(room, room_in_the_air(simulation)[0])
    assert room > 0.5 * LENGTH
    assert simulation.agents[Position.xyz][0, 0] > 45


def test_beside_a_wall_steering_does_nothing_and_a_field_pushes():
    """The paper's second complaint: peripheral vision."""
    wall = obstacle(box(0, 0, 200, 1), "wall")
    for avoid, moved in (("steer", False), ("field", True)):
        simulation = meadow(boids(**only("obstacle", avoid=avoid)), width=200, obstacles=[wall])
        put_aloft(simulation, (20, 1.8, 50))
        simulation.run(48)
        assert bool(abs(simulation.agents[Position.xyz][0, 1] - 1.8) > 0.05) is moved


def test_the_animals_on_the_ground_are_obstacles():
    elephant = brush("elephant", mean=0.0, body={"length": 6.0, "radius": 1.5}, leader_neighbours=-1)
    simulation = meadow(elephant, boids(**only("obstacle")), width=80)
    put(simulation, [(30, 20)], np.pi / 2, brush="elephant")
    put_aloft(simulation, (14, 20, 1.5), brush="boids")
    for _ in range(100):
        simulation.tick()
        x, y, z = simulation.agents[Position.xyz][1] - simulation.agents[Position.xyz][0]
        assert np.hypot(x, y) > 3.0 or z > 3.0
    assert x > 5  # past it


def test_near_the_ground_it_climbs():
    simulation = meadow(boids(**only("obstacle")))
    put_aloft(simulation, (10, 20, 3), (1, 0, -1))
    simulation.run(120)
    assert simulation.agents[Position.xyz][0, 2] > 5 * LENGTH - 0.05


def test_stopped_in_a_nook_a_bird_gets_out_again():
    """Between a box and a cylinder that overlap, both ways past lead into the other."""
    one, other = obstacle(box(28, 12, 32, 20), "one"), obstacle(box(28, 18, 34, 24), "other")
    other.shape = "cylinder"
    simulation = meadow(boids(**only("obstacle", "migration", migration_strength=0.4)), obstacles=[one, other])
    put_aloft(simulation, (20, 19.4, 50), (1, 0.05, 0))
    simulation.submit(Migrate(1.0, 0.0, 0.0, kind="direction"))
    simulation.run(300)
    assert simulation.agents[Position.xyz][0, 0] > 36


def test_nobody_is_born_inside_what_hangs_over_the_ground():
    balloon = obstacle(box(10, 10, 30, 30), "balloon")
    balloon.shape, balloon.z_min, balloon.z_max = "sphere", 5.0, 25.0
    level = {"spawns": [spawn(box(5, 5, 35, 35), "boids", 200, altitude=8.0, depth=8.0)], "obstacles": [balloon]}
    assert room_in_the_air(meadow(boids(), **level)).min() > 0


# held to the ground -------------------------------------------------------------------------


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
