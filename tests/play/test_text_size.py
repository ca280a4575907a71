"""Large words: no control goes away for good, and the usual size comes back with one key."""

import pytest
from pygame_gui.elements import UIButton, UIScrollingContainer
from small_pasture import pasture
from window import Window

from flockbrush.studio.layout import places
from flockbrush.studio.panels import PANELS
from flockbrush.studio.settings import load_settings
from flockbrush.studio.shortcuts import BY_KEY
from flockbrush.studio.tools import TOOLS


@pytest.fixture
def opened(tmp_path):
    """``opened(size, **options)``: a window on a pasture."""
    windows = []

    def open_one(size=(1280, 720), **options):
        windows.append(Window(pasture(tmp_path, script=False), size, **options))
        return windows[-1]

    yield open_one
    for window in windows:
        assert window.said("error") == []
        window.close()


@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0, 3.0])
@pytest.mark.parametrize("size", [(1280, 720), (800, 600)])
def test_no_part_goes_away_because_the_words_are_large(size, scale):
    place = places(size, scale)
    assert None not in vars(place).values()
    assert place.canvas.width >= size[0] // 3 - 2 and place.canvas.height >= 60


@pytest.mark.parametrize("scale", [2.0, 3.0])
def test_every_tab_and_tool_is_there_with_large_words(opened, scale):
    window = opened(scale=scale)
    area = window.screen.get_rect()
    assert len(window.column.tabs) == len(PANELS)
    for tab in window.column.tabs:
        assert area.contains(tab.rect)
        words = tab.font.size(tab.text)[0]
        assert scale > 2 or words <= tab.rect.width
    assert len(window.toolbox.tools) == len(TOOLS)
    assert all(area.contains(button.rect) for button in window.toolbox.tools)


@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0])
def test_the_words_of_buttons_fit_in_them(opened, scale):
    window = opened(scale=scale)
    for tab in list(window.column.tabs):
        window.push(tab)
        window.frames(2)
        buttons = [part for part in window.manager.get_sprite_group().sprites() if type(part) is UIButton]
        assert len(buttons) > 12
        cut = [part.text for part in buttons if part.font.size(part.text)[0] > part.rect.width]
        assert cut == [], tab.text


@pytest.mark.parametrize("scale", [2.0, 3.0])
def test_the_palette_is_reached_by_scrolling_when_there_is_no_room_for_it(opened, scale):
    window = opened(scale=scale)
    lower = window.toolbox.lower
    assert window.toolbox.palette is not None
    assert lower.vert_scroll_bar is not None and lower.vert_scroll_bar.visible
    lower.vert_scroll_bar.set_scroll_from_start_percentage(0.9)
    window.frames(3)
    palette = window.toolbox.palette.back.rect.clip(lower.rect)
    assert palette.height >= min(60, lower.rect.height // 2)


def test_the_options_do_not_scroll_where_there_is_room(opened):
    window = opened(scale=1.0)
    assert not isinstance(window.toolbox.lower, UIScrollingContainer)
    assert window.toolbox.inside.contains(window.toolbox.palette.back.relative_rect.move(window.toolbox.inside.topleft))


def test_a_key_gives_the_usual_size_back_and_keeps_it(opened):
    window = opened()
    usual = window.scale
    window.set_scale(3.0)
    assert window.scale == 3.0 and load_settings()[0].ui_scale == 3.0
    assert BY_KEY["f4"].name == "text size"
    window.key("f4")
    assert window.scale == usual and load_settings()[0].ui_scale is None


def test_the_text_size_of_the_command_line_is_not_kept(opened):
    window = opened(scale=1.5)
    assert window.scale == 1.5 and load_settings()[0].ui_scale is None
