"""A run in which one goes back: the past is the past, whichever way one walks in it, and branches leave it alone."""

import numpy as np
import pytest
from flockbrush.components import Position
from flockbrush.engine.commands import CommandError, command
from flockbrush.engine.recording import open_recording
from flockbrush.engine.state import pieces, snapshot, state_hash
from flockbrush.systems.commands import AddAnimals, AddObstacle, PaintBrush, RemoveAnimals, SetParameter, SwitchBrush
from flockbrush.systems.edits import RemoveThing
from flockbrush.systems.mark_commands import PlaceKey
from flockbrush.systems.steer import AskModels
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_pasture import pasture, straight_run, verified

from flockbrush.runs import run as running
from flockbrush.runs.run import open_level
from flockbrush.studio.branches import Beginning, Keyframes
from flockbrush.studio.timeline import Timeline, WentWrong


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    return pasture(tmp_path_factory.mktemp("pasture"))


@pytest.fixture
def timeline(level, monkeypatch):
    """A timeline that keeps a moment every quarter of a second."""
    made = new_timeline(level, monkeypatch)
    yield made
    made.close()


def new_timeline(level, monkeypatch, **options):
    monkeypatch.setattr("flockbrush.studio.timeline.KEYFRAME_SECONDS", 0.25)
    return Timeline(Beginning(*open_level(level)), "pasture", **options)


def lived(timeline, ticks):
    for _ in range(ticks):
        timeline.step()
    return timeline


def state(timeline):
    return state_hash(timeline.simulation.world)


def by_hand_of(timeline):
    script = [entry[:2] for entry in timeline.current.script]
    return [entry for entry in timeline.current.commands if entry not in script]


def test_keys_placed_on_the_way_act_in_every_branch_as_in_a_straight_run(timeline, level, tmp_path):
    lived(timeline, 2)
    timeline.perform([PlaceKey(90, "later", 12 / 32, "RemoveAnimals", {"radius": 9.0}, 6.0, 8.0)])
    lived(timeline, 18)
    first = by_hand_of(timeline)
    assert [(tick, type(cmd).__name__) for tick, cmd in first] == [(2, "PlaceKey"), (12, "RemoveAnimals")]
    timeline.export(tmp_path / "keys.flock")
    assert verified(tmp_path / "keys.flock").last_tick == 20
    timeline.go_to(7)
    timeline.fork()
    lived(timeline, 13)
    assert by_hand_of(timeline) == first  # it still waited where the branch left
    timeline.go_to(7)
    timeline.fork()
    timeline.perform([RemoveThing("key", 90)])
    lived(timeline, 13)
    assert len(timeline.simulation.agents) == 9
    for name in timeline.branches:
        timeline.switch(name)
        done = [(tick, cmd) for tick, cmd in by_hand_of(timeline) if not isinstance(cmd, RemoveAnimals)]
        assert timeline.current.differs is None and timeline.current.hashes == straight_run(level, done, 20)


def test_the_past_cannot_be_edited_without_a_branch(timeline):
    lived(timeline, 4).go_to(2)
    with pytest.raises(ValueError, match="start a new branch first"):
        timeline.perform([RemoveAnimals(6, 8, 9)])


def test_a_branch_leaves_the_old_future_as_it_was(timeline, level):
    lived(timeline, 6)
    timeline.perform([PaintBrush("swarm", 8, 8, 4)])
    lived(timeline, 6)
    before, end = dict(timeline.current.hashes), state(timeline)
    timeline.go_to(4)
    branch = timeline.fork()
    assert (branch.name, branch.parent, branch.left, branch.last_tick) == ("pasture-2", "pasture", 4, 4)
    timeline.perform([RemoveAnimals(6, 8, 2)])
    lived(timeline, 10)
    assert timeline.current.hashes == straight_run(level, by_hand_of(timeline), 14)
    timeline.switch("pasture")
    assert timeline.tick == 12 and state(timeline) == end
    lived(timeline, 3)
    assert timeline.current.hashes.items() >= before.items()
    assert timeline.current.hashes == straight_run(level, [(6, PaintBrush("swarm", 8, 8, 4))], 15)


def test_a_branch_that_was_given_up_leaves_no_trace(timeline):
    lived(timeline, 10)
    timeline.go_to(4)
    here = state(timeline)
    timeline.fork()
    timeline.give_up()
    assert list(timeline.branches) == ["pasture"] and timeline.tick == 4 and state(timeline) == here
    timeline.go_to(10)
    assert timeline.current.differs is None


def test_a_new_beginning_is_another_branch(timeline, level):
    lived(timeline, 9)
    world = timeline.simulation
    timeline.begin(timeline.current.beginning)
    assert timeline.current.name == "pasture-2" and timeline.tick == 0 and timeline.simulation is not world
    lived(timeline, 3)
    timeline.begin(Beginning(*open_level(level), seed=99), "other")
    lived(timeline, 3)
    assert timeline.current.hashes == straight_run(level, [], 3, seed=99)
    timeline.switch("pasture")
    assert timeline.tick == 9 and timeline.moved == ["all"]


def test_a_long_way_can_be_gone_in_pieces(timeline):
    lived(timeline, 7)
    assert not timeline.go_to(6, deadline=0.0)
    assert timeline.tick == 0
    assert timeline.go_to(6)
    assert timeline.go_to(7, deadline=0.0) is False or timeline.tick == 7


def test_a_command_that_fails_costs_no_tick(timeline, level):
    lived(timeline, 3)
    timeline.queue.submit(SwitchBrush("swarm", species="cow"), 3)
    timeline.queue.submit(SwitchBrush("swarm"), 3)
    with pytest.raises(CommandError, match="no species 'cow'"):
        timeline.step()
    assert timeline.tick == 3
    lived(timeline, 6)
    assert by_hand_of(timeline) == [(3, SwitchBrush("swarm"))]
    assert timeline.current.hashes == straight_run(level, by_hand_of(timeline), 9)


def ill_from(tick):
    """A `AskModels._ask` whose models fail from this tick on."""
    ask = AskModels._ask

    def asked(world, scene, *rest):
        if scene.tick >= tick:
            raise ZeroDivisionError("ill")
        return ask(world, scene, *rest)

    return staticmethod(asked)


def test_a_model_that_fails_leaves_the_world_as_it_was(timeline, level, monkeypatch):
    lived(timeline, 11)
    timeline.perform([RemoveAnimals(6, 8, 1)])
    here = state(timeline)
    monkeypatch.setattr(AskModels, "_ask", ill_from(11))
    for _ in range(2):
        with pytest.raises(WentWrong, match="ill"):
            timeline.step()
        assert timeline.tick == 11 and state(timeline) == here
    monkeypatch.undo()
    lived(timeline, 4)
    assert timeline.current.hashes == straight_run(level, by_hand_of(timeline), 15)


def test_a_model_that_fails_everywhere_leaves_us_at_a_kept_moment(timeline, level, monkeypatch):
    lived(timeline, 11)
    monkeypatch.setattr(AskModels, "_ask", ill_from(0))
    with pytest.raises(WentWrong):
        timeline.step()
    assert timeline.tick == 8 and timeline.current.last_tick == 11
    with pytest.raises(WentWrong):
        timeline.go_to(10)
    monkeypatch.undo()
    assert timeline.go_to(11)
    lived(timeline, 4)
    assert timeline.current.hashes == straight_run(level, [], 15)


def test_a_past_that_comes_out_differently_is_told_once(level, monkeypatch):
    told = []
    timeline = new_timeline(level, monkeypatch, tell=told.append)
    lived(timeline, 12).go_to(1)
    timeline.simulation.agents[Position.xyz][0, 0] += 1e-9
    timeline.go_to(7)
    assert len(told) == 1 and told[0].startswith("tick 2 of pasture gave another state than the known one")
    timeline.close()


# what is kept ----------------------------------------------------------------


def test_what_does_not_change_is_kept_once(timeline):
    kept = Keyframes()
    for tick in (0, 8, 16):
        timeline.go_to(tick) if tick <= timeline.current.last_tick else lived(timeline, tick - timeline.tick)
        kept.keep(tick, snapshot(timeline.simulation.world))
    whole = len(kept[0])
    assert sum(map(len, kept.parts().values())) < 2 * whole
    assert [kept[tick] == b"".join(kept.cut(tick)) for tick in kept] == [True] * 3
    assert len(kept.cut(0)) == len(pieces(kept[0]))


def test_kept_moments_stay_within_their_budget(level, monkeypatch):
    timeline = new_timeline(level, monkeypatch, budget=120_000)
    lived(timeline, 400)
    ticks = list(timeline.current.keyframes)
    assert timeline.memory() <= 120_000 and ticks[0] == 0 and ticks[-1] == 400
    assert max(np.diff(ticks)) <= 4 * min(np.diff(ticks))  # no part of the past is far away
    timeline.go_to(133)
    assert timeline.current.differs is None
    timeline.fork()
    lived(timeline, 200)
    assert timeline.memory() <= 120_000
    timeline.close()


def test_large_states_are_hashed_less_often(level, monkeypatch):
    monkeypatch.setattr("flockbrush.studio.timeline.HASH_BYTES", 0)
    timeline = new_timeline(level, monkeypatch)
    assert list(lived(timeline, 17).current.hashes) == [0, 8, 16]
    timeline.close()


# files -----------------------------------------------------------------------


def test_every_branch_is_a_recording_beside_the_first(level, monkeypatch, tmp_path):
    timeline = new_timeline(level, monkeypatch, folder=tmp_path)
    lived(timeline, 6)
    timeline.perform([SetParameter("march", "cohesion_weight", 0.5)])
    lived(timeline, 6)
    timeline.go_to(9)
    timeline.fork()
    timeline.perform([AddObstacle("rock", [[3, 3], [4, 3], [4, 4], [3, 4]])])
    lived(timeline, 9)
    timeline.switch("pasture")
    lived(timeline, 3)
    timeline.fork("upper way / 2")
    timeline.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "pasture-2.flock", "pasture.flock", "upper-way-2.flock",
    ]  # fmt: skip
    assert verified(tmp_path / "pasture.flock").last_tick == 15
    assert verified(tmp_path / "pasture-2.flock").last_tick == 18
    assert len(verified(tmp_path / "pasture-2.flock").hashes) == 19
    assert not open_recording(tmp_path / "pasture.flock").truncated


def test_a_recording_has_moments_to_start_from(level, monkeypatch, tmp_path):
    monkeypatch.setattr("flockbrush.runs.run.KEYFRAME_SECONDS", 0.5)
    timeline = new_timeline(level, monkeypatch, folder=tmp_path)
    lived(timeline, 70)
    timeline.close()
    run = verified(tmp_path / "pasture.flock")
    assert sorted(run.keyframes) == [16, 32, 48, 64]
    assert len(run.keyframes[48]) > 1000


def test_a_recording_of_many_animals_has_as_many_moments_as_one_made_without_a_window(level, monkeypatch, tmp_path):
    monkeypatch.setattr(running, "KEYFRAME_STEPS", 8 * 9)  # as if nine sheep were 100,000
    timeline = new_timeline(level, monkeypatch, folder=tmp_path)
    timeline.perform([AddAnimals("march", 4, 4, 2, 9, "sheep")])
    lived(timeline, 40)
    simulation = running.begin_again(open_recording(timeline.current.recorder.path))
    recorder = running.record(tmp_path / "headless.flock", simulation)
    simulation.submit(AddAnimals("march", 4, 4, 2, 9, "sheep"))
    for _ in range(40):
        simulation.tick()
        recorder.take()
    recorder.close()
    simulation.close()
    timeline.go_to(20)
    timeline.fork()
    timeline.export(tmp_path / "exported.flock")
    timeline.close()
    whole = verified(tmp_path / "pasture.flock")
    ends = {0, 1, 40}  # of small herds, besides
    assert set(whole.keyframes) | ends == set(verified(tmp_path / "headless.flock").keyframes)
    assert sorted(whole.keyframes) == [8, 16, 24, 32, 40]
    for name in ("exported", "pasture-2"):  # those kept in memory, up to where it left
        assert sorted(verified(tmp_path / f"{name}.flock").keyframes) == [8, 16]


def test_of_a_recording_no_more_is_kept_than_fits_and_that_evenly(level, monkeypatch, tmp_path):
    monkeypatch.setattr(running, "KEYFRAME_STEPS", 8 * 9)
    timeline = new_timeline(level, monkeypatch, folder=tmp_path)
    lived(timeline, 64)
    branch, world = timeline.current.until(0, "again"), timeline.simulation.world
    timeline.close()
    run = open_recording(tmp_path / "pasture.flock")
    branch.take_over(run, world, 4 * len(run.keyframes[8]) + 100)
    assert sorted(branch.keyframes) == [0, 16, 32, 48, 64]


def test_a_branch_does_not_take_the_name_of_a_file_that_is_there(level, monkeypatch, tmp_path):
    (tmp_path / "pasture-2.flock").write_bytes(b"last week's")
    timeline = new_timeline(level, monkeypatch, folder=tmp_path)
    lived(timeline, 2)
    assert timeline.fork().name == "pasture-3"
    timeline.close()
    assert (tmp_path / "pasture-2.flock").read_bytes() == b"last week's"


@command
class Topple:
    """Fails half-way."""

    def apply(self, world):
        world.agents[Position.xyz][:] += 1.0
        return 1 / 0


def test_a_command_of_others_that_fails_leaves_the_world_as_it_was(timeline):
    lived(timeline, 3)
    timeline.perform([SwitchBrush("swarm")])
    before = state(timeline)
    with pytest.raises(CommandError, match="command 'Topple' of .* failed: ZeroDivisionError"):
        timeline.perform([SwitchBrush("march"), Topple()])
    assert state(timeline) == before and timeline.tick == 3
    assert [type(cmd) for _, cmd in timeline.current.commands] == [SwitchBrush]
    lived(timeline, 2)
    assert timeline.tick == 5


def test_a_full_disk_ends_the_recording_and_not_the_run(level, monkeypatch, tmp_path):
    told = []
    timeline = new_timeline(level, monkeypatch, folder=tmp_path, tell=told.append)
    lived(timeline, 2)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("flockbrush.engine.recording.Recording._append", full)
    lived(timeline, 5)
    monkeypatch.undo()
    assert len(told) == 1 and "not recorded any more" in told[0] and "No space left" in told[0]
    timeline.export(tmp_path / "whole.flock")  # once there is room again
    assert verified(tmp_path / "whole.flock").last_tick == 7
    timeline.close()


# whichever way one walks -------------------------------------------------------


WAYS = st.lists(
    st.one_of(
        st.tuples(st.just("live"), st.integers(1, 12)),
        st.tuples(st.just("go"), st.integers(0, 60)),
        st.tuples(st.just("do"), st.integers(0, 4)),
        st.tuples(st.just("fork"), st.just(0)),
        st.tuples(st.just("switch"), st.integers(0, 3)),
    ),
    min_size=3,
    max_size=12,
)  # fmt: skip
DEEDS = [
    PaintBrush("swarm", 9, 8, 3),
    AddAnimals("march", 4, 4, 2, 2, "sheep"),
    RemoveAnimals(8, 8, 1.5),
    AddObstacle("rock", [[11, 3], [12, 3], [12, 4], [11, 4]]),
    SetParameter("march", "alignment_weight", 0.1),
]


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ways=WAYS)
def test_any_walk_through_time_is_a_straight_run_of_what_was_done(level, monkeypatch, ways):
    timeline = new_timeline(level, monkeypatch)
    for kind, number in ways:
        walk(timeline, kind, number)
    for name in list(timeline.branches):
        timeline.switch(name)
        lived(timeline, 3)
        branch = timeline.current
        assert branch.differs is None
        assert [cmd for _, cmd in branch.commands].count(branch.script[0][1]) == (branch.last_tick > 8)
        assert branch.hashes == straight_run(level, by_hand_of(timeline), branch.last_tick), (name, ways)
    timeline.close()


def walk(timeline, kind, number):
    """One thing that somebody may do with a timeline."""
    if kind == "live":
        lived(timeline, number)
    elif kind == "go":
        timeline.go_to(number)
    elif kind == "do":
        if not timeline.at_end:
            timeline.fork()
        timeline.perform([DEEDS[number]])
    elif kind == "fork":
        timeline.fork()
    else:
        names = list(timeline.branches)
        timeline.switch(names[number % len(names)])


def test_one_step_back_is_short_once_one_looks_there(timeline, monkeypatch):
    monkeypatch.setattr("flockbrush.studio.timeline.NEAR_TICKS", 2)
    lived(timeline, 8)
    ticks = []
    tick = timeline.simulation.tick
    monkeypatch.setattr(timeline.simulation, "tick", lambda: (ticks.append(timeline.tick), tick()))
    timeline.go_to(7)
    first = len(ticks)
    timeline.go_to(6)
    timeline.go_to(5)
    assert first == 7 and len(ticks) == first + 0 + 1
    timeline.fork()
    timeline.perform([RemoveAnimals(6, 8, 30)])
    lived(timeline, 3)
    timeline.go_to(6)  # of this branch, not of the one before
    assert state(timeline) == timeline.current.hashes[6]
    timeline.go_to(8)
    assert timeline.current.differs is None
    assert state(timeline) == timeline.current.hashes[8]
