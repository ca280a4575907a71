"""The palette of brushes is kept in the settings, and worn by all that the window shows of a brush."""

import numpy as np
import pytest
from window import Window

from flockbrush.render.style import PALETTES, THEMES
from flockbrush.studio.settings import load_settings


@pytest.fixture
def window(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    window = Window("meadow")
    window.frames(2)
    yield window
    window.close()


def test_a_palette_is_worn_by_all_that_shows_a_brush_and_kept(window):
    before = window.canvas.frame.copy()
    names = list(window.canvas.herd.brush_names)
    own = [window.colour_of(name) for name in names]
    window.set_palette("okabe-ito")
    window.frames(2)
    colours = [window.colour_of(name) for name in names]
    assert colours == list(PALETTES["okabe-ito"][: len(names)]) and colours != own
    assert (np.abs(window.canvas.frame.astype(int) - before).max(axis=2) > 20).sum() > 100
    assert load_settings()[0].palette == "okabe-ito"
    for _ in THEMES:
        window.toggle_theme()
    assert window.theme.palette == "okabe-ito"
    assert not window.said("error")
    window.set_palette("own")
    assert [window.colour_of(name) for name in names] == own
