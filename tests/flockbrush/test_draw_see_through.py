"""A view that follows a herd sees it through what stands before it."""

from types import SimpleNamespace

import numpy as np
import pytest
from test_draw_space import NOBODY, birds, camera, field, inked, painter, pillar

from flockbrush.render.see_through import opacities
from flockbrush.render.solid_meshes import CLEAR

LOOK = camera(elevation=2.0, distance=40.0, target=(30, 40, 6.0))


def seen(level, see_through):
    """Whether a bird in the middle of the view is seen."""
    one, herd = painter(level, shadows=False), birds((30, 40, 6.0))
    one.look(LOOK)
    one.see_through = see_through
    return bool(inked(one.frame(herd), one.frame(NOBODY)).any())


def test_a_pillar_before_the_herd_is_clear_only_when_the_view_follows():
    level = field(pillar(30, 30, 20.0))
    assert not seen(level, False) and seen(level, True)


def test_chasing_a_herd_is_following_it():
    one = painter(field(pillar(30, 30, 20.0)))
    assert not one.see_through
    one.chase(birds((30, 40, 6.0)))
    assert one.see_through


@pytest.mark.parametrize(("x", "y", "clear"), [(30, 20, True), (30, 40, False), (30, 55, False), (48, 20, False)])
def test_only_what_stands_between_is_clear(x, y, clear):
    (opacity,) = opacities([pillar(x, y, 20.0)], LOOK)
    assert opacity == (CLEAR if clear else 1.0)


def test_an_obstacle_becomes_clear_smoothly_as_it_comes_into_the_way():
    values = [opacities([pillar(30 + aside, 20, 20.0)], LOOK)[0] for aside in np.arange(0, 12, 0.05)]
    assert values[0] == CLEAR and values[-1] == 1.0
    assert np.all(np.diff(values) >= 0) and np.diff(values).max() < 0.1


def test_the_eye_within_an_obstacle_sees_out():
    wide = SimpleNamespace(polygon=np.array([(0, -20), (60, -20), (60, 20), (0, 20)], float))
    assert opacities([wide], LOOK)[0] == CLEAR
