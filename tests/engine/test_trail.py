"""Sums of a state, tick by tick: what differs, and which animal, when it is one."""

import numpy as np
import pytest
from flockbrush.components.agent import Heading, Position, Velocity
from flockbrush.engine.commands import Commands
from flockbrush.engine.state import state_hash
from flockbrush.engine.trail import Trail, TrailError, as_row, only_row, rows_in, state_at, traces, values_of
from hypothesis import given
from hypothesis import strategies as st
from small_meadow import Births, Whistle, meadow, submit


def values(world):
    marks = {}
    state_hash(world, marks)
    return values_of(world, marks | traces(world))


def value(column):
    """What a trail keeps of a column, by way of a world."""
    world, _ = meadow(len(column))
    world.agents[Position.xyz][:] = column
    return values(world)["Position.xyz"]


def test_the_marks_change_nothing_of_the_hash():
    world, step = meadow()
    for _ in range(6):
        marks = {}
        assert state_hash(world, marks) == state_hash(world)
        assert {"ids", "entities", "Position.xyz", "resource Clock", "resource Births"} <= set(marks)
        step()


def test_records_add_up_to_the_state_of_every_tick():
    world, step = meadow(8)
    trail, records = Trail(), []
    for tick in range(12):
        marks = {}
        state_hash(world, marks)
        records.append(trail.record(world, marks))
        assert state_at(records) == values(world), tick
        step()
    assert state_at(records[:5]) != state_at(records[:4])


def test_a_record_holds_only_what_has_changed():
    world, _ = meadow()
    trail, marks = Trail(), {}
    state_hash(world, marks)
    first = trail.record(world, marks)
    assert trail.record(world, marks) == b""
    world.agents[Velocity.xyz][0, 0] += 1
    state_hash(world, marks)
    assert len(first) > 1000 > len(trail.record(world, marks)) > 30


def test_a_part_that_is_gone_is_gone():
    world, _ = meadow()
    trail, marks = Trail(), {}
    state_hash(world, marks)
    records = [trail.record(world, marks)]
    del marks["resource Births"]
    records.append(trail.record(world, marks))
    assert "resource Births" in state_at(records[:1])
    assert "resource Births" not in state_at(records)


@pytest.mark.parametrize("row", [0, 1, 250, 499])
@pytest.mark.parametrize("change", [1e-16, -1e300, 4e-320, np.nan, -0.0])
def test_one_animal_that_differs_is_found_with_its_value_to_the_last_bit(row, change):
    rng = np.random.default_rng(row)
    then = rng.normal(0, 50, (500, 3))
    now = then.copy()
    now[row, 1] = change
    now[row, 2] = np.nextafter(now[row, 2], 1e9)
    found, words = only_row(value(then), now)
    assert found == row
    assert as_row(words, now).tobytes() == then[row].tobytes()


@given(st.lists(st.floats(width=64, allow_nan=False), min_size=2, max_size=30), st.data())
def test_whatever_is_found_is_true(numbers, data):
    """Also where words have many zeros at their end, as small whole numbers do: nothing is better than a wrong row."""
    then = np.zeros((len(numbers), 3))
    then[:, 0] = numbers
    now = then.copy()
    row = data.draw(st.integers(0, len(numbers) - 1))
    now[row, 0] = data.draw(st.floats(width=64, allow_nan=False))
    found = only_row(value(then), now)
    if found is not None:
        assert found[0] == row
        assert as_row(found[1], now).tobytes() == then[row].tobytes()
    elif now[row, 0].tobytes() != then[row, 0].tobytes():
        apart = now[row, :1].view(np.uint64) ^ then[row, :1].view(np.uint64)
        assert int(apart[0]) & 0xFFFFFFFFFF == 0  # it differs in its first bits only


def test_two_animals_that_differ_are_not_taken_for_one():
    rng = np.random.default_rng(3)
    then = rng.normal(0, 50, (300, 3))
    for _ in range(200):
        now = then.copy()
        now[rng.choice(300, 2, replace=False)] += rng.normal(0, 1e-9, (2, 3))
        assert only_row(value(then), now) is None


def test_small_whole_numbers_come_back_too():
    then = np.arange(20, dtype=np.uint8) % 2
    now = then.copy()
    now[7] = 0
    world, _ = meadow(20)
    column = world.agents.fields["Memory.known"]
    assert column.default.dtype == np.uint8
    world.agents[column][:] = then
    row, words = only_row(values(world)["Memory.known"], now)
    assert (row, as_row(words, now)) == (7, 1)


def test_columns_of_other_herds_are_not_compared():
    rng = np.random.default_rng(3)
    herd = rng.normal(0, 50, (30, 3))
    assert only_row(value(herd), herd[:-1]) is None
    assert only_row(b"", herd) is None
    assert only_row(value(herd)[:-1], herd) is None
    assert only_row(value(herd), herd) is None  # nothing differs
    assert rows_in(value(herd)) == 30
    assert rows_in(b"") == 0


def test_a_herd_of_nobody_has_sums():
    world, _ = meadow(0)
    assert values(world)["Heading.forward"] == bytes(8 * 5)
    assert Heading.forward in world.agents.arrays


@pytest.mark.parametrize("data", [b"x", b"\0\0\0\0\0\0\0", b"\1\0\0\3\0\0\0abc", b"\0\0\2\0\0\0\0\xff\xff"])
def test_records_that_are_none_are_refused(data):
    with pytest.raises(TrailError, match="the sums are damaged"):
        state_at([data])


def test_what_a_command_changes_is_in_the_sums():
    world, step = meadow()
    submit(world, Whistle(2.5))
    before = values(world)
    world.resource(Commands).apply(world)
    assert [name for name, now in values(world).items() if before[name] != now] == ["Position.xyz"]
    world.resource(Births).count += 1
    assert {name for name, now in values(world).items() if before[name] != now} == {"Position.xyz", "resource Births"}
