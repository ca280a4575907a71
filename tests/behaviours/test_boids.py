"""Boids: the urges' formulas, who gets the acceleration, and what flocks then do (Reynolds 1987)."""

import numpy as np
import pytest
from flockbrush.behaviours.models.boids import URGES, Given, Params, WishColumns, add_request, rule_of
from flockbrush.components import Body, Heading, Position, Velocity
from flockbrush.engine.raster import Raster
from flockbrush.systems.commands import Migrate
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.measures import compute_polarization
from flockbrush.systems.steer import scene_of
from hypothesis import given
from hypothesis import strategies as st
from numba import njit
from small_flock import BOIDS, only, wishes_of
from small_herd import boids, box, brush, meadow, obstacle, put, put_aloft, room_in_the_air, spawn


def flock(n=150, side=8.0, seed=1, heading=None, things=None, **parameters):
    """A flock at random in a cube, headings at random unless told."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(0, side, (n, 3)) + (96, 96, 40)
    angle = rng.uniform(0, 2 * np.pi, n) if heading is None else np.full(n, heading)
    simulation = meadow(boids(**parameters), width=200, height=200, cell=2.0, **(things or {}))
    put_aloft(simulation, xyz, np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]))
    return simulation


def polarization(simulation):
    return compute_polarization(simulation.agents[Heading.forward])


# the urges, one pair after the other -------------------------------------------------------


def transcription(scene, p, i):
    """Separation, matching and centring of one bird in plain numpy; shares of the most, uncut."""
    air, own = scene.air, scene.length[i]
    f, v = scene.forward[i], scene.velocity[i] / own
    lean = p.forward_weight * min(np.linalg.norm(v) / p.max_speed, 1.0)
    most = p.max_acceleration * p.max_speed
    apart, offsets, velocities, weights = np.zeros(3), [], [], []
    for k in range(air.first[i], air.first[i + 1]):
        o, j = air.offset[k] / own, air.near[k]
        d = np.linalg.norm(o)
        if d > p.neighbour_range:
            continue
        if d < p.separation:
            apart -= o / d * (p.separation**2 / max(d, 0.3) ** 2 - 1)
        if scene.species[j] != scene.species[i]:
            continue
        offsets.append(o)
        velocities.append(scene.velocity[j] / own)
        weights.append(max(d, 0.3) ** -p.exponent * (1 + lean * 0.5 * (1 + f @ o / d)))
    if not weights:
        return apart, np.zeros(3), np.zeros(3)
    matching = (np.average(velocities, 0, weights) - v) / (p.matching_time * most)
    return apart, matching, np.average(offsets, 0, weights) / p.neighbour_range


def cut(v):
    return v / max(np.linalg.norm(v), 1.0)


@given(st.integers(0, 10_000), st.sampled_from([0.0, 1.0, 2.0, 3.0]), st.floats(0, 2), st.floats(1, 8))
def test_the_three_urges_are_the_formulas_of_the_page(seed, exponent, forward_weight, separation):
    simulation = flock(12, 3.0, seed)
    simulation.tick()
    shape = {"exponent": exponent, "forward_weight": forward_weight, "separation": separation}
    scene = scene_of(simulation.world)
    for number, urge in enumerate(("separation", "matching", "centring")):
        p = only(urge, **shape, **{f"{urge}_strength": 0.7})
        found = wishes_of(simulation, tick=False, **p)
        for i in range(12):
            assert found[i] == pytest.approx(0.7 * cut(transcription(scene, Params(**p), i)[number]), abs=1e-9)


@pytest.mark.parametrize("sight", ["exact", "topological"])
@pytest.mark.parametrize("exponent", [0.0, 1.5, 2.0])
def test_a_crowd_of_two_kinds_on_a_wrapped_map_is_added_up_by_slot_and_by_row(sight, exponent):
    """Dozens of others in view: by formula, and the same bits without lists by row."""
    n, p = 120, {"exponent": exponent, "separation": 6.0}
    eyes = {"range": 30.0, "field_of_view": 300.0, "occlusion": False, "sight": sight, "neighbours": 25}
    simulation = meadow(
        brush("boids", "boids", 45.0, {"length": 0.2, "radius": 0.04}, eyes, **p),
        width=16.0, height=16.0, boundary="wrap",
    )  # fmt: skip
    rng = np.random.default_rng(7)
    xyz, forward = rng.uniform(0, 16, (n, 3)) * (1, 1, 0.5) + (0, 0, 30), rng.normal(size=(n, 3))
    put_aloft(simulation, xyz[: n // 2], forward[: n // 2], species="one")
    put_aloft(simulation, xyz[n // 2 :], forward[n // 2 :], species="other")
    simulation.tick()
    whole, lean = scene_of(simulation.world), scene_of(simulation.world, lists=False)
    rows = np.arange(n, dtype=np.int32)
    seen = np.diff(whole.air.first)
    assert lean.air.near is None and seen.max() > (25 if sight == "topological" else 40)
    for number, urge in enumerate(("separation", "matching", "centring")):
        params = Params(**only(urge, **p), matching_time=10.0)
        found = BOIDS.steer(lean, rows, params).acceleration
        by_row = BOIDS.steer(whole._replace(air=whole.air._replace(by_slot=None)), rows, params).acceleration
        assert found.tobytes() == by_row.tobytes()
        found /= simulation.agents[Body.length][:, None] * params.max_acceleration * params.max_speed
        strength = getattr(params, f"{urge}_strength")
        wanted = [strength * cut(transcription(whole, params, i)[number]) for i in range(n)]
        assert found == pytest.approx(np.array(wanted), abs=1e-9)


def test_a_bird_behind_is_not_seen_and_one_at_the_side_is():
    simulation = meadow(boids())
    put_aloft(simulation, [(20, 20, 50), (18, 20, 50), (20, 22, 50)])
    simulation.tick()
    air = scene_of(simulation.world).air
    assert air.near[air.first[0] : air.first[1]].tolist() == [2]


@given(st.floats(0, 180), st.integers(0, 10_000))
def test_a_bird_sees_300_degrees_about_its_heading(degrees, seed):
    if abs(degrees - 150.0) < 1e-6:
        return
    forward, across = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 2)))[0].T
    angle = np.radians(degrees)
    simulation = meadow(boids())
    here = np.array([20.0, 20.0, 50.0])
    put_aloft(simulation, [here, here + 2.0 * (np.cos(angle) * forward + np.sin(angle) * across)], forward)
    simulation.agents[Velocity.xyz][:] = 0.0
    simulation.tick()
    air = scene_of(simulation.world).air
    assert (1 in air.near[air.first[0] : air.first[1]]) == (degrees < 150.0)


def test_a_bird_behind_another_is_seen_only_without_occlusion():
    for occlusion, expected in ((True, [1]), (False, [1, 2])):
        eyes = {"range": 40.0, "field_of_view": 300.0, "occlusion": occlusion}
        simulation = meadow(brush("boids", "boids", 45.0, {"length": 0.2, "radius": 0.04}, eyes))
        put_aloft(simulation, [(20, 20, 50), (21, 20, 50), (22, 20.001, 50)])
        simulation.tick()
        air = scene_of(simulation.world).air
        assert sorted(air.near[air.first[0] : air.first[1]].tolist()) == expected


# arbitration ----------------------------------------------------------------------------------


@njit
def _hand_out(requests, rule, wish):
    given = Given(0.0, 0.0, 0.0, 0.0)
    for urge in range(len(requests)):
        given = add_request(given, urge, (requests[urge, 0], requests[urge, 1], requests[urge, 2]), rule, wish, 0)
    return given


def allotted(requests, **parameters):
    """What urges of full strength get together of their requests, `Given`."""
    rule = rule_of(Params(**{f"{urge}_strength": 1.0 for urge in URGES}, **parameters), 1 / 32)
    nothing = np.zeros((1, 3))
    return _hand_out(requests, rule, WishColumns(nothing, nothing[0], nothing, nothing[None], 0))


@given(st.lists(st.tuples(*[st.floats(-2, 2)] * 3), min_size=1, max_size=7), st.booleans())
def test_allocation_hands_out_at_most_one_in_order(requests, grounded):
    ask = np.array([cut(np.array(r)) for r in requests]) * (1, 1, not grounded)
    given_, left = np.zeros(3), 1.0
    for request in ask:  # the paper's words
        size = np.linalg.norm(request)
        given_ += request * (min(size, left) / size if size else 0.0)
        left = max(left - size, 0.0)
    found = allotted(np.array(requests), grounded=grounded)
    assert found[:3] == pytest.approx(given_, abs=1e-12)
    assert np.linalg.norm(found[:3]) <= 1 + 1e-12 and found.used == pytest.approx(1.0 - left, abs=1e-12)


def test_averaging_wavers_between_two_sides_and_allocation_does_not():
    """The indecision of the paper: an obstacle says left, the others say right."""
    ask = np.array([(0.0, 1.0, 0.0), (0.0, 0.0, 0.0), (0.0, -0.95, 0.0)])
    assert allotted(ask, arbitration="average") == pytest.approx((0, 0.05, 0, 2.0))  # of two that ask
    assert allotted(ask)[:3] == pytest.approx((0, 1, 0))


def passes_the_pillar(arbitration):
    """How near a bird comes to the face of a pillar, m, soonest passed on the left, while its migration says right."""
    pillar = obstacle(box(28, 18, 32, 22), "pillar")
    p = only("obstacle", "migration", migration_strength=1.0, arbitration=arbitration)
    simulation = meadow(boids(**p), obstacles=[pillar])
    put_aloft(simulation, (23, 21.2, 50))
    simulation.submit(Migrate(0.0, -1.0, 0.0, kind="direction"))
    nearest = np.inf
    for _ in range(24):
        simulation.tick()
        if simulation.agents[Position.xyz][0, 0] > 28:
            break
        nearest = min(nearest, room_in_the_air(simulation)[0])
    return nearest


def test_an_undecided_bird_hits_the_pillar_and_one_with_priorities_passes_it():
    assert passes_the_pillar("average") < 1e-3
    assert passes_the_pillar("priority") > 0.05


# fear, migration, height ------------------------------------------------------------------------


def test_a_flock_flees_from_a_falcon_in_its_midst_and_hurries():
    falcon = boids("falcon", 10.0, "raptor", **only())
    simulation = meadow(boids(), falcon, width=200, height=200, cell=2.0)
    xyz = np.random.default_rng(1).normal(0, 1.5, (40, 3)) + (100, 100, 40)
    put_aloft(simulation, xyz, brush="boids")
    put_aloft(simulation, (100, 100, 40), brush="falcon", species="falcon")
    simulation.run(24)
    xyz, velocity = simulation.agents[Position.xyz], simulation.agents[Velocity.xyz]
    assert np.median(np.linalg.norm(xyz[:40] - xyz[40], axis=1)) > 5.0
    assert np.linalg.norm(velocity[:40], axis=1).mean() > 9.5


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, -1, 0), (-1, 0, 0), (1, 1, 1)])
def test_a_flock_turns_the_way_it_is_sent(direction):
    simulation = flock(30, 3.0, heading=0.0)
    simulation.submit(Migrate(*map(float, direction), kind="direction"))
    simulation.run(256)
    way = np.array(direction) / np.linalg.norm(direction)
    assert (simulation.agents[Heading.forward] @ way).mean() > 0.9


def test_a_flock_flies_to_the_point_it_is_sent_to_and_follows_where_that_glides():
    simulation = flock(30, 3.0, heading=0.0)
    simulation.submit(Migrate(130.0, 60.0, 45.0))
    nearest = np.inf
    for _ in range(400):
        simulation.tick()
        middle = simulation.agents[Position.xyz].mean(0)
        nearest = min(nearest, np.linalg.norm(middle - (130, 60, 45)))
    assert nearest < 3
    simulation.submit(Migrate(60.0, 160.0, 45.0, seconds=8.0), 400)
    simulation.run(480)
    assert np.linalg.norm(simulation.agents[Position.xyz].mean(0) - (60, 160, 45)) < 25


def test_a_script_that_asks_for_nonsense_is_told_so():
    simulation = flock(3)
    for wrong, message in (
        (Migrate(0, 0, 0, kind="somewhere"), "kind must be one of none, direction, point"),
        (Migrate(0, 0, 0, kind="direction"), "must not be"),
        (Migrate(1, 0, 0, seconds=-1), "seconds must be at least 0"),
        (Migrate(1, 0, 0, species="emu"), "no species 'emu'"),
    ):
        with pytest.raises((ValueError, LookupError), match=message):
            wrong.apply(simulation.world)


def test_it_climbs_to_the_height_it_should_keep_over_hills():
    y, x = np.mgrid[0.5:200, 0.5:200]
    hills = Raster(1.0, 5 * np.sin(x / 25))
    simulation = flock(10, 3.0, heading=0.0, things={"height_map": hills}, height=15.0, height_strength=1.0)
    simulation.run(300)
    xyz = simulation.agents[Position.xyz]
    land = simulation.world.resource(Landscape)
    above = np.array([z - land.ground((x, y)) for x, y, z in xyz])
    assert above == pytest.approx(15.0, abs=3.0)


def test_held_to_the_terrain_it_is_a_herd():
    y, x = np.mgrid[0.5:200, 0.5:200]
    hills = Raster(1.0, 3 * np.sin(x / 9) + 0.05 * y)
    herd = brush(
        "herd", "boids", 2.0, {"length": 1.5, "radius": 0.3, "contact": "disc"},
        {"range": 8.0, "field_of_view": 300.0}, grounded=True, max_speed=6.0, min_speed=0.2, neighbour_range=8.0,
        separation=1.5, matching_time=0.4,
    )  # fmt: skip
    simulation = meadow(herd, width=200, height=200, cell=2.0, height_map=hills, boundary="wall")
    rng = np.random.default_rng(2)
    put(simulation, rng.uniform(90, 110, (40, 2)), rng.normal(0, 1.0, 40))
    land = simulation.world.resource(Landscape)
    for _ in range(300):
        simulation.tick()
    for x, y, z in simulation.agents[Position.xyz]:
        assert z == pytest.approx(land.ground((x, y)), abs=1e-12)
    assert (simulation.agents[Heading.forward][:, 2] == 0).all()
    assert polarization(simulation) > 0.9


# what flocks do -----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_from_random_headings_a_flock_becomes_polarized(seed):
    simulation = flock(150, 7.0, seed)
    simulation.tick()
    before = polarization(simulation)
    simulation.run(255)
    assert before < 0.2
    assert polarization(simulation) > 0.9


def test_a_crowd_expands_in_a_flash():
    """Crowded far below the separation, everybody bursts away from the middle."""
    simulation = flock(120, 0.4, heading=0.0, mean=10.0, min_speed=0.0)
    spread, outwards = [], None
    for tick in range(16):
        xyz = simulation.agents[Position.xyz]
        spread.append(np.linalg.norm(xyz - xyz.mean(0), axis=1).mean())
        simulation.tick()
        if tick == 3:
            off = xyz - xyz.mean(0)
            away = simulation.agents[Velocity.xyz] - simulation.agents[Velocity.xyz].mean(0)
            outwards = np.mean((off * away).sum(1) > 0)
    assert spread[-1] > 1.8 * spread[0]
    assert outwards > 0.8
    assert (np.diff(spread) > 0).all()


def test_birds_on_a_small_shell_contract():
    """Released on a shell within the neighbourhood's radius, at rest, they draw together."""
    rng = np.random.default_rng(3)
    shell = rng.normal(size=(40, 3))
    shell *= 1.6 / np.linalg.norm(shell, axis=1, keepdims=True)
    simulation = meadow(boids(mean=0.0, min_speed=0.0, separation=1.0, forward_weight=0.0), width=200, height=200)
    put_aloft(simulation, shell + (100, 100, 40), shell * (-1, -1, 0), speed=0.0)
    simulation.run(20)
    xyz = simulation.agents[Position.xyz]
    assert np.linalg.norm(xyz - xyz.mean(0), axis=1).mean() < 1.5


def field_of_pillars(seed, n=60, count=24):
    """A flock before a field of pillars at random, and the way beyond."""
    rng = np.random.default_rng(seed)
    things = []
    for k in range(count):
        x, y, r = 40 + 60 * rng.uniform(), 70 + 60 * rng.uniform(), rng.uniform(0.6, 2.2)
        thing = obstacle(box(x - r, y - r, x + r, y + r), f"pillar {k}")
        thing.shape, thing.z_max = rng.choice(["cylinder", "box"]), 100.0
        things.append(thing)
    simulation = meadow(boids(separation=5.0), width=200, height=200, cell=2.0, obstacles=things, seed=seed)
    xyz = rng.uniform(0, 1, (n, 3)) * (8, 16, 6) + (20, 92, 30)
    put_aloft(simulation, xyz)
    simulation.submit(Migrate(1.0, 0.0, 0.0, kind="direction"))
    return simulation


@pytest.mark.parametrize("seed", range(4))
def test_a_flock_flies_through_a_field_of_pillars_and_nobody_into_one(seed):
    simulation = field_of_pillars(seed)
    for _ in range(420):
        simulation.tick()
        assert room_in_the_air(simulation).min() > 0
    assert (simulation.agents[Position.xyz][:, 0] > 100).mean() > 0.95


def test_a_flock_is_born_between_its_altitude_and_so_much_higher():
    level = {"spawns": [spawn(box(5, 5, 35, 35), "boids", 200, altitude=10.0, depth=6.0)]}
    xyz = meadow(boids(), **level).agents[Position.xyz]
    assert 10.0 <= xyz[:, 2].min() < 10.5
    assert 15.5 < xyz[:, 2].max() <= 16.0
    assert np.histogram(xyz[:, 2], 4, (10, 16))[0].min() > 30
