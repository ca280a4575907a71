"""What a level looks like when it is opened: birds in space, in frame, with a brush for birds in hand."""

import numpy as np
import pytest
from flockbrush.behaviours.brush import flies_free
from flockbrush.components import Position
from small_pasture import pasture
from window import Window


@pytest.fixture(scope="module")
def pillars():
    window = Window("pillars")
    yield window
    window.close()


def in_frame(window):
    """Which birds are drawn within the canvas."""
    pixels, depth = window.canvas.camera.project(window.agents[Position.xyz])[:2]
    width, height = window.canvas.rect.size
    return (depth > 0) & (pixels >= 0).all(axis=1) & (pixels[:, 0] <= width) & (pixels[:, 1] <= height)


def test_a_level_of_birds_opens_in_space_with_all_of_them_in_frame(pillars):
    assert pillars.canvas.in_space and pillars.canvas.follows
    assert in_frame(pillars).mean() == 1


def test_the_brush_in_hand_is_one_that_the_birds_follow(pillars):
    brush = pillars.find_brush(pillars.brush)
    assert brush.is_made_for("starling", ("bird", "flock")) and pillars.brush != "starlings" and flies_free(brush)


def test_the_birds_stay_in_frame_while_they_fly(pillars):
    pillars.session.play()
    pillars.frames(96)
    assert in_frame(pillars).mean() > 0.95
    assert np.ptp(pillars.agents[Position.xyz][:, 2]) > 0


def test_a_level_of_animals_on_the_ground_opens_as_a_plan(tmp_path):
    window = Window(pasture(tmp_path))
    assert not window.canvas.in_space and not window.canvas.follows
    assert window.brush == "mill-hollow"
    window.close()
