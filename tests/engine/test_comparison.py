"""Two states side by side."""

import numpy as np
import pytest
from flockbrush.components.agent import Heading, Position, Velocity
from flockbrush.engine.state import StateError, snapshot
from flockbrush.engine.state_comparison import SHOWN, compare
from small_meadow import Births, Whistle, meadow, submit


def apart(change, animals=5):
    """What differs after a change to a meadow."""
    world, step = meadow(animals)
    step()
    one = snapshot(world)
    change(world)
    return {d.part: d for d in compare(world, one, snapshot(world))}


def test_the_same_state_differs_in_nothing():
    assert apart(lambda world: None) == {}


def test_columns_animals_and_values_are_named():
    def change(world):
        world.agents[Position.xyz][1] += (0, 0, 2)
        world.agents[Position.xyz][3] += (0, -5, 0)
        world.agents[Velocity.xyz][4, 0] = np.nextafter(world.agents[Velocity.xyz][4, 0], 9)

    found = apart(change)
    assert list(found) == ["Position.xyz", "Velocity.xyz"]
    position = found["Position.xyz"]
    assert (position.count, position.ids) == (2, [4, 2])  # the largest difference first
    assert position.largest == pytest.approx(5)
    assert position.other[0][1] - position.one[0][1] == pytest.approx(-5)
    assert found["Velocity.xyz"].ids == [5]
    assert 0 < found["Velocity.xyz"].largest < 1e-14


def test_zeros_of_two_signs_are_not_the_same_and_no_number_is_far_from_any():
    def change(world):
        world.agents[Heading.forward][0, 2] = -0.0
        world.agents[Velocity.xyz][2, 2] = np.nan

    found = apart(change)
    assert (found["Heading.forward"].ids, found["Heading.forward"].largest) == ([1], 0.0)
    assert (found["Velocity.xyz"].ids, found["Velocity.xyz"].largest) == ([3], np.inf)


def test_who_lives_in_one_state_only_is_named_and_the_others_are_compared():
    def change(world):
        world.delete_entity(2)
        world.agents[Position.xyz][4, 0] += 1

    found = apart(change)
    assert (found["ids"].count, found["ids"].ids) == (1, [2])
    assert (found["ids"].one, found["ids"].other) == (["lives"], ["not alive"])
    assert found["Position.xyz"].ids == [5]


def test_many_animals_are_counted_and_some_are_shown():
    found = apart(lambda world: world.agents[Position.xyz].__iadd__(1), animals=50)["Position.xyz"]
    assert (found.count, len(found.ids), len(found.one)) == (50, SHOWN, SHOWN)


def test_of_a_resource_it_is_shown_where_it_differs():
    found = apart(lambda world: setattr(world.resource(Births), "count", 12))["resource Births"]
    assert (found.one, found.other, found.count) == (["0"], ["12"], None)


def test_what_waits_is_no_part_of_what_a_herd_is():
    assert apart(lambda world: submit(world, Whistle(1.0), tick=90)) == {}


def test_what_is_no_snapshot_is_refused():
    world, _ = meadow()
    with pytest.raises(StateError):
        compare(world, snapshot(world), b"nothing")
