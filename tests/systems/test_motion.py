"""MOVE writes where everybody is: on hills, across the seam of a wrapped map, within walls, with threads."""

import numpy as np
import pytest
from flockbrush.components import Heading, Position, Velocity
from flockbrush.engine.raster import Raster
from small_herd import brush, forward_of, gaps_of, meadow, put, straight, xy_of

WIDE, HIGH = 32.0, 24.0  # powers of two and their sums: shifting by them costs few bits


def herd_at(shift, n=24, mean=2.0):
    """A herd of thin animals, who seldom touch, on a wrapped map: in its middle, shifted.  Their speeds are noisy."""
    asset = brush(mean=mean, speed={"deviation": 0.3}, body={"radius": 0.03}, avoidance_radial=0.4)
    simulation = meadow(asset, width=WIDE, height=HIGH, boundary="wrap", cell=2.0)
    rng = np.random.default_rng(3)
    xy = np.array([(11.5 + 1.8 * i, 8.4 + 1.8 * j) for i in range(6) for j in range(4)]) + rng.uniform(
        -0.3, 0.3, (n, 2)
    )
    put(simulation, np.mod(xy + shift, (WIDE, HIGH)), 0.4 + rng.normal(0, 0.3, n), speed=mean)
    return simulation


def unwrapped(offset):
    return offset - np.array([WIDE, HIGH]) * np.round(offset / (WIDE, HIGH))


@pytest.mark.parametrize("shift", [(16.0, 0.0), (0.0, 12.0), (16.0, 12.0), (13.7, -9.1)])
def test_a_herd_that_crosses_the_seam_moves_as_in_the_middle_of_the_map(shift):
    middle, seam = herd_at((0.0, 0.0)), herd_at(shift)
    for _ in range(40):
        middle.tick()
        seam.tick()
        apart = unwrapped(xy_of(seam) - xy_of(middle) - shift)
        assert np.abs(apart).max() < 1e-6
        assert forward_of(seam) == pytest.approx(forward_of(middle), abs=1e-6)
    assert seam.measures()["polarization"] == pytest.approx(middle.measures()["polarization"], abs=1e-6)
    here = xy_of(seam)
    assert ((here >= 0) & (here <= (WIDE, HIGH))).all()
    assert (np.ptp(here, axis=0) > (WIDE / 2, HIGH / 2)).any()  # it really stands on the seam


@pytest.mark.parametrize("speed", [5.0, 60.0])
def test_the_fast_do_not_run_through_one_another_across_the_seam(speed):
    run = straight(mean=speed)
    simulation = meadow(run, width=WIDE, height=HIGH, boundary="wrap", cell=2.0)
    y = np.linspace(2, 22, 12)
    odd = np.arange(12) % 2
    put(simulation, np.column_stack([np.where(odd, 3.0, WIDE - 3.0), y // 2 * 2]), np.pi * odd)
    for _ in range(60):
        before = gaps_across(simulation)
        simulation.tick()
        assert gaps_across(simulation) > min(before, 0.0) - 1e-6


def test_a_seam_slows_nobody_down():
    simulation = meadow(straight(mean=60.0), width=WIDE, height=HIGH, boundary="wrap", cell=2.0)
    put(simulation, [(5.0, 12.0)], 0.0)
    simulation.run(3)
    assert np.linalg.norm(simulation.agents[Velocity.xyz][0]) == pytest.approx(60.0)


def gaps_across(simulation):
    """The smallest room between bodies, also across the seams."""
    from flockbrush.components import Body
    from small_herd import gaps

    agents = simulation.agents
    xy, forward = xy_of(simulation), forward_of(simulation)
    half, radius = agents[Body.axis], agents[Body.radius]
    least = gaps(xy, forward, half, radius).min()
    n = len(xy)
    for dx, dy in ((WIDE, 0), (0, HIGH), (WIDE, HIGH), (WIDE, -HIGH)):
        both = np.vstack([xy, xy + (dx, dy)])
        i, j = np.triu_indices(2 * n, 1)
        whole = gaps(both, np.vstack([forward] * 2), np.tile(half, 2), np.tile(radius, 2))
        least = min(least, whole[(i < n) & (j >= n) & (j - n != i)].min())
    return least


def test_a_walled_map_keeps_everybody_in():
    asset = brush(mean=4.0, speed={"deviation": 1.0})
    simulation = meadow(asset, width=16, height=12, boundary="wall")
    put(simulation, np.random.default_rng(2).uniform(1, 11, (30, 2)), np.arange(30.0))
    for _ in range(250):
        simulation.tick()
        here = xy_of(simulation)
        assert ((here >= 0.2 - 1e-6) & (here <= np.array([16, 12]) - 0.2 + 1e-6)).all()
    assert gaps_of(simulation).min() > -1e-6


def test_an_open_map_has_no_edge():
    simulation = meadow(straight(mean=8.0), width=16, height=12)
    put(simulation, [(8, 6)], 0.0)
    simulation.run(96)
    assert xy_of(simulation)[0] == pytest.approx((8 + 24, 6))


def test_the_ground_carries_walkers_and_who_is_above_it_comes_down():
    y, x = np.mgrid[0.5:40, 0.5:40]
    hills = Raster(1.0, 2 * np.sin(x / 5) + 0.1 * y)
    simulation = meadow(straight(mean=3.0), height_map=hills)
    walker, flyer = put(simulation, [(5, 10), (5, 30)], 0.3)
    world = simulation.world
    for entity, altitude in ((walker, 0.0), (flyer, 7.0)):
        here = world.component_for_entity(entity, Position)
        here.xyz = (*here.xyz[:2], hills.sample(here.xyz[None, :2])[0] + altitude)
    for tick in range(34):
        before = simulation.agents[Position.xyz].copy()
        simulation.tick()
        now = simulation.agents[Position.xyz]
        assert now[:, 2] - hills.sample(now[:, :2]) == pytest.approx([0.0, max(7.0 - (tick + 1) / 8, 2.6)], abs=1e-6)
        assert simulation.agents[Velocity.xyz] == pytest.approx((now - before) * 32, abs=1e-9)
    simulation.run(160)
    now = simulation.agents[Position.xyz]
    assert now[:, 2] - hills.sample(now[:, :2]) == pytest.approx([0.0, 0.0], abs=1e-6)


def test_velocity_is_what_was_done_and_heading_what_is_faced():
    simulation = meadow(straight(mean=3.0), boundary="wall")
    put(simulation, [(0.8, 0.8)], 1.25 * np.pi)  # into the corner: nearly nothing can be done
    simulation.run(7)
    before = xy_of(simulation)
    simulation.tick()
    assert simulation.agents[Velocity.xyz][0, :2] == pytest.approx((xy_of(simulation) - before)[0] * 32, abs=1e-9)
    assert np.linalg.norm(simulation.agents[Velocity.xyz][0]) < 2.9
    assert np.linalg.norm(simulation.agents[Heading.forward][0]) == pytest.approx(1.0)


def test_while_two_brushes_blend_nobody_turns_faster_than_either_allows():
    calm = straight("calm", max_turn=0.5, transition=2.0)
    quick = brush("quick", max_turn=100.0, cohesion_weight=1.0, leader_neighbours=-1, transition=2.0)
    simulation = meadow(calm, quick)
    put(simulation, [(20, 20), (17, 20.5)], 0.0, brush="calm")
    simulation.run(2)
    from flockbrush.systems.commands import SwitchBrush

    simulation.submit(SwitchBrush("quick"))
    for _ in range(60):
        before = forward_of(simulation)
        simulation.tick()
        cosine = np.clip((before * forward_of(simulation)).sum(1), -1, 1)
        assert np.arccos(cosine).max() <= 0.5 / 32 + 1e-6
