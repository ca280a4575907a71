"""Every tick lived twice: what a snapshot does not hold, and what threads decide, comes to light."""

import json

import pytest
from flockbrush.components import Position
from flockbrush.engine.clock import Clock
from flockbrush.engine.commands import Commands
from flockbrush.engine.recording import open_recording
from flockbrush.engine.state import state_hash
from flockbrush.systems.commands import AddAnimals
from flockbrush.systems.motion import Move
from flockbrush.systems.senses import Near

from flockbrush.runs import synctest
from flockbrush.runs.run import open_level, shipped_levels, start
from flockbrush.runs.synctest import OutOfSync, SyncTest
from flockbrush.runs.terminal import Stopped

MOST = 1500  # animals: of larger levels a part will do


def run_twice(simulation, every, ticks):
    test = SyncTest(simulation, every, ticks, simulation.tick)
    while simulation.clock.tick < ticks:
        test.tick()
    return test


@pytest.mark.parametrize("name", shipped_levels())
def test_every_shipped_level_lives_every_tick_the_same_again(name, monkeypatch):
    """What each system leaves behind is looked at in the first ticks, later only the state after each tick."""
    marks = synctest._marks
    monkeypatch.setattr(synctest, "_marks", lambda world: marks(world) if world.resource(Clock).tick < 4 else {})
    agents = MOST if open_level(name)[0].agents > MOST else None
    simulation = start(name, agents=agents)
    assert run_twice(simulation, 12, 36).compared == 36
    plain = start(name, agents=agents)
    plain.run(36)
    assert state_hash(simulation.world) == state_hash(plain.world)


@pytest.mark.parametrize(("every", "ticks"), [(1, 5), (7, 20), (100, 12)])
def test_any_number_of_ticks_between_snapshots_will_do(level, every, ticks):
    simulation, plain = start(level), start(level)
    assert run_twice(simulation, every, ticks).compared == ticks
    plain.run(ticks)
    assert state_hash(simulation.world) == state_hash(plain.world)
    assert simulation.clock.tick == ticks


@pytest.fixture
def forgetful(monkeypatch):
    """Animals are pushed by a counter that no snapshot holds."""
    plain, calls = Move.process, []

    def process(self, world):
        plain(self, world)
        calls.append(1)
        world.agents[Position.xyz][[2, 5]] += 1e-9 * (len(calls) // 14)

    monkeypatch.setattr(Move, "process", process)
    return calls


def test_what_no_snapshot_holds_is_found_with_system_animals_and_both_values(level, forgetful):
    with pytest.raises(OutOfSync) as found:
        run_twice(start(level), 8, 40)
    report = found.value.report
    assert (report.tick, report.system, report.parts) == (6, "Move", ["Position.xyz"])
    (position,) = report.differences
    assert (position.count, sorted(position.ids)) == (2, [3, 6])
    assert position.largest == pytest.approx(1e-9, rel=1e-3)


def test_the_system_is_the_one_that_reads_what_no_snapshot_holds(level, monkeypatch):
    """Also where what it makes is no part of the state."""
    from flockbrush.systems.senses import FindNeighbours

    plain, calls = FindNeighbours.process, []

    def process(self, world):
        plain(self, world)
        calls.append(1)
        world.resource(Near).cells.x[:] *= 1 + 1e-9 * (len(calls) > 10)

    monkeypatch.setattr(FindNeighbours, "process", process)
    with pytest.raises(OutOfSync) as found:
        run_twice(start(level), 8, 40)
    assert found.value.report.system == "FindNeighbours"
    assert "resource Near" in found.value.report.parts


def test_the_command_says_so_and_writes_both_states(cli, level, forgetful, tmp_path):
    done = cli("run", level, "--ticks", 40, "--synctest", 8, "--report", tmp_path / "r")
    assert done.code == 1
    assert "tick 6 gives another state when it is simulated again" in done.out
    assert "first system that differs: Move" in done.out
    assert {path.name for path in (tmp_path / "r").iterdir()} == {
        "report.json", "first-6.csv", "first-6.state", "again-6.csv", "again-6.state",
    }  # fmt: skip
    forgetful.clear()
    report = json.loads(cli("run", level, "--ticks", 40, "--synctest", 8, "--json").out)
    assert (report["synctest"], report["desync"]["system"]) == (8, "Move")


def test_the_command_runs_and_records_as_without_it(cli, level, tmp_path):
    """What the level's script does in the middle of a window is done, and recorded, once."""
    plain = json.loads(cli("run", level, "--ticks", 30, "--record", tmp_path / "a.flock", "--json").out)
    done = cli("run", level, "--ticks", 30, "--synctest", 11, "--record", tmp_path / "b.flock", "--json")
    twice = json.loads(done.out)
    assert (done.code, twice["synctest"]) == (0, {"every": 11, "ticks": 30})
    assert twice["hash"] == plain["hash"]
    one, other = open_recording(tmp_path / "a.flock"), open_recording(tmp_path / "b.flock")
    assert (one.hashes, one.commands) == (other.hashes, other.commands)
    assert len(other.commands) == 1
    assert cli("replay", tmp_path / "b.flock", "--verify").code == 0
    assert "30 ticks simulated twice: identical, bit for bit" in cli("run", level, "--ticks", 30, "--synctest", 30).out


def test_what_a_designer_hands_in_meanwhile_is_applied_once(level):
    simulation = start(level)
    test = SyncTest(simulation, 6, 24, simulation.tick)
    for tick in range(24):
        if tick == 12:
            simulation.submit(AddAnimals("swarm", 30.0, 22.0, 3.0, 5, "goat"))
        test.tick()
    assert len(simulation.agents) == 29
    assert [type(cmd).__name__ for _, cmd in simulation.world.resource(Commands).log] == ["SwitchBrush", "AddAnimals"]


def test_a_test_that_is_stopped_while_it_is_ahead_comes_back_first(level):
    def stop():
        raise Stopped

    simulation = start(level)
    with pytest.raises(Stopped):
        SyncTest(simulation, 8, 40, simulation.tick, stop).tick()
    assert simulation.clock.tick == 0
    assert state_hash(simulation.world) == state_hash(start(level).world)


def test_options_that_go_with_others_say_so(cli, level, tmp_path):
    assert cli("run", level, "--report", tmp_path).code == 2
    assert cli("run", level, "--keyframes", 4).code == 2
    assert cli("run", level, "--synctest", 0).code == 2
