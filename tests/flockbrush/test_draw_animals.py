"""Animals in pictures: where they are, where they look, and what they leave behind."""

from types import SimpleNamespace

import numpy as np
import pytest

from flockbrush.render.animal_figures import KINDS, NO_WINGS, figure
from flockbrush.render.drawn_herd import DrawnHerd
from flockbrush.render.painter import Painter
from flockbrush.render.shapes import Pose
from flockbrush.render.sprites import LARGEST, Sprites, Stamps
from flockbrush.render.style import DARK, LIGHT, palette
from flockbrush.render.trails import Trails
from flockbrush.render.view_camera import ViewCamera

BLUE, RED = (40, 90, 200), (200, 60, 60)


def field(width=40.0, height=30.0):
    """A bare level."""
    return SimpleNamespace(name="field", width=width, height=height)


def painter(size=(320, 240), level=None, **options):
    """A painter whose picture is all ground: no words, no trails, no shadows unless asked."""
    return Painter(level or field(), size, **{"words": False, "trails": None, "shadows": False} | options)


def herd(*xy, heading=0.0, length=2.0, radius=0.5, colours=(BLUE, RED), **more):
    """Animals at these places, all with one heading (rad)."""
    xy = np.array(xy, float).reshape(-1, 2)
    turn = np.broadcast_to(np.asarray(heading, float), len(xy))
    forward = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    more.setdefault("brush", np.zeros(len(xy), int))
    return DrawnHerd(xy, forward, length, radius, brush_colours=np.array(colours, np.uint8), **more)


def changed(frame, ground):
    """Rows and columns of the pixels that differ, (k, 2)."""
    return np.argwhere((frame != ground).any(axis=2))


def middle_of(pixels):
    """Centre of pixels (k, 2) as (x, y)."""
    return pixels.mean(axis=0)[::-1] + 0.5


def heaviest(weight):
    """Centre of gravity (x, y) of weights (h, w)."""
    rows, cols = np.indices(weight.shape)
    return np.array([(cols * weight).sum(), (rows * weight).sum()]) / weight.sum()


@pytest.mark.parametrize("xy", [(20, 15), (6, 7), (33.3, 24.1)])
@pytest.mark.parametrize("length", [0.1, 1.0, 2.0, 8.0])  # a dart, a stamp, a ring-sized one, one without a sheet
def test_an_animal_is_where_the_camera_says(xy, length):
    p = painter()
    pixels = changed(p.frame(herd(xy, length=length, radius=length / 4)), p.ground)
    assert len(pixels)
    box = (pixels.min(axis=0) + pixels.max(axis=0))[::-1] / 2 + 0.5
    assert box == pytest.approx(p.camera.pixels(xy), abs=0.8)
    assert np.ptp(pixels, axis=0).max() < max(length * p.camera.scale, 4) + 3


@pytest.mark.parametrize("heading", np.linspace(0, 2 * np.pi, 13))
@pytest.mark.parametrize("length", [0.3, 0.7, 1.5, 6.0])
def test_the_light_end_is_the_front(heading, length):
    """A blue animal's head is lighter, so it is red that lies ahead of blue."""
    p = painter(theme="dark")
    frame = p.frame(herd((20, 15), heading=heading, length=length, radius=length / 4))
    red, _, blue = np.moveaxis(np.maximum(frame.astype(float) - p.ground, 0), 2, 0)
    forward = heaviest(red) - heaviest(blue)
    assert forward @ (np.cos(heading), -np.sin(heading)) > 0.05 * max(length * p.camera.scale, 4)


@pytest.mark.parametrize("length", [0.5, 1.5, 4.0])
def test_a_turned_herd_makes_a_turned_picture(length):
    """By a quarter turn; angles fall on the sheet's headings, so that nothing is rounded differently."""
    rng = np.random.default_rng(3)
    xy = rng.integers(-40, 40, (30, 2)) / 4
    heading = rng.integers(0, 96, 30) * 2 * np.pi / 96
    stamps = Stamps(palette(2), LIGHT)
    camera = ViewCamera((0.0, 0.0), 8.0, (240, 240), (0, 0, 240, 240))

    def drawn(xy, heading):
        frame = np.full((240, 240, 3), 128, np.uint8)
        one = np.ones(30)
        look = np.arange(30) % 2 * KINDS + KINDS + np.arange(30) % 3
        forward = np.stack([np.cos(heading), -np.sin(heading)], axis=1)
        animals = Sprites(camera.pixels(xy), forward, one * length, one / 3, look, one, one * NO_WINGS)
        stamps.draw(frame, np.array([0, 0, 240, 240]), animals, 8.0)
        return frame.astype(int)

    turned = drawn(np.stack([-xy[:, 1], xy[:, 0]], axis=1), heading + np.pi / 2)
    assert np.abs(turned - np.rot90(drawn(xy, heading))).max() <= 2


@pytest.mark.parametrize("kind", ["plain", "leader", "predator"])
@pytest.mark.parametrize("length", [3.0, 5.0, 11.0, LARGEST])
def test_a_stamp_looks_like_the_figure_it_was_cut_from(kind, length):
    stamps = Stamps(palette(1), DARK)
    look = np.array([KINDS + ("plain", "leader", "predator").index(kind)])
    clip = np.array([0, 0, 60, 60])
    stamped, drawn = np.full((2, 60, 60, 3), 90, np.uint8)
    at, forward, radius = np.array([[30.25, 29.5]]), np.array([[0.0, -1.0]]), length / 4
    one = np.ones(1)
    animals = Sprites(at, forward, one * length, one * radius, look, one * 0, one * NO_WINGS)
    stamps.draw(stamped, clip, animals, 1.0)
    pose, colours = Pose(30.25, 29.5, 0.0, -1.0), stamps.colours[look[0]]
    figure(drawn, clip, pose, length, radius, int(look[0] % 4), True, colours, NO_WINGS)
    assert (stamped != 90).any()
    assert np.abs(stamped.astype(int) - drawn).max() <= 3


def test_two_draws_are_the_same_and_leave_the_ground_alone():
    p, rng = painter(trails=2.0, words=True, size=(640, 400)), np.random.default_rng(1)
    animals = herd(*rng.uniform(0, 30, (200, 2)), leader=rng.random(200) < 0.1)
    again = Painter(field(), (640, 400), trails=2.0, shadows=False)
    ground = p.ground.copy()
    for tick in range(3):
        assert np.array_equal(p.frame(animals, time=tick / 30), again.frame(animals, time=tick / 30))
    assert np.array_equal(p.ground, ground)


def test_later_rows_lie_on_top():
    p = painter()
    red_last = p.frame(herd((20, 15), (20.2, 15), brush=np.array([0, 1])))[120, 158].astype(int)
    blue_last = p.frame(herd((20, 15), (20.2, 15), brush=np.array([1, 0])))[120, 158].astype(int)
    assert red_last[0] > red_last[2] + 50
    assert blue_last[2] > blue_last[0] + 50


def test_leaders_and_predators_look_different_in_shape_and_in_brightness():
    p = painter()
    plain = p.frame(herd((20, 15), length=0.8))
    for other in ({"leader": np.array([True])}, {"predator": np.array([True])}):
        frame = p.frame(herd((20, 15), length=0.8, **other))
        assert len(changed(frame, p.ground)) > len(changed(plain, p.ground))
        assert np.abs(frame.mean(axis=2) - plain.mean(axis=2)).max() > 40


@pytest.mark.parametrize("length", [0.5, 1.5, 6.0])
def test_an_animal_half_out_of_the_picture_is_half_there(length):
    p = painter()
    for edge in ((0, 120), (320, 120), (160, 0), (160, 240)):
        xy = p.camera.metres(edge)
        there = changed(p.frame(herd(xy, length=length, radius=length / 4)), p.ground)
        whole = changed(p.frame(herd((20, 15), length=length, radius=length / 4)), p.ground)
        assert 0 < len(there) < len(whole)


def test_animals_far_outside_are_not_drawn():
    p = painter()
    far = herd((1e6, 15), (-1e300, 2), (20, -9e9), (1e18, 1e18))
    assert np.array_equal(p.frame(far), p.ground)


def test_no_animals_are_a_picture_too():
    p = painter()
    assert np.array_equal(p.frame(), p.ground)
    assert np.array_equal(p.frame(herd()), p.ground)


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ({"xy": np.array([[1.0, 2.0], [np.nan, 3.0]])}, "row 1.*position"),
        ({"forward": np.array([[np.inf, 0.0], [1.0, 0.0]])}, "row 0.*heading"),
        ({"length": np.array([1.0, np.nan])}, "row 1.*length"),
        ({"leader": np.array([True])}, "leader of 2 animals"),
        ({"xy": np.zeros(4)}, "shape"),
        ({"forward": np.zeros((1, 2))}, "2 animals need as many headings"),
    ],
)
def test_what_is_not_a_number_is_refused_by_name(broken, said):
    with pytest.raises(ValueError, match=said):
        painter().frame(herd((1, 2), (3, 4))._replace(**broken))


def test_an_animal_without_a_heading_is_a_dot():
    p = painter()
    pixels = changed(p.frame(herd((20, 15))._replace(forward=np.zeros((1, 2)))), p.ground)
    assert np.ptp(pixels[:, 0]) == np.ptp(pixels[:, 1])


def test_animals_keep_off_the_words():
    p = Painter(field(), (640, 400), trails=None)
    _, top, _, bottom = p.camera.view
    p.look(p.camera.zoomed(6))
    for length in (0.2, 3.0):
        many = herd(*np.random.default_rng(0).uniform((5, 8), (35, 22), (3000, 2)), length=length, radius=length / 4)
        pixels = changed(p.frame(many, legend=False, title=""), p.ground)
        assert pixels[:, 0].min() == top and pixels[:, 0].max() == bottom - 1


@pytest.mark.parametrize("size", [(40, 30), (8, 8), (301, 201), (3840, 2160)])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_pictures_of_any_size(size, theme):
    frame = Painter(field(), size, theme).frame(herd((20, 15), leader=np.array([True])), time=75.25)
    assert frame.shape == (size[1], size[0], 3)
    assert frame.std() > 1


@pytest.mark.parametrize("size", [(0, 10), (10, -1), (20000, 10), (3, 3), "large", (10,)])
def test_sizes_nobody_can_have_are_refused(size):
    with pytest.raises(ValueError, match="pixels"):
        Painter(field(), size)


def test_more_sheets_than_there_is_room_for(monkeypatch):
    """Older sheets give way, and the picture is the same."""
    import flockbrush.render.sprites as module

    rng = np.random.default_rng(2)
    crowd = herd(*rng.uniform(0, 30, (60, 2)), length=rng.uniform(0.3, 3, 60), radius=rng.uniform(0.1, 0.7, 60))
    plenty = painter().frame(crowd)
    monkeypatch.setattr(module, "BUDGET", 3 << 20)
    p = painter()
    assert np.abs(p.frame(crowd).astype(int) - plenty).max() <= 140  # drawn without sheets: not rounded to headings
    assert (np.abs(p.frame(crowd).astype(int) - plenty).max(axis=2) > 60).mean() < 0.01


def test_shadows_lie_to_the_lower_right_and_further_off_the_higher_the_bird():
    p = painter(shadows=True)
    low = changed(p.frame(herd((20, 15), z=np.array([2.0]))), p.ground)
    high = changed(p.frame(herd((20, 15), z=np.array([6.0]))), p.ground)
    assert (middle_of(low) - p.camera.pixels((20, 15)) > 0.5).all()
    assert high.max(axis=0).sum() > low.max(axis=0).sum() + 5


def test_a_trail_leads_back_to_where_the_animal_was():
    p = painter(trails=5.0)
    for tick in range(40):
        frame = p.frame(herd((5 + tick * 0.5, 15), length=1.0), time=tick / 30)
    pixels = changed(frame, p.ground)
    x = (np.array([6.0, 15.0, 23.0]) * 8).astype(int)
    faintness = np.abs(frame.astype(int) - p.ground)[120, x].sum(axis=1)
    assert pixels[:, 1].min() <= 48
    assert (faintness > 0).all() and faintness[0] < faintness[1] < faintness[2]
    assert np.ptp(pixels[:, 0]) < 12


def test_trails_fade_away():
    p = painter(trails=1.0)
    p.frame(herd((20, 15)), time=0.0)
    for tick in range(1, 200):
        frame = p.frame(time=tick / 30)
    assert np.array_equal(frame, p.ground)


def test_trails_follow_their_animals_through_deaths():
    """The second animal dies: the third must not draw a line to where the second was."""
    p = painter(trails=3.0)
    three = herd((5, 5), (5, 15), (5, 25), ids=np.array([1, 2, 3]))
    p.frame(three, time=0.0)
    frame = p.frame(herd((5.5, 5), (5.5, 25), ids=np.array([1, 3])), time=1 / 30)
    between = frame[60:100] != p.ground[60:100]
    assert not between.any()


def test_a_newborn_has_no_trail_yet():
    p = painter(trails=3.0)
    p.frame(herd((20, 15), ids=np.array([7])), time=0.0)
    frame = p.frame(herd((20, 15), (20, 18), ids=np.array([7, 8])), time=1 / 30)
    assert np.array_equal(frame[102:112], p.ground[102:112])  # between the two


def test_an_animal_that_comes_round_the_edge_draws_no_line_across():
    p = painter(trails=3.0)
    p.frame(herd((39.5, 15)), time=0.0)
    frame = p.frame(herd((0.5, 15)), time=1 / 30)
    assert np.array_equal(frame[:, 60:260], p.ground[:, 60:260])


def test_a_jump_back_in_time_clears_the_trails():
    p = painter(trails=3.0)
    for tick in range(20):
        p.frame(herd((5 + tick, 15)), time=tick / 30)
    frame = p.frame(herd((35, 25)), time=0.0)
    assert changed(frame, p.ground)[:, 1].min() > 240


def test_trails_move_with_the_camera():
    p = painter(trails=5.0)
    for tick in range(20):
        p.frame(herd((10 + tick * 0.5, 15)), time=tick / 30)
    p.look(p.camera.moved(40, 24))
    frame = p.frame(time=20 / 30)
    pixels = changed(frame, p.ground)
    assert middle_of(pixels) == pytest.approx(p.camera.pixels((15, 15)), abs=4)


def test_trails_that_last_no_time_are_refused():
    with pytest.raises(ValueError, match="positive"):
        Trails(-1)


def test_drawing_into_a_frame_of_ones_own():
    p = painter()
    out = np.zeros((240, 320, 3), np.uint8)
    assert p.frame(herd((20, 15)), out=out) is out
    assert np.array_equal(out, p.frame(herd((20, 15))))
    with pytest.raises(ValueError, match="out must be"):
        p.frame(out=np.zeros((10, 10, 3), np.uint8))


def test_the_camera_goes_there_and_back():
    camera = ViewCamera.fit(40, 30, (320, 240)).zoomed(2.5, about=(100, 50)).moved(7, -3)
    xy = np.random.default_rng(0).uniform(0, 30, (20, 2))
    assert camera.metres(camera.pixels(xy)) == pytest.approx(xy)
    assert camera.pixels((1, 2))[1] < camera.pixels((1, 1))[1]  # north is up


def test_zooming_leaves_the_ground_under_the_pointer():
    camera = ViewCamera.fit(40, 30, (320, 240))
    there = camera.metres((100, 50))
    assert camera.zoomed(3, about=(100, 50)).pixels(there) == pytest.approx((100, 50))
