"""Worlds: animals as rows and as windows on rows, through births and deaths."""

import copy
import gc
import pickle
import sys
import threading
import time
import tracemalloc
from dataclasses import dataclass

import esper
import numpy as np
import pytest
from flockbrush.components.agent import AGENT, Body, Position, Role, Velocity
from flockbrush.engine.columns import Component, Field
from flockbrush.engine.world import World


@dataclass
class Waterhole:
    litres: float


@dataclass
class Bell:
    tone: str


@pytest.fixture
def world():
    world = World((Position, Velocity, Role))
    yield world
    world.close()


def five(world):
    return world.create_agents(5, {Position.xyz: np.arange(15.0).reshape(5, 3)})


def test_a_component_is_the_same_object_before_and_after_its_birth(world):
    here = Position(xyz=(3, 4, 0))
    here.xyz[2] = 7
    sheep = world.create_entity(here)
    assert world.component_for_entity(sheep, Position) is here
    here.xyz += (1, 0, 0)
    assert world.agents[Position.xyz].tolist() == [[4, 4, 7]]


def test_writing_to_one_animal_is_seen_in_the_columns(world):
    ids = five(world)
    where = world.component_for_entity(ids[2], Position)
    where.xyz[0] = 3
    where.xyz += 0.5
    world.component_for_entity(ids[2], Role).leader = 1
    assert world.agents[Position.xyz][2].tolist() == [3.5, 7.5, 8.5]
    assert world.agents[Role.leader].tolist() == [0, 0, 1, 0, 0]


def test_writing_to_the_columns_is_seen_in_one_animal(world):
    ids = five(world)
    world.agents[Velocity.xyz][3] = (1, 2, 3)
    assert world.component_for_entity(ids[3], Velocity).xyz.tolist() == [1, 2, 3]


def test_handles_follow_their_rows_through_deaths(world):
    ids = five(world)
    last = world.component_for_entity(ids[-1], Position)
    world.delete_entity(ids[0])
    world.delete_entity(ids[2])
    assert len(world.agents) == 5
    world.flush()
    assert last.xyz.tolist() == [12, 13, 14]
    assert world.agents.ids.tolist() == [ids[1], ids[3], ids[4]]


def test_handles_follow_their_rows_through_growth(world):
    first = world.component_for_entity(five(world)[0], Position)
    world.create_agents(5000, {})
    first.xyz[1] = 9
    assert world.agents[Position.xyz][0].tolist() == [0, 9, 2]


def test_births_after_deaths_keep_the_order_of_ids(world):
    ids = five(world)
    world.delete_entity(ids[4])
    world.flush()
    more = world.create_agents(2, {})
    assert more[0] > ids[4]
    assert world.agents.ids.tolist() == sorted(ids[:4] + more)
    assert world.agents[Position.xyz][4:].tolist() == [[0, 0, 0]] * 2


def test_births_into_rows_of_the_dead_have_defaults_in_every_column(world):
    ids = five(world)
    for column in world.agents.arrays:
        world.agents[column][:] = 1
    for entity in ids[1:]:
        world.delete_entity(entity)
    world.flush()
    world.create_agents(1000, {})
    for column in world.agents.arrays:
        assert (world.agents[column][0] == 1).all()
        assert (world.agents[column][1:] == column.default).all()


def test_rows_keep_their_bits_through_growth(world):
    five(world)
    world.agents[Velocity.xyz][:] = -0.0
    world.create_agents(5000, {})
    assert np.signbit(world.agents[Velocity.xyz][:5]).all()
    assert not np.signbit(world.agents[Velocity.xyz][5:]).any()


def test_the_dead_are_named_when_asked_for(world):
    ids = five(world)
    window = world.component_for_entity(ids[1], Position)
    world.delete_entity(ids[1])
    world.delete_entity(ids[1])  # two wolves, one sheep
    assert not world.entity_exists(ids[1])
    world.flush()
    with pytest.raises(KeyError, match=f"agent {ids[1]} is not alive"):
        _ = window.xyz
    with pytest.raises(KeyError, match="no entity"):
        world.component_for_entity(ids[1], Position)
    with pytest.raises(KeyError, match="no entity"):
        world.delete_entity(ids[1])


def test_a_herd_may_die_out_and_come_back(world):
    for entity in five(world):
        world.delete_entity(entity)
    world.flush()
    assert (len(world.agents), world.get_component(Position)) == (0, [])
    ids = five(world)
    assert [entity for entity, _ in world.get_component(Position)] == ids


def test_worlds_of_several_threads_keep_apart():
    """As when the playground runs a tick and draws the thumbnail of a brush, which is a herd of its own."""
    every, wrong = sys.getswitchinterval(), []

    def live(litres):
        try:
            world = World((Position,))
            for k in range(150):
                ids = world.create_agents(3, {Position.xyz: (k, 0, 0)})
                hole = world.create_entity(Waterhole(litres))
                world.delete_entity(ids[0])
                world.flush()
                assert world.component_for_entity(hole, Waterhole).litres == litres
            assert {hole.litres for _, hole in world.get_component(Waterhole)} == {litres}
            assert len(world.agents) == len(world.get_component(Position)) == 300
            world.close()
        except Exception as error:  # noqa: BLE001  told by the thread that waits
            wrong.append(error)

    sys.setswitchinterval(1e-6)
    try:
        threads = [threading.Thread(target=live, args=(float(k),)) for k in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(120)
    finally:
        sys.setswitchinterval(every)
    assert not wrong and not any(thread.is_alive() for thread in threads)


def test_obstacles_are_plain_entities(world):
    hole = world.create_entity(Waterhole(90.0))
    five(world)
    assert world.component_for_entity(hole, Waterhole).litres == 90
    assert len(world.agents) == 5
    assert world.plain_entities() == [hole]


def test_an_animal_may_wear_a_bell(world):
    wether = world.create_entity(Position(), Bell("low"))
    five(world)
    assert world.component_for_entity(wether, Bell).tone == "low"
    assert [entity for entity, _ in world.get_component(Bell)] == [wether]
    assert world.component_for_entity(wether, Velocity).xyz.tolist() == [0, 0, 0]


def test_esper_itself_finds_every_animal(world):
    ids = five(world)
    world.create_entity(Waterhole(1.0))
    assert sorted(entity for entity, _ in esper.get_components(Position, Velocity)) == ids
    assert esper.has_components(ids[0], Position, Role)
    assert not esper.has_component(ids[0], Waterhole)
    assert [type(c) for c in esper.components_for_entity(ids[0])] == [Position, Velocity, Role]


def test_a_component_belongs_to_one_animal(world):
    here = Position()
    world.create_entity(here)
    with pytest.raises(ValueError, match="belongs to agent 1"):
        world.create_entity(here)


def test_mistakes_are_told_in_words(world):
    with pytest.raises(TypeError, match="Position has no field 'x'; it has xyz"):
        Position(x=3)
    with pytest.raises(AttributeError, match="Position has no field 'xy'; it has xyz"):
        Position().xy = 3
    with pytest.raises(ValueError, match=r"Position.xyz holds an array of shape \(3,\), got"):
        Position(xyz=(1, 2))
    with pytest.raises(ValueError, match="must be finite"):
        Position(xyz=(1, np.nan, 2))
    with pytest.raises(ValueError, match="whole numbers"):
        Role(leader=0.5)
    with pytest.raises(ValueError, match="uint8"):
        Role(leader=300)
    with pytest.raises(TypeError, match="no columns for Body"):
        world.create_entity(Body())
    with pytest.raises(KeyError, match="no column Body.length"):
        _ = world.agents[Body.length]
    with pytest.raises(LookupError, match="no Bell in .*; resources: Waterhole"):
        world.insert(Waterhole(1))
        world.resource(Bell)
    with pytest.raises(KeyError, match="has no Bell; it has Position, Velocity, Role"):
        world.component_for_entity(five(world)[0], Bell)


@pytest.mark.parametrize("wrong", [{Position.xyz: np.nan}, {Position.xyz: np.zeros((4, 3))}, {Body.length: 1}])
def test_a_birth_that_fails_leaves_nobody_behind(world, wrong):
    with pytest.raises((ValueError, KeyError)):
        world.create_agents(5, wrong)
    assert len(world.agents) == 0
    assert world.next_entity == 1


def test_components_inherit_columns():
    class Marked(Component):
        number = Field(0, np.int32)

    class Tagged(Marked):
        colour = Field(1.5)

    world = World((Tagged,))
    world.create_entity(Tagged(number=3))
    assert (world.agents[Marked.number].tolist(), world.agents[Tagged.colour].tolist()) == ([3], [1.5])
    assert list(Marked.fields) == ["number"]


def test_forgotten_worlds_leave_esper():
    before = len(esper.list_worlds())
    for _ in range(20):
        World((Position,)).create_agents(3, {})
    gc.collect()
    World((Position,)).close()
    assert len(esper.list_worlds()) <= before + 1


def test_a_hundred_thousand_animals_are_light():
    """Under 100 MB with all their columns, and not one object an animal and component."""
    tracemalloc.start()
    begin = time.perf_counter()
    world = World(AGENT)
    world.create_agents(100_000, {Position.xyz: np.zeros((100_000, 3))})
    seconds, (size, _) = time.perf_counter() - begin, tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert size < 100e6
    assert seconds < 15  # a tenth of a second without tracing; a loop over all components takes minutes
    assert world.component_for_entity(int(world.agents.ids[77_777]), Position).xyz.tolist() == [0, 0, 0]
    world.close()


def test_a_copy_of_a_world_has_its_entities_and_lives_by_itself(world):
    ids, hole, marked = five(world), world.create_entity(Waterhole(3.0)), world.create_entity(Bell("c"))
    belled = world.create_entity(Position(xyz=(1, 2, 3)), Bell("a"))
    world.delete_entity(ids[1])
    world.delete_entity(marked)
    for other in (copy.deepcopy(world), pickle.loads(pickle.dumps(world)), copy.copy(world)):
        assert other.name != world.name and not other.entity_exists(ids[1]) and other.next_entity == world.next_entity
        other.flush()
        assert other.agents.ids.tolist() == [*ids[:1], *ids[2:], belled] and other.plain_entities() == [hole]
        other.component_for_entity(hole, Waterhole).litres = 1.0
        other.component_for_entity(belled, Position).xyz[0] = 9
        assert (other.agents[Position.xyz][-1, 0], other.component_for_entity(belled, Bell).tone) == (9, "a")
        assert [entity for entity, _ in other.get_component(Bell)] == [belled]
        other.close()
    assert world.component_for_entity(hole, Waterhole).litres == 3.0
    assert (len(world.agents), world.agents[Position.xyz][-1, 0]) == (6, 1)
