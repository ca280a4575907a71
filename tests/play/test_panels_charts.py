"""Charts: the run at a glance, the present marked, and what is yet to come pale."""

import numpy as np
import pytest
from flockbrush.systems.commands import AddAnimals, RemoveAnimals
from small_pasture import pasture
from small_window import SmallWindow

from flockbrush.studio.panels.chart_panel import DRAWN, ChartsPanel, counted_words
from flockbrush.studio.panels.panel_strip import Strip, end_of, strip_picture, top_of, value_at
from flockbrush.studio.theme import chrome


@pytest.fixture(scope="module")
def level(tmp_path_factory):
    return pasture(tmp_path_factory.mktemp("charted"))


@pytest.fixture
def window(level):
    made = SmallWindow(level, ChartsPanel)
    yield made
    made.close()


def test_charts_follow_a_run(window):
    still = window.picture().copy()
    window.session.step(64)
    window.wait(0.9)
    assert (window.picture() != still).any()
    assert all(window.panel.strips[name].said[2] == 2.0 for name in DRAWN)


def test_a_chart_that_says_the_same_is_not_drawn_again(window):
    window.session.step(16)
    window.wait(0.9)
    shown = [window.panel.strips[name].element.image for name in DRAWN]
    window.wait(0.9)
    assert all(a is b for a, b in zip(shown, (window.panel.strips[n].element.image for n in DRAWN), strict=True))


def test_the_present_is_marked_when_one_goes_back(window):
    window.session.step(96)
    window.wait(0.9)
    end = window.picture().copy()
    window.session.scrub(32)
    window.wait(0.9)
    assert (window.picture() != end).any()
    assert window.panel.strips["speed"].said[2] == 1.0


def test_a_line_counts_species_births_and_those_who_are_gone(window):
    def words():
        window.session.step(8)
        return counted_words(window.session.chart, window.session.clock.now)

    assert words() == ["sheep 9", "0 born and 0 gone since the start"]
    window.session.do("add", [AddAnimals("march", 4, 4, 2, 3, "sheep"), AddAnimals("march", 9, 4, 2, 2, "dog")])
    assert words() == ["sheep 12, dog 2", "5 born and 0 gone since the start"]
    window.session.do("remove", [RemoveAnimals(6, 8, 99)])
    assert words() == ["no animals", "5 born and 14 gone since the start"]
    window.session.undo()
    assert words() == ["sheep 12, dog 2", "5 born and 0 gone since the start"]


def strip(now, values=None, time=None, **more):
    time = np.arange(0.0, 10.01, 0.5) if time is None else time
    values = np.full(len(time), 0.5) if values is None else values
    return Strip("order", time, [(values, (200, 0, 0))], now, 10.0, 1.0, "0.50", **more)


def pixels(strip, theme="light"):
    import pygame

    from flockbrush.render.style import theme_of

    pygame.display.init()
    pygame.font.init()
    pygame.display.set_mode((300, 100))
    surface = strip_picture(strip, (200, 80), 12, chrome(theme_of(theme)))
    return pygame.surfarray.array3d(surface).swapaxes(0, 1).astype(int)


def redness(image):
    return (image[..., 0] - image[..., 1]).clip(0)


def test_what_is_to_come_is_paler_than_what_has_been():
    red = redness(pixels(strip(5.0)))
    assert red[:, 10:90].max() > 2 * red[:, 120:190].max() > 0


def test_half_is_drawn_half_way_up():
    red = redness(pixels(strip(10.0)))
    rows = np.flatnonzero(red[:, 50] > 100)
    assert abs(rows.mean() - (18 + 80) / 2) < 2


@pytest.mark.parametrize("stacked", [False, True])
def test_nothing_to_show_shows_nothing(stacked):
    for empty in (
        strip(0.0, np.zeros(0), np.zeros(0), stacked=stacked),
        strip(0.0, np.full(1, np.nan), np.zeros(1), stacked=stacked),
        strip(3.0, np.full(21, np.nan), stacked=False),
    ):
        assert redness(pixels(empty)).max() < 30  # no curve, which is red
    assert redness(pixels(strip(10.0, stacked=stacked))).max() > 100


def test_a_chart_ends_at_a_round_time_and_value():
    assert [end_of(t) for t in (0, 10, 12, 49, 61, 99, 101)] == [10, 10, 15, 50, 65, 100, 150]
    assert top_of(np.array([0.0, 2.9])) == 3.0
    assert top_of(np.array([np.nan])) == top_of(np.zeros(0)) == 1.0
    values = np.array([1.0, 2.0])
    assert (value_at(np.array([0.0, 1.0]), values, 0.5), value_at(np.array([0.0, 1.0]), values, 1.0)) == (1.0, 2.0)
    assert np.isnan(value_at(np.zeros(0), np.zeros(0), 1.0))
