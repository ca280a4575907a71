"""Ticks beside drawing: they change nothing of the run, are waited for by whoever asks, and their errors are said."""

import math
import threading

import pytest
from flockbrush.engine.plugins import PluginError
from flockbrush.engine.problems import Problem
from flockbrush.systems.commands import AddAnimals
from flockbrush.systems.steer import AskModels
from small_pasture import by_hand, pasture, straight_run, stroke, verified
from window import Window

from flockbrush.render.explanation_cache import ExplanationCache
from flockbrush.studio.session import Session
from flockbrush.studio.ticks_beside import BackgroundWork, TickResult

FRAME = 1 / 60  # s
TICK = 1 / 32
PLENTY = 10.0  # s
NEVER = 60.0  # s; a test that waits so long has failed


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    return pasture(tmp_path_factory.mktemp("pasture"), script=False)


class Gate:
    """Ticks of a session that do not end before they are let through."""

    def __init__(self, session, monkeypatch):
        self.open = threading.Event()
        step = session.timeline.step

        def held():
            assert self.open.wait(NEVER)
            step()

        monkeypatch.setattr(session.timeline, "step", held)

    def open_soon(self):
        """Let them through while somebody waits."""
        threading.Timer(0.05, self.open.set).start()


@pytest.fixture
def gate(session, monkeypatch):
    made = Gate(session, monkeypatch)
    yield made
    made.open.set()


def begun(session):
    """Have a tick run beside."""
    session.play()
    assert session.catch_up(1.5 * TICK, PLENTY, 0.0)
    session.set_off(PLENTY)
    assert session.ticking


def test_a_run_with_ticks_beside_is_the_same_run(session, level, tmp_path):
    session.play()
    for frame in range(90):
        if session.catch_up(FRAME, PLENTY, 0.0):  # in no hurry and in no order: as the machine has it
            session.set_off(PLENTY)
        session.view()
        if frame % 20 == 11:
            session.do("add", [AddAnimals("march", 4, 4 + 0.1 * frame, 2, 1, "sheep")])
        if frame % 31 == 30:
            session.do("paint", [stroke("march", 12, 8, 3)])
            session.undo()
    session.pause()
    assert session.tick > 0 and not session.ticking
    assert session.timeline.current.hashes == straight_run(level, by_hand(session), session.last_tick)
    assert session.export_recording(tmp_path / "run.flock")
    verified(tmp_path / "run.flock")


def test_what_is_shown_stays_while_a_tick_runs_and_who_asks_for_the_world_waits(session, gate):
    begun(session)
    shown = session.view()
    assert not session.catch_up(FRAME, PLENTY, 0.0) and session.ticking
    assert session._after.time == shown.time == 0.0
    gate.open_soon()
    assert session.tick == 1 and not session.ticking
    assert session._after.time == pytest.approx(TICK)


def test_who_has_no_patience_gets_ticks_later_and_none_is_lost(session, gate):
    begun(session)
    for _ in range(3):
        assert not session.catch_up(FRAME / 4, PLENTY, 0.0)
        session.set_off(PLENTY)  # nothing begins before the last one has ended
    gate.open.set()
    assert session.catch_up(0.0, PLENTY) and session.tick == 1


def test_what_is_shown_moves_on_evenly_while_ticks_run_beside(session):
    session.play()
    times = []
    for _ in range(40):
        session.catch_up(FRAME, PLENTY)
        session.set_off(PLENTY)
        times.append(session.view().time)
    steps = [after - before for before, after in zip(times[6:], times[7:], strict=False)]
    assert steps == pytest.approx([FRAME] * len(steps))


@pytest.mark.parametrize("act", ["pause", "step", "scrub", "undo", "branch", "save", "restart", "export", "autosave"])
def test_whatever_is_done_waits_for_the_tick_that_runs(session, gate, act, tmp_path):
    gate.open.set()
    session.do("paint", [stroke("march", 12, 8, 3)])
    session.step(3)
    gate.open.clear()
    begun(session)
    gate.open_soon()
    tick = {
        "pause": lambda: session.pause() or 4,
        "step": lambda: session.step() or 5,
        "scrub": lambda: session.scrub(2) and 2,
        "undo": lambda: session.undo() and 4,
        "branch": lambda: session.branch() and 4,
        "save": lambda: session.save(tmp_path / "saved.tmj") and 4,
        "restart": lambda: session.restart() or 0,
        "export": lambda: session.export_recording(tmp_path / "run.flock") and 4,
        "autosave": lambda: session.timeline.flush() or 4,
    }[act]()
    assert not session.ticking and session.tick == tick
    assert session.notices() == [] or act == "export"


def test_closing_waits_for_the_tick_that_runs(level, tmp_path, monkeypatch):
    session = Session.open(level, state_folder=tmp_path / "state", record=tmp_path / "run.flock")
    gate = Gate(session, monkeypatch)
    begun(session)
    gate.open_soon()
    session.close()
    assert verified(tmp_path / "run.flock").last_tick == 1


def test_a_tick_in_which_something_is_due_is_waited_for_before_anybody_draws(tmp_path):
    session = Session.open(pasture(tmp_path), state_folder=tmp_path / "state")  # at tick 8 it loosens
    session.step(7)
    for tick, waits in ((8, False), (9, True), (10, False)):
        session.playing = True
        session.catch_up(1.01 * TICK, PLENTY)
        session.set_off(PLENTY)
        assert session.ticking != waits and session.tick == tick
    session.scrub(7)
    assert [session.timeline.changes_within(ticks) for ticks in (1, 2)] == [True, True]
    session.scrub(3)
    assert [session.timeline.changes_within(ticks) for ticks in (1, 5)] == [False, True]
    session.close()


def test_an_error_in_a_tick_beside_is_a_notice_and_a_pause(session, monkeypatch):
    ask = AskModels._ask

    def ill(world, scene, palette, index, rows):
        if scene.tick == 2:
            text = "gave a wish that is not finite, for entity 1 in tick 2"
            raise PluginError([Problem("herd.py", None, None, text)])
        return ask(world, scene, palette, index, rows)

    monkeypatch.setattr(AskModels, "_ask", staticmethod(ill))
    session.play()
    for _ in range(5):
        session.catch_up(1.01 * TICK, PLENTY)
        session.set_off(PLENTY)
    (notice,) = session.notices()
    assert notice.kind == "error" and "entity 1 in tick 2" in notice.text
    assert session.tick == 2 and not session.playing and not session.ticking
    monkeypatch.undo()
    session.step()
    assert session.tick == 3


def test_any_other_error_is_raised_once_and_the_session_goes_on(session, monkeypatch):
    measure = session.timeline.measure

    def lost(simulation):
        raise OSError("the disk is gone")

    monkeypatch.setattr(session.timeline, "measure", lost)
    begun(session)
    with pytest.raises(OSError, match="the disk is gone"):
        session.catch_up(0.0, PLENTY)
    monkeypatch.setattr(session.timeline, "measure", measure)
    assert session.catch_up(0.0, PLENTY)
    session.step()
    assert session.tick == 2


def test_one_piece_of_work_runs_at_a_time():
    beside = BackgroundWork()
    go_on = threading.Event()
    beside.begin(lambda: TickResult(int(go_on.wait(NEVER)), None, None))
    with pytest.raises(RuntimeError, match="one piece of work at a time"):
        beside.begin(lambda: TickResult(2, None, None))
    assert beside.busy and not beside.is_done(0.0)
    go_on.set()
    assert beside.take() == TickResult(1, None, None) and not beside.busy and beside.is_done(0.0)


def test_of_an_animal_the_last_answer_holds_while_a_tick_runs(session):
    session.step(2)
    asked = ExplanationCache(session.simulation)
    known, other = session._after.ids[:2].tolist()
    told = asked.of(known)
    asked.held = True
    assert asked.of(known) is told is not None and asked.of(other) is None
    asked.held = False
    assert asked.of(other) is not None and asked.of(math.inf) is None


def test_the_window_draws_while_a_tick_takes_long(level, monkeypatch):
    window = Window(level, (640, 480))
    window.selected = int(window.session._after.ids[0])
    window.frames(4)
    gate = Gate(window.session, monkeypatch)
    tick = window.session.tick
    window.session.play()
    window.patience = 0.0
    for _ in range(6):
        window.frame(TICK)
    assert window.session.ticking
    window.overlays.add("links")  # they are of the world itself
    gate.open_soon()
    window.frame(TICK)
    assert not window.session.ticking and window.session.tick > tick
    window.close()


def test_the_main_loop_waits_for_no_tick_and_its_run_can_be_lived_again(level, tmp_path):
    window = Window(level, (640, 480))
    window.run(frames=12)
    window.session.pause()
    assert window.session.export_recording(tmp_path / "run.flock")
    assert verified(tmp_path / "run.flock").last_tick == window.session.tick
    window.close()
