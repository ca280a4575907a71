"""All controls by keys: F6, Tab and arrows reach and turn what the mouse does."""

import pygame
import pytest
from pygame_gui.elements import UIDropDownMenu, UIHorizontalSlider
from small_pasture import pasture
from window import Window

from flockbrush.studio.shortcuts import BY_NAME, tip_of


@pytest.fixture
def window(tmp_path):
    opened = Window(pasture(tmp_path, script=False), (1100, 700))
    yield opened
    assert opened.said("error") == []
    opened.close()


def key(window, code, mod=0):
    window.post(pygame.KEYDOWN, key=code, mod=mod, unicode="")
    window.post(pygame.KEYUP, key=code, mod=mod)
    window.frames(2)


def go_to(window, wanted, way=0):
    """Tab until a control is reached that fits; the control."""
    keys = window.control_keys
    for _ in range(200):
        key(window, pygame.K_TAB, way)
        if wanted(keys.now):
            return keys.now
    raise AssertionError("Tab never reached it")


def test_tab_reaches_every_button_of_the_bars_and_comes_round(window):
    key(window, pygame.K_F6)
    first, seen = window.control_keys.now, set()
    for _ in range(200):
        seen.add(window.control_keys.now)
        key(window, pygame.K_TAB)
        if window.control_keys.now is first:
            break
    assert window.control_keys.now is first
    assert {button for button in window.buttons if button.is_enabled} <= seen
    assert {type(one) for one in seen} >= {UIHorizontalSlider}


def test_arrows_turn_a_slider_and_escape_gives_the_keys_back(window):
    key(window, pygame.K_F6)
    before = window.size
    slider = go_to(window, lambda one: one is window.toolbox.sliders["size"].slider)
    key(window, pygame.K_RIGHT)
    once = window.size
    key(window, pygame.K_RIGHT, pygame.KMOD_SHIFT)
    assert before < once < window.size
    more = window.size
    assert slider.alive()
    key(window, pygame.K_LEFT)
    assert once < window.size < more
    key(window, pygame.K_ESCAPE)
    assert window.control_keys.now is None
    left = window.canvas.camera
    key(window, pygame.K_RIGHT)
    assert window.canvas.camera != left  # an arrow moves the view again


def test_enter_presses_a_button_and_space_does_not_play(window):
    key(window, pygame.K_F6)
    playing, theme = window.session.playing, window.theme.name
    go_to(window, lambda one: one in window.buttons and one.tool_tip_text == tip_of(BY_NAME["help"]))
    key(window, pygame.K_SPACE)
    assert window.help is not None and window.help.alive()
    assert (window.session.playing, window.theme.name) == (playing, theme)


def test_a_menu_is_turned_by_arrows(window):
    key(window, pygame.K_F6)
    speeds = lambda one: isinstance(one, UIDropDownMenu) and ("½×", "½×") in one.options_list  # noqa: E731
    menu = go_to(window, speeds)
    rate = window.session.rate
    assert menu.selected_option[0] == "1×"
    key(window, pygame.K_UP)
    assert window.session.rate == rate / 2
    key(window, pygame.K_DOWN)
    assert window.session.rate == rate
