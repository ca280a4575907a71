"""Commands: applied when they are due, written as JSON, read back or refused with a reason."""

import numpy as np
import pytest
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import COMMANDS, Commands, command, from_record, to_json, to_record
from flockbrush.engine.world import World


@command
class Call:
    """Somebody calls."""

    who: str
    loud: float = 1.0
    times: int = 1
    heading: float | None = None
    notes: list | None = None
    soft: bool = False

    def apply(self, world):
        world.resource(list).append(self.who)


@pytest.fixture
def world():
    world = World()
    world.insert(Clock())
    world.insert(Commands())
    world.insert([])
    yield world
    world.close()


def test_commands_come_in_order_of_tick_then_of_submission(world):
    queue, clock = world.resource(Commands), world.resource(Clock)
    for who, tick in (("late", 5), ("first", 0), ("second", 0), ("middle", 3)):
        queue.submit(Call(who), tick)
    for clock.tick in range(10):
        queue.apply(world)
    assert world.resource(list) == ["first", "second", "middle", "late"]
    assert [(tick, cmd.who) for tick, cmd in queue.log] == [(0, "first"), (0, "second"), (3, "middle"), (5, "late")]


def test_a_command_comes_back_from_its_record():
    call = Call("dog", 2.5, 3, 0.1, [1, "two"], True)
    assert from_record(*to_record(call)) == call
    assert to_json(call).startswith('["Call",{"who":"dog"')


def test_the_first_run_has_the_very_numbers_of_the_replay(world):
    """A designer's 2 is a replay's 2.0."""
    queue = world.resource(Commands)
    queue.submit(Call("dog", 2, heading=np.float64(1)))
    applied = queue.pending[0][1]
    assert [type(applied.loud), type(applied.heading)] == [float, float]


@pytest.mark.parametrize(
    "name, values, words",
    [
        ("Cal", {}, "unknown command 'Cal'; did you mean 'Call'"),
        ("PutGoal", {}, "unknown command 'PutGoal'; PlaceGoal replaced it"),
        ("Zzz", {}, "available: .*Call"),
        ("Call", {}, "Call needs who"),
        ("Call", {"who": "a", "lound": 1}, "Call has no field 'lound'; did you mean 'loud'"),
        ("Call", {"who": 3}, "Call.who must be a string, got 3"),
        ("Call", {"who": "a", "loud": "very"}, "Call.loud must be a number, got 'very'"),
        ("Call", {"who": "a", "loud": True}, "Call.loud must be a number, got True"),
        ("Call", {"who": "a", "loud": float("inf")}, "Call.loud must be a finite number"),
        ("Call", {"who": "a", "heading": float("nan")}, "Call.heading must be a finite number"),
        ("Call", {"who": "a", "times": 1.5}, "Call.times must be a whole number"),
        ("Call", {"who": "a", "times": True}, "Call.times must be a whole number"),
        ("Call", {"who": "a", "notes": "n"}, "Call.notes must be a list"),
        ("Call", {"who": "a", "soft": 1}, "Call.soft must be true or false"),
    ],
)
def test_what_does_not_fit_is_refused_in_words(name, values, words):
    with pytest.raises(ValueError, match=words):
        from_record(name, values)


def test_what_cannot_be_recorded_is_refused_at_once(world):
    queue = world.resource(Commands)
    with pytest.raises(TypeError, match="str is not a command"):
        queue.submit("come")
    endless = []
    endless.append(endless)
    for call, words in (
        (Call("a", notes=[object()]), "Call.notes cannot be recorded: <object .*> is neither a number nor a string"),
        (Call("a", notes=endless), "Call.notes cannot be recorded: Circular"),
        (Call("a", notes=[1.0, float("nan")]), "Call.notes must be a finite number, got nan"),
        (Call("a", notes=np.array([[1.0, np.inf]])), "Call.notes must be a finite number, got inf"),
        (Call("a", loud=np.float32("nan")), "Call.loud must be a finite number, got nan"),
        (Call("a", notes=[[0.0, 1e300]]), r"Call.notes must be within ±1e\+15, got 1e\+300"),
        (Call("a", 1e16), r"Call.loud must be within ±1e\+15, got 1e\+16"),
        (Call("a", times=np.float64(3)), "Call.times must be a whole number, got 3.0"),
    ):
        with pytest.raises(ValueError, match=words):
            queue.submit(call)
    assert queue.pending == []


def test_numbers_and_arrays_of_numpy_are_those_of_python(world):
    queue, ids = world.resource(Commands), np.array([3, 5])
    queue.submit(Call("a", np.float32(0.1), np.int64(2), np.float64(0.1), list(ids), np.True_))
    queue.submit(Call("b", np.int32(4), notes=np.array([(0.5, 1.0), (0.1, 2.0)])))
    one, other = (cmd for _, cmd in queue.pending)
    assert to_json(one) == to_json(Call("a", float(np.float32(0.1)), 2, 0.1, [3, 5], True))
    assert other == Call("b", 4.0, notes=[[0.5, 1.0], [0.1, 2.0]])


def test_a_name_is_given_once():
    try:
        with pytest.raises(ValueError, match=r"command Call is already registered by .*test_commands"):
            command(type("Call", (), {"__module__": "somewhere.else"}))
    finally:
        assert COMMANDS["Call"] is Call


def test_the_queue_is_kept_as_bytes():
    queue, other = Commands(), Commands()
    queue.submit(Call("b"), 9)
    queue.submit(Call("a"), 4)
    queue.follow(7, 9, Call("c"))
    other.set_state(queue.state())
    assert other.waiting == queue.waiting == [(4, Call("a"), 0), (9, Call("b"), 0), (9, Call("c"), 7)]
    other.follow(7, 0, None)
    assert other.pending == [(4, Call("a")), (9, Call("b"))]
