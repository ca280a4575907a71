"""View and Profile: what is laid over the herd, colours and sizes, and where the time goes."""

import pytest
from small_pasture import pasture
from small_window import SmallWindow

from flockbrush.render.overlays import OVERLAYS
from flockbrush.studio.panels import PANELS
from flockbrush.studio.panels.profile import FRAME, ProfilePanel, words_of
from flockbrush.studio.panels.view import SCALES, ViewPanel, overlays, said
from flockbrush.studio.settings import Settings


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    return pasture(tmp_path_factory.mktemp("viewed"))


@pytest.fixture
def window(level):
    made = SmallWindow(level, ViewPanel, size=(320, 1400))  # as tall as the panel: a new overlay adds a row
    yield made
    made.close()


def test_every_overlay_has_a_check_box_with_a_tooltip(window):
    offered = {name: words for group in overlays().values() for name, words in group.items()}
    assert offered.keys() == window.panel.boxes.keys() == OVERLAYS.keys() | {"trails", "shadows", "dust"}
    assert all(window.panel.boxes[name].tool_tip_text == offered[name][1] for name in offered)


@pytest.mark.parametrize("name", [*OVERLAYS, "trails", "shadows", "dust"])
def test_a_check_box_shows_and_hides_its_overlay(window, name):
    before = name in window.overlays
    window.click(window.panel.boxes[name])
    assert (name in window.overlays) != before
    assert window.settings.overlays == {name: name in window.overlays}
    window.click(window.panel.boxes[name])
    assert (name in window.overlays) == before


def test_a_check_box_follows_what_a_key_has_done(window):
    window.overlays.add("density")
    window.wait()
    assert window.panel.boxes["density"].is_checked


def test_colours_and_sizes_are_chosen_from_lists(window):
    choose(window, window.panel.theme, "dark")
    assert window.asked_theme == "dark"
    choose(window, window.panel.scale, "150 %")
    assert window.asked_scale == 1.5
    choose(window, window.panel.scale, "automatic")
    assert window.asked_scale is None


def choose(window, menu, option):
    closed = menu.menu_states["closed"]
    window.click(closed.open_button or closed.selected_option_button)
    options = menu.menu_states["expanded"].options_selection_list
    window.click(next(item["button_element"] for item in options.item_list if item["text"] == option))


def test_the_size_of_last_time_is_shown(level):
    from types import SimpleNamespace

    panel = ViewPanel.__new__(ViewPanel)
    panel.app = SimpleNamespace(settings=Settings(ui_scale=1.3))
    assert panel._scale_now() == "125 %"
    panel.app.settings = Settings()
    assert panel._scale_now() == "automatic"
    assert len({said(scale) for scale in SCALES}) == len(SCALES)


def test_the_profile_shows_every_system_and_every_part_of_a_frame(level):
    window = SmallWindow(level, ProfilePanel)
    window.session.step(140)
    window.wait(1.0)
    panel = window.panel
    assert panel.means.keys() == FRAME.keys() == window.seconds.keys()
    assert panel.means["simulation"] == pytest.approx(4.0, rel=0.05)
    profile = window.session.profile()
    assert {"See", "AskModels", "Move"} <= profile.keys()
    assert panel.systems.size[1] == (len(profile) + 1) * panel.row
    window.close()


def test_systems_are_named_in_words():
    assert words_of("FindNeighbours") == "Find neighbours"


@pytest.mark.parametrize("kind", PANELS, ids=lambda kind: kind.title)
def test_every_panel_has_a_title_and_a_tip_and_lives_through_a_change_of_size(level, kind):
    window = SmallWindow(level, kind, theme="dark", size=(260, 200))
    assert kind.title and kind.tip
    window.panel.close()
    window.panel.make()
    window.wait()
    assert window.said == []
    window.close()


@pytest.mark.parametrize("kind", PANELS, ids=lambda kind: kind.title)
def test_a_closed_panel_leaves_nothing_behind(level, kind):
    window = SmallWindow(level, kind)
    window.panel.close()
    left = [element for element in window.container.get_container().elements if element.alive()]
    assert left == []
    window.session.close()
