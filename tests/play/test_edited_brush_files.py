"""Brush files that are edited on disk while a session tunes what was loaded from them; a restart has both."""

from flockbrush.behaviours.brush import load_brush, shipped
from flockbrush.systems.commands import SetParameter
from flockbrush.systems.palette import Palette
from small_pasture import pasture, texts

from flockbrush.studio.needed import brush_needed
from flockbrush.studio.session import Session


def with_own_march(folder, where="own", **options):
    """(a session of a pasture with a brush file of its own, a function that edits that file, and one to ask it)."""
    (folder / where).mkdir(parents=True)
    file = folder / where / "march.brush.toml"
    file.write_bytes(shipped().get("march").source)
    session = Session.open(pasture(folder, script=False, **options), state_folder=folder.parent / "state")

    def edit(**parameters):
        file.write_bytes(load_brush(file).with_parameters(**parameters).source)

    def number(name):
        palette = session.simulation.world.resource(Palette)
        return palette.brushes[palette.named("march")].parameters[name]

    return session, edit, number


def test_a_brush_file_that_was_edited_meanwhile_counts_beside_what_was_tuned(tmp_path):
    session, edit, number = with_own_march(tmp_path / "levels", brush="own/march.brush.toml")
    session.do("tune", [SetParameter("march", "cohesion_weight", 0.25)])
    session.do("tune", [SetParameter("march", "alignment_weight", 0.11)])
    edit(alignment_weight=0.77, avoidance_weight=0.33)
    for _ in range(2):
        session.restart()
        assert [number(f"{name}_weight") for name in ("cohesion", "alignment", "avoidance")] == [0.25, 0.77, 0.33]
    assert [text for text in texts(session) if text.startswith("march: changed on disk, so the file as it is now")]
    session.step(2)
    assert session.undo() and session.undo()  # the file as it is now, without what was tuned
    assert number("cohesion_weight") == shipped().get("march").parameters["cohesion_weight"]
    assert (number("alignment_weight"), number("avoidance_weight")) == (0.77, 0.33)
    session.restart()
    assert texts(session) == []
    session.close()


def test_an_edited_file_of_a_brush_that_was_brought_by_hand_counts(tmp_path):
    session, edit, number = with_own_march(tmp_path / "levels", "brushes", brush="graze")
    session.do("bring", brush_needed(session, "march"))
    session.do("tune", [SetParameter("march", "cohesion_weight", 0.25)])
    session.restart()
    assert number("cohesion_weight") == 0.25
    edit(alignment_weight=0.77)
    for _ in range(2):
        session.restart()
        assert (number("cohesion_weight"), number("alignment_weight")) == (0.25, 0.77)
    session.close()


def test_an_edited_file_of_a_brush_that_nobody_tuned_is_read_again(tmp_path):
    session, edit, number = with_own_march(tmp_path / "levels", brush="own/march.brush.toml")
    edit(alignment_weight=0.77)
    session.restart()
    assert number("alignment_weight") == 0.77 and session.unsaved_brushes() == []
    session.close()
