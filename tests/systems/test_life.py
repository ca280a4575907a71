"""LIVE: births, arrivals, exits, the edge of the world."""

import numpy as np
import pytest
from flockbrush.components import Destination, Position, Species
from flockbrush.levels.schema import Exit, Goal
from flockbrush.systems.life import Nursery, births_due, inside_polygon
from small_herd import box, gaps_of, meadow, put, spawn, straight, xy_of

WALK = straight("walk", mean=2.0)


def goal(name="there", x=30.0, on_arrive="stay", next="", polygon=None):
    return Goal(1, name, np.array([x, 20.0]), 2.0, on_arrive, next, polygon)


def seconds_until(simulation, condition, most=60):
    for k in range(32 * most):
        if condition():
            return k / 32
        simulation.tick()
    raise AssertionError("it never came to that")


# goals ---------------------------------------------------------------------------------


def test_who_arrives_at_a_despawning_goal_leaves_the_world():
    simulation = meadow(WALK, goals=[goal(on_arrive="despawn")])
    put(simulation, [(15, 20), (15, 24)], 0.0)
    when = seconds_until(simulation, lambda: len(simulation.agents) == 0)
    assert when == pytest.approx((30 - 2 - 15) / 2, abs=1.5)


def test_who_arrives_at_a_goal_with_a_next_one_goes_on_to_it():
    first, second = goal("first", on_arrive="next", next="second"), goal("second", 10.0)
    simulation = meadow(WALK, goals=[first, second])
    put(simulation, [(25, 20)], 0.0)
    bound = simulation.agents[Destination.goal]
    assert bound.tolist() == [0]
    seconds_until(simulation, lambda: bound[0] == 1)
    assert xy_of(simulation)[0, 0] == pytest.approx(28, abs=0.2)
    seconds_until(simulation, lambda: xy_of(simulation)[0, 0] < 12)  # turned round


def test_one_goal_is_reached_in_a_tick_in_whatever_order_they_are_listed():
    here = [goal("a", 20.0, "next", "b"), goal("b", 20.0, "next", "a")]
    simulation = meadow(WALK, goals=here)
    put(simulation, [(20, 20)], 0.0)
    for expected in (1, 0, 1):
        simulation.tick()
        assert simulation.agents[Destination.goal].tolist() == [expected]


def test_at_a_dispersing_goal_animals_are_free_and_at_a_staying_one_they_remain_bound():
    for how, bound in (("disperse", -1), ("stay", 0)):
        simulation = meadow(WALK, goals=[goal(on_arrive=how)])
        put(simulation, [(29, 20)], 0.0)
        simulation.run(3)
        assert simulation.agents[Destination.goal].tolist() == [bound]
        assert len(simulation.agents) == 1


def test_a_goal_may_be_an_area():
    area = goal(on_arrive="despawn", polygon=box(28, 0, 32, 40))
    simulation = meadow(WALK, goals=[area])
    put(simulation, [(30, 38), (20, 20)], np.pi)
    simulation.tick()
    assert len(simulation.agents) == 1


def test_whoever_is_bound_elsewhere_walks_through_a_goal():
    simulation = meadow(WALK, goals=[goal("here", 20.0, "despawn"), goal("there", 35.0)])
    put(simulation, [(20, 20), (20, 20.8)], 0.0)
    simulation.agents[Destination.goal][:] = (1, -1)
    simulation.run(4)
    assert len(simulation.agents) == 2


# exits and edges -------------------------------------------------------------------------


def test_at_an_exit_animals_leave_whatever_their_goal():
    simulation = meadow(WALK, exits=[Exit(1, "gate", box(24, 18, 26, 22))])
    stays, leaves = put(simulation, [(20, 30), (20, 20)], 0.0)
    seconds_until(simulation, lambda: len(simulation.agents) == 1)
    assert simulation.agents.ids.tolist() == [stays]
    assert leaves not in simulation.agents
    with pytest.raises(KeyError):
        simulation.world.component_for_entity(leaves, Position)


def test_over_the_edge_of_a_despawning_map_animals_are_gone_and_rows_follow():
    simulation = meadow(WALK, boundary="despawn")
    entities = put(simulation, [(38, 10), (20, 20), (38, 30)], [0.0, 0.0, np.pi])
    simulation.run(40)
    assert simulation.agents.ids.tolist() == entities[1:]
    assert simulation.world.component_for_entity(entities[2], Position).xyz[1] == pytest.approx(30)


# births -------------------------------------------------------------------------------------


def test_a_spawn_with_a_rate_brings_its_animals_in_time_and_number():
    gate = spawn(box(2, 2, 38, 38), "walk", 7, start=1.0, rate=2.0)
    simulation = meadow(WALK, spawns=[gate])
    seen = []
    for _ in range(32 * 6):
        simulation.tick()
        seen.append(len(simulation.agents))
    # the first at 1.0 s, then one every half second, seven in all; a tick ends at (k + 1) / 32 s
    expected = [min(7, max(0, int(((k + 1) / 32 - 1.0) * 2) + 1)) if (k + 1) / 32 >= 1 else 0 for k in range(192)]
    assert seen == expected


def test_a_late_spawn_without_a_rate_comes_all_at_once():
    simulation = meadow(WALK, spawns=[spawn(box(2, 2, 38, 38), "walk", 9, start=1.5, species="wolf")])
    simulation.run(47)
    assert len(simulation.agents) == 0
    simulation.tick()
    assert len(simulation.agents) == 9
    simulation.run(100)
    assert len(simulation.agents) == 9
    assert set(simulation.agents[Species.index].tolist()) == {0}


def test_a_rate_without_a_count_never_ends():
    endless = spawn(box(2, 2, 38, 38), "walk", 0, rate=16.0)
    assert [births_due(endless, t) for t in (0.0, 1.0, 10.0)] == [1, 17, 161]
    simulation = meadow(straight("walk", mean=8.0), spawns=[endless], boundary="despawn")
    simulation.run(320)
    assert simulation.world.resource(Nursery).born[0] == 161
    assert 10 < len(simulation.agents) < 161  # those at the edge have left


def test_when_the_gate_is_full_the_rest_wait_and_nobody_is_born_into_another():
    pen = spawn(box(18, 18, 21, 21), "walk", 40, rate=40.0)
    simulation = meadow(straight("walk", mean=1.0), spawns=[pen])
    full = 0
    for _ in range(32 * 12):
        before = len(simulation.agents)
        simulation.tick()
        full += len(simulation.agents) == before < 40
        if len(simulation.agents) > 1:
            assert gaps_of(simulation).min() > -1e-6
    assert full > 20
    assert len(simulation.agents) == 40  # all came in the end


def test_births_on_the_run_are_like_births_at_the_start():
    now = meadow(WALK, spawns=[spawn(box(5, 5, 35, 35), "walk", 20, None)])
    later = meadow(WALK, spawns=[spawn(box(5, 5, 35, 35), "walk", 20, None, start=1.0)])
    later.run(32)
    for simulation in (now, later):
        assert len(simulation.agents) == 20
        assert gaps_of(simulation).min() > 0
        assert ((xy_of(simulation) > 5) & (xy_of(simulation) < 35)).all()


def test_inside_polygon_is_what_it_says():
    l_shape = np.array([(0, 0), (4, 0), (4, 1), (1, 1), (1, 4), (0, 4)], float)
    points = np.random.default_rng(1).uniform(-1, 5, (500, 2))
    x, y = points.T
    expected = ((x >= 0) & (x < 4) & (y >= 0) & (y < 1)) | ((x >= 0) & (x < 1) & (y >= 0) & (y < 4))
    assert np.array_equal(inside_polygon(points, l_shape), expected)
