"""How fast: the Ornstein-Uhlenbeck process of the paper's eq. 6, and everything that slows."""

import numpy as np
import pytest
from flockbrush.behaviours.behaviour import TAKES_UP
from flockbrush.behaviours.wander import half_wave_correlation
from flockbrush.components import Body, BrushBinding, Ground, Heading, Position, Speed, Velocity, Wish
from flockbrush.engine.noise import Noise
from flockbrush.engine.raster import Raster
from flockbrush.engine.state import restore, snapshot, state_hash
from flockbrush.levels.schema import Zone
from flockbrush.systems.pace import WAVES, in_common_, waves_of
from flockbrush.systems.terrain import slope_factor_
from small_herd import box, brush, level, meadow, put, straight

from flockbrush.film.speed_process import _followed

DT = 1 / 32


def grid(n, step=6.0, start=5.0):
    """Animals far from one another."""
    side = int(np.ceil(np.sqrt(n)))
    return np.array([(start + step * (k % side), start + step * (k // side)) for k in range(n)])


def lonely(asset, n=1, **things):
    """A world of animals that go straight on and never meet."""
    simulation = meadow(asset, width=300, height=300, cell=5.0, **things)
    put(simulation, grid(n, 3000.0 if things.get("boundary", "open") == "open" else 6.0), 0.0)
    return simulation


def target(simulation):
    simulation.tick()
    return simulation.agents[Speed.target].copy()


@pytest.mark.parametrize(("mean", "deviation", "reversion"), [(4.0, 0.6, 1.0), (3.0, 0.5, 4.0)])
def test_speeds_are_the_stationary_process_of_eq_6(mean, deviation, reversion):
    wander = straight(mean=mean, speed={"deviation": deviation, "reversion": reversion})
    simulation = lonely(wander, 600)
    drawn = []
    for k in range(960):
        simulation.tick()
        if k > 250 and k % 20 == 0:
            drawn.append(simulation.agents[Speed.drawn].copy())
    drawn = np.array(drawn)
    # v' = (1 - a) v + a mean + deviation sqrt(dt) N with a = reversion dt: the variance that reproduces itself
    variance = deviation**2 * DT / (1 - (1 - reversion * DT) ** 2)
    assert drawn.mean() == pytest.approx(mean, abs=4 * np.sqrt(variance / drawn.size * 20))
    assert drawn.var() == pytest.approx(variance, rel=0.05)
    # and it forgets as exp(-reversion t)
    now, later = drawn[:-1] - mean, drawn[1:] - mean
    assert (now * later).mean() / variance == pytest.approx((1 - reversion * DT) ** 20, abs=0.05)


def test_animals_differ_for_life_by_their_share_of_the_mean():
    simulation = lonely(straight(mean=4.0, speed={"individual": 0.1, "reversion": 4.0}), 600)
    simulation.run(96)
    once = simulation.agents[Speed.drawn].copy()
    simulation.run(320)
    later = simulation.agents[Speed.drawn]
    assert np.allclose(once, later, rtol=1e-3)  # without noise of their own, each keeps its usual speed
    assert later.std() == pytest.approx(0.4, rel=0.1)


def test_a_herd_hurries_together():
    herd = lonely(straight(mean=4.0, speed={"common": 0.5, "common_time": 1.0, "reversion": 8.0}))
    put(herd, grid(4, 2.0), 0.0)
    speeds = []
    for _ in range(600):
        herd.run(8)
        speeds.append(herd.agents[Speed.drawn][1:].copy())
    speeds = np.array(speeds)
    assert np.corrcoef(speeds.T).min() > 0.95
    assert speeds.std() == pytest.approx(0.5 * np.sqrt(_followed(np.zeros(1), 1.0, 8.0)[0]), rel=0.15)


@pytest.mark.parametrize("apart", ["in size", "by the border", "by their brushes"])
def test_animals_side_by_side_hurry_together_anywhere_on_the_map(apart):
    speed = {"common": 0.5, "common_time": 1.0, "reversion": 8.0}
    one, two = (straight(name, mean=4.0, speed=speed) for name in ("one", "two"))
    herd = meadow(one, two, width=320, height=300, cell=5.0, boundary="wrap")
    place = (0.5, 150.0) if apart == "by the border" else (310.0, 290.0)
    put(herd, [place, (place[0] - 1.5, place[1])], np.pi / 2, brush="one")
    if apart == "by their brushes":
        for field in (BrushBinding.brush, BrushBinding.previous, BrushBinding.home):
            herd.agents[field][1] = 1
    herd.agents[Body.length][:] = (1.1, 0.9) if apart == "in size" else 1.0
    rate, speeds = herd.agents[Body.length].copy(), []
    for _ in range(60):
        herd.agents[Position.xyz][:, 1] = place[1]
        herd.run(8)
        speeds.append(herd.agents[Speed.drawn] / rate)
    assert np.corrcoef(np.transpose(speeds))[0, 1] > 0.95


def test_on_a_map_that_goes_on_what_a_herd_does_together_goes_on_too():
    stream, waves = Noise(3).stream("common speed"), waves_of([1.2, 30.0], (400.0, 300.0))
    for herd in (0, 1):
        for x, y in ((3.0, 7.0), (390.0, 200.0)):
            here = in_common_(x, y, 0.3, stream, waves, herd)
            for over in ((x + 400.0, y), (x, y - 300.0)):
                assert in_common_(*over, 0.3, stream, waves, herd) == pytest.approx(here, abs=1e-9)
    assert np.abs(waves[0] - WAVES / 1.2).max() < 0.5 * 2 * np.pi / 300.0 + 1e-12


def test_going_back_and_a_newcomer_change_nothing_of_what_a_herd_does_together():
    uneven = straight(mean=4.0, speed={"individual": 0.2, "common": 0.8, "common_time": 0.5, "deviation": 0.3})
    herd = lonely(uneven)
    put(herd, grid(40, 6.0), 0.0)
    herd.run(50)
    kept = snapshot(herd.world)
    herd.run(40)
    later = state_hash(herd.world), herd.agents[Speed.drawn].copy()
    restore(herd.world, kept)
    herd.run(40)
    assert state_hash(herd.world) == later[0]
    restore(herd.world, kept)
    put(herd, [(1500.0, 1500.0)], 0.0)
    herd.run(40)
    assert np.array_equal(herd.agents[Speed.drawn][:-1], later[1])


def test_what_a_herd_does_together_is_normal_and_lasts_as_long_as_half_waves_do():
    stream, waves = Noise(3).stream("common speed"), WAVES[None]
    drawn = np.array(
        [[in_common_(0.0, 0.0, 0.7 * k + lag, stream, waves, 0) for lag in (0.0, 0.5, 1.0, 2.0)] for k in range(20_000)]
    )
    assert abs(drawn.mean()) < 0.03 and drawn.var() == pytest.approx(1.0, abs=0.03)
    assert abs((drawn**3).mean()) < 0.1 and (drawn**4).mean() == pytest.approx(3.0, abs=0.5)
    for k, lag in enumerate((0.0, 0.5, 1.0, 2.0)):
        assert (drawn[:, 0] * drawn[:, k]).mean() == pytest.approx(half_wave_correlation(lag), abs=0.04)


@pytest.mark.parametrize(("far", "least", "most"), [(10.0, 0.85, 1.0), (30.0, 0.45, 0.65), (60.0, -0.1, 0.25)])
def test_herds_far_apart_do_not_hurry_together(far, least, most):
    stream, alike, waves = Noise(3).stream("common speed"), [], WAVES[None]
    for angle in np.linspace(0.0, np.pi, 8, endpoint=False):
        x, y = far * np.cos(angle), far * np.sin(angle)
        alike += [
            in_common_(0.0, 0.0, k, stream, waves, 0) * in_common_(x, y, k, stream, waves, 0) for k in range(2000)
        ]
    assert least < np.mean(alike) < most


def test_animals_of_two_sizes_go_as_many_body_lengths_a_second():
    wander = straight(mean=3.0, speed={"deviation": 0.3})
    speeds = {}
    for size in (0.5, 2.0):
        simulation = meadow(wander, width=100, height=100)
        put(simulation, [(50, 50)], 0.0, length=size, speed=3.0 * size)
        simulation.run(50)
        speeds[size] = simulation.agents[Speed.drawn][0] / size
    assert speeds[0.5] == pytest.approx(speeds[2.0], rel=1e-12)  # the same entity draws the same chance


def test_chance_belongs_to_the_animal_and_not_to_its_place_in_the_herd():
    wander = straight(mean=3.0, speed={"deviation": 0.5})

    def speeds(without):
        simulation = lonely(wander, 5)
        if without:
            simulation.world.delete_entity(without)
            simulation.world.flush()
        simulation.run(20)
        return dict(zip(simulation.agents.ids.tolist(), simulation.agents[Speed.drawn].tolist(), strict=True))

    whole, fewer = speeds(None), speeds(2)
    assert fewer == {entity: v for entity, v in whole.items() if entity != 2}


def test_nobody_walks_backwards_however_wild_the_noise():
    simulation = lonely(straight(mean=0.3, speed={"deviation": 5.0}), 100)
    least, most = np.inf, 0.0
    for _ in range(200):
        simulation.tick()
        speed = simulation.agents[Speed.target]
        least, most = min(least, speed.min()), max(most, speed.max())
    assert least == 0.0
    assert most > 3.0


def test_without_noise_and_friction_a_walker_keeps_its_mean():
    simulation = lonely(straight(mean=2.5), 1)
    simulation.run(64)
    assert simulation.agents[Velocity.xyz][0] == pytest.approx((2.5, 0, 0))
    assert simulation.agents[Position.xyz][0, 0] == pytest.approx(5.0 + 2.5 * 2)


def test_speed_follows_the_table_of_density():
    table = ((0.0, 1.0), (0.2, 0.5), (0.6, 0.1))
    for others, factor in ((0, 1.0), (1, None), (2, None), (4, None), (12, 0.1)):
        crowded = straight(mean=2.0, speed={"by_density": table}, body={"length": 1.0, "radius": 0.05})
        assert crowded.speed.by_density == table
        simulation = meadow(crowded, width=100, height=100)
        angle = 2 * np.pi * np.arange(others) / max(others, 1)
        around = np.column_stack([50 + 1.5 * np.cos(angle), 50 + 1.5 * np.sin(angle)])
        put(simulation, [(50, 50), *around, (53, 50)], np.pi / 2)  # the last one is too far to count
        density = others / (4 * np.pi)  # per square body length, within two body lengths
        expected = np.interp(density, *zip(*table, strict=True)) if factor is None else factor
        assert target(simulation)[0] == pytest.approx(2.0 * expected, rel=1e-12)


def test_density_is_counted_in_body_lengths_of_the_animal_itself():
    crowded = straight(mean=1.0, speed={"by_density": ((0.0, 1.0), (1.0, 0.0))})
    for size in (0.25, 1.0, 2.0):
        simulation = meadow(crowded, width=100, height=100)
        put(simulation, np.array([(20, 20), (21.9, 20), (22.1, 20)]) * size, 0.0, length=size)
        assert target(simulation)[0] == pytest.approx(size * (1 - 1 / (4 * np.pi)))


def test_surface_and_painted_factors_multiply_and_caps_hold():
    zones = [
        Zone(1, "snow", box(0, 0, 100, 300), None, np.inf, 0.5, 0.5),
        Zone(2, "deep", box(50, 0, 100, 300), None, np.inf, 0.5, 0.5),
        Zone(3, "cap", box(200, 0, 300, 300), None, 1.5, 1.0, 0.5),
    ]
    simulation = meadow(straight(mean=4.0), width=300, height=300, cell=5.0, zones=zones)
    put(simulation, [(20, 20), (70, 20), (150, 20), (250, 20)], np.pi / 2)
    assert target(simulation) == pytest.approx([2.0, 1.0, 4.0, 1.5])
    assert simulation.agents[Ground.factor] == pytest.approx([0.5, 0.25, 1.0, 1.0])


def test_a_cap_ends_at_its_edge():
    zone = Zone(1, "ford", box(20, 0, 25, 40), None, 1.0, 1.0, 0.5)
    simulation = meadow(straight(mean=4.0), zones=[zone])
    put(simulation, [(15, 20)], 0.0)
    x, speed = [], []
    for _ in range(300):
        before = simulation.agents[Position.xyz][0, 0]
        simulation.tick()
        x.append(before)
        speed.append(simulation.agents[Velocity.xyz][0, 0])
    x, speed = np.array(x), np.array(speed)
    inside = (x >= 20) & (x < 25)
    assert speed[inside] == pytest.approx(1.0)
    assert speed[~inside] == pytest.approx(4.0)
    assert inside.sum() > 100


@pytest.mark.parametrize("rise", [-0.5, -0.05, 0.0, 0.1, 0.4])
def test_slopes_slow_as_toblers_hikers(rise):
    x = np.arange(0.5, 60)
    hill = Raster(1.0, np.broadcast_to(rise * x, (60, 60)).copy())
    simulation = meadow(straight(mean=2.0), width=60, height=60, height_map=hill)
    put(simulation, [(30, 30), (30, 40), (30, 50)], [0.0, np.pi, np.pi / 2])
    simulation.agents[Position.xyz][:, 2] = 30.0 * rise
    tobler = [np.exp(-3.5 * (abs(r + 0.05) - 0.05)) for r in (rise, -rise, 0.0)]
    assert target(simulation) == pytest.approx(2.0 * np.array(tobler), rel=1e-9)
    assert slope_factor_(rise) == pytest.approx(tobler[0])
    # up, down and along: the height under the feet is followed, and the velocity has its part of it
    velocity = simulation.agents[Velocity.xyz]
    assert velocity[:, 2] == pytest.approx(velocity[:, 0] * rise, abs=1e-9)


def test_effort_is_gathered_and_let_go_over_time():
    simulation = lonely(straight(mean=1.0), 1)
    agents = simulation.agents
    from flockbrush.engine.parallel import over_rows  # noqa: F401
    from flockbrush.systems.pace import Pace

    pace = Pace()
    expected = 1.0
    for wanted in [3.0] * 40 + [0.5] * 40:
        simulation.tick()
        agents[Speed.effort][:] = expected
        agents[Wish.pace][:] = wanted
        pace.process(simulation.world)
        expected += (wanted - expected) * DT / TAKES_UP
        assert agents[Speed.effort][0] == pytest.approx(expected)
        assert agents[Speed.target][0] == pytest.approx(expected, rel=0.05)
    assert 0.5 < expected < 0.7


def test_a_standing_herd_stands():
    simulation = lonely(straight(mean=0.0), 4)
    before = simulation.agents[Position.xyz].copy()
    simulation.run(30)
    assert np.array_equal(simulation.agents[Position.xyz], before)
    assert np.isfinite(simulation.agents[Heading.forward]).all()


def test_a_brush_without_speed_noise_draws_nothing():
    same = [lonely(brush(mean=2.0), 3, seed=seed) for seed in (1, 2)]
    for simulation in same:
        simulation.run(20)
    assert same[0].agents[Speed.drawn].tolist() == same[1].agents[Speed.drawn].tolist()
    assert level().seed == 1
