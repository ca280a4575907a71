"""The window itself: keys, time, files, sizes, and what goes wrong."""

import json
from pathlib import Path

import cv2
import numpy as np
import pygame
import pytest
from flockbrush.behaviours.brush import load_brush
from flockbrush.behaviours.brush_writer import brush_to_toml
from flockbrush.behaviours.program import shipped_programs
from flockbrush.systems.commands import SetParameter
from flockbrush.systems.edits import PlaceGoal
from flockbrush.systems.program_commands import UseProgram
from flockbrush.systems.undo import UseBrush
from foreign_maps import LEVEL, level_in_tmx
from small_pasture import pasture
from window import Window

from flockbrush.studio.session import Session
from flockbrush.studio.shortcuts import ACTIONS, BY_KEY, BY_NAME, key_of, shown, tip_of
from flockbrush.studio.tools import TOOLS
from flockbrush.studio.widgets import is_open

pytestmark = pytest.mark.usefixtures("in_own_folder")


# the first half minute -----------------------------------------------------------------


def test_it_opens_with_a_brush_in_hand_that_does_something_new(window):
    assert window.tool.name == "brush" and window.brush not in window.behaviour()
    assert window.hint.said.startswith("Drag over the ground")


def test_a_key_that_was_let_go_in_a_frame_that_took_long_was_pressed_once(window, monkeypatch):
    """The clock that repeats keys goes on meanwhile."""
    pressed = []
    monkeypatch.setattr(window, "handle", lambda event: pressed.append(event) if event.type == pygame.KEYDOWN else None)
    down, up = (pygame.event.Event(kind, key=pygame.K_z) for kind in (pygame.KEYDOWN, pygame.KEYUP))
    for events, times in (([down] * 20 + [up] + [down] * 20 + [up], 2), ([down] * 3, 3), ([down] * 5 + [up], 0)):
        pressed.clear()
        pygame.event.clear()
        for event in events:
            pygame.event.post(event)
        window.events()
        assert len(pressed) == times, (len(events), len(pressed))


def test_the_legend_names_behaviours_and_leaders(window):
    window.session.play()
    window.frames(12)
    names = [name for name, *_ in window.legend._said[0]]
    assert "march" in names and any(name.startswith("leader") for name in names)


def test_the_brush_that_was_asked_for_is_in_hand(tmp_path):
    window = Window(pasture(tmp_path), brush="graze")
    assert window.brush == "graze"
    window.close()


def test_an_unknown_brush_is_refused_with_what_was_meant(tmp_path):
    with pytest.raises(LookupError, match="did you mean 'graze'"):
        Window(pasture(tmp_path), brush="grase")


@pytest.mark.parametrize(("rate", "fps"), [(1.0, 60), (1.0, 30), (8.0, 60)])
def test_what_changes_on_the_ground_is_drawn_at_once_however_fast_time_goes(window, rate, fps, monkeypatch):
    """Also where a tick is under way in every frame."""
    window.session.rate = rate
    window.session.play()
    window.frames(10, 1 / fps)
    drawn = []
    monkeypatch.setattr(window.canvas.painter, "repaint", drawn.append)
    window.do("goal", [PlaceGoal(window.new_id(), "there", 20.0, 20.0, 3.0)])
    window.frames(2, 1 / fps)
    assert len(drawn) == 1


def test_the_ground_stays_sharp_while_the_view_follows_the_herd(window):
    def sharp():
        picture = window.canvas.painter.tiles.image
        return cv2.Laplacian(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), cv2.CV_64F).var()

    window.session.play()
    window.frames(30, 1 / 60)
    still, begin = sharp(), np.median(window.session.view().xyz, axis=0)[:2]
    window.toggle_follow()
    window.frames(2, 1 / 60)
    pixel = window.canvas.pixels(np.median(window.session.view().xyz, axis=0)[:2])
    window.frames(120, 1 / 60)
    assert sharp() > 0.4 * still
    there = np.median(window.session.view().xyz, axis=0)[:2]
    assert np.hypot(*(there - begin)) * window.canvas.camera.scale > 5.0  # pixels, which the view has gone along
    assert np.abs(np.subtract(window.canvas.pixels(there), pixel)).max() < 2.0


# paint, undo, save, open again ------------------------------------------------------------


def test_what_is_painted_is_saved_and_found_again(window, tmp_path):
    before = json.loads(Path("pasture.tmj").read_text())
    window.choose("brush", "graze")
    window.drag((3, 5), (9, 5), (9, 11), (3, 11))
    window.session.play()
    window.frames(4)
    assert "graze" in window.behaviour()
    window.key("ctrl+s")
    assert window.said("error") == [] and not window.session.dirty
    painted = window.land.brush.copy()
    again = Session.open(tmp_path / "pasture.tmj")
    from flockbrush.systems.landscape import Landscape

    assert np.array_equal(again.simulation.world.resource(Landscape).brush >= 0, painted >= 0)
    again.close()
    after = json.loads(Path("pasture.tmj").read_text())
    assert after != before and {layer["name"] for layer in before["layers"]} <= {x["name"] for x in after["layers"]}


def test_undo_and_redo_by_their_buttons(window):
    window.choose("brush", "graze")
    window.drag((12, 3), (14, 3))
    window.frames(8)
    window.push(window.top.buttons["undo"])
    assert window.painted((13, 3)) is None
    window.frames(8)
    window.push(window.top.buttons["redo"])
    assert window.painted((13, 3)) == "graze"


def test_nothing_to_undo_is_said(window):
    window.key("ctrl+z")
    assert window.said() == ["there is nothing to undo"]


def test_a_level_with_a_dot_in_its_name_is_still_a_level_file(window, tmp_path):
    window.key("ctrl+shift+s")
    window.dialog.entry.set_text(str(tmp_path / "pasture v1.2"))
    window.key("return")
    assert (tmp_path / "pasture v1.2.tmj").is_file() and window.session.path.name == "pasture v1.2.tmj"


def test_quitting_with_unsaved_changes_asks_first(window):
    window.drag((12, 3), (14, 3))
    window.post(pygame.QUIT)
    assert window.running and window.dialog is not None
    window.key("escape")
    window.frames(2)
    assert window.running and window.session.dirty
    window.key("ctrl+q")
    save, leave, cancel = window.dialog.answers
    window.push(leave)
    assert not window.running


def test_who_quits_and_saves_a_shipped_level_is_gone_when_it_is_saved(tmp_path):
    window = Window("meadow", (640, 480))
    window.drag((20, 20), (24, 20))
    window.key("ctrl+q")
    window.key("return")
    window.dialog.entry.set_text(str(tmp_path / "mine.tmj"))
    window.key("return")
    assert not window.running and (tmp_path / "mine.tmj").is_file()
    window.close()


def test_a_level_in_tmx_is_saved_as_tmj(tmp_path):
    path = level_in_tmx(tmp_path)
    window = Window(path, (640, 480))
    window.key("ctrl+s")
    assert window.dialog.entry.get_text() == str(path.with_suffix(".tmj"))
    assert "Changes of a .tmx file are saved as .tmj" in window.dialog.question
    window.key("return")
    assert path.with_suffix(".tmj").is_file() and path.read_text() == LEVEL and window.said("error") == []
    window.key("ctrl+s")
    assert window.dialog is None
    window.close()


def test_who_quits_is_asked_for_the_level_and_for_changed_programs(window, tmp_path):
    mine = shipped_programs().get("stampede").source.decode().replace("8..12 s", "3..4 s")
    window.drag((12, 3), (14, 3))
    brushes = map(window.session.library.get, shipped_programs().get("stampede").brushes)
    commands = [*(UseBrush(brush.name, brush.source.decode()) for brush in brushes), UseProgram("stampede", mine)]
    assert window.session.do("program", commands)
    window.key("ctrl+q")
    assert "unsaved changes of pasture and the program stampede" in window.dialog.question
    window.dialog.answer(next(iter(window.dialog.answers)))  # Save: the level has a file
    assert window.running and not window.session.dirty and "stampede.program.toml" in window.dialog.question
    window.dialog.entry.set_text(str(tmp_path / "mine"))
    window.dialog.answer(next(iter(window.dialog.answers)))
    assert not window.running and "3..4 s" in (tmp_path / "mine" / "stampede.program.toml").read_text()


def test_who_quits_is_asked_for_every_branch_that_is_not_saved(window):
    window.session.pause()
    window.session.step(8)
    window.drag((12, 3), (14, 3))
    window.session.scrub(4)
    window.session.branch("another")
    assert not window.session.dirty
    window.key("ctrl+q")
    assert "the branch pasture" in window.dialog.question
    save = lambda: window.dialog.answer(next(iter(window.dialog.answers)))  # noqa: E731
    save()
    assert window.running and window.session.branch_name == "pasture" and window.session.dirty
    assert Path(window.dialog.entry.get_text()).name == "pasture-pasture.tmj"
    before = Path("pasture.tmj").read_bytes()
    save()
    assert not window.running and Path("pasture.tmj").read_bytes() == before != Path("pasture-pasture.tmj").read_bytes()


def test_who_quits_is_asked_for_brushes_that_were_changed(window):
    window.session.do("pace", [SetParameter("march", "max_turn", 1.25)])
    window.key("ctrl+q")
    assert "unsaved changes of the brush march." in window.dialog.question
    window.dialog.answer(next(iter(window.dialog.answers)))
    assert window.running and window.dialog.entry.get_text() == "march-2"
    window.dialog.answer(next(iter(window.dialog.answers)))
    assert not window.running
    assert load_brush(Path("brushes", "march-2.brush.toml")).params.max_turn == 1.25


@pytest.mark.parametrize("again", ["undo", "as before"])
def test_brushes_with_the_numbers_of_their_files_ask_nothing(window, again):
    usual = window.session.library.get("march").params.max_turn
    window.session.do("pace", [SetParameter("march", "max_turn", 1.25)])
    assert window.session.unsaved_brushes()
    if again == "undo":
        window.session.undo()
    else:
        window.session.do("pace", [SetParameter("march", "max_turn", usual)])
    window.key("ctrl+q")
    assert not window.running


def test_a_brush_that_was_made_in_the_run_and_is_in_no_file_asks_once_it_is_changed(window):
    own = window.session.library.get("march").with_parameters(max_turn=2.0)
    window.session.do("brush", [UseBrush("mine", brush_to_toml(own))])
    assert not window.session.unsaved_brushes()
    window.session.do("pace", [SetParameter("mine", "max_turn", 1.25)])
    window.key("ctrl+q")
    assert "unsaved changes of the brush mine." in window.dialog.question


def test_menus_of_the_time_bar_open_over_everything_and_escape_closes_them(window):
    window.session.branch("another")
    window.frames(12)
    menu = window.timebar.branches
    for choose in (False, True):
        window.push(menu)
        window.frames(2)
        shown = menu.current_state.options_selection_list
        assert is_open(menu) and shown.rect.height >= 2 * 20 and shown.rect.bottom <= menu.rect.top + 1
        if choose:
            entry = next(item for item in shown.item_list if item["text"] == "pasture")
            window.push(entry["button_element"])
            window.frames(2)
        else:
            window.key("escape")
            window.frames(2)
            assert window.session.branch_name == "another"
        assert not is_open(window.timebar.branches)
    assert window.session.branch_name == "pasture"


def test_quitting_without_changes_just_quits(window):
    window.key("ctrl+q")
    assert not window.running


def test_a_level_that_changes_on_disk_may_be_read_again(window):
    path = Path("pasture.tmj")
    window.drag((12, 3), (14, 3))  # unsaved: it is asked for
    path.write_text(path.read_text().replace('"stone"', '"menhir"'))
    window.frames(40)
    assert window.dialog is not None
    window.key("return")
    window.frames(2)
    assert [barrier.name for barrier in window.land.barriers] == ["menhir"]
    path.write_text(path.read_text().replace('"menhir"', '"boulder"'))  # nothing unsaved: it is read at once
    window.frames(40)
    assert window.dialog is None
    assert [barrier.name for barrier in window.land.barriers] == ["boulder"]


def test_a_level_that_is_broken_on_disk_is_offered_again_when_it_is_mended(window):
    path = Path("pasture.tmj")
    good = path.read_text()
    window.drag((12, 3), (14, 3))
    path.write_text("{ half a")
    window.frames(40)
    window.key("return")
    assert (
        "The level in this window is not changed" in window.said("error")[-1]
        and window.painted((13, 3)) == window.brush
    )
    window.frames(80)
    assert window.dialog is None and sum("is not changed" in text for text in window.said("error")) == 1
    path.write_text(good.replace('"stone"', '"menhir"'))
    window.frames(40)
    window.key("return")
    assert [barrier.name for barrier in window.land.barriers] == ["menhir"] and window.painted((13, 3)) is None


def settle(window, tick):
    """Let the window go to a tick; on a busy machine that takes some frames."""
    for _ in range(200):
        if window.session.tick == tick:
            break
        window.frames(1)


# time -----------------------------------------------------------------------------------


def test_space_plays_and_pauses(window):
    window.key("space")
    window.frames(8)
    assert window.session.playing and window.session.tick > 4
    window.key("space")
    tick = window.session.tick
    window.frames(4)
    assert not window.session.playing and window.session.tick == tick


def test_single_steps_go_forth_and_back(window):
    for key in (".", ".", ".", ","):
        window.key(key)
    assert (window.session.tick, window.session.last_tick) == (2, 3)


def test_the_rate_goes_from_a_quarter_to_eight(window):
    rates = []
    for key in "-----++++++++":
        window.key(key)
        rates.append(window.session.rate)
    assert min(rates) == 0.25 and max(rates) == rates[-1] == 8


def test_the_past_is_looked_at_by_dragging_along_the_strip(window):
    window.session.play()
    window.frames(40)
    window.key("space")
    there = window.standing()
    strip = window.timebar.strip
    end = strip.x + round(window.session.last_tick / window.timebar._span() * strip.width)
    window.post(pygame.MOUSEBUTTONDOWN, pos=(end, strip.centery), button=1)
    window.post(pygame.MOUSEMOTION, pos=(strip.x, strip.centery), rel=(-9, 0), buttons=(1, 0, 0))
    window.post(pygame.MOUSEBUTTONUP, pos=(strip.x, strip.centery), button=1)
    settle(window, 0)
    assert window.session.tick == 0 and not np.allclose(window.standing(), there)
    window.key("end")
    settle(window, window.session.last_tick)
    assert np.array_equal(window.standing(), there)


def test_painting_in_the_past_begins_a_branch_that_the_menu_shows(window):
    window.session.play()
    window.frames(20)
    window.scrub(4)
    settle(window, 4)
    window.drag((12, 3), (14, 3))
    window.frames(8)
    assert len(window.session.branches) == 2 and len(window.timebar._branches[0]) == 2
    old = next(name for name in window.session.branches if name != window.session.branch_name)
    window.switch(old)
    window.frames(2)
    assert window.painted((13, 3)) is None


# the view -------------------------------------------------------------------------------


def test_the_wheel_zooms_about_the_mouse(window):
    here = (16.0, 8.0)
    position = window.at(here)
    window.canvas.zoom(1.2**3, position)
    assert np.allclose(window.canvas.metres(position), here, atol=0.05)
    assert window.canvas.camera.scale > 1.5 * window.canvas.home.scale


def test_ctrl_and_the_wheel_change_the_size_of_the_brush(window, monkeypatch):
    size = window.size
    monkeypatch.setattr(pygame.key, "get_mods", lambda: pygame.KMOD_LCTRL)
    window.post(pygame.MOUSEWHEEL, x=0, y=1, precise_y=1.0)
    assert window.size > size


@pytest.mark.parametrize("how", ["middle", "space"])
def test_the_view_is_moved_by_dragging(window, how):
    before, sheep = window.canvas.camera.centre, window.standing()
    if how == "space":
        window.post(pygame.KEYDOWN, key=pygame.K_SPACE, mod=0, unicode=" ")
    window.press((12, 8), button=1 if how == "space" else 2)
    window.move((12, 8), rel=(40, 0))
    window.release((12, 8), button=1 if how == "space" else 2)
    if how == "space":
        window.post(pygame.KEYUP, key=pygame.K_SPACE, mod=0)
    assert window.canvas.camera.centre[0] < before[0] and not window.session.playing
    assert np.array_equal(window.standing(), sheep) and window.painted((12, 8)) is None
    window.key("home")
    assert window.canvas.camera == window.canvas.home


def test_a_brush_file_with_a_mistake_closes_no_window_and_is_told_where_it_is_used(window):
    (window.session.path.parent / "brushes").mkdir()
    (window.session.path.parent / "brushes" / "bad.brush.toml").write_text('name = "bad"\n')
    window.session.brush_folder()  # looks for brushes again
    window.frames(3)
    assert "bad" in window.brush_names() and window.said() == []
    window.choose("brush", "bad")
    window.drag((4, 13), (8, 13))
    assert "bad.brush.toml:1: schema: is missing" in window.said()[-1]


# all keys ---------------------------------------------------------------------------------


def test_every_key_does_something_and_nothing_breaks(window, monkeypatch):
    """One after the other in one window."""
    monkeypatch.setattr(pygame.display, "toggle_fullscreen", lambda: None)
    for action in ACTIONS:
        for key in action.keys:
            window.key(key)
            window.frames(2)
            if window.dialog is not None:
                window.key("escape")
        window.end_video()
        assert [text for text in window.said() if "this failed" in text] == [], action.name


def test_no_key_means_two_things():
    keys = [key for action in ACTIONS for key in action.keys] + [tool.key for tool in TOOLS]
    assert len(keys) == len(set(keys)) == len(BY_KEY) + len(TOOLS)


def test_every_button_says_what_it_does(window):
    shown_tips = {button.tool_tip_text for button in window.buttons}
    assert shown_tips <= {tip_of(action) for action in ACTIONS}
    for name in ("play", "step", "restart", "undo", "redo", "save", "video", "screenshot", "help"):
        assert BY_NAME[name].title in tip_of(BY_NAME[name]) and tip_of(BY_NAME[name]) in shown_tips


def test_the_help_page_has_every_key(window):
    from html import escape

    from flockbrush.studio.help import columns

    page = " ".join(columns(window.theme, 2))
    for key, title in [(action.keys[0], action.title) for action in ACTIONS] + [(t.key, t.title) for t in TOOLS]:
        assert escape(title, False) in page and f"<b>{escape(shown(key), False)}" in page
    window.key("f1")
    assert window.help.alive()
    window.key("escape")
    assert not window.help.alive()


def test_signs_are_taken_as_printed_wherever_they_lie():
    bracket = pygame.event.Event(pygame.KEYDOWN, key=pygame.K_8, mod=pygame.KMOD_RALT, unicode="[")
    assert key_of(bracket) == "["
    undo = pygame.event.Event(pygame.KEYDOWN, key=pygame.K_z, mod=pygame.KMOD_LCTRL | pygame.KMOD_LSHIFT, unicode="")
    assert key_of(undo) == "ctrl+shift+z" and shown("ctrl+shift+z") == "Ctrl+Shift+Z"


def test_letters_that_are_typed_into_a_field_take_no_tool(window):
    window.key("ctrl+e")
    window.post(pygame.KEYDOWN, key=pygame.K_v, mod=0, unicode="v")
    window.post(pygame.TEXTINPUT, text="v")
    assert window.tool.name == "brush" and window.dialog.entry.get_text().endswith("v")


def test_keys_are_for_tools_again_after_a_click_on_the_ground(window):
    from pygame_gui.elements import UITextEntryLine

    field = UITextEntryLine(pygame.Rect(300, 60, 80, 24), window.manager)
    window.manager.set_focus_set(field)
    window.key("g")
    assert window.tool.name == "brush"
    window.click((20, 3))
    window.key("g")
    assert window.tool.name == "guide"
