"""States: the same hash for the same herd, another for any other; snapshots that go on as if nothing had been."""

import numpy as np
import pytest
from flockbrush.components.agent import Body, Position, Role
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import Commands
from flockbrush.engine.noise import Noise
from flockbrush.engine.recording import StateError, restore, snapshot, state_hash
from flockbrush.engine.state import pieces
from flockbrush.engine.world import World
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_meadow import Births, Whistle, meadow, submit


class Well:
    """A plain thing with a state."""

    def __init__(self, litres):
        self.litres = litres

    def state(self):
        return str(self.litres).encode()

    def set_state(self, data):
        self.litres = int(data)


def walked(ticks):
    world, step = meadow()
    for _ in range(ticks):
        step()
    return world, step


def test_the_same_herd_has_the_same_hash():
    assert state_hash(walked(9)[0]) == state_hash(walked(9)[0])
    assert len(state_hash(walked(0)[0])) == 16


@pytest.mark.parametrize(
    "touch",
    [
        lambda world: world.agents[Position.xyz].__setitem__(
            (2, 1), np.nextafter(world.agents[Position.xyz][2, 1], 9e9)
        ),
        lambda world: world.agents[Role.leader].__setitem__(0, 1),
        lambda world: setattr(world.resource(Clock), "tick", 4),
        lambda world: setattr(world.resource(Noise), "seed", 4),
        lambda world: setattr(world.resource(Births), "count", 1),
        lambda world: world.create_entity(Well(3)),
        lambda world: (world.delete_entity(3), world.flush()),
        lambda world: (world.create_agents(1, {}), world.delete_entity(6), world.flush()),  # only the next id differs
    ],
)
def test_any_difference_is_another_hash(touch):
    world, _ = meadow()
    before = state_hash(world)
    touch(world)
    assert state_hash(world) != before


@pytest.mark.parametrize("row", [0, 1, 2, 3, 4, 5, 6])
def test_an_exchange_of_two_animals_is_another_hash(row):
    world, _ = meadow(animals=8)
    before, xyz = state_hash(world), world.agents[Position.xyz]
    xyz[[row, row + 1]] = xyz[[row + 1, row]]
    assert state_hash(world) != before


def test_what_still_waits_to_be_commanded_is_no_part_of_the_herd():
    """A replay knows the commands from the first tick, the run learned them one by one."""
    world, _ = meadow()
    before = state_hash(world)
    submit(world, Whistle(1.0), 50)
    assert state_hash(world) == before


def test_a_snapshot_goes_on_as_if_nothing_had_been():
    world, step = walked(10)
    submit(world, Whistle(3.0), 12)
    kept, then = snapshot(world), []
    for _ in range(9):
        step()
        then.append((state_hash(world), world.agents.ids.tolist()))
    other, step = walked(3)
    restore(other, kept)
    again = []
    for _ in range(9):
        step()
        again.append((state_hash(other), other.agents.ids.tolist()))
    assert again == then
    assert other.resource(Commands).log == [(12, Whistle(3.0))]


def test_a_snapshot_brings_back_the_dead_and_takes_the_unborn():
    world, step = walked(0)
    kept, before = snapshot(world), state_hash(world)
    window = world.component_for_entity(4, Position)
    dying = world.component_for_entity(1, Position)
    for _ in range(9):
        step()
    world.delete_entity(4)
    restore(world, kept)
    assert state_hash(world) == before
    assert world.agents.ids.tolist() == [1, 2, 3, 4, 5]
    assert window.xyz.tolist() == [9, 10, 11]
    assert dying.xyz.tolist() == world.component_for_entity(1, Position).xyz.tolist() == [0, 1, 2]
    assert [entity for entity, _ in world.get_component(Body)] == [1, 2, 3, 4, 5]
    assert world.create_agents(1, {}) == [6]


def test_plain_things_come_back_too():
    def with_wells():
        world = World((Position,))
        world.create_entity(Well(5))
        world.create_agents(2, {})
        world.create_entity(Well(6))
        return world

    world, other = with_wells(), with_wells()
    world.component_for_entity(4, Well).litres = 1
    world.delete_entity(1)
    restore(other, snapshot(world))
    assert state_hash(other) == state_hash(world)
    assert [well.litres for _, well in other.get_component(Well)] == [1]


def test_an_empty_world_has_a_snapshot():
    world, other = World((Position,)), World((Position,))
    other.create_agents(3, {})
    restore(other, snapshot(world))
    assert (len(other.agents), other.next_entity) == (0, 1)


def test_a_snapshot_of_another_kind_of_world_is_refused():
    world, _ = meadow()
    plain = World((Position,))
    before = state_hash(world)
    with pytest.raises(StateError, match=r"column \w+\.\w+ differs"):
        restore(world, snapshot(plain))
    plain.create_entity(Well(1))
    with pytest.raises(StateError, match=r"entity 1 \(Well\) is not in this one"):
        restore(World((Position,)), snapshot(plain))
    with pytest.raises(StateError, match="no snapshot"):
        restore(world, b"hello")
    assert state_hash(world) == before


def test_a_resource_that_refuses_leaves_the_world_as_it_was():
    world, step = meadow()
    kept, before = snapshot(world).replace(b"0", b"x"), state_hash(world)  # the births are no number any more
    for _ in range(2):
        with pytest.raises(StateError):
            restore(world, kept)
    assert state_hash(world) == before
    step()


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_snapshot_with_any_byte_changed_is_taken_or_refused(data):
    """Whatever the bytes: a state or a StateError, and a world that lives on."""
    world, _ = FUZZED
    kept = bytearray(KEPT)
    if data.draw(st.booleans()):
        at = data.draw(st.integers(0, min(1500, len(kept) - 1)))
        kept[at] ^= data.draw(st.integers(1, 255))
    else:
        del kept[data.draw(st.integers(0, len(kept) - 1)) :]
    before = state_hash(world)
    try:
        restore(world, bytes(kept))
    except StateError:
        assert state_hash(world) == before
    else:
        restore(world, KEPT)
        assert state_hash(world) == before


FUZZED = walked(6)
KEPT = snapshot(FUZZED[0])


def test_a_snapshot_cut_into_pieces_is_the_same_snapshot():
    data = snapshot(walked(2)[0])
    assert len(pieces(data)) > 5 and b"".join(pieces(data)) == data
