"""Birds in line formation in a level: places, leaders, turns, and what is shown of them."""

import numpy as np
import pytest
from flockbrush.components import FormationPlace, Heading, Position, ReferenceBird, Role, Velocity
from flockbrush.engine.state import restore, snapshot, state_hash
from flockbrush.systems.commands import Migrate, SwitchBrush
from flockbrush.systems.gusts import Gust
from flockbrush.systems.initiation import random_flock
from flockbrush.systems.palette import Palette
from small_herd import brush, meadow, put, put_aloft, straight

from flockbrush.runs.run import start

WING = 1.7 * 0.9  # m


def geese(name="geese", **parameters):
    """Geese of 15 m/s without chance in their speed."""
    return brush(
        name, model="line_formation", mean=16.7, body={"length": 0.9, "radius": 0.2}, vision={"range": 60.0},
        transition=0.0, **parameters,
    )  # fmt: skip


def flock(birds=9, seed=3, height=50.0, **parameters):
    """Scattered geese over an endless plain, their leader flying north."""
    simulation = meadow(geese(**parameters), boundary="open")
    x, y, heading = random_flock(birds, seed)
    put(simulation, np.c_[x * WING, y * WING], np.pi / 2 - 0.5 * heading)
    agents = simulation.agents
    agents[Position.xyz][:, 2] = height
    agents[Velocity.xyz][:] = 15.0 * agents[Heading.forward]
    simulation.submit(Migrate(0.0, 1.0, 0.0, kind="direction"))
    return simulation


@pytest.fixture(scope="module")
def kept():
    """The state of a flock in its V, after 400 ticks."""
    simulation = flock(deviation=0.0)
    simulation.run(400)
    return snapshot(simulation.world)


@pytest.fixture
def formed(kept):
    """A flock in its V."""
    simulation = flock(deviation=0.0)
    restore(simulation.world, kept)
    return simulation


def formation(simulation):
    """(places, arms, to the right, ahead, above) of all from left to right, wingspans from the leader."""
    a = simulation.agents
    lead = int(np.flatnonzero(a[FormationPlace.place] == 0)[0])
    ahead = a[Heading.forward][lead, :2] / np.linalg.norm(a[Heading.forward][lead, :2])
    away = (a[Position.xyz] - a[Position.xyz][lead]) / WING
    x, y = away[:, 0] * ahead[1] - away[:, 1] * ahead[0], away[:, :2] @ ahead
    order = np.argsort(x)
    return a[FormationPlace.place][order], a[FormationPlace.arm][order], x[order], y[order], away[order, 2]


def test_geese_find_into_a_v_and_touch_nobody():
    simulation = flock()
    nearest = []
    for _ in range(60):
        simulation.run(16)
        xyz = simulation.agents[Position.xyz]
        nearest.append(np.sort(np.linalg.norm(xyz[:, None] - xyz, axis=2) / WING, axis=1)[:, 1].min())
    place, arm, x, y, z = formation(simulation)
    assert place.tolist() == [4, 3, 2, 1, 0, 1, 2, 3, 4]
    assert arm.tolist() == [-1] * 4 + [0] + [1] * 4
    assert x == pytest.approx(1.25 * np.arange(-4, 5), abs=0.15)
    assert y == pytest.approx(-0.8 * np.abs(x), abs=1.0)  # alive, so not exactly
    assert np.abs(z).max() < 0.2
    assert min(nearest) > 0.5
    a = simulation.agents  # roles and reference birds are live
    assert a[Role.leader].sum() == 1
    assert (a[ReferenceBird.entity] == 0).tolist() == (a[Role.leader] == 1).tolist()
    row = {int(i): k for k, i in enumerate(a.ids)}
    for k in range(len(a)):
        if a[ReferenceBird.entity][k]:
            followed = row[int(a[ReferenceBird.entity][k])]
            assert a[FormationPlace.place][followed] == a[FormationPlace.place][k] - 1


@pytest.mark.parametrize("shape", ["line", "J", "inverted V", "inverted U"])
def test_other_shapes_are_found_too(shape):
    simulation = flock(shape=shape, left={"line": 0.0, "J": 0.2}.get(shape, 0.5), deviation=0.0)
    simulation.run(400)
    place, _, x, y, _ = formation(simulation)
    if shape == "line":
        assert place.tolist() == list(range(9))
        assert y == pytest.approx(-0.8 * x, abs=0.3)
    elif shape == "J":
        assert place.tolist() == [2, 1, 0, 1, 2, 3, 4, 5, 6]
        assert y == pytest.approx(-0.05 * x**2, abs=0.3)
    else:
        assert place.tolist() == list(range(9))
        assert y[8] == pytest.approx(0.0, abs=0.3)  # the two tips lead side by side
        assert y[4] == pytest.approx(-4.0 if shape == "inverted V" else -1.25, abs=0.3)
        assert simulation.agents[Role.leader].sum() == 2


def test_the_flock_turns_with_its_leader(formed):
    formed.submit(Migrate(1.0, 0.0, 0.0, kind="direction"))
    formed.run(640)
    a = formed.agents
    assert a[Heading.forward][:, 0].min() > 0.99
    place, _, x, y, _ = formation(formed)
    assert place.tolist() == [4, 3, 2, 1, 0, 1, 2, 3, 4]
    assert y == pytest.approx(-0.8 * np.abs(x), abs=0.3)


def test_geese_start_from_the_ground_and_climb_to_where_they_are_bound():
    simulation = flock(birds=5, height=0.0)
    simulation.agents[Velocity.xyz][:] = 0.0
    simulation.submit(Migrate(0.0, 1e4, 40.0))
    simulation.run(32)
    assert 0 < np.linalg.norm(simulation.agents[Velocity.xyz], axis=1).max() < 15
    simulation.run(760)
    assert simulation.agents[Position.xyz][:, 2] == pytest.approx(40.0, abs=1.5)


def test_leaders_take_turns():
    simulation = flock(turns=15.0, deviation=0.0)
    leaders = []
    for _ in range(2):
        simulation.run(470)
        leaders.append(int(np.flatnonzero(simulation.agents[Role.leader])[0]))
        assert formation(simulation)[0].tolist() == [4, 3, 2, 1, 0, 1, 2, 3, 4]
    assert leaders[0] != leaders[1]


def test_a_bird_that_dies_leaves_no_gap(formed):
    a = formed.agents
    second = int(a.ids[np.flatnonzero((a[FormationPlace.place] == 1) & (a[FormationPlace.arm] == 1))[0]])
    formed.world.delete_entity(second)
    formed.run(240)
    place, _, x, y, _ = formation(formed)
    assert sorted(place.tolist()) == [0, 1, 1, 2, 2, 3, 3, 4]
    assert y == pytest.approx(-0.8 * np.abs(x), abs=0.3)


def test_when_the_leader_dies_another_leads(formed):
    a = formed.agents
    formed.world.delete_entity(int(a.ids[np.flatnonzero(a[FormationPlace.place] == 0)[0]]))
    formed.run(400)
    place, *_ = formation(formed)
    assert sorted(place.tolist()) == [0, 1, 1, 2, 2, 3, 3, 4]


def test_who_takes_another_brush_forgets_its_place():
    """Birds that are given a brush of the ground come down first; straight down, too, they keep a heading."""
    simulation = flock(height=12.0)
    simulation.world.resource(Palette).add(brush("walk"))
    simulation.run(40)
    simulation.submit(SwitchBrush("walk"), tick=40)
    simulation.run(400)
    a = simulation.agents
    assert (a[FormationPlace.place] == -1).all()
    assert not a[FormationPlace.reference].any()
    assert np.isfinite(a[Position.xyz]).all()
    assert np.hypot(*a[Heading.forward][:, :2].T) == pytest.approx(1.0)


@pytest.mark.parametrize("birds", [1, 2, 3])
def test_one_two_and_three_geese_fly(birds):
    simulation = flock(birds=birds)
    simulation.run(200)
    assert np.isfinite(simulation.agents[Position.xyz]).all()
    assert simulation.agents[Role.leader].sum() == 1
    assert simulation.agents[Velocity.xyz][:, 1].min() > 10


def test_a_gust_scatters_the_flock_and_it_closes_up_again(formed):
    still = formation(formed)
    formed.submit(Gust(5.0, 0.0, 0.0, seconds=2.0, uneven=1.0))
    formed.run(48)
    blown = formation(formed)
    assert np.abs(blown[2] - still[2]).max() > 0.3
    formed.run(320)
    assert formation(formed)[2] == pytest.approx(1.25 * np.arange(-4, 5), abs=0.2)
    assert not formed.agents[FormationPlace.wind].any()


def test_a_gust_blows_at_those_alone_who_fly_in_formation():
    simulation = meadow(geese(), straight("rest", mean=0.0), boundary="open")
    put(simulation, [(0.0, 0.0)], brush="rest")
    put_aloft(simulation, [(0.0, 20.0, 50.0)], brush="geese")
    simulation.submit(Gust(5.0, 0.0, seconds=2.0, uneven=0.0))
    simulation.run(4)
    assert simulation.agents[FormationPlace.gust].any(axis=1).tolist() == [False, True]
    simulation.run(32 * 10)
    for column in (FormationPlace.gust, FormationPlace.wind, FormationPlace.felt):
        assert not simulation.agents[column].any()


def test_a_gust_that_cannot_be_is_refused():
    simulation = flock(birds=2)
    for wrong in (Gust(1.0, 0.0, seconds=0.0), Gust(1.0, 0.0, uneven=2.0), Gust(1.0, 0.0, radius=-1.0)):
        with pytest.raises(ValueError):
            wrong.apply(simulation.world)


@pytest.mark.slow
def test_the_geese_of_the_level_rest_fly_in_a_v_and_land():
    simulation = start("geese")
    agents = simulation.agents
    simulation.run(100)
    assert not agents[Position.xyz][:, 2].any()
    simulation.run(900)
    assert formation_places(simulation) == [*range(10, 0, -1), 0, *range(1, 11)]
    assert simulation.agents[Position.xyz][:, 2].min() > 30
    simulation.run(1850)
    assert len(simulation.agents) == 21
    assert simulation.agents[Position.xyz][:, 2].max() < 0.5
    assert np.linalg.norm(simulation.agents[Velocity.xyz], axis=1).max() < 1.0


def formation_places(simulation):
    """Places from left to right."""
    return formation(simulation)[0].tolist()


def test_a_bird_changes_sides_in_a_level_and_the_others_keep_their_order():
    simulation = flock(switching=0.5, lateral=0.1)
    simulation.run(32 * 50)  # all are in their places
    a = simulation.agents
    before = a[FormationPlace.arm].copy()
    assert sorted(before.tolist()) == [-1] * 5 + [0] + [1] * 3  # as in the first minute
    ways, nearest = [], []
    while simulation.clock.now < 75.0:
        if simulation.clock.now == 62.0:  # one is on its way
            late = snapshot(simulation.world)
        simulation.run(16)
        xyz = a[Position.xyz] / WING
        nearest.append((np.linalg.norm(xyz[:, None] - xyz, axis=2) + 9.0 * np.eye(9)).min())
        ways.append(np.linalg.norm(a[Velocity.xyz], axis=1).max())
    after = a[FormationPlace.arm]
    changed = np.flatnonzero(after != before)
    assert len(changed) == 1 and (before[changed], after[changed]) == (-1, 1)
    place, arm, x, y, z = formation(simulation)
    assert place.tolist() == [4, 3, 2, 1, 0, 1, 2, 3, 4]
    assert y == pytest.approx(-0.8 * np.abs(x), abs=1.0)
    assert min(nearest) > 0.5 and max(ways) < 1.6 * 15.1
    again = flock(switching=0.5, lateral=0.1)
    restore(again.world, late)
    again.run(32 * 13)
    assert state_hash(again.world) == state_hash(simulation.world)
