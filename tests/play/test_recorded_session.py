"""A recording in the playground: every moment of it, branches from it, its level saved elsewhere; itself untouched."""

import os
import time

import numpy as np
import pytest
import typer
from crashed_session import crashed, thrown_away
from flockbrush.behaviours.brush import load_brush, shipped
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.engine.recording import RecordingError, open_recording
from flockbrush.engine.state import state_hash
from flockbrush.systems.commands import SetParameter
from flockbrush.systems.edits import RemoveThing
from flockbrush.systems.landscape import Landscape
from flockbrush.systems.obstacle_commands import AddObstacle
from flockbrush.systems.paint_commands import PaintBrush
from flockbrush.systems.undo import UseBrush
from small_pasture import advance, pasture, stroke, verified
from typer.testing import CliRunner
from window import Window

from flockbrush.cli.main import app as cli
from flockbrush.runs.run import record, start
from flockbrush.studio import session_folders
from flockbrush.studio.app import App
from flockbrush.studio.recorded_session import open_recorded, recovered, unpack
from flockbrush.studio.recovery import leftovers
from flockbrush.studio.session import Session
from flockbrush.studio.start import StartOptions, opening_of, refuse_wishes

TICKS = 96


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Three seconds of the pasture, with the script of its level."""
    folder = tmp_path_factory.mktemp("recorded")
    made = folder / "walk.flock"
    ran = CliRunner().invoke(cli, ["run", str(pasture(folder)), "--seconds", "3", "--record", str(made)])
    assert ran.exit_code == 0, ran.output
    return made


@pytest.fixture
def session(recording, tmp_path):
    session = open_recorded(recording, tmp_path / "state")
    yield session
    session.close()


def test_it_begins_at_the_first_tick_with_all_of_the_run_known(session):
    assert (session.tick, session.last_tick, session.in_past) == (0, TICKS, True)
    assert any("walk.flock: 3 s" in notice.text for notice in session.notices())


def test_it_says_when_this_version_shows_another_motion_than_was_recorded(recording, tmp_path, monkeypatch):
    run = open_recording(recording)
    run.hashes[0] = "0" * 16
    monkeypatch.setattr("flockbrush.studio.recorded_session.open_recording", lambda path: run)
    session = open_recorded(recording, tmp_path / "state")
    session.scrub(40)
    warnings = [notice.text for notice in session.notices() if notice.kind == "warning"]
    session.close()
    assert len(warnings) == 1 and "this is not what was recorded" in warnings[0]


def test_any_moment_can_be_reached_and_is_what_was_recorded(session):
    known = session.timeline.current.hashes
    done = {tick for tick, _ in session.timeline.current.commands}  # there the recorded hash is of before it was done
    assert done == {8}
    for tick in np.random.default_rng(3).integers(0, TICKS + 1, 8):
        session.scrub(int(tick))
        assert session.tick == tick
        assert (state_hash(session.simulation.world) == known[int(tick)]) == (tick not in done)
    assert session.timeline.current.differs is None and len(session.branches) == 1


def test_what_is_done_in_it_begins_a_branch_that_verifies(session, tmp_path):
    session.scrub(40)
    assert session.do("paint", [stroke("swarm", 6, 8, 3)])
    session.step(8)
    assert len(session.branches) == 2 and session.last_tick == 48
    assert session.branches["main"].last_tick == TICKS
    assert session.export_recording(tmp_path / "branch.flock")
    assert verified(tmp_path / "branch.flock").last_tick == 48


def test_time_goes_on_after_the_end_of_the_recording(session):
    session.scrub(TICKS)
    session.step(5)
    assert session.tick == session.last_tick == TICKS + 5


def test_its_level_is_saved_under_another_name_and_the_recording_stays(recording, tmp_path, monkeypatch):
    before = recording.read_bytes()
    monkeypatch.chdir(tmp_path)
    window = Window.__new__(Window)
    App.__init__(window, open_recorded(recording, tmp_path / "state"), (1000, 640), "light")
    window.frames(2)
    assert window.session.lent
    window.key("ctrl+s")
    assert window.dialog.entry.get_text() == str(tmp_path / "pasture.tmj")
    window.key("return")
    window.frames(2)
    assert not window.session.lent and (tmp_path / "pasture.tmj").exists()
    assert CliRunner().invoke(cli, ["level", "check", str(tmp_path / "pasture.tmj")]).exit_code == 0
    assert window.said("error") == []
    window.close()
    assert recording.read_bytes() == before


def obstacles(session):
    return {(obstacle.id, obstacle.name) for obstacle in session.simulation.world.resource(Landscape).obstacles}


@pytest.fixture(params=["from its beginning", "after a crash"])
def worked_on(request, tmp_path):
    """A recording at its end: a rampart was built in it, a place painted, and another painted and undone."""
    made = Session.open(pasture(tmp_path), state_folder=tmp_path / "made")
    made.step(10)
    assert made.do("wall", [AddObstacle("rampart", [[10, 2], [12, 2], [12, 3], [10, 3]], id=made.editor.new_id())])
    assert made.do("paint", [stroke("swarm", 6, 8, 3)]) and made.do("paint", [stroke("march", 20, 3, 2)])
    made.step(2)
    assert made.undo()
    made.step(4)
    assert made.export_recording(tmp_path / "worked.flock")
    made.close()
    session = open_recorded(tmp_path / "worked.flock", tmp_path / "state")
    assert [notice.kind for notice in session.notices()] == ["info"] and not session.dirty
    if request.param == "after a crash":
        session.scrub(session.last_tick)
        assert session.do("paint", [stroke("swarm", 20, 13, 1)])
        session.close(keep=True)
        session = recovered(Session.recoverable(tmp_path / "worked.flock", tmp_path / "state")[0], tmp_path / "state")
        assert session.lent and session.path.exists()
    session.scrub(session.last_tick)
    yield session
    session.close()


def test_what_was_built_and_painted_in_a_recorded_run_is_in_its_level(worked_on, tmp_path):
    session = worked_on
    known = obstacles(session)
    wall = next(number for number, name in known if name == "rampart")
    assert session.do("shed", [AddObstacle("shed", [[2, 2], [3, 2], [3, 3], [2, 3]], id=session.editor.new_id())])
    assert obstacles(session) > known and len(obstacles(session)) == len(known) + 1
    (tmp_path / "saved").mkdir()
    assert session.save(tmp_path / "saved" / "pasture.tmj")
    saved = Session.open(tmp_path / "saved" / "pasture.tmj", state_folder=tmp_path / "other")
    land, shown = (one.simulation.world.resource(Landscape) for one in (saved, session))
    assert obstacles(saved) == obstacles(session) and (land.brush == shown.brush).all() and land.brush.any()
    saved.close()
    assert session.do("remove", [RemoveThing("obstacle", wall)]) and wall not in dict(obstacles(session))
    assert session.undo() and wall in dict(obstacles(session))
    session.restart()
    assert {name for _, name in obstacles(session)} >= {"rampart", "shed"} and session.tick == 0


def test_a_level_as_it_was_earlier_lacks_what_was_built_later(worked_on):
    worked_on.scrub(5)
    assert "rampart" not in worked_on.editor.at(5).text() and "rampart" in worked_on.editor.text()
    worked_on.branch("early")
    assert "rampart" not in worked_on.editor.text()


def test_what_the_script_of_a_level_does_is_no_change_of_the_level(session):
    assert session.timeline.current.commands and session.timeline.current.done_by_hand() == []


def test_brushes_that_were_made_in_a_run_are_saved_beside_its_level(tmp_path):
    for folder in ("made", "elsewhere"):
        (tmp_path / folder).mkdir()
    made = Session.open(pasture(tmp_path / "made"), state_folder=tmp_path / "state")
    mine = shipped().get("swarm").model_copy(update={"name": "mine"})
    assert made.do("make", [UseBrush("mine", brush_to_toml(mine))]) and made.do("paint", [stroke("mine", 6, 8, 3)])
    made.restart()
    made.step(4)
    assert made.export_recording(tmp_path / "made.flock") and made.save()
    saved = [notice.text for notice in made.notices() if notice.kind == "warning"]
    assert made.do("tune", [SetParameter("mine", "cohesion_weight", 0.31)]) and made.save()
    assert saved == [] and [n.text.split(":")[0] for n in made.notices() if n.kind == "warning"] == ["mine"]
    recorded = open_recorded(tmp_path / "made.flock", tmp_path / "state")
    assert recorded.save(tmp_path / "elsewhere" / "copy.tmj")
    for session, file in ((made, made.path), (recorded, tmp_path / "elsewhere" / "copy.tmj")):
        assert [notice.text for notice in session.notices() if notice.kind != "info"] == []
        assert load_brush((file.parent / "brushes" / "mine.brush.toml").read_bytes(), "mine.brush.toml") == mine
        assert CliRunner().invoke(cli, ["level", "check", str(file)]).exit_code == 0
        session.close()


def test_who_saves_a_level_is_told_once_that_changed_brushes_are_in_no_file(tmp_path):
    session = Session.open(pasture(tmp_path), state_folder=tmp_path / "state")
    said = lambda: [notice.text for notice in session.notices() if notice.kind == "warning"]  # noqa: E731
    assert session.save() and said() == []
    assert session.do("tune", [SetParameter("march", "cohesion_weight", 0.31)])
    assert session.save()
    assert [text.split(":")[0] for text in said()] == ["march"]
    assert session.save() and said() == []
    assert session.undo() and session.save() and said() == []
    session.close()


def test_what_a_level_cannot_hold_of_a_recorded_run_is_said(tmp_path):
    simulation = start(pasture(tmp_path))
    for tick in range(4):
        simulation.submit(PaintBrush("swarm", 6.0 + tick, 8.0, 2.0), tick)
    recorder = record(tmp_path / "script.flock", simulation)
    for _ in range(8):
        simulation.tick()
        recorder.take()
    recorder.close()
    simulation.close()
    session = open_recorded(tmp_path / "script.flock", tmp_path / "state")
    warnings = [notice.text for notice in session.notices() if notice.kind == "warning"]
    session.close()
    assert len(warnings) == 1 and "a saved level will lack" in warnings[0]
    assert warnings[0].count("PaintBrush at") == 3 and warnings[0].endswith("and 1 more")


def test_new_objects_of_a_run_whose_level_cannot_be_edited_get_ids_of_their_own(tmp_path):
    made = Session.open("sheep-pasture", agents=3000, state_folder=tmp_path / "made")
    number = made.editor.new_id()
    assert made.do("wall", [AddObstacle("wall", [[1, 1], [2, 1], [2, 2]], id=number)])
    made.step(1)
    assert made.export_recording(tmp_path / "many.flock")
    made.close()
    session = open_recorded(tmp_path / "many.flock", tmp_path / "state")
    assert session.editor.new_id() > number
    session.close()


def test_undo_in_the_past_takes_back_what_was_done_until_then(session):
    session.scrub(TICKS)
    assert session.do("paint", [stroke("swarm", 6, 8, 3)]) and session.undo_label == "paint"
    session.step(3)
    session.scrub(20)
    assert session.undo_label is None and session.redo_label == "paint"
    session.edits.select([1, 2])
    session.edit("delete")
    assert session.undo_label and session.undo() and not session.edits.file.edits()
    assert session.branch_name == "main"


def test_nothing_of_it_stays_in_the_folder_of_sessions(recording, tmp_path):
    open_recorded(recording, tmp_path / "state").close()
    assert not [path for path in (tmp_path / "state").rglob("*.tmj") if "trash" not in path.parts]


def test_nothing_stays_either_where_a_signal_ends_it_with_nothing_unsaved(recording, tmp_path):
    open_recorded(recording, tmp_path / "state").close(keep=True)
    assert [path for path in (tmp_path / "state").rglob("*") if path.is_file()] == []


def frames(session, count):
    for _ in range(count):
        advance(session, 0.4, 10)


def test_after_a_crash_who_opens_the_recording_is_offered_the_session_with_its_edits(recording):
    session = open_recorded(recording)
    assert session.do("paint", [stroke("swarm", 6, 8, 3)])
    crashed(session)
    session.edits.close()
    opening = opening_of(StartOptions(str(recording)), (1000, 640))
    window = opening.then(opening.work(), (1000, 640))
    assert window.dialog is not None and "walk.flock, " in window.dialog.question
    window.dialog.answer(next(iter(window.dialog.answers)))
    session = window.session
    assert (
        session.branch_name == "main-2" and session.lent and session.path.is_relative_to(session_folders.state_folder())
    )
    session.switch("main")
    session.edits.select([1, 2])
    session.scrub(0)
    session.edit("delete")
    assert len(session.view()) == 7 and session.undo()
    session.scrub(TICKS - 4)
    session.play()
    frames(session, 3)
    assert session.tick == TICKS and not session.playing
    window.close()


def test_a_session_whose_recording_is_gone_is_recovered_without_edits(recording, tmp_path):
    copy = tmp_path / "copy.flock"
    copy.write_bytes(recording.read_bytes())
    session = open_recorded(copy, tmp_path / "state")
    assert session.do("paint", [stroke("swarm", 6, 8, 3)]) and session.save(tmp_path / "saved.tmj")
    assert session.undo() and session.close(keep=True)
    copy.unlink()
    (left,) = Session.recoverable(tmp_path / "saved.tmj", tmp_path / "state")
    assert Session.recoverable(copy, tmp_path / "state") == [left]
    session = recovered(left, tmp_path / "state")
    assert session.edits is None and any("copy.flock: there is no such file" in n.text for n in session.notices())
    assert session.path == tmp_path / "saved.tmj" and not session.lent and session.redo()
    session.close()


def test_the_trash_of_recordings_is_counted_and_removed(recording, tmp_path, monkeypatch):
    state = tmp_path / "state"
    for _ in range(2):
        session = open_recorded(recording, state)
        assert session.do("paint", [stroke("swarm", 6, 8, 3)])
        session.close()
    old, new = thrown_away(state)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    (old / "recorded" / "linked").symlink_to(tmp_path / "mine", target_is_directory=True)
    os.utime(old, (1e9, time.time() - 60))
    each = sum(path.stat().st_size for path in new.rglob("*") if path.is_file())
    monkeypatch.setattr(session_folders, "LARGEST_TRASH", 1.5 * each)
    leftovers(root=state)
    assert thrown_away(state) == [new]
    os.utime(new, (1e9, 1e9))
    leftovers(root=state)
    assert thrown_away(state) == [] and (tmp_path / "mine" / "notes.txt").read_text() == "mine"


def test_a_recording_that_cannot_be_opened_leaves_no_folder(recording, tmp_path, monkeypatch):
    monkeypatch.setattr("flockbrush.studio.recorded_session.Branch.begun", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        open_recorded(recording, tmp_path / "state")
    assert list((tmp_path / "state").iterdir()) == []


def test_names_that_lead_out_of_the_folder_are_refused(tmp_path):
    for name in ("../evil", "/etc/evil", "a/../../b", "c:evil", "a\\b"):
        with pytest.raises(RecordingError, match=r"r\.flock: contains a file .* outside its folder"):
            unpack({name: b"x"}, tmp_path / "in", "r.flock")
    assert not (tmp_path / "evil").exists()


def test_what_is_no_recording_is_refused_in_words(tmp_path):
    (tmp_path / "bad.flock").write_bytes(b"no recording")
    with pytest.raises(RecordingError, match="bad.flock"):
        open_recorded(tmp_path / "bad.flock", tmp_path / "state")
    with pytest.raises(typer.BadParameter):
        refuse_wishes(StartOptions("walk.flock", seed=3))


def test_a_recording_of_a_shipped_level_is_edited_and_saved_elsewhere(tmp_path):
    made = tmp_path / "walk.flock"
    ran = CliRunner().invoke(cli, ["run", "sheep-pasture", "--agents", "8", "--seconds", "0.5", "--record", str(made)])
    assert ran.exit_code == 0, ran.output
    session = open_recorded(made, tmp_path / "state")
    assert [notice.kind for notice in session.notices()] == ["info"]
    assert session.do("paint", [stroke("graze", 30, 40, 5)]) and session.undo_label == "paint"
    (tmp_path / "mine").mkdir()
    assert session.save(tmp_path / "mine" / "pasture.tmj")
    session.close()
    assert CliRunner().invoke(cli, ["level", "check", str(tmp_path / "mine" / "pasture.tmj")]).exit_code == 0


def test_playing_pauses_at_the_end_of_the_recording_and_goes_on_when_asked(session):
    session.scrub(TICKS - 20)
    session.play()
    frames(session, 6)
    assert session.tick == TICKS and not session.playing
    assert any("end of the recording" in notice.text for notice in session.notices())
    session.play()
    frames(session, 6)
    assert session.tick > TICKS and session.playing
    session.scrub(20)
    session.play()
    session.do("paint", [stroke("swarm", 6, 8, 3)])
    frames(session, 12)
    assert session.branch_name != "main" and session.tick > TICKS  # a branch has no recorded end
