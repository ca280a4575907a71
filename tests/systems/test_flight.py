"""Geometric flight: frames, limits, banking, weight; and nobody inside anything, whatever he wishes."""

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import Behaviour, Flight, Parameters, Wishes
from flockbrush.components import Airborne, Ground, Heading, Position, Species, Speed, Transit, Velocity
from flockbrush.engine.commands import Commands
from flockbrush.engine.raster import Raster
from flockbrush.engine.solid_queries import surface_
from flockbrush.engine.state import state_hash
from flockbrush.systems.commands import AddObstacle, MoveObstacle, RemoveObstacle
from flockbrush.systems.flight import GRAVITY, rolled, turned_without_roll
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from flockbrush.systems.population import SpeciesList
from scipy.spatial import Delaunay
from small_herd import boids, box, brush, meadow, obstacle, put, put_aloft, room_in_the_air, straight

import flockbrush

ALONE = {f"{urge}_strength": 0.0 for urge in ("separation", "matching", "centring", "migration", "height")}
LENGTH, DT = 0.2, 1 / 32


class NoParams(Parameters):
    pass


def pilot(simulation, wish, **limits):
    """Let a function of the scene and rows fly the birds of a world within these limits."""
    palette = simulation.world.resource(Palette)

    def steer(scene, rows, p):
        return wish(scene, rows)

    model = Behaviour("pilot", steer, NoParams, "", flight=lambda p: Flight(**limits))
    palette.models[0] = model
    palette.flight = np.array([model.flight(None)], float)
    palette.grounded[:] = limits.get("grounded", False)


def thrust(*acceleration):
    """Everybody wishes this acceleration, m/s^2."""

    def wish(scene, rows):
        k = len(rows)
        return Wishes(scene.forward[rows].copy(), np.ones(k), np.tile(np.asarray(acceleration, float), (k, 1)))

    return wish


def circling(acceleration):
    """Everybody pulls to the left, level."""

    def wish(scene, rows):
        left = np.column_stack([-scene.forward[rows, 1], scene.forward[rows, 0], np.zeros(len(rows))])
        return Wishes(scene.forward[rows].copy(), np.ones(len(rows)), acceleration * left)

    return wish


def one_bird(wish=None, mean=45.0, at=(20, 20, 50), forward=(1, 0, 0), level=None, **limits):
    simulation = meadow(boids(mean=mean, **ALONE), **(level or {}))
    put_aloft(simulation, at, forward)
    if wish is not None:
        pilot(simulation, wish, **limits)
    return simulation


def vectors(simulation):
    agents = simulation.agents
    return (
        agents[Position.xyz][0].copy(), agents[Velocity.xyz][0].copy(), agents[Heading.forward][0].copy(),
        agents[Airborne.up][0].copy(),
    )  # fmt: skip


# the frame ------------------------------------------------------------------------


def test_the_frame_stays_orthonormal_through_a_thousand_wild_ticks():
    rng = np.random.default_rng(1)
    simulation = meadow(boids(**ALONE))
    put_aloft(simulation, rng.uniform(0, 40, (20, 3)) + (0, 0, 500), rng.normal(size=(20, 3)))
    pilot(simulation, lambda scene, rows: thrust(*rng.normal(0, 60, 3))(scene, rows), max_speed=80.0, banking=1.0)
    for _ in range(1000):
        simulation.tick()
    forward, up = simulation.agents[Heading.forward], simulation.agents[Airborne.up]
    assert np.abs(np.linalg.norm(forward, axis=1) - 1).max() < 1e-14
    assert np.abs(np.linalg.norm(up, axis=1) - 1).max() < 1e-14
    assert np.abs((forward * up).sum(1)).max() < 1e-14


def test_pitch_and_yaw_bring_no_roll():
    """Turned the short way from one heading to another, what stands at right angles to both stays."""
    rng = np.random.default_rng(2)
    for _ in range(200):
        f, g = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
        axis = np.cross(f, g) / np.linalg.norm(np.cross(f, g))
        assert turned_without_roll(*axis, *f, *g) == pytest.approx(axis, abs=1e-9)
        assert turned_without_roll(*np.cross(f, axis), *f, *g) == pytest.approx(np.cross(g, axis), abs=1e-9)


def test_turned_right_about_the_frame_is_still_a_frame():
    u = np.array(turned_without_roll(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0))
    assert np.linalg.norm(u) == pytest.approx(1.0)
    assert u[0] == pytest.approx(0.0)


def test_a_roll_goes_by_a_share_of_the_angle_to_where_it_should():
    u = rolled(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.5)
    assert u == pytest.approx((0, np.sin(np.pi / 4), np.cos(np.pi / 4)))


# speed and acceleration -----------------------------------------------------------------


def test_left_alone_a_bird_goes_straight_on():
    simulation = one_bird()
    simulation.run(32)
    xyz, velocity, forward, up = vectors(simulation)
    assert xyz == pytest.approx((20 + 45 * LENGTH, 20, 50))
    assert velocity == pytest.approx((45 * LENGTH, 0, 0))
    assert (*forward, *up) == pytest.approx((1, 0, 0, 0, 0, 1))


def test_speed_stays_between_its_limits():
    fast = one_bird(thrust(500, 0, 0), max_speed=60.0)
    slow = one_bird(thrust(-20, 0, 0), min_speed=10.0)
    for _ in range(60):
        fast.tick()
        slow.tick()
        assert np.linalg.norm(vectors(fast)[1]) <= 60 * LENGTH + 1e-12
        assert np.linalg.norm(vectors(slow)[1]) >= 10 * LENGTH - 1e-12
    assert np.linalg.norm(vectors(fast)[1]) == pytest.approx(60 * LENGTH)
    assert np.linalg.norm(vectors(slow)[1]) == pytest.approx(10 * LENGTH)


def test_no_wish_accelerates_by_more_than_a_bird_can():
    simulation = one_bird(thrust(0, 900, 0), max_acceleration=50.0)
    before = vectors(simulation)[1]
    simulation.tick()
    assert np.linalg.norm(vectors(simulation)[1] - before) == pytest.approx(50 * LENGTH * DT)


def test_damping_brings_the_speed_back_to_the_birds_own():
    simulation = one_bird(thrust(0, 0, 0), damping=2.0)
    simulation.agents[Velocity.xyz][0] = (3.0, 0, 0)
    simulation.run(16)
    assert np.linalg.norm(vectors(simulation)[1]) == pytest.approx(9 - 6 * (1 - 2 * DT) ** 16, rel=1e-9)


def test_a_painted_cap_holds_in_the_air_and_mud_does_not():
    simulation = one_bird()
    simulation.world.resource(Landscape).surface[..., 0] = 0.1
    simulation.run(40)
    assert np.linalg.norm(vectors(simulation)[1]) == pytest.approx(9.0)
    simulation.world.resource(Landscape).surface[..., 1] = 4.0
    simulation.run(40)
    assert simulation.agents[Ground.cap][0] == 4.0
    assert np.linalg.norm(vectors(simulation)[1]) == pytest.approx(4.0)


def test_a_cap_below_the_slowest_flight_of_a_species_is_no_lower():
    lake = flockbrush.start("lake")
    lake.run(400)
    lake.world.resource(Landscape).surface[..., 1] = 1.0
    lake.run(100)
    fauna, agents = lake.world.resource(SpeciesList), lake.agents
    goose = fauna.names.index("goose")
    flies = (agents[Species.index] == goose) & (agents[Position.xyz][:, 2] > 3.0) & (agents[Transit.kind] == 0)
    speed = np.linalg.norm(agents[Velocity.xyz], axis=1)[flies]
    assert len(speed) and speed == pytest.approx(fauna.table.slowest[goose], rel=0.01)


def test_a_model_that_says_only_a_direction_is_turned_to_it_at_its_own_speed():
    def wish(scene, rows):
        return Wishes(np.tile([0.0, 0.6, 0.8], (len(rows), 1)), np.ones(len(rows)))

    simulation = one_bird(wish)
    simulation.world.resource(Palette).max_turn[:] = 1.0
    simulation.tick()
    assert vectors(simulation)[2][0] == pytest.approx(np.cos(DT))
    simulation.run(80)
    assert vectors(simulation)[1] == pytest.approx((0, 5.4, 7.2))


def test_a_model_may_say_the_velocity_itself():
    def wish(scene, rows):
        k = len(rows)
        return Wishes(np.tile([0.0, 1.0, 0.0], (k, 1)), np.ones(k), velocity=np.tile([0.1, -2.0, 0.3], (k, 1)))

    simulation = one_bird(wish, exact=True)
    before = vectors(simulation)[0]
    simulation.tick()
    xyz, velocity, forward, _ = vectors(simulation)
    assert velocity.tolist() == [0.1, -2.0, 0.3]
    assert forward.tolist() == [0.0, 1.0, 0.0]
    assert xyz == pytest.approx(before + DT * velocity)


# banking ------------------------------------------------------------------------------------


def bank(simulation):
    """Degrees by which the bird leans to its left."""
    _, _, forward, up = vectors(simulation)
    left = np.array([-forward[1], forward[0], 0.0])
    return np.degrees(np.arctan2(up @ left, up[2]))


@pytest.mark.parametrize("acceleration", [2.0, 9.81, 30.0])
def test_in_a_steady_turn_a_bird_banks_as_a_coordinated_turn_asks(acceleration):
    """tan(bank) = v^2 / (r g): the pendulum of the paper."""
    simulation = one_bird(circling(acceleration), max_speed=45.0, min_speed=45.0, banking=1.0, roll_time=0.1)
    simulation.run(64)
    assert bank(simulation) == pytest.approx(np.degrees(np.arctan(acceleration / GRAVITY)), abs=2.0)


def test_banking_may_be_reversed_or_off():
    for banking, expected in ((-1.0, -np.degrees(np.arctan(9.81 / GRAVITY))), (0.0, 0.0)):
        simulation = one_bird(circling(9.81), max_speed=45.0, min_speed=45.0, banking=banking)
        simulation.run(64)
        assert bank(simulation) == pytest.approx(expected, abs=2.0)


def test_after_a_turn_the_bird_levels_out():
    simulation = one_bird(circling(20.0), max_speed=45.0, min_speed=45.0, banking=1.0)
    simulation.run(64)
    pilot(simulation, thrust(0, 0, 0), banking=1.0)
    simulation.run(96)
    assert abs(bank(simulation)) < 0.01


# weight ---------------------------------------------------------------------------------------


def test_by_weight_alone_a_bird_falls():
    simulation = one_bird(thrust(0, 0, 0), at=(20, 20, 500), weight=1.0)
    simulation.run(32)
    assert vectors(simulation)[1][2] == pytest.approx(-GRAVITY)


def test_lift_bears_the_weight_in_level_flight_at_its_own_speed():
    simulation = one_bird(thrust(0, 0, 0), weight=1.0, lift=1.0, banking=1.0)
    simulation.run(64)
    assert vectors(simulation)[1][2] == pytest.approx(0.0, abs=1e-9)


def test_too_slow_it_stalls_and_diving_it_gains_speed():
    stalled = one_bird(thrust(0, 0, 0), weight=1.0, lift=1.0, banking=1.0)
    stalled.agents[Velocity.xyz][0] = (3.0, 0, 0)
    stalled.run(16)
    assert vectors(stalled)[1][2] < -0.5
    diving = one_bird(thrust(0, 0, 0), forward=(1, 0, -1), at=(20, 20, 500), weight=1.0, lift=1.0, banking=1.0)
    diving.run(16)
    assert np.linalg.norm(vectors(diving)[1]) > 9.5


def test_what_floats_needs_no_wings():
    simulation = one_bird(thrust(0, 0, 0), weight=1.0, buoyancy=1.0)
    simulation.run(32)
    assert vectors(simulation)[1][2] == 0.0


# never inside anything --------------------------------------------------------------------------

PILLARS = [obstacle(box(x, y, x + 1, y + 1), f"{x} {y}") for x in range(6, 36, 5) for y in range(6, 36, 5)]


def with_shape(o, shape, z_min=0.0, z_max=1000.0):
    o.shape, o.z_min, o.z_max = shape, z_min, z_max
    return o


def mad_birds(simulation, n=60, seed=4, speed=20.0):
    """Birds who wish anything, and a tick for which they are checked."""
    rng = np.random.default_rng(seed)
    xyz = np.column_stack([rng.uniform(1, 5, n), rng.uniform(1, 39, n), rng.uniform(1, 12, n)])
    put_aloft(simulation, xyz, rng.normal(size=(n, 3)), speed=speed)

    def wish(scene, rows):
        return Wishes(scene.forward[rows].copy(), np.ones(len(rows)), rng.normal(0, 200, scene.xyz.shape)[rows])

    pilot(simulation, wish, max_speed=speed / LENGTH, min_speed=speed / LENGTH)


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere"])
@pytest.mark.parametrize("speed", [10.0, 80.0])
def test_nobody_is_ever_inside_an_obstacle_or_under_the_ground(shape, speed):
    high = 3.0 if shape == "sphere" else 8.0
    things = [with_shape(obstacle(o.polygon, o.name), shape, 0.0, high) for o in PILLARS]
    things.append(with_shape(obstacle(box(0, 0, 40, 40), "roof"), "box", 9.0, 10.0))
    simulation = meadow(boids(), boundary="wall", obstacles=things)
    mad_birds(simulation, speed=speed)
    simulation.tick()
    for _ in range(150):
        simulation.tick()
        assert room_in_the_air(simulation).min() >= 0
    assert np.ptp(simulation.agents[Position.xyz][:, 0]) > 20  # they really got among the pillars


ROCK = [[-3.0, -2.0, 0.0], [3.0, -2.0, 0.0], [2.0, 3.0, 0.0], [-2.0, 2.0, 1.0], [1.0, 0.0, 7.0], [-2.0, 0.0, 5.0]]


def rock(x=20.0, y=20.0, low=0.0):
    """A boulder with six corners, no two faces alike."""
    foot = obstacle(box(x - 3, y - 3, x + 3, y + 3), "boulder")
    foot.shape, foot.corners, foot.z_min, foot.z_max = "hull", np.array(ROCK), low, low + 7.0
    return foot


def test_nobody_is_ever_inside_a_boulder():
    simulation = meadow(boids(), boundary="wall", obstacles=[rock(), rock(10, 30), rock(30, 12, low=4.0)])
    mad_birds(simulation, speed=30.0)
    simulation.tick()
    hulls = [Delaunay(np.array(ROCK) + at) for at in ((20, 20, 0), (10, 30, 0), (30, 12, 4))]
    near = 0
    for _ in range(150):
        simulation.tick()
        xyz = simulation.agents[Position.xyz]
        assert room_in_the_air(simulation).min() >= 0
        assert all((hull.find_simplex(xyz) < 0).all() for hull in hulls)
        near += int((np.linalg.norm(xyz - (20, 20, 3), axis=1) < 4).sum())
    assert near > 20  # they were where its box is, beside its slopes


def test_a_boulder_that_is_moved_goes_as_it_is_and_comes_back():
    simulation = meadow(boids(), boundary="wall")
    land = simulation.world.resource(Landscape)
    foot = [[18, 18], [22, 18], [22, 22], [18, 22]]
    AddObstacle("boulder", foot, z_max=7.0, shape="hull", corners=ROCK).apply(simulation.world)
    peak = np.array([21.0, 20.0, 7.0])
    simulation.submit(MoveObstacle("boulder", 10.0, 12.0, 2.0))
    simulation.tick()
    inside = surface_(land.sky, 0, *(peak - (10.0, 8.0, -1.9)))[0]
    assert inside < 0 < surface_(land.sky, 0, *(peak - (0.0, 0.0, 1.0)))[0]
    back = simulation.world.resource(Commands).perform(simulation.world, [RemoveObstacle("boulder")])
    assert len(land.sky.kind) == 4  # the walls of the map
    for command in back:
        command.apply(simulation.world)
    assert land.find("boulder")[0].corners.tolist() == ROCK
    assert surface_(land.sky, 0, *(peak - (10.0, 8.0, -1.9)))[0] == inside


@pytest.mark.parametrize(
    ("corners", "told"),
    [
        (None, "a hull needs corners"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "must not lie in one plane"),
        ([[0, 0], [1, 0], [0, 1], [1, 1]], "east, north, up"),
        ([[0, 0, "high"]] * 4, "east, north, up"),
        ([[k, k * k, k**3] for k in range(40)], "at most 32 corners"),
    ],
)
def test_what_is_no_hull_is_told(corners, told):
    simulation = meadow(boids())
    with pytest.raises(ValueError, match=told):
        AddObstacle("boulder", box(18, 18, 22, 22).tolist(), shape="hull", corners=corners).check(simulation.world)


def test_on_hills_nobody_is_under_the_ground():
    y, x = np.mgrid[0.5:40, 0.5:40]
    simulation = meadow(boids(), boundary="wall", height_map=Raster(1.0, 4 * np.sin(x / 3) * np.cos(y / 4) + 4))
    mad_birds(simulation)
    simulation.tick()
    for _ in range(150):
        simulation.tick()
        assert room_in_the_air(simulation).min() > -1e-9


@pytest.mark.parametrize("at, forward", [((20, 0.6, 20), (0, -1, 0)), ((5, 5, 20), (-0.5, -0.5, 0.6))])
def test_a_bird_at_a_wall_turns_away_and_does_not_climb_along_it(at, forward):
    simulation = one_bird(mean=10.0, at=at, forward=forward, level={"boundary": "wall"})
    simulation.run(3 * 32)
    at_wall = vectors(simulation)[0]
    simulation.run(5 * 32)
    place, velocity = vectors(simulation)[:2]
    assert np.hypot(*velocity[:2]) > 1.0 and np.hypot(*(place - at_wall)[:2]) > 5.0
    assert abs(place[2] - at_wall[2]) < 0.5


def test_under_a_ceiling_and_over_a_lake():
    lake, ceiling = obstacle(box(1, 1, 2, 2), "lake"), obstacle(box(1, 1, 2, 2), "ceiling")
    things = [with_shape(lake, "plane", -1.0, 2.0), with_shape(ceiling, "plane", 6.0, 7.0)]
    simulation = meadow(boids(), boundary="wall", obstacles=things)
    mad_birds(simulation)
    simulation.run(3)
    for _ in range(60):
        simulation.tick()
        z = simulation.agents[Position.xyz][:, 2]
        assert ((z > 2.0) & (z < 6.0)).all()


def test_what_hangs_over_the_ground_stops_birds_and_not_walkers():
    beam = with_shape(obstacle(box(20, 0, 22, 40), "beam"), "box", 3.0, 6.0)
    simulation = meadow(straight(mean=4.0), boids(obstacle_strength=0.0, **ALONE), obstacles=[beam])
    put(simulation, [(15, 20)], 0.0, brush="straight")
    put_aloft(simulation, [(15, 20, 4.5), (15, 25, 2.0)], brush="boids")
    simulation.run(96)
    walker, stopped, below = simulation.agents[Position.xyz]
    assert walker[0] > 25
    assert stopped[0] < 20
    assert below[0] > 25


def test_an_obstacle_that_moves_pushes_birds_and_goes_where_it_is_sent():
    simulation = meadow(boids(mean=0.0, min_speed=0.0, **ALONE), obstacles=[obstacle(box(5, 15, 9, 25), "door")])
    put_aloft(simulation, [(12, 20, 3), (12, 30, 3)], speed=0.0)
    simulation.submit(MoveObstacle("door", 17.0, 20.0, 1.0, seconds=2.0))
    for _ in range(64):
        simulation.tick()
        assert room_in_the_air(simulation).min() >= 0
    pushed, other = simulation.agents[Position.xyz]
    assert pushed[0] > 18
    assert other == pytest.approx((12, 30, 3))
    door = simulation.world.resource(Landscape).obstacles[0]
    assert door.polygon.mean(0) == pytest.approx((17, 20))
    assert (door.z_min, door.z_max) == (1.0, 1001.0)
    assert simulation.world.resource(Landscape).glides == []


def test_obstacles_put_down_and_taken_away_are_there_for_birds_too():
    simulation = meadow(boids(obstacle_strength=0.0, **ALONE))
    put_aloft(simulation, (10, 20, 5))
    simulation.submit(AddObstacle("wall", [[14, 10], [15, 10], [15, 30], [14, 30]]))
    simulation.run(40)
    assert simulation.agents[Position.xyz][0, 0] < 14
    simulation.submit(RemoveObstacle("wall"))
    simulation.run(40)
    assert simulation.agents[Position.xyz][0, 0] > 15


def test_a_snapshot_keeps_what_glides_and_what_hangs():
    from flockbrush.engine.state import restore, snapshot

    def world():
        beam = with_shape(obstacle(box(20, 0, 22, 40), "beam"), "cylinder", 3.0, 6.0)
        simulation = meadow(boids(), obstacles=[beam, obstacle(box(5, 5, 6, 6), "post")])
        put_aloft(simulation, [(15, 20, 4.5), (15, 22, 4)])
        return simulation

    one, other = world(), world()
    one.submit(MoveObstacle("beam", 24.0, 20.0, 2.0, seconds=1.0))
    one.submit(MoveObstacle("post", 8.0, 5.0, seconds=1.0))
    one.run(16)
    restore(other.world, snapshot(one.world))
    one.run(30)
    other.run(30)
    assert state_hash(one.world) == state_hash(other.world)


# beside others -------------------------------------------------------------------------------


def test_walkers_keep_every_bit_when_birds_fly_over_them():
    def flock(birds):
        herd = brush("walk", mean=2.0, speed={"deviation": 0.4})
        simulation = meadow(herd, boids(), boundary="wall")
        put(simulation, np.random.default_rng(3).uniform(5, 35, (40, 2)), np.arange(40.0), brush="walk")
        if birds:
            put_aloft(simulation, np.random.default_rng(4).uniform(5, 35, (30, 3)) + (0, 0, 20), brush="boids")
        simulation.run(90)
        return simulation.agents

    alone, below = flock(False), flock(True)
    for column in (Position.xyz, Velocity.xyz, Heading.forward, Speed.target):
        assert alone[column].tobytes() == below[column][:40].tobytes()


def test_on_a_wrapped_map_a_flock_crosses_the_seam_as_in_the_middle():
    wide, high = 32.0, 24.0

    def flock(shift):
        simulation = meadow(boids(separation=6.0), width=wide, height=high, boundary="wrap", cell=2.0)
        xyz = np.random.default_rng(5).uniform(0, 4, (20, 3)) + (14, 10, 20)
        xyz[:, :2] = np.mod(xyz[:, :2] + shift, (wide, high))
        put_aloft(simulation, xyz, (1.0, 0.4, 0.0))
        return simulation

    middle, seam = flock((0, 0)), flock((16.0, 12.0))
    for _ in range(60):
        middle.tick()
        seam.tick()
        apart = seam.agents[Position.xyz] - middle.agents[Position.xyz] - (16.0, 12.0, 0)
        apart[:, :2] -= np.array([wide, high]) * np.round(apart[:, :2] / (wide, high))
        assert np.abs(apart).max() < 1e-6


def test_a_sky_without_birds_is_fine():
    simulation = one_bird()
    simulation.world.delete_entity(1)
    simulation.run(3)
    assert len(simulation.agents) == 0
