"""The panels in the real window: tabs, sliders, names for new brushes, one animal and its forces."""

import pytest
from flockbrush.components import Position
from small_pasture import pasture
from window import Window

from flockbrush.studio.panels import PANELS

TITLES = [kind.title for kind in PANELS]


@pytest.fixture
def window(tmp_path):
    made = Window(pasture(tmp_path, script=False), brush="march")
    yield made
    made.close()


def show(window, title):
    window.push(window.column.tabs[TITLES.index(title)])
    return next(panel for panel in window.panels if panel.title == title)


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
