"""What the window shows stays true when it is undone, changed, or seen in the past."""

import numpy as np
import pytest
from flockbrush.components import Position
from flockbrush.systems.commands import SetParameter
from flockbrush.systems.edits import PlaceGoal
from small_pasture import pasture
from window import Window

from flockbrush.studio.hunters import hunters
from flockbrush.studio.widgets import PictureButton


@pytest.fixture
def window(tmp_path, in_own_folder):
    window = Window(pasture(tmp_path))
    yield window
    window.close()


def test_a_thing_stays_selected_when_its_move_is_undone(window):
    assert window.session.do("goal", [PlaceGoal(window.session.editor.new_id(), "fold", 18.0, 4.0)])
    window.key("v")
    window.drag((18, 4), (14, 4))
    window.key("ctrl+z")
    window.frames(2)
    assert "goal 'fold'" in window.hint.said
    window.key("delete")
    window.frames(2)
    assert not window.land.goals and window.hint.said == window.tool.hint


def test_of_a_thing_that_is_undone_nothing_more_is_said(window):
    assert window.session.do("goal", [PlaceGoal(window.session.editor.new_id(), "fold", 18.0, 4.0)])
    window.key("v")
    window.click((18, 4))
    assert "goal 'fold'" in window.hint.said
    window.session.undo()
    window.move((4, 12))
    window.frames(2)
    assert window.hint.said == window.tool.hint


def test_animals_that_were_added_and_undone_leave_no_trails(window):
    window.session.pause()
    window.frames(4)
    window.key("n")
    window.drag((12, 10), (18, 10))
    window.frames(8)
    trails = window.painter.trails
    assert trails.alpha.any()
    while window.session.undo():
        pass
    window.frames(2)
    there = window.agents[Position.xyz][:, :2]
    inked = np.argwhere(trails.alpha[..., 0])[:, ::-1]
    on_screen = window.canvas.camera.pixels(there)
    assert all(np.hypot(*(on_screen - spot).T).min() < 12 for spot in inked)


def test_the_tile_of_a_brush_is_that_of_its_numbers(window):
    palette = window.toolbox.palette
    shown = []
    tile = palette._make("march")
    tile.picture = lambda *pictures, at: shown.append(pictures)
    window.session.do("tune", [SetParameter("march", "max_turn", 1.0)])
    window.frames(12)
    window.session.undo()
    window.frames(12)
    assert len(shown) >= 2 and palette._pictured["march"] is window.find_brush("march")


def test_a_button_stays_selected_when_its_picture_is_another(window):
    palette = window.toolbox.palette
    chosen = palette._make(window.paint["brush"])
    assert isinstance(chosen, PictureButton) and chosen.is_selected
    chosen.picture(*chosen._pictures, at=chosen._at)
    assert chosen.drawable_shape.active_state is chosen.drawable_shape.states["selected"]


def test_a_lion_has_the_brush_of_lions_where_wolves_are(window):
    names = window.brush_names
    window.brush_names = lambda: ["wolf-hunt", *names()]  # of a level with wolves
    known = hunters(window)
    assert known["lion"].brush.startswith("lion-") and known["wolf"].brush == "wolf-hunt"


def test_who_saves_in_the_past_is_told_that_the_end_is_saved(window):
    window.session.pause()
    window.session.step(8)
    window.drag((12, 3), (14, 3))
    window.session.scrub(2)
    window.frames(2)
    window.key("ctrl+s")
    assert window.said()[-1].endswith(", as the level is at the end of this branch")


def test_the_view_says_whom_it_follows(window):
    window.key("t")
    assert "follows the herd" in window.said()[-1]
    window.key("t")
    window.select(int(window.agents.ids[0]))
    window.key("t")
    assert "follows the selected animal" in window.said()[-1]


def test_paint_that_binds_nobody_says_why_once(window):
    for brush in ("falcon", "falcon", "sparrows", "graze"):
        window.choose("brush", brush)
        window.drag((4, 13), (8, 13))
    told = [text for text in window.said("info") if text.startswith("Paint")]
    assert told[0] == "Paint of falcon binds none of these animals: it is made for falcon, raptor, and they are sheep."
    assert [text.split()[2] for text in told] == ["falcon", "sparrows"]
    window.key("f")
    window.choose("brush", "geese")
    window.click((20, 13))
    assert "made for goose, skein" in window.said("info")[-1]
