"""Herds in space: where the camera shows what, who hides whom, how a bird that banks looks."""

import time
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from flockbrush.components.level_things import Obstacle

from flockbrush.render import DrawnHerd, Painter, Scenery
from flockbrush.render.body_meshes import COARSE, attitude_of, standing
from flockbrush.render.facets import SpacePose, deep, pixel_of
from flockbrush.render.far_bodies import step_of
from flockbrush.render.orbit import OrbitCamera
from flockbrush.render.solid_meshes import block, hull, stood_up
from flockbrush.render.space_view import SpacePainter, far_first, sky_of
from flockbrush.render.ways import Ways
from flockbrush.runs.run import start

SIZE = (320, 240)
NOBODY = DrawnHerd(np.zeros((0, 3)), np.zeros((0, 3)))


def camera(azimuth=90.0, elevation=30.0, distance=20.0, target=(0, 0, 0), size=SIZE, **more):
    angles = np.radians((azimuth, elevation))
    return OrbitCamera(target, distance, *angles, size, (0, 0, *size), **more)


def painter(level=None, theme="light", **more):
    more = {"trails": None, "words": False} | more
    return SpacePainter(level, SIZE, theme, **more)


def birds(xyz, heading=90.0, pitch=0.0, bank=0.0, **more):
    """Birds of a metre with spread wings, angles in degrees."""
    xyz = np.atleast_2d(np.asarray(xyz, float))
    angles = (np.full(len(xyz), np.radians(angle)) for angle in (heading, pitch, bank))
    forward, up = attitude_of(*angles)
    told = {"wings": np.zeros(len(xyz)), "brush": np.arange(len(xyz)), "ids": 10 + np.arange(len(xyz))}
    told["brush_colours"] = ("#c02020", "#2040d0", "#208030", "#905010")[: len(xyz)]
    return DrawnHerd(xyz, forward, up=up, **told | more)


def inked(frame, empty):
    """Where a frame differs from one without animals, bool."""
    return (np.abs(frame.astype(int) - empty.astype(int)).max(axis=2)) > 12


def drawn(look, herd, level=None, shadows=False, **more):
    """(frame, where there are animals) from a camera."""
    one = painter(level, shadows=shadows, **more)
    one.look(look)
    empty = one.frame(NOBODY)
    frame = one.frame(herd)
    return frame, inked(frame, empty)


# where the camera shows what --------------------------------------------------------------


def test_a_point_beside_the_target_is_as_many_pixels_away_as_the_distance_says():
    look = camera(distance=20.0)
    focal = 120 / np.tan(look.fov / 2)
    at, depth = look.project([[0, 0, 0], [1, 0, 0]])
    assert np.allclose(at[0], (160, 120)) and depth[0] == pytest.approx(20)
    assert np.allclose(at[1], (160 + focal / 20, 120))  # it looks north: east is to the right


def test_a_point_above_the_target_follows_the_pinhole_by_hand():
    look = camera(elevation=30.0, distance=20.0)
    focal = 120 / np.tan(look.fov / 2)
    (_, y), depth = (values[0] for values in look.project([[0, 0, 3.0]]))
    assert depth == pytest.approx(20 - 3 * np.sin(np.radians(30)))
    assert y == pytest.approx(120 - focal * 3 * np.cos(np.radians(30)) / depth)


def test_from_straight_above_the_picture_is_the_plan():
    look = camera(elevation=90.0, distance=50.0)
    at = look.pixels([[2.0, 0.0], [0.0, 3.0]]) - (160, 120)
    assert np.allclose(at, [[2 * look.scale, 0], [0, -3 * look.scale]])


@pytest.mark.parametrize("azimuth", [0.0, 77.0, 200.0, 311.0])
def test_what_lies_under_a_pixel_is_shown_there(azimuth):
    look = camera(azimuth, 25.0, 60.0, target=(12.0, -7.0, 4.0), floor=1.5)
    places = np.array([[20.0, 3.0], [0.0, -20.0], [12.0, -7.0]])
    assert np.allclose(look.metres(look.pixels(places)), places)


def test_above_the_horizon_lies_ground_far_ahead():
    look = camera(azimuth=0.0, elevation=5.0, distance=30.0)
    x, y = look.metres((160, 0))
    assert x > 30 * 30 and abs(y) < 1e-6


def test_the_horizon_is_level_and_as_high_as_the_eye_looks():
    one = painter()
    look = camera(elevation=5.0, distance=30.0)
    one.look(look)
    frame = one.frame(NOBODY, legend=False)
    row = 120 - look.focal * np.tan(np.radians(5))
    column = frame[:, 40].astype(int)
    sky = np.array(sky_of(one.theme)[0])
    assert np.abs(column[int(row) - 1] - sky).max() <= 3 < np.abs(column[int(row) + 40] - sky).max()


@pytest.mark.parametrize("azimuth", [0.0, 45.0, 130.0, 270.0])
@pytest.mark.parametrize("elevation", [10.0, 40.0, 90.0])
def test_all_points_fit_in_and_touch_the_rim(azimuth, elevation):
    points = np.random.default_rng(3).normal(size=(50, 3)) * (40, 15, 6) + (100, 50, 30)
    look = OrbitCamera.of(points, SIZE, None, *np.radians((azimuth, elevation)), margin=0.1)
    at, depth = look.project(points)
    assert (depth > 0).all()
    free = np.array([at.min(axis=0), np.array(SIZE) - at.max(axis=0)]) - 0.1 * np.array(SIZE)
    assert (free > -1e-6).all()
    assert np.isclose(free, 0, atol=1e-6).all(axis=0).any()  # no nearer camera shows them all


def test_the_camera_shows_all_of_a_herd():
    one, herd = painter(), birds([[0, 0, 10], [200, 5, 30], [90, 80, 25]])
    one.look(one.around(herd, camera(20, 15)))
    at, _ = one.camera.project(herd.xy)
    assert (at > 0).all() and (at < SIZE).all()


def test_going_round_keeps_the_target_in_the_middle_and_the_distance():
    look = camera(target=(3, 4, 5)).turned(0.7, 0.3)
    assert np.allclose(look.pixels((3, 4, 5)), look.middle)
    assert np.linalg.norm(look.eye - (3, 4, 5)) == pytest.approx(20)


def test_the_eye_stays_above_the_ground_and_below_the_zenith():
    assert camera().turned(0, -3).eye[2] > 0
    assert camera().turned(0, 3).elevation == pytest.approx(np.pi / 2)
    assert camera(target=(0, 0, 50)).turned(0, -3).elevation < 0  # a flock high up may be seen from below


def test_zooming_leaves_the_ground_under_the_mouse_where_it_is():
    look, mouse = camera(azimuth=30.0, elevation=35.0), (200.0, 170.0)
    assert np.allclose(look.zoomed(1.5, mouse).metres(mouse), look.metres(mouse))


def test_dragging_moves_the_ground_with_the_mouse():
    look = camera(azimuth=140.0, elevation=60.0, distance=30)
    place = look.metres(look.middle)
    assert np.allclose(look.moved(10, 6).pixels(place) - look.middle, (10, 6), atol=0.6)


def test_a_camera_that_chases_a_flock_keeps_it_in_the_middle_and_comes_slowly_nearer():
    one, apart = painter(), np.array([[-6.0, 0, 10], [6, 3, 12], [0, -3, 8]])
    one.look(camera(40, 15))
    one.chase(birds(apart))
    wide = one.camera.distance
    for k in range(1, 33):  # at 15 m/s, and drawing together
        herd = birds(apart * (1, 1, 1) * (0.5 if k > 1 else 1) + (0.5 * k, 0, 0))
        one.chase(herd, 1 / 30)
    at, _ = one.camera.project(herd.xy)
    assert np.abs(at.mean(axis=0) - one.camera.middle).max() < 25
    assert one.around(herd).distance < one.camera.distance < wide


# attitude ------------------------------------------------------------------------------------


def test_a_bird_that_climbs_and_banks_points_up_and_leans_to_its_right():
    forward, up = attitude_of([0.0], [np.radians(30)], [np.radians(20)])
    assert np.allclose(forward, [[np.cos(np.radians(30)), 0, 0.5]])
    assert up[0, 1] == pytest.approx(-np.sin(np.radians(20)))  # heading east, right is south
    assert np.allclose((forward * up).sum(1), 0) and np.allclose((up**2).sum(1), 1)


def test_animals_that_do_not_bank_stand_upright():
    forward, _ = attitude_of(np.linspace(0, 6, 7), np.linspace(-1.5, 1.5, 7), np.zeros(7))
    assert np.allclose(standing(forward), attitude_of(np.linspace(0, 6, 7), np.linspace(-1.5, 1.5, 7), np.zeros(7))[1])
    assert np.isfinite(standing(np.array([[0.0, 0.0, 1.0]]))).all()


@pytest.mark.parametrize(("bank", "lower"), [(-35.0, "left"), (35.0, "right")])
def test_in_a_bank_to_the_left_the_left_wing_is_the_lower(bank, lower):
    """Seen from behind: the bird flies away from us, so that its left is ours."""
    look = camera(azimuth=90.0, elevation=0.1, distance=6.0, target=(0, 0, 5.0))
    _, ink = drawn(look, birds((0, 0, 5), heading=90.0, bank=bank))
    rows, columns = np.nonzero(ink)
    left, right = rows[columns <= columns.min() + 3].mean(), rows[columns >= columns.max() - 3].mean()
    assert (left > right + 20) == (lower == "left") and abs(left - right) > 20


def test_a_bird_that_beats_its_wings_lifts_both():
    look = camera(elevation=0.1, distance=6.0, target=(0, 0, 5.0))
    tips = []
    for beat in (-1.0, 0.0, 1.0):
        _, ink = drawn(look, birds((0, 0, 5), wings=np.array([beat])))
        rows, columns = np.nonzero(ink)
        tips.append([rows[columns <= columns.min() + 3].mean(), rows[columns >= columns.max() - 3].mean()])
    tips = np.array(tips)
    assert (np.diff(tips, axis=0) < -10).all() and np.allclose(tips[:, 0], tips[:, 1], atol=3)


def test_a_bird_that_climbs_shows_its_bill_higher_than_its_tail():
    look = camera(azimuth=90.0, elevation=0.1, distance=5.0, target=(0, 0, 5.0))
    _, ink = drawn(look, birds((0, 0, 5), heading=0.0, pitch=40.0, wings=np.array([np.nan])))
    rows, columns = np.nonzero(ink)
    assert rows[columns >= columns.max() - 2].mean() < rows[columns <= columns.min() + 2].mean() - 15


# who hides whom ----------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_the_nearer_bird_is_in_front_whatever_its_row(order):
    places = np.array([[0.0, -3.0, 5.0], [0.0, 3.0, 5.0]])[list(order)]
    look = camera(elevation=0.1, distance=20.0, target=(0, 0, 5.0))
    frame, ink = drawn(look, birds(places))
    rows, columns = np.nonzero(ink)
    middle = frame[int(rows.mean()), round(columns.mean())].astype(int)
    red_is_near = order[0] == 0
    assert (middle[0] > middle[2]) == red_is_near


def pillar(x, y, height, radius=2.0, **more):
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    polygon = np.array([x, y]) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return SimpleNamespace(polygon=polygon, z_min=0.0, z_max=height, shape="cylinder", blocks_view=True, **more)


def field(*obstacles):
    return SimpleNamespace(width=60.0, height=60.0, name="field", obstacles=list(obstacles))


def test_a_bird_behind_a_pillar_is_hidden_and_one_before_it_is_not():
    level = field(pillar(30, 30, 20.0))
    look = camera(elevation=2.0, distance=40.0, target=(30, 30, 6.0))
    for y, seen in ((40.0, False), (20.0, True)):
        _, ink = drawn(look, birds((30, y, 6.0)), level)
        assert ink.any() == seen


def test_a_bird_above_a_pillar_is_seen():
    level = field(pillar(30, 30, 4.0))
    _, ink = drawn(camera(elevation=2.0, distance=40.0, target=(30, 30, 6.0)), birds((30, 40, 9.0)), level)
    assert ink.any()


def test_a_pillar_is_as_tall_in_the_picture_as_the_pinhole_says():
    level = field(pillar(30, 30, 12.0, radius=1.0))
    bare, one = painter(field()), painter(level)
    look = camera(elevation=1.0, distance=60.0, target=(30, 30, 6.0))
    for which in (bare, one):
        which.look(look)
    ink = inked(one.frame(NOBODY), bare.frame(NOBODY))[:, 160]
    top = look.pixels((30.0, 29.0, 12.0))[1]
    assert abs(np.flatnonzero(ink).min() - top) <= 1.5


def test_a_pillar_on_the_border_of_a_periodic_map_stands_at_the_other_too():
    look = camera(elevation=20.0, distance=40.0, target=(60, 30, 3.0))
    here, there = (Obstacle(1, "", pillar(x, 30, 6.0).polygon, True, True, 0.0, 0.0, 6.0, "cylinder") for x in (0, 60))
    pictures = []
    for level, wraps in ((field(here), True), (field(there), True), (field(here), False)):
        level.boundary = "wrap" if wraps else "open"
        view = painter(level)
        view.see_through = True
        view.look(look)
        pictures.append(view.frame(NOBODY).copy())
    assert np.array_equal(*pictures[:2]) and not np.array_equal(pictures[0], pictures[2])


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere", "plane"])
def test_obstacles_of_every_shape_stand_up(shape):
    outline = np.array([(0, 0), (4, 0), (4, 3), (0, 3)], float)
    faces = stood_up(SimpleNamespace(polygon=outline, z_min=1, z_max=6, shape=shape), 2)
    assert len(faces.corners) and np.allclose(np.linalg.norm(faces.normals, axis=1), 1)
    assert faces.corners[..., 2].min() >= 0.9 or shape == "sphere"


def test_the_outside_of_a_hull_looks_away_from_its_middle():
    faces = hull([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0), (0, 0, 5)])
    assert len(faces.corners) == 6  # four sides, and a square of two triangles
    assert ((faces.corners.mean(axis=1) - (0, 0, 1)) * faces.normals).sum(axis=1).min() > 0
    wall = block([(0, 0), (4, 0), (4, 3), (0, 3)], 0, 2)
    assert ((wall.corners.mean(axis=1) - (2, 1.5, 1)) * wall.normals).sum(axis=1).min() > 0


def test_what_was_told_no_height_is_low_and_lower_still_when_one_sees_across():
    def height(**more):
        outline = np.array([(0, 0), (4, 0), (4, 4), (0, 4)], float)
        return stood_up(SimpleNamespace(polygon=outline, z_min=0.0, z_max=1000.0, **more), 2.0).corners[..., 2].max()

    assert height(blocks_view=True) == 2.0 > 5 * height(blocks_view=False) > 0


# shadows, trails, who is selected ------------------------------------------------------------------


def test_a_shadow_lies_straight_beneath():
    one = painter()
    look = camera(elevation=50.0, distance=40.0)
    one.look(look)
    for x, y, z in ((0, 0, 8.0), (5, -4, 3.0)):
        herd = birds((x, y, z))
        one.shadows = True
        shaded = one.frame(herd)
        one.shadows = False
        rows, columns = np.nonzero(inked(shaded, one.frame(herd)))
        at = look.pixels((float(x), float(y), 0.0))
        assert np.hypot(columns.mean() + 0.5 - at[0], rows.mean() + 0.5 - at[1]) < 2.0


def test_a_higher_bird_has_a_fainter_shadow():
    one = painter()
    one.look(camera(elevation=60.0, distance=60.0))
    darkest = []
    for z in (2.0, 15.0):
        frames = []
        for one.shadows in (True, False):
            frames.append(one.frame(birds((0, 0, z))).astype(int))
        darkest.append((frames[1] - frames[0]).max())
    assert darkest[0] > 1.2 * darkest[1] > 0


def test_a_trail_leads_to_where_the_bird_was():
    one = painter(trails=2.0, shadows=False)
    look = camera(elevation=40.0, distance=40.0)
    one.look(look)
    empty = one.frame(NOBODY)
    for k in range(21):
        frame = one.frame(birds((-6 + 0.5 * k, 0, 4), heading=0.0), time=k / 16)
    ink = inked(frame, empty)
    x, y = look.pixels((-1.0, 0.0, 4.0)).astype(int)
    assert ink[y - 2 : y + 3, x].any()
    far = look.pixels((-9.0, 0.0, 4.0)).astype(int)
    assert not ink[far[1] - 3 : far[1] + 4, far[0]].any()


def test_ways_follow_their_animals_through_deaths_and_forget_after_a_jump_in_time():
    ways = Ways(1.0)
    for k in range(10):
        ways.go(np.array([[k, 0, 0], [k, 1, 0], [k, 2, 0]], float), np.array([4, 5, 6]), k / 10)
    ways.go(np.array([[10.0, 0, 0], [10, 2, 0], [0, 9, 9]]), np.array([4, 6, 9]), 1.0)
    rows = [(ways.first + k) % len(ways.places) for k in range((ways.last - ways.first) % len(ways.places))]
    assert (ways.places[rows][:, 1, 1] == 2).all() and np.isnan(ways.places[rows][:, 2]).all()
    ways.go(np.array([[3.0, 0, 0]]), np.array([4]), 0.3)
    assert ways.first == ways.last


def test_the_selected_bird_is_marked_and_joined_to_the_ground():
    one = painter(shadows=False)
    look = camera(elevation=30.0, distance=40.0)
    one.look(look)
    herd = birds([(0, 0, 8), (6, 0, 8)])
    ink = inked(one.frame(herd, selected=11), one.frame(herd))
    foot, top = look.pixels((6.0, 0.0, 0.0)), look.pixels((6.0, 0.0, 8.0))
    column = ink[int(top[1]) + 12 : int(foot[1]), int(foot[0]) - 3 : int(foot[0]) + 4].any(axis=1)
    assert 0.3 < column.mean() < 1.0  # dashed
    assert ink[int(foot[1]) - 8 : int(foot[1]) + 9].any() and not ink[:, :140].any()


def test_the_bird_under_the_mouse_is_picked_the_nearer_one_first():
    one = painter()
    one.look(camera(elevation=0.1, distance=20.0, target=(0, 0, 5.0)))
    one.frame(birds([[0, 8, 5.0], [0.05, -2, 5.0], [4, 0, 5.0]]))
    assert one.pick((160, 120)) == 1
    assert one.pick(one.camera.pixels((4.0, 0.0, 5.0))) == 2
    assert one.pick((20, 20)) is None
    beside = one.camera.pixels((4.0, 0.0, 5.0)) + (25, 0)
    assert one.pick(beside, reach=20) == 2 and one.pick(beside, reach=1) is None


# beasts, grounds, frames ------------------------------------------------------------------------------


def test_beasts_on_the_ground_stand_on_it_with_legs():
    look = camera(elevation=2.0, distance=6.0, target=(0, 0, 0.5))
    herd = DrawnHerd(
        np.array([[0.0, 0, 0]]), np.array([[1.0, 0, 0]]), brush=np.zeros(1, int), brush_colours=("#c02020",)
    )
    _, ink = drawn(look, herd)
    rows = np.nonzero(ink.any(axis=1))[0]
    assert abs(rows.max() - look.pixels((0.0, 0.0, 0.0))[1]) < 4
    belly = int(look.pixels((0.0, 0.0, 0.12))[1])
    assert not ink[belly].all() and (np.diff(ink[belly].astype(int)) == 1).sum() >= 2  # one sees between the legs


def test_far_animals_are_still_seen():
    _, ink = drawn(camera(elevation=20.0, distance=3000.0), birds((0, 0, 5.0)))
    assert 8 < ink.sum() < 120


def test_corners_of_a_small_body_are_where_perspective_has_them():
    """All over the picture, in all attitudes, with a body of `COARSE` pixels, as far away as it is then."""
    rng, look, worst = np.random.default_rng(5), camera(elevation=20.0, distance=30.0, size=(1280, 720)), 0.0
    cam, (right, up, ahead) = look.numbers(), look.axes
    for _ in range(300):
        axes, depth = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.uniform(20, 200)
        x, y = rng.uniform((0, 0), look.size)
        place = look.eye + depth * (ahead + (x - cam[13]) / cam[12] * right - (y - cam[14]) / cam[12] * up)
        steps = np.array([step_of(cam, axes, np.int64(row), deep(cam, *place), COARSE / depth) for row in range(3)])
        corner = rng.uniform(-1, 1, 3) * (0.6, 1.0, 0.7)  # body lengths
        exact = pixel_of(cam, SpacePose(place, axes), *(corner * COARSE * depth / cam[12]))[:2]
        worst = max(worst, np.hypot(*((x, y) + corner @ steps - exact)))
    assert worst < 0.12  # pixels


def test_the_farthest_are_drawn_first_and_those_as_far_in_their_order():
    far = np.random.default_rng(2).integers(0, 40, 300).astype(float)
    for depths in (far, far + np.random.default_rng(3).uniform(0, 0.5, 300)):
        assert far_first(depths).tolist() == sorted(range(300), key=lambda row: -depths[row])


@pytest.mark.parametrize("wings", [0.0, np.nan])
def test_the_few_triangles_of_a_far_animal_cover_what_its_body_would(wings):
    """Just shorter than `COARSE` pixels, and just longer: as large for its size, and of one colour."""
    sizes, colours = [], []
    for long in (0.93 * COARSE, 1.07 * COARSE):
        covered, tints = 0, []
        for azimuth in range(0, 360, 30):
            look = camera(azimuth=azimuth, distance=20.0)
            look = camera(azimuth=azimuth, distance=look.focal / long)
            height = 0.0 if np.isnan(wings) else 2.0
            frame, where = drawn(look, birds((0, 0, height), wings=np.array([wings])))
            covered += where.sum()
            tints.append(frame[where].mean(0))
        sizes.append(covered / long**2)
        colours.append(np.mean(tints, axis=0))
    assert sizes[0] == pytest.approx(sizes[1], rel=0.3)
    np.testing.assert_allclose(*colours, atol=25)


def test_the_ground_of_a_level_lies_where_the_plan_has_it():
    scenery = Scenery(start("river", seed=1))
    flat = Painter(scenery, SIZE, trails=None, words=False, labels=False)
    plan = flat.ground.astype(float)
    one, own = painter(scenery), flat.camera
    distance = camera(distance=1.0).scale / own.scale
    one.look(camera(elevation=90.0, distance=distance, target=(*own.centre, 0.0)))
    seen = one.frame(NOBODY).astype(float)
    (left, bottom), (right, top) = own.pixels(((0, 0), (scenery.width, scenery.height))).round().astype(int)
    one, other = (cv2.GaussianBlur(image[top:bottom, left:right, 2], (0, 0), 4) for image in (plan, seen))
    part = slice(0, -60), slice(0, -70)  # the compass is in a corner
    assert np.corrcoef(one[part].ravel(), other[part].ravel())[0, 1] > 0.9


def test_a_frame_is_the_same_every_time_and_leaves_the_herd_alone():
    herd = birds([(0, 0, 8), (6, 0, 8)], bank=20)
    before = herd.xy.copy(), herd.forward.copy()
    frames = [painter(theme="dark").frame(herd, time=1.0) for _ in range(2)]
    assert np.array_equal(*frames) and np.array_equal(before[0], herd.xy) and np.array_equal(before[1], herd.forward)


def test_an_animal_that_is_nowhere_is_named():
    with pytest.raises(ValueError, match="row 1 cannot be drawn: its height"):
        painter().frame(birds([(0, 0, 8), (6, 0, np.nan)]))
    with pytest.raises(ValueError, match=r"up of 1 animals has shape \(1, 3\)"):
        painter().frame(birds((0, 0, 8))._replace(up=np.zeros((1, 2))))


def test_herds_of_the_plan_are_drawn_too_and_nobody_at_all():
    flat = DrawnHerd(np.array([[3.0, 4]]), np.array([[0.0, 1]]))
    assert painter(field()).frame(flat).shape == (240, 320, 3)
    assert painter(field()).frame().shape == (240, 320, 3)


def test_words_of_space_are_those_of_the_plan():
    herd = birds((30, 30, 5))
    one = SpacePainter(field(), (640, 480), trails=None)
    other = Painter(field(), (640, 480), trails=None)
    top = one.layout.above
    assert np.array_equal(one.frame(herd, 2.0)[:top], other.frame(herd, 2.0)[:top])


def test_a_thousand_birds_take_a_few_milliseconds():
    rng = np.random.default_rng(1)
    xyz = rng.normal(size=(1000, 3)) * (9, 9, 3) + (0, 0, 20)
    herd = birds(xyz, brush=np.zeros(1000, int), brush_colours=("#3355aa",), length=np.full(1000, 0.4))
    one = SpacePainter(None, (1280, 720), trails=None)
    one.look(one.around(herd))
    out = one.frame(herd)
    begin = time.process_time()
    for _ in range(5):
        one.frame(herd, out=out)
    assert (time.process_time() - begin) / 5 < 0.06  # 6 ms on a quiet machine
