"""A session as a designer has it: time that goes, slows and stands; deeds that succeed or say why not."""

import numpy as np
import pytest
from flockbrush.engine.problems import ProblemsError
from flockbrush.engine.state import state_hash
from flockbrush.systems.commands import AddAnimals, AddObstacle, RemoveAnimals, SetParameter, SwitchBrush
from flockbrush.systems.edits import DrawGuide
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.palette import Palette
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_pasture import advance, by_hand, pasture, straight_run, stroke, texts, verified

from flockbrush.runs.run import begin
from flockbrush.studio.session import Session

FRAME = 1 / 60  # s
PLENTY = 10.0  # s of budget


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    return pasture(tmp_path_factory.mktemp("pasture"))


def played(session, frames, budget=PLENTY):
    """So many frames of real time; the ticks that have passed."""
    return sum(advance(session, FRAME, budget) for _ in range(frames))


# time ---------------------------------------------------------------------------


def test_a_level_that_is_wrong_does_not_open(tmp_path):
    with pytest.raises(ProblemsError, match="no such file"):
        Session.open(tmp_path / "nowhere.tmj")


def test_nobody_moves_until_play(session):
    assert played(session, 30) == 0 and session.tick == 0
    session.play()
    assert played(session, 60) == 32 and session.tick == 32


@pytest.mark.parametrize(("rate", "ticks"), [(0.25, 8), (1, 32), (8, 256), (100, 256), (0, 8)])
def test_a_second_is_as_long_as_the_rate_says(session, rate, ticks):
    session.rate = rate
    session.play()
    assert abs(played(session, 60) - ticks) <= 1


def test_a_slow_machine_plays_slower_and_never_falls_behind(session, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("flockbrush.studio.session.time.perf_counter", lambda: now[0])
    step = session.timeline.step

    def slow():
        now[0] += 0.1  # a tick takes a tenth of a second: 0.3 of real time
        step()

    monkeypatch.setattr(session.timeline, "step", slow)
    session.play()
    for _ in range(40):
        assert advance(session, 0.1, 0.02) == 1
    assert session.pace == pytest.approx(10 / 32)
    monkeypatch.setattr(session.timeline, "step", step)
    assert advance(session, 1 / 32, PLENTY) <= 2  # nothing is made up for


def test_one_frame_never_takes_longer_than_its_budget(session, monkeypatch):
    now = [0.0]
    monkeypatch.setattr("flockbrush.studio.session.time.perf_counter", lambda: now[0])
    step = session.timeline.step

    def steady():
        now[0] += 0.004
        step()

    monkeypatch.setattr(session.timeline, "step", steady)
    session.rate = 8
    session.play()
    played(session, 20, 0.01)
    before = now[0]
    assert advance(session, FRAME, 0.01) == 2 and now[0] - before == pytest.approx(0.008)


def test_sheep_glide_between_ticks(session):
    session.step(4)
    session.play()
    advance(session, 1.5 / 32, PLENTY)
    before, after = session._before, session._after
    middle = session.view()
    assert middle.time == pytest.approx((before.time + after.time) / 2)
    assert middle.xyz == pytest.approx((before.xyz + after.xyz) / 2)
    session.pause()
    assert session.view() is session._after


def test_the_past_is_watched_again_and_then_goes_on(session, level):
    session.step(10)
    session.do("paint", [stroke("swarm", 8, 8, 3)])
    session.step(10)
    session.scrub(3)
    assert session.in_past
    session.play()
    played(session, 90)
    assert session.tick > 20 and list(session.branches) == ["pasture"]
    session.pause()
    assert session.timeline.current.hashes == straight_run(level, by_hand(session), session.last_tick)


def test_dragging_through_a_long_past_takes_its_time(session):
    session.step(60)
    assert not session.scrub(59, budget_s=0.0)
    for _ in range(200):
        if session.tick == 59:
            break
        advance(session, FRAME, 0.001)
    assert session.tick == 59 and not session.playing
    session.scrub(20, budget_s=0.0)
    session.do("paint", [stroke("swarm", 8, 8, 3)])  # whoever acts, acts where he wanted to be
    assert session.tick == 20 and session.branch_name == "pasture-2"


# what goes wrong -------------------------------------------------------------------


def test_what_cannot_be_done_is_said_and_nothing_has_happened(session):
    session.step(3)
    here = state_hash(session.simulation.world)
    assert not session.do("switch", [SwitchBrush("swarm"), SwitchBrush("swarm", species="cow")])
    assert texts(session) == ["there is no species 'cow'; available: sheep"]
    assert state_hash(session.simulation.world) == here
    assert texts(session) == []


def test_what_cannot_be_done_in_the_past_begins_no_branch(session):
    session.step(9)
    session.scrub(4)
    assert not session.do("switch", [SwitchBrush("swarm", species="cow")])
    assert list(session.branches) == ["pasture"] and session.tick == 4 and session.in_past


def test_a_script_that_fails_pauses_and_says_so(tmp_path):
    level = pasture(tmp_path, sheep=3)
    session = Session.open(level, state_folder=tmp_path / "state")
    session.simulation.submit(SwitchBrush("swarm", species="cow"), 5)
    session.play()
    played(session, 60)
    (text,) = texts(session)
    assert session.tick == 5 and not session.playing and "no species 'cow'" in text
    session.play()
    played(session, 60)
    assert session.tick > 30
    session.close()


def test_an_unknown_branch_is_said(session):
    session.switch("left")
    assert "there is no branch 'left'" in texts(session)[0]


# numbers ------------------------------------------------------------------------------


def test_the_chart_knows_the_whole_branch(session):
    session.step(20)
    chart = session.chart
    assert chart.time.tolist() == [0, 0.125, 0.25, 0.375, 0.5, 0.625]
    assert chart.counts["march"].tolist() == [9, 9, 9, 0, 0, 0]  # the script loosens them after a quarter second
    assert set(chart.values) == {"polarization", "milling", "speed"}
    assert (chart.values["polarization"] <= 1).all() and (chart.values["speed"] > 0).all()
    session.scrub(8)
    assert len(session.chart.time) == 6
    session.do("paint", [stroke("march", 8, 8, 3)])
    assert len(session.chart.time) == 3


def test_a_long_chart_is_thinned(session, monkeypatch):
    monkeypatch.setattr("flockbrush.studio.gauges.CHART_POINTS", 10)
    session.step(160)
    assert 8 <= len(session.chart.time) <= 11 and session.chart.time[-1] == 5.0


def test_the_profile_names_the_systems(session):
    assert session.profile() == {}
    session.step(140)
    profile = session.profile()
    assert profile["AskModels"] > 0 and set(profile) == set(session.simulation.schedule.nanoseconds)


def test_only_the_ground_that_changed_is_named(session):
    session.step(2)
    assert session.ground_changes() == []
    session.do("paint", [stroke("swarm", 8, 8, 2)])
    ((west, south, east, north),) = session.ground_changes()
    assert 5.9 <= west < 6.6 and 9.4 < east <= 10.1 and 5.9 <= south < north <= 10.1
    session.do("slower", [SetParameter("march", "cohesion_weight", 0.5)])
    assert session.ground_changes() == []
    session.step(2)
    session.scrub(1)
    assert len(session.ground_changes()) == 1  # it looks as it did before
    session.scrub(4)
    assert len(session.ground_changes()) == 1


# whatever one does ----------------------------------------------------------------------


DEEDS = [
    lambda session: [stroke("march", 9, 8, 2)],
    lambda session: [stroke("swarm", 6, 6, 3)],
    lambda session: [stroke("", 8, 8, 2)],
    lambda session: [AddObstacle("rock", [[11, 3], [12, 3], [12, 4], [11, 4]], id=session.editor.new_id())],
    lambda session: [DrawGuide(session.editor.new_id(), "by", [[2, 2], [20, 3]])],
    lambda session: [AddAnimals("march", 4, 4, 2, 2, "sheep")],
    lambda session: [RemoveAnimals(8, 8, 1.5)],
    lambda session: [SetParameter("march", "alignment_weight", 0.1)],
]
WAYS = st.lists(
    st.one_of(
        st.tuples(st.just("step"), st.integers(-6, 9)),
        st.tuples(st.just("play"), st.integers(1, 15)),
        st.tuples(st.just("scrub"), st.integers(0, 40)),
        st.tuples(st.just("do"), st.integers(0, len(DEEDS) - 1)),
        st.tuples(st.just("do"), st.integers(0, len(DEEDS) - 1)),
        st.tuples(st.just("undo"), st.just(0)),
        st.tuples(st.just("redo"), st.just(0)),
        st.tuples(st.just("restart"), st.just(0)),
        st.tuples(st.just("switch"), st.integers(0, 3)),
    ),
    min_size=4,
    max_size=14,
)  # fmt: skip


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(ways=WAYS)
def test_whatever_one_does_every_branch_replays_and_its_level_is_what_one_sees(level, tmp_path, ways):
    session = Session.open(level, state_folder=tmp_path / "state")
    for kind, number in ways:
        act(session, kind, number)
    for name in list(session.branches):
        session.switch(name)
        session.step(2)
        assert session.timeline.current.differs is None
        assert session.export_recording(tmp_path / "run.flock")
        assert verified(tmp_path / "run.flock").last_tick == session.last_tick
        assert ground_of(session.simulation) == ground_of(begin(session._level_now(), session.library))
    assert [text for text in texts(session) if not text.startswith("wrote")] == []
    session.close()


def act(session, kind, number):
    """One thing that a designer may do."""
    if kind == "do":
        session.do(kind, DEEDS[number](session), join=f"stroke {number}")
    elif kind == "switch":
        names = list(session.branches)
        session.switch(names[number % len(names)])
    elif kind == "play":
        session.play()
        played(session, number)
        session.pause()
    elif kind in ("undo", "redo", "restart"):
        getattr(session, kind)()
    else:
        getattr(session, kind)(number)


def ground_of(simulation):
    """What is painted and what stands there, in names."""
    land, names = simulation.world.resource(Landscape), simulation.world.resource(Palette).names
    painted = [names[k] if k >= 0 else "" for k in land.brush.ravel()]
    things = [(barrier.name, barrier.polygon.round(6).tolist()) for barrier in land.barriers]
    guides = [(guide.name, np.round(guide.points, 6).tolist()) for guide in land.guides]
    return painted, sorted(things), sorted(guides)
