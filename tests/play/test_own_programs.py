"""Programs and species of a designer's own: changed in a session, restarted, kept, and saved with their level."""

import shutil

import pytest
from crashed_session import sessions, thrown_away
from flockbrush.systems.fauna import SpeciesList
from flockbrush.systems.program_commands import UseProgram
from flockbrush.systems.programs import Programs
from small_pasture import WARY, of_ones_own, texts

from flockbrush.studio.needed import programs_of
from flockbrush.studio.recorded_session import open_recorded
from flockbrush.studio.session import Session


@pytest.fixture
def own(tmp_path):
    """A session of a level of one's own species and program, which is changed: who is wary is so for longer."""
    session = Session.open(of_ones_own(tmp_path / "own", script=False), state_folder=tmp_path / "state")
    assert session.do("longer", [UseProgram("wary", WARY.replace("2..3 s", "8..9 s"))])
    session.step(2)
    yield session
    session.close()


def seconds_wary(session):
    (program,) = session.simulation.world.resource(Programs).programs
    return str(program.states["wary"].lasts)


def test_a_changed_program_is_there_after_a_restart_with_its_undo(own):
    for _ in range(2):
        own.restart()
        assert seconds_wary(own) == "8..9 s" and [p.name for p in own.unsaved_programs()] == ["wary"]
    assert own.undo() and seconds_wary(own) == "2..3 s"
    assert own.redo() and seconds_wary(own) == "8..9 s" and texts(own) == []


def test_a_program_that_lies_beside_the_level_is_found_and_is_not_unsaved(own):
    other = WARY.replace("2..3 s", "5..6 s")
    (own.path.parent / "programs" / "other.program.toml").write_text(other)
    assert {"other", "wary", "stampede"} <= set(programs_of(own).names())
    assert own.do("other", [UseProgram("other", other)])
    assert [program.name for program in own.unsaved_programs()] == ["wary"]


def test_a_program_file_that_was_written_meanwhile_counts_after_a_restart(tmp_path):
    session = Session.open(of_ones_own(tmp_path / "own"), state_folder=tmp_path / "state")
    (tmp_path / "own" / "programs" / "wary.program.toml").write_text(WARY.replace("2..3 s", "4..5 s"))
    session.restart()
    assert seconds_wary(session) == "4..5 s" and session.unsaved_programs() == []
    session.close()


@pytest.mark.parametrize("elsewhere", ["branch", "reload"])
def test_a_program_that_was_changed_on_another_branch_is_unsaved(own, elsewhere):
    own.scrub(0)
    own.branch() if elsewhere == "branch" else own.reload()
    assert own.undo() or elsewhere == "reload"
    assert seconds_wary(own) == "2..3 s"
    assert [str(program.states["wary"].lasts) for program in own.unsaved_programs()] == ["8..9 s"] and own.unsaved


def test_a_changed_program_is_kept_when_the_session_is_stopped_and_goes_to_the_trash_when_it_is_discarded(
    own, tmp_path
):
    assert own.save() and own.unsaved and own.close(keep=True)
    (left,) = Session.recoverable(own.path, tmp_path / "state")
    again = Session.recover(left, tmp_path / "state")
    assert left.programs == ("wary",) and seconds_wary(again) == "8..9 s" and again.unsaved
    before = len(thrown_away(tmp_path / "state"))
    again.close()
    assert sessions(tmp_path / "state") == [] and len(thrown_away(tmp_path / "state")) == before + 1


@pytest.mark.parametrize("of", ["level", "recording"])
def test_species_and_programs_of_ones_own_go_where_their_level_is_saved(tmp_path, of):
    (tmp_path / "elsewhere").mkdir()
    session = Session.open(of_ones_own(tmp_path / "own"), state_folder=tmp_path / "state")
    if of == "recording":
        session.step(4)
        assert session.export_recording(tmp_path / "walk.flock")
        session.close()
        session = open_recorded(tmp_path / "walk.flock", tmp_path / "state")
    shutil.rmtree(tmp_path / "own" / "programs")  # the level that is open still knows it
    texts(session)
    to = tmp_path / "elsewhere" / "pasture.tmj"
    assert session.save(to) == to and texts(session) == []
    session.close()
    assert {str(path.relative_to(to.parent)) for path in to.parent.rglob("*.toml")} == {
        "programs/wary.program.toml", "species/goat.species.toml",
    }  # fmt: skip
    again = Session.open(to, state_folder=tmp_path / "state")
    assert [one.name for one in again.simulation.world.resource(SpeciesList).assets] == ["goat"]
    assert again.level.programs["wary"].source == WARY.encode() and again.save() and texts(again) == []
    again.close()


def test_a_program_of_the_same_name_elsewhere_is_left_alone_and_said(tmp_path):
    session = Session.open(of_ones_own(tmp_path / "own"), state_folder=tmp_path / "state")
    other = tmp_path / "elsewhere" / "programs" / "wary.program.toml"
    other.parent.mkdir(parents=True)
    other.write_text(WARY.replace("2..3 s", "4..5 s"))
    assert session.save(tmp_path / "elsewhere" / "pasture.tmj")
    assert texts(session) == [f"{other} is another file of this name, which the level uses from now on"]
    assert "4..5 s" in other.read_text()
    session.close()
