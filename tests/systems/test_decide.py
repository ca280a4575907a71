"""DECIDE: who leads, by whom one keeps one's place, and what is remembered."""

import numpy as np
import pytest
from flockbrush.components import Heading, Memory, ReferenceBird, Role
from flockbrush.levels.schema import Goal, Guide
from small_herd import box, brush, meadow, obstacle, put, straight, xy_of

CALM = brush("calm", mean=0.0, body={"radius": 0.1})


def roles(simulation):
    simulation.tick()
    return simulation.agents[Role.leader].tolist()


@pytest.mark.parametrize(("others", "leads"), [(0, 1), (1, 1), (2, 1), (3, 0), (6, 0)])
def test_who_sees_at_most_two_of_its_kind_leads(others, leads):
    simulation = meadow(CALM)
    angle = np.linspace(0, 5, others) if others else np.zeros(0)
    put(simulation, [(20, 20), *np.column_stack([20 + 3 * np.cos(angle), 20 + 3 * np.sin(angle)])])
    assert roles(simulation)[0] == leads


def test_other_kinds_those_out_of_range_and_the_hidden_do_not_count():
    simulation = meadow(CALM, obstacles=[obstacle(box(17, 18, 17.5, 22))])
    put(simulation, [(20, 20), (22, 20), (20, 22)])
    put(simulation, [(20, 17), (22, 17.5)], species="dog")
    put(simulation, [(20, 24.5), (25, 20.5), (16.5, 20)])  # too far, too far, behind a rock
    put(simulation, [(23.2, 20.0)])  # in range, and hidden behind the one at (22, 20)
    assert roles(simulation)[0] == 1
    put(simulation, [(18.5, 21.5)])
    assert roles(simulation)[0] == 0


def test_with_the_rule_off_nobody_leads_and_with_a_larger_number_more_do():
    for limit, leads in ((-1, 0), (0, 0), (3, 1), (100, 1)):
        simulation = meadow(brush("calm", mean=0.0, body={"radius": 0.1}, leader_neighbours=limit))
        put(simulation, [(20, 20), (22, 20), (20, 22), (18, 20)])
        assert roles(simulation)[0] == leads


def test_with_a_cone_the_front_row_leads_and_those_behind_it_do_not():
    for cone, leaders in ((120.0, [1, 1, 1, 0, 0, 0]), (360.0, [0] * 6)):
        calm = brush("calm", mean=0.0, body={"radius": 0.05}, leader_cone=cone, leader_neighbours=0)
        simulation = meadow(calm)
        put(simulation, [(20, 18), (20, 19.5), (20, 21), (18.5, 18), (18.5, 19.5), (18.5, 21)], 0.0)
        assert roles(simulation) == leaders


def test_the_reference_bird_is_the_nearest_in_the_front_half():
    simulation = meadow(CALM)
    me, ahead, _behind, far, _side = put(simulation, [(20, 20), (22, 20.5), (19, 20), (23.5, 19), (20, 21)], 0.0)
    simulation.tick()
    world = simulation.world
    assert world.component_for_entity(me, ReferenceBird).entity == ahead
    simulation.agents[Heading.forward][:] = (0.0, -1.0, 0.0)
    simulation.tick()
    assert world.component_for_entity(me, ReferenceBird).entity == far


def test_nobody_ahead_is_no_reference():
    simulation = meadow(CALM)
    me, _ = put(simulation, [(20, 20), (19, 20)], 0.0)
    simulation.tick()
    assert simulation.world.component_for_entity(me, ReferenceBird).entity == 0


def test_animals_remember_where_they_last_saw_others():
    walk = straight(mean=2.0)
    simulation = meadow(CALM, walk)
    put(simulation, [(20, 20), (20, 21), (20, 22)], brush="calm")
    (leaver,) = put(simulation, [(21.5, 21)], 0.0, brush=walk.name)
    memory = simulation.world.component_for_entity(leaver, Memory)
    assert memory.known == 0
    simulation.run(32 * 5)
    assert memory.known == 1
    assert memory.herd == pytest.approx((20, 21), abs=0.7)
    assert xy_of(simulation)[3, 0] > 30


def test_on_a_wrapped_map_the_way_back_may_lead_across_the_seam():
    stray = brush("stray", mean=1.0, slope_aversion=0.0)
    simulation = meadow(stray, width=40, height=40, boundary="wrap")
    (entity,) = put(simulation, [(1.0, 20.0)], np.pi / 2)
    memory = simulation.world.component_for_entity(entity, Memory)
    memory.herd, memory.known = (35.0, 20.0), 1  # 6 m to the west across the seam, 34 to the east
    simulation.run(40)
    assert simulation.world.component_for_entity(entity, Heading).forward[0] < -0.7


def test_leaders_find_their_way_out_of_a_u_shaped_wall_to_the_goal():
    u = np.array([(12, 10), (30, 10), (30, 30), (12, 30), (12, 29), (29, 29), (29, 11), (12, 11)], float)
    goal = Goal(1, "out", np.array([36.0, 20.0]), 1.5, "despawn", "")
    seeker = brush("seeker", mean=3.0)
    simulation = meadow(seeker, goals=[goal], obstacles=[obstacle(u)], boundary="wall")
    put(simulation, [(26, 14), (26, 20), (27.5, 26)], 0.0)
    assert roles(simulation) == [1, 1, 1]
    west = xy_of(simulation)[:, 0]
    for _ in range(32 * 40):
        simulation.tick()
        if not len(simulation.agents):
            break
        west = np.minimum(west[: len(simulation.agents)], xy_of(simulation)[:, 0])
    assert len(simulation.agents) == 0  # all arrived
    assert west.min() < 12.5  # round the open end


def test_followers_come_along_behind_leaders_on_a_guide():
    guide = Guide(1, "way", np.array([(5, 20), (75, 20)], float), 1.0, 30.0, 5.0, "", False)
    herd = brush("herd", mean=2.0, cohesion_weight=0.15, alignment_weight=0.3)
    simulation = meadow(herd, width=80, guides=[guide])
    put(simulation, np.random.default_rng(1).uniform((10, 15), (20, 25), (25, 2)), np.arange(25.0))
    simulation.run(32 * 12)
    assert simulation.agents[Heading.forward][:, 0].mean() > 0.9
    assert (simulation.agents[Role.leader] == 0).any()
    assert xy_of(simulation)[:, 0].mean() > 28
