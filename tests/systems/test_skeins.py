"""Skeins of one brush that arrive apart: two formations that meet, pass or join by what their birds see."""

import numpy as np
import pytest
from flockbrush.components import FormationPlace, Heading, Position, Role, Velocity
from flockbrush.components.formation import Lost
from flockbrush.systems.commands import Migrate, RemoveAnimals
from flockbrush.systems.groups import groups_of
from flockbrush.systems.initiation import random_flock
from flockbrush.systems.skeins import skeins
from small_herd import brush, meadow, put

WING = 1.7 * 0.9  # m


def sky(*flocks, shuffle_seed=None, **parameters):
    """Flocks of geese over an endless plain: each (birds, east, north, heading in degrees)."""
    kind = brush("geese", model="line_formation", mean=16.7, body={"length": 0.9, "radius": 0.2},
                 vision={"range": 60.0}, transition=0.0, deviation=0.0, **parameters)  # fmt: skip
    simulation = meadow(kind, boundary="open", shuffle_seed=shuffle_seed)
    for birds, east, north, heading in flocks:
        x, y, off = random_flock(birds, 3)
        put(simulation, np.c_[x * WING + east, y * WING + north], np.radians(heading) - 0.5 * off)
    a = simulation.agents
    a[Position.xyz][:, 2] = 50.0
    a[Velocity.xyz][:] = 15.0 * a[Heading.forward]
    for birds, east, north, heading in flocks:
        way = np.cos(np.radians(heading)), np.sin(np.radians(heading))
        simulation.submit(Migrate(*way, 0.0, kind="direction", at_x=east, at_y=north, radius=3.0 * WING * birds**0.5))
    return simulation


def arms(simulation, rows):
    """Places of these birds, sorted."""
    return np.sort(simulation.agents[FormationPlace.place][rows]).tolist()


def nearest(simulation):
    xyz = simulation.agents[Position.xyz]
    return np.sort(np.linalg.norm(xyz[:, None] - xyz, axis=2) / WING, axis=1)[:, 1].min()


def test_two_skeins_that_arrive_apart_fly_two_formations():
    simulation = sky((9, 0, 0, 90), (7, 200, 0, 90))
    simulation.run(300)
    assert arms(simulation, slice(0, 9)) == [0, 1, 1, 2, 2, 3, 3, 4, 4]
    assert arms(simulation, slice(9, 16)) == [0, 1, 1, 2, 2, 3, 3]
    assert simulation.agents[Role.leader].sum() == 2
    assert groups_of(simulation.world).tolist() == [1] * 9 + [10] * 7


def test_a_flock_far_away_changes_nothing_of_a_skein():
    alone, two = sky((9, 0, 0, 90)), sky((9, 0, 0, 90), (5, 900, 0, 90))
    alone.run(150)
    two.run(150)
    assert (two.agents[Position.xyz][:9] == alone.agents[Position.xyz]).all()


def test_skeins_that_see_each_other_on_like_ways_join_behind_the_foremost_leader():
    simulation = sky((9, 0, 0, 80), (7, 130, 30, 100))
    simulation.run(300)
    a = simulation.agents
    leaders = np.flatnonzero(a[FormationPlace.place] == 0)
    assert len(leaders) == 2
    foremost = a.ids[leaders[np.argmax(a[Position.xyz][leaders, 1])]]
    simulation.run(420)
    assert a.ids[np.flatnonzero(a[FormationPlace.place] == 0)].tolist() == [foremost]
    assert arms(simulation, slice(None)) == [0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7, 8]
    assert len(set(groups_of(simulation.world).tolist())) == 1


@pytest.mark.parametrize(("flocks", "meets"), [
    (((9, 0, 0, 70), (7, 110, 0, 110)), "pass"),
    (((9, 0, 0, 60), (7, 165, 260, 240)), "join"),  # head on
])  # fmt: skip
def test_skeins_pass_as_their_brush_says_or_where_they_fly_different_ways(flocks, meets):
    simulation = sky(*flocks, meets=meets)
    a, least, met = simulation.agents, np.inf, False
    for _ in range(66):
        simulation.run(8)
        least = min(least, nearest(simulation))
        met |= np.linalg.norm(a[Position.xyz][:9, None] - a[Position.xyz][9:], axis=2).min() < 20.0
        assert (a[FormationPlace.place] == 0).sum() == 2
    assert met
    assert least > 0.5
    assert arms(simulation, slice(0, 9)) == [0, 1, 1, 2, 2, 3, 3, 4, 4]
    assert arms(simulation, slice(9, 16)) == [0, 1, 1, 2, 2, 3, 3]
    assert len(set(groups_of(simulation.world).tolist())) == 2


def test_a_leader_that_dies_is_followed_by_one_of_its_own_and_a_late_bird_joins_whom_it_sees():
    simulation = sky((9, 0, 0, 90), (7, 200, 0, 90))
    simulation.run(250)
    a = simulation.agents
    ids, place, xyz = a.ids.copy(), a[FormationPlace.place].copy(), a[Position.xyz].copy()
    first, second = np.flatnonzero(place == 0)
    simulation.submit(RemoveAnimals(*xyz[first, :2], 0.3), tick=250)
    put(simulation, [xyz[second, :2] + (10, -25)], np.pi / 2)
    a[Position.xyz][-1, 2], a[Velocity.xyz][-1] = 50.0, (0.0, 15.0, 0.0)
    simulation.run(450)
    assert len(a) == 16
    assert arms(simulation, slice(0, 8)) == [0, 1, 1, 2, 2, 3, 3, 4]
    assert arms(simulation, slice(8, 16)) == [0, 1, 1, 2, 2, 3, 3, 4]
    assert a.ids[8:][a[FormationPlace.place][8:] == 0].tolist() == [ids[second]]


def test_who_is_seen_by_two_skeins_does_not_make_them_one():
    sees = np.zeros((5, 5), bool)
    sees[4] = [True, True, True, True, False]
    xy = np.array([(0, 0), (1, -1), (30, 0), (31, -1), (14, 0)], float)
    reference, place = np.array([-1, 0, -1, 2, -1]), np.array([0, 1, 0, 1, -1])
    label, leads = skeins(xy, np.tile((0.0, 1.0), (5, 1)), reference, place, sees, sees)
    assert label[0] == label[1] == label[4] != label[2] == label[3]
    assert leads.tolist() == [True, False, True, False, False]
    label, _ = skeins(xy, np.tile((0.0, 1.0), (5, 1)), reference, place, sees, sees, (40.0, 40.0))
    assert label[4] == label[0]


@pytest.mark.parametrize("bound", [
    Migrate(1.0, 0.0, 0.0, kind="direction"), Migrate(400.0, 100.0, 50.0, kind="point"), None
])  # fmt: skip
def test_who_lost_its_skein_knows_where_that_flies_to_where_they_are_bound(bound):
    simulation = sky((5, 0, 0, 90))
    simulation.run(200)
    a = simulation.agents
    north = np.tile((-np.sin(0.3), np.cos(0.3), 0.0), (5, 1))
    a[Heading.forward][:], a[Velocity.xyz][:] = north, 25.0 * north  # as in a fright
    simulation.submit(bound or Migrate(*north[0], kind="direction"))
    simulation.run(2)
    leader = int(np.flatnonzero(a[FormationPlace.place] == 0)[0])
    lost = (leader + 1) % 5
    a[Position.xyz][lost, :2] -= 600.0
    simulation.run(320)
    assert a[Lost.entity][lost] == a.ids[leader]
    assert a[Lost.ticks][lost] > 300
    assert np.linalg.norm(a[Lost.place][lost] - a[Position.xyz][leader, :2]) < 12.0  # of 150 m flown
