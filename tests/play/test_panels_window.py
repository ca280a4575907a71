"""The panels in the real window: tabs, sliders, names for new brushes, one animal and its forces."""

import pygame
import pytest
from flockbrush.behaviours.brush import load_brush
from flockbrush.components import Position
from small_pasture import pasture
from window import Window

from flockbrush.studio.panels import PANELS
from flockbrush.studio.panels.panel import palette_of

TITLES = [kind.title for kind in PANELS]


@pytest.fixture
def window(tmp_path):
    made = Window(pasture(tmp_path, script=False), brush="march")
    yield made
    made.close()


def show(window, title):
    window.push(window.column.tabs[TITLES.index(title)])
    return next(panel for panel in window.panels if panel.title == title)


def row(panel, name):
    return next(row for row in panel.rows if row.knob.name == name)


def drag(window, element, right):
    """Take a slider's knob and move it by so many pixels."""
    x, y = element.rect.center
    hold(window, (x, y), (0, 0, 0))
    window.post(pygame.MOUSEBUTTONDOWN, pos=(x, y), button=1)
    for k in range(1, 5):
        hold(window, (x + k * right // 4, y), (1, 0, 0))
    window.post(pygame.MOUSEBUTTONUP, pos=(x + right, y), button=1)
    window.frames(2)


def hold(window, at, buttons):
    pygame.mouse.set_pos(at)
    window.post(pygame.MOUSEMOTION, pos=at, rel=(0, 0), buttons=buttons)
    window.frames(2)


def running(window, name="march"):
    palette = palette_of(window.session)
    return palette.brushes[palette.named(name)]


def test_a_slider_turns_the_herd_and_undo_turns_it_back(window):
    panel, before = show(window, "Brush"), running(window)
    window.session.play()
    drag(window, row(panel, "pace").slider.sliding_button, 40)
    assert running(window).speed.mean > before.speed.mean
    window.key("ctrl+z")
    assert running(window) == before
    window.key("ctrl+y")
    assert running(window).speed.mean > before.speed.mean
    assert window.said("error") == []


def test_what_was_tuned_is_saved_by_name_and_can_be_painted_with(window, tmp_path):
    panel = show(window, "Brush")
    window.push(panel.mode)
    panel.turn(row(panel, "mean").knob, 2.5, True)
    window.push(panel.save)
    window.dialog.entry.set_text("")
    window.type("shy-march")
    window.frames(3)
    saved = load_brush(tmp_path / "brushes" / "shy-march.brush.toml")
    assert saved.speed.mean == 2.5 and saved.provenance.kind == "hand-set"
    assert window.brush == "shy-march" and "shy-march" in window.said("info")[-1]
    window.key("b")
    window.drag((5, 8), (8, 8))
    assert window.painted((6, 8)) == "shy-march"
    assert window.said("error") == []


def test_a_clicked_animal_is_explained(window):
    window.session.play()
    window.frames(12)
    window.session.pause()
    window.key("v")
    animal = int(window.agents.ids[4])
    window.click(window.agents[Position.xyz][4, :2])
    assert window.selected == animal
    panel = window.column.made[window.column.index][0]
    assert panel.title == "Animal"
    window.frames(10)
    assert panel.pictures.keys() == {"facts", "pulls"}
    window.overlays.discard("forces")
    window.frames(2)
    without = window.canvas.frame.copy()
    window.overlays.add("forces")
    window.frames(2)
    assert (window.canvas.frame != without).any()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_every_tab_lives_through_time_themes_and_sizes(tmp_path, theme):
    window = Window(pasture(tmp_path), theme=theme)
    window.session.play()
    for title in TITLES:
        show(window, title)
        window.frames(6)
    window.resize((700, 420))
    window.frames(4)
    window.set_scale(1.5)
    window.frames(4)
    window.session.restart()
    window.frames(4)
    assert window.said("error") == []
    window.close()


def test_choosing_colours_in_the_list_makes_the_window_anew(window):
    import pygame_gui

    panel = show(window, "View")
    window.post(pygame_gui.UI_DROP_DOWN_MENU_CHANGED, ui_element=panel.theme, text="dark")
    window.frames(2)
    assert window.theme.name == "dark" and window.said("error") == []
    panel = window.column.made[window.column.index][0]
    assert panel.title == "View" and panel.theme.selected_option[0] == "dark"
    window.post(pygame_gui.UI_DROP_DOWN_MENU_CHANGED, ui_element=panel.scale, text="125 %")
    window.frames(2)
    assert window.scale == 1.25
