"""The journal of an editor: recovered after a crash, cut off anywhere, and the level as it was at another time."""

import pytest
from edited_level import done, editor, read
from flockbrush.behaviours.brush import shipped
from flockbrush.levels.editor import Editor, JournalError
from flockbrush.systems.commands import PaintCells
from flockbrush.systems.edits import DrawGuide, Paint, PlaceGoal, RemoveThing


def stacks(edit):
    return [[(s.label, s.commands, s.back, s.tick, s.again) for s in steps] for steps in (edit.done, edit.undone)]


def history(edit, journal):
    """A day of edits, with a journal."""
    edit.journal(journal)
    for k in range(4):
        done(edit, Paint("brush", "march", 3.0, 2.0 + k, 9.0, 2.0 + k, 0.5), tick=k, join="stroke")
    done(edit, DrawGuide(20, "way", [[1.0, 1.0], [9.0, 9.0]]), back=[RemoveThing("guide", 20)], tick=10)
    done(edit, Paint("cap", 0.35, 3.0, 5.0, 9.0, 5.0, 1.0), tick=20)
    edit.undo(25, again=[PaintCells("cap", [0.35], [[2, 1, 3, 0]])])
    done(edit, PlaceGoal(21, "pen", 3.0, 3.0), tick=30)
    edit.undo(40)
    return edit


def test_a_journal_gives_the_level_and_all_steps_back(tmp_path):
    edit = history(editor(path=tmp_path / "small.tmj"), tmp_path / "journal")
    found = Editor.recover(tmp_path / "journal", shipped())
    assert found.text() == edit.text()
    assert stacks(found) == stacks(edit)
    assert (found.dirty, found.path) == (edit.dirty, edit.path)
    found.redo(50)
    edit.redo(50)
    assert found.text() == edit.text()
    found.journal(tmp_path / "journal")
    done(found, DrawGuide(22, "more", [[1.0, 1.0], [9.0, 2.0]]))
    assert Editor.recover(tmp_path / "journal", shipped()).text() == found.text()


def test_a_journal_cut_off_anywhere_opens_up_to_its_last_whole_line(tmp_path):
    edit = editor(path=tmp_path / "small.tmj")
    start = edit.text()
    history(edit, tmp_path / "journal")
    whole = (tmp_path / "journal").read_bytes()
    lines = whole.split(b"\n")
    for cut in range(len(lines[0]) + 1, len(whole), 97):
        (tmp_path / "cut").write_bytes(whole[:cut])
        found = Editor.recover(tmp_path / "cut", shipped())
        assert len(found._events) == whole[:cut].count(b"\n") - 1
        if not found._events:
            assert found.text() == start
    (tmp_path / "cut").write_bytes(lines[0][:50])
    with pytest.raises(JournalError, match="this is not the journal of an editor"):
        Editor.recover(tmp_path / "cut")
    with pytest.raises(JournalError, match="cannot be read: No such file"):
        Editor.recover(tmp_path / "none")


def test_a_journal_that_can_no_longer_be_written_stops_nobody(tmp_path):
    edit = editor(path=tmp_path / "small.tmj")
    edit.journal(tmp_path / "journal")
    edit._journal.close()
    done(edit, DrawGuide(20, "way", [[1.0, 1.0], [9.0, 9.0]]))
    assert "journal: cannot be written" in edit.journal_problem
    assert edit.undo_label == "edit"


def test_the_document_of_another_time_with_what_came_after_to_be_done_again(tmp_path):
    edit = history(editor(path=tmp_path / "small.tmj"), tmp_path / "journal")
    end, steps = edit.text(), stacks(edit)
    early = edit.at(10)
    assert read(early).guides == []
    assert len(early.done) == 1
    assert [s.tick for s in early.undone] == [10]
    assert read(edit.at(10, after=True)).guides[0].name == "way"
    assert edit.at(0).undo_label is None
    early.redo(12)
    assert early.text() == end
    done(early, DrawGuide(23, "other", [[1.0, 1.0], [9.0, 3.0]]), tick=13)
    assert (edit.text(), stacks(edit)) == (end, steps)  # the other branch is as it was
    early.journal(tmp_path / "branch")
    assert Editor.recover(tmp_path / "branch", shipped()).text() == early.text()
    assert edit.at(99).text() == end


def test_a_branch_of_a_saved_level_is_dirty_where_it_differs(tmp_path):
    edit = editor(path=tmp_path / "small.tmj")
    done(edit, DrawGuide(20, "way", [[1.0, 1.0], [9.0, 9.0]]), tick=5)
    edit.save()
    done(edit, PlaceGoal(21, "pen", 3.0, 3.0), tick=9)
    assert not edit.at(7).dirty
    branch = edit.at(3)
    assert branch.dirty
    done(branch, PlaceGoal(21, "pen", 3.0, 3.0), tick=4)
    assert branch.dirty
