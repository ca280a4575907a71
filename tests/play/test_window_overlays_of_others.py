"""Overlays of others that fail: the window names them, switches them off and goes on."""

import pytest
from small_pasture import pasture
from window import Window

from flockbrush.render.overlay_registry import OVERLAYS, load_overlays, overlay


@pytest.fixture
def window(tmp_path):
    load_overlays()
    before = dict(OVERLAYS)
    made = Window(pasture(tmp_path, script=False), brush="march")
    yield made
    made.close()
    OVERLAYS.clear()
    OVERLAYS.update(before)


@pytest.mark.parametrize("in_space", [False, True])
@pytest.mark.parametrize("lies_below", [False, True])
def test_it_is_named_with_its_line_and_switched_off_and_the_others_are_drawn(window, in_space, lies_below):
    @overlay
    class Torn:
        name, title, tip, below, in_space = "torn", "Torn", "Nothing", lies_below, True

        def draw(self, view):
            raise ArithmeticError("no paper")

    @overlay
    class Stamp:
        name, title, tip, in_space = "stamp", "Stamp", "A red mark", True

        def draw(self, view):
            view.canvas.image[:4, :4] = (255, 0, 0)

    if in_space:
        window.key("3")
    window.overlays |= {"torn", "stamp"}
    window.session.play()
    window.frames(4)
    (said,) = window.said("error")
    assert "test_window_overlays_of_others.py:" in said and "overlay 'torn' of" in said
    assert said.endswith("failed: ArithmeticError: no paper; this overlay is switched off")
    assert "torn" not in window.overlays and "stamp" in window.overlays
    assert (window.canvas.frame[:4, :4] == (255, 0, 0)).all()
    tick = window.session.tick
    window.frames(8)
    assert window.session.tick > tick and len(window.said("error")) == 1
