"""Replays that are not the same: which system it was, what differs, in whom, and by how much.

Determinism is broken here on purpose, by systems that do something else from some tick on.
"""

import csv
import json

import numpy as np
import pytest
from flockbrush.components import Ground, Position, Role, Speed, Wish
from flockbrush.engine.clock import Clock
from flockbrush.engine.recording import open_recording
from flockbrush.engine.state import restore, state_hash
from flockbrush.engine.trail import Trail
from flockbrush.systems.decide import Roles
from flockbrush.systems.ground import Underfoot
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.life import Live
from flockbrush.systems.motion import Move
from flockbrush.systems.pace import Pace
from flockbrush.systems.senses import FindNeighbours, Near, See, Sight
from flockbrush.systems.steer import AskModels
from pens import pen
from processes import other_process
from test_replaying import copied

from flockbrush.runs.run import rebuild, start


@pytest.fixture(scope="module")
def walk(shared):
    """A recording of 24 sheep over 60 ticks, made by another process."""
    path = shared / "walk.flock"
    done = other_process("run", pen(shared, "walk"), "--ticks", 60, "--record", path)
    assert done.returncode == 0, done.stderr
    return path


@pytest.fixture
def edited(monkeypatch):
    """``edited(System, change, tick)``: a system that also does ``change(world)`` from this tick on."""

    def edit(system, change, tick=20, only=False):
        plain = system.process

        def process(self, world):
            plain(self, world)
            now = world.resource(Clock).tick + 1  # the state differs after so many ticks
            if now == tick or (now > tick and not only):
                change(world)

        monkeypatch.setattr(system, "process", process)

    return edit


@pytest.fixture
def desync(cli, walk):
    """What ``replay --verify`` says of the walk as JSON."""

    def told(path=walk, *options):
        done = cli("replay", path, "--verify", "--json", *options)
        assert done.code == 1
        return json.loads(done.out)["desync"]

    return told


def pushed(field, row, by):
    def change(world):
        world.agents[field][row] += by

    return change


# the system ----------------------------------------------------------------------------------


def test_an_edited_speed_is_told_with_system_columns_animals_and_values(desync, edited):
    """As when a file was edited: every animal is a hair faster from the first tick on."""
    edited(Pace, lambda world: world.agents[Speed.target].__imul__(1 + 1e-12), tick=1)
    found = desync()
    assert (found["tick"], found["system"], found["repeatable"]) == (1, "Pace", True)
    assert {"Speed.target", "Position.xyz"} <= set(found["parts"]) <= {"Speed.target", "Position.xyz", "Velocity.xyz"}
    speed = next(d for d in found["differences"] if d["part"] == "Speed.target")
    assert (speed["count"], len(speed["ids"])) == (24, 10)
    assert np.allclose(np.divide(speed["other"], speed["one"]), 1 + 1e-12, rtol=1e-14, atol=0)
    assert 1e-13 < speed["largest"] < 1e-11
    assert found["later"] is None


def test_one_animal_is_found_between_snapshots_with_both_values(desync, edited, walk):
    edited(Move, pushed(Position.xyz, (16, 1), 1e-9))
    found = desync()
    assert (found["tick"], found["system"], found["parts"]) == (20, "Move", ["Position.xyz"])
    (position,) = found["differences"]
    assert (position["count"], position["ids"]) == (1, [17])
    assert position["largest"] == pytest.approx(1e-9, rel=1e-4)
    run = open_recording(walk)
    assert 20 not in run.keyframes
    simulation = start(walk.parent / "walk.tmj")
    simulation.run(20)  # edited as well: the recorded value is the one before the push
    assert position["other"] == [simulation.agents[Position.xyz][16].tolist()]
    assert position["one"][0][1] == pytest.approx(position["other"][0][1] - 1e-9, abs=1e-14)


def one_less(count):
    """Everybody overlooks the last of those he sees."""
    count -= count > 0


@pytest.mark.parametrize(
    ("system", "change", "part"),
    [
        (Underfoot, pushed(Ground.slope, slice(None), 1e-9), "Ground.slope"),
        (FindNeighbours, lambda world: world.resource(Near).cells.x.__imul__(1 + 1e-9), "resource Near"),
        (See, lambda world: one_less(world.resource(Sight).by_slot.count), "resource Sight"),
        (Roles, pushed(Role.leader, slice(None), 1), "Role.leader"),
        (AskModels, pushed(Wish.direction, slice(None), 1e-9), "Wish.direction"),
        (Move, pushed(Position.xyz, slice(None), 1e-9), "Position.xyz"),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_the_first_system_that_does_something_else_is_named(desync, edited, system, change, part):
    """Also where what it makes is no part of the state, and where systems after it change more."""
    edited(system, change)
    found = desync()
    assert (found["tick"], found["system"]) == (20, system.__name__)
    assert part in found["parts"]


def test_an_animal_that_dies_is_named(desync, edited):
    edited(Live, lambda world: world.delete_entity(9), only=True)
    found = desync()
    assert (found["tick"], found["system"], found["parts"]) == (20, "Live", ["ids"])
    (who,) = found["differences"]
    assert (who["ids"], who["one"], who["other"]) == ([9], ["lives"], ["not alive"])
    assert {d["part"] for d in found["later_differences"]} >= {"ids"}


def test_a_resource_that_differs_is_shown_where_it_does(desync, edited):
    def grown(world):
        land = world.resource(Landscape)
        land.reach += 1.0
        land._head = None

    edited(Live, grown, only=True)
    found = desync()
    assert found["parts"] == ["resource Landscape"]
    (later,) = [d for d in found["later_differences"] if d["part"] == "resource Landscape"]
    assert "reach" in later["one"][0] and later["one"] != later["other"]


# what is known, and what is not ----------------------------------------------------------------


def test_several_animals_between_snapshots_are_compared_in_the_next_one(cli, desync, edited, walk):
    edited(Move, pushed(Position.xyz, slice(3, 7), 1e-9))
    found = desync()
    assert (found["system"], found["parts"], found["later"]) == ("Move", ["Position.xyz"], 60)
    assert [(d["part"], d["count"], d["ids"]) for d in found["differences"]] == [("Position.xyz", None, [])]
    assert next(d for d in found["later_differences"] if d["part"] == "Position.xyz")["count"] >= 4
    said = cli("replay", walk, "--verify").out
    assert "first system that differs: Move" in said
    assert "several animals differ in Position.xyz" in said
    assert "record with --keyframes 1 to have a snapshot of every tick" in said
    assert "in the next snapshot, after tick 60" in said


def test_with_a_snapshot_of_every_tick_all_is_known(cli, desync, edited, walk, tmp_path):
    path = tmp_path / "all.flock"
    assert cli("run", walk.parent / "walk.tmj", "--ticks", 30, "--keyframes", 1, "--record", path).code == 0
    assert list(open_recording(path).keyframes) == list(range(31))
    edited(Move, pushed(Position.xyz, slice(3, 7), 1e-9))
    found = desync(path)
    (position,) = found["differences"]
    assert (position["count"], sorted(position["ids"]), found["later"]) == (4, [4, 5, 6, 7], None)
    assert position["largest"] == pytest.approx(1e-9, rel=1e-4)


def test_a_state_that_comes_by_chance_is_told_apart_from_other_code(cli, desync, edited, walk):
    """Something outside the world decides: the second time the tick gives what was recorded: both states are known."""
    times = []

    def sometimes(world):
        times.append(1)
        if len(times) == 1:
            world.agents[Position.xyz][2:5] += 1e-9

    edited(Move, sometimes, only=True)
    found = desync()
    assert (found["tick"], found["repeatable"], found["system"]) == (20, False, "Move")
    assert sorted(found["differences"][0]["ids"]) == [3, 4, 5]
    times.clear()
    assert "simulating this tick again gave the recorded state" in cli("replay", walk, "--verify").out


def test_a_recording_without_sums_is_compared_in_the_next_snapshot(cli, edited, walk, tmp_path):
    """As those of the playground are."""
    run, path = open_recording(walk), tmp_path / "a.flock"
    copied(walk, path)
    edited(Move, pushed(Position.xyz, 4, 1e-9))
    report = json.loads(cli("replay", path, "--verify", "--json").out)
    assert report["first_difference"]["tick"] == 20
    assert (report["desync"]["system"], report["desync"]["parts"]) == (None, [])
    assert report["desync"]["notes"] == ["the recording has no snapshot after this tick"]
    assert run.sums(20) and not open_recording(path).sums(20)


def test_a_world_that_is_built_differently_is_compared_before_its_first_tick(cli, walk, monkeypatch):
    from flockbrush.runs import run as running

    plain = running.rebuild

    def moved(recorded):
        simulation = plain(recorded)
        simulation.agents[Position.xyz][5, 0] += 0.5
        return simulation

    monkeypatch.setattr(running, "rebuild", moved)
    done = cli("replay", walk, "--verify", "--json")
    found = json.loads(done.out)["desync"]
    assert (done.code, found["tick"], found["system"], found["parts"]) == (1, 0, None, ["Position.xyz"])
    assert (found["differences"][0]["ids"], found["differences"][0]["largest"]) == ([6], 0.5)


def test_what_differs_in_the_build_comes_first(cli, edited, walk, tmp_path):
    build = open_recording(walk).header["build"]
    sources = build["sources"] | {"flockbrush/systems/motion.py": "0" * 8}
    path = copied(
        walk, tmp_path / "a.flock", header={"build": build | {"code": "0" * 64, "sources": sources, "cpu": "z80"}}
    )
    edited(Move, pushed(Position.xyz, 4, 1e-9))
    lines = cli("replay", path, "--verify").out.splitlines()
    assert "the replay differs in tick 20" in lines[0]
    assert lines[1] == "recorded with other code: flockbrush/systems/motion.py"
    assert lines[2].startswith("recorded on z80 (here ")
    assert "code, libraries and CPU are the same as when it was recorded" in cli("replay", walk, "--verify").out


# the folder ------------------------------------------------------------------------------------


def test_a_report_writes_both_states(cli, edited, walk, tmp_path):
    edited(Pace, lambda world: world.agents[Speed.target].__imul__(1 + 1e-12), tick=1)
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / "thesis.txt").write_text("mine")
    done = cli("replay", walk, "--verify", "--report", folder)
    assert done.code == 1
    names = {path.name for path in folder.iterdir()}
    assert names == {"report.json", "thesis.txt"} | {
        f"{who}-1.{kind}" for who in ("recorded", "replayed") for kind in ("csv", "state")
    }
    assert all(f"wrote {folder / name}" in done.out for name in names - {"thesis.txt"})
    report, run = json.loads((folder / "report.json").read_text()), open_recording(walk)
    assert (report["desync"]["system"], report["build"]) == ("Pace", {})
    world = rebuild(run).world
    for who, digest in (("recorded", run.hashes[1]), ("replayed", report["hash"])):
        restore(world, (folder / f"{who}-1.state").read_bytes())
        assert state_hash(world) == digest
        with open(folder / f"{who}-1.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        assert [int(row["id"]) for row in rows] == world.agents.ids.tolist()
        assert [float(row["Position.xyz.1"]) for row in rows] == world.agents[Position.xyz][:, 1].tolist()


def test_a_report_of_an_animal_between_snapshots_has_the_states_that_are_known(cli, edited, walk, tmp_path):
    edited(Move, pushed(Position.xyz, 4, 1e-9))
    assert cli("replay", walk, "--verify", "--report", tmp_path / "r").code == 1
    names = {path.name for path in (tmp_path / "r").glob("*.state")}
    assert names == {"replayed-20.state", "recorded-60.state", "replayed-60.state"}


def test_a_replay_that_is_the_same_writes_no_report(cli, walk, tmp_path):
    done = cli("replay", walk, "--verify", "--report", tmp_path / "r")
    assert done.code == 0
    assert not (tmp_path / "r").exists()


def test_a_folder_that_is_none_is_refused_before_the_replay(cli, walk, tmp_path):
    (tmp_path / "f").write_text("")
    assert "is a file; --report must be a folder" in cli("replay", walk, "--verify", "--report", tmp_path / "f").err
    assert "there is no folder" in cli("replay", walk, "--verify", "--report", tmp_path / "a" / "b").err
    assert cli("replay", walk, "--report", tmp_path / "r").code == 2


# sums ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("level", ["crowded", "pillars", "geese"])
def test_sums_are_the_same_on_any_number_of_threads(level):
    """What systems make for one another too: otherwise an innocent one would be named."""
    from flockbrush.engine.parallel import set_threads

    def trail(count):
        before = set_threads(count)
        try:
            simulation, records, sums = start(level, agents=3000 if level == "crowded" else None), [], Trail()
            for _ in range(3):
                simulation.tick()
                marks = {}
                state_hash(simulation.world, marks)
                records.append(sums.record(simulation.world, marks))
            return records
        finally:
            set_threads(before)

    assert trail(1) == trail(3)
