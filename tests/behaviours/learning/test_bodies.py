"""Animals in a mask: how large one is, where they are, and how they lie, alone and where they touch."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment
from scipy.special import ndtri

from benchmarks import foreign_herds, herd_film
from flockbrush.film.body_outlines import BodySize, bodies_of, size_of_bodies
from flockbrush.film.body_shapes import Outlines, capsule, gone_on
from flockbrush.film.measured_size import blur_margin

SHEEP = Path(__file__).parents[4] / "shared/data/aerial_sheep"


def drawn(places, length=16.0, width=6.4, size=(200, 160)):
    """A mask with a capsule at each (x, y, degrees)."""
    y, x = np.mgrid[: size[1], : size[0]] + 0.5
    mask = np.zeros((size[1], size[0]), np.uint8)
    for px, py, angle in places:
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        along, across = c * (x - px) + s * (y - py), c * (y - py) - s * (x - px)
        half = 0.5 * (length - width)
        mask |= np.hypot(along - np.clip(along, -half, half), across) < width / 2
    return mask


def size(length=16.0, width=6.4):
    return BodySize(length, width, np.pi * width**2 / 4 + width * (length - width), 10)


def found(places, bodies):
    """(distance px, angle °) of each drawn body to the one found nearest."""
    out = []
    for x, y, angle in places:
        d = np.hypot(*(bodies.xy - (x, y)).T)
        k = np.argmin(d)
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        out.append((d[k], np.degrees(np.arcsin(min(1, abs(c * bodies.axis[k, 1] - s * bodies.axis[k, 0]))))))
    return np.array(out)


def judged(film, frame, bodies, reach=0.5):
    """Recall, precision, and of the pairs: distance off the usual one (BL) and angle of the axes (°)."""
    m = film.to_pixels[frame]
    scale = np.hypot(*m[:, 0])
    d = np.hypot(*(film.pixels(frame)[:, None] - bodies.xy).transpose(2, 0, 1)) / scale
    i, j = linear_sum_assignment(np.minimum(d, reach))
    i, j = i[d[i, j] < reach], j[d[i, j] < reach]
    forward = film.truth.forward[frame][i] @ m[:, :2].T / scale
    axis = bodies.axis[j]
    angle = np.degrees(np.arcsin(np.minimum(np.abs(forward[:, 0] * axis[:, 1] - forward[:, 1] * axis[:, 0]), 1)))
    return len(i) / film.inside(frame).sum(), len(j) / len(bodies), d[i, j], angle


def filmed(name, look, body_px, count=80, **more):
    truth = foreign_herds.herd(name, count, 0.16)
    film = herd_film.shoot(truth, size=(480, 360), body_px=body_px, look=look, **more)
    return film, [herd_film.mask_of(f, look) for f in film.frames]


def test_a_lone_body_is_measured_to_a_quarter_of_a_pixel_and_a_degree():
    for angle in (0, 30, 75, 120):
        bodies = bodies_of(drawn([(80.3, 70.8, angle)]), size())
        assert len(bodies) == 1 and bodies.alone.all()
        off, turned = found([(80.3, 70.8, angle)], bodies)[0]
        assert off < 0.25 and turned < 1.5
        assert bodies.length[0] == pytest.approx(16, rel=0.05) and bodies.width[0] == pytest.approx(6.4, rel=0.08)


@pytest.mark.parametrize("places", [
    [(80, 70, 20), (80.6, 78.5, 32), (82, 87, 8)],  # beside each other
    [(80, 70, 0), (93, 73, 70)],  # one's end at the other's flank
])  # fmt: skip
def test_bodies_that_touch_only_in_a_blurred_mask_are_where_the_picture_shows_them(places):
    """The mask is wider by a pixel."""
    grey = cv2.GaussianBlur(drawn(places) * np.float32(150), (0, 0), 0.8) + 60
    mask = cv2.dilate(drawn(places), np.ones((3, 3), np.uint8))
    picture = np.repeat(grey.astype(np.uint8)[..., None], 3, 2)
    assert cv2.connectedComponents(mask)[0] == 2  # one blob and the ground
    bodies = bodies_of(mask, size(18.0, 8.4), picture, None, 1.0)
    off, turned = found(places, bodies).T
    assert len(bodies) == len(places) and off.max() < 0.3 and turned.max() < 2.5


def test_in_the_next_frame_bodies_are_looked_for_where_they_went():
    bodies, expected = None, None
    for step in range(3):
        places = [(60 + 3 * step, 70, 10), (61 + 3 * step, 77, 15), (62 + 3 * step, 84, 5)]
        mask = drawn(places)
        picture = np.repeat((mask * 150 + 60).astype(np.uint8)[..., None], 3, 2)
        last, bodies = bodies, bodies_of(mask, size(), picture, expected)
        off, turned = found(places, bodies).T
        assert off.max() < 0.5 and turned.max() < 3.0
        expected = gone_on(bodies, last, 16.0)
        gone = expected.xy - bodies.xy
        assert np.allclose(gone, (0, 0) if step == 0 else (3, 0), atol=0.4)


def test_a_capsule_is_known_by_its_area_and_variances():
    long, wide = 9.0, 3.0
    y, x = np.mgrid[-600:600, -600:600] / 100.0
    inside = np.hypot(x - np.clip(x, -3, 3), y) < 1.5
    length, width = capsule(inside.sum() / 1e4, x[inside].var(), y[inside].var())
    assert (length, width) == (pytest.approx(long, rel=0.01), pytest.approx(wide, rel=0.01))


@pytest.mark.parametrize(
    "places",
    [
        [(60, 60, 0), (60, 66, 0)],  # side by side
        [(60, 60, 0), (75, 60, 0)],  # nose to tail
        [(60, 60, 0), (70, 67, 80)],  # one walks into the other's flank
        [(60, 60, 40), (70, 60, 140), (65, 72, 90)],
        [(50 + 6 * k, 60 + 4 * (k % 2), 90) for k in range(6)],  # a row, shoulder to shoulder
    ],
)
def test_animals_that_touch_are_told_apart(places):
    mask = drawn(places)
    assert cv2.connectedComponents(mask)[0] == 2  # ground, and all of them in one
    bodies = bodies_of(mask, size())
    assert len(bodies) == len(places) and not bodies.alone.any()
    off, turned = found(places, bodies).T
    assert off.max() < 2.0 and turned.max() < 12


def test_scraps_are_no_animals_and_an_empty_mask_has_none():
    scraps = drawn([(40, 40, 0), (90, 90, 0)], length=5.0, width=3.0)
    assert len(bodies_of(scraps, size())) == 0
    assert len(bodies_of(np.zeros((50, 60), bool), size())) == 0


def test_a_herd_at_the_border_of_the_picture_is_cut_there_and_no_more():
    bodies = bodies_of(drawn([(2, 80, 0), (2, 86, 0), (197, 3, 0), (120, 158, 90)]), size())
    assert 3 <= len(bodies) <= 4
    assert (bodies.xy > 0).all() and (bodies.xy < (200, 160)).all()


def test_the_size_of_one_is_that_of_those_who_stand_alone():
    rng = np.random.default_rng(0)
    alone = [(20 + 40 * (k % 9), 20 + 40 * (k // 9), rng.uniform(0, 180)) for k in range(20)]
    pairs = [(30 + 60 * k, 150 + s, 0) for k in range(5) for s in (0, 6)]
    told = size_of_bodies([drawn(alone + pairs, size=(400, 200))])
    assert told.length == pytest.approx(16, rel=0.04) and told.width == pytest.approx(6.4, rel=0.05)
    assert told.alone == 20


def test_nobody_tells_the_size_of_one_when_all_stand_in_one_heap():
    heap = [(60 + 6 * k, 30 + 14 * s, 90) for k in range(12) for s in range(7)]
    assert size_of_bodies([drawn(heap)]) is None
    assert size_of_bodies([np.zeros((60, 80), np.uint8)]) is None


@pytest.mark.parametrize(
    ("name", "look", "body_px"), [("graze", "cattle", 14), ("mill", "fish", 12), ("band", "poor", 16)]
)
def test_the_size_of_one_is_found_in_a_film(name, look, body_px):
    film, masks = filmed(name, look, body_px)
    told = size_of_bodies(masks)
    scale = np.hypot(*film.to_pixels[0][:, 0])
    if look == "poor":  # the dark heads are not in its mask
        assert told.length / scale == pytest.approx(0.73, abs=0.05)
    else:
        assert told.length / scale == pytest.approx(1.0, abs=0.06)
        assert told.width / told.length == pytest.approx(0.41, abs=0.03)


@pytest.mark.parametrize(
    ("name", "look", "body_px", "recall", "axis"),
    [
        ("swarm", "dun", 10, 0.98, 4),
        ("school", "fish", 14, 0.99, 3),
        ("band", "cattle", 14, 0.99, 2),
        ("mill", "shadowed sheep", 20, 0.99, 3),
        ("own:march", "cattle", 14, 0.97, 3),
    ],
)
def test_nearly_everybody_is_found_in_a_film_and_hardly_anybody_else(name, look, body_px, recall, axis):
    film, masks = filmed(name, look, body_px)
    told = size_of_bodies(masks)
    measured = [judged(film, t, bodies_of(mask, told)) for t, mask in enumerate(masks)]
    assert np.mean([m[0] for m in measured]) >= recall
    assert np.mean([m[1] for m in measured]) >= 0.97
    assert np.median(np.concatenate([m[2] for m in measured])) < 0.12  # heads not in the mask: .1
    assert np.median(np.concatenate([m[3] for m in measured])) < axis


def test_seams_between_animals_are_seen_in_the_picture():
    film, masks = filmed("topological", "cattle", 14, 120)
    told = size_of_bodies(masks)
    plain = [judged(film, t, bodies_of(mask, told)) for t, mask in enumerate(masks)]
    seams = [judged(film, t, bodies_of(m, told, f)) for t, (m, f) in enumerate(zip(masks, film.frames, strict=True))]
    for measured in (plain, seams):
        assert np.mean([m[0] for m in measured]) > 0.98 and np.mean([m[1] for m in measured]) > 0.98


@pytest.mark.parametrize("angle", [0.0, np.pi / 2])
def test_a_heap_that_can_be_parted_in_two_ways_is_parted_as_before(angle):
    heap = np.zeros((90, 90), np.uint8)
    heap[30:60, 30:60] = 1
    axis = np.array([np.cos(angle), np.sin(angle)])
    beside = np.array([-8.0, 8.0])[:, None] * axis[::-1]
    before = Outlines(45 + beside, np.tile(axis, (2, 1)), *np.array([[30.0, 15.0, 400.0]] * 2).T, np.zeros(2, bool))
    bodies = bodies_of(heap, size(30.0, 13.0), None, before)
    assert len(bodies) == 2 and (np.abs(bodies.axis @ axis) > 0.98).all()


def test_animals_that_stand_in_a_heap_do_not_jump_to_and_fro():
    truth = foreign_herds.herd("graze", 40, 0.4, starts=0.0, spacing=0.6, room=0.5)
    film = herd_film.shoot(truth, size=(360, 300), camera=herd_film.STILL, look="poor")
    masks = [herd_film.mask_of(frame, "poor") for frame in film.frames]
    one = BodySize(13.5, 5.6, 68.0, 9)

    def jumps(remember):
        last, steps = None, []
        for mask, picture in zip(masks, film.frames, strict=True):
            now = bodies_of(mask, one, picture, last if remember else None)
            if last is not None:
                steps.append(np.linalg.norm(now.xy[:, None] - last.xy, axis=2).min(1))
            last = now
        return np.sqrt(np.mean(np.concatenate(steps) ** 2))

    assert jumps(True) < 0.5 * jumps(False)


def test_bodies_move_with_the_picture():
    bodies = bodies_of(drawn([(80, 60, 30)]), size())
    moved = bodies.moved(np.array([[0.0, -2.0, 300.0], [2.0, 0.0, 10.0]]))  # a quarter turn, twice as large
    assert np.allclose(moved.xy, [[300 - 2 * bodies.xy[0, 1], 10 + 2 * bodies.xy[0, 0]]])
    assert np.allclose(moved.axis, [[-bodies.axis[0, 1], bodies.axis[0, 0]]])
    assert np.allclose(moved.length, 2 * bodies.length) and np.allclose(moved.area, 4 * bodies.area)


@pytest.mark.skipif(not SHEEP.is_dir(), reason="no real clip here")
def test_real_sheep_are_where_people_drew_boxes_around_them():
    boxes = np.genfromtxt(SHEEP / "sheep_0043_boxes.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    film = cv2.VideoCapture(str(SHEEP / "sheep_0043.mp4"))
    recall, precision, length = [], [], []
    numbers, drawn_boxes = np.unique(boxes["frame"], return_counts=True)
    numbers = [int(k) for k in numbers[drawn_boxes >= 25] if k >= 30][::5]  # nobody drew boxes in some frames
    frames = [film.read()[1] for _ in range(73)]
    masks = [white(frames[k]) for k in numbers]
    told = size_of_bodies(masks)
    for k, mask in zip(numbers, masks, strict=True):
        here = boxes[boxes["frame"] == k]
        at = np.column_stack([here["cx"], here["cy"]])
        inside = ((at > 10) & (at < (950, 530))).all(1)
        bodies = bodies_of(mask, told)
        d = np.hypot(*(at[:, None] - bodies.xy).transpose(2, 0, 1))
        i, j = linear_sum_assignment(np.minimum(d, told.length))
        close = d[i, j] < 0.6 * told.length
        recall.append(np.isin(np.flatnonzero(inside), i[close]).mean())
        precision.append(close.sum() / len(bodies))
        length.append(np.maximum(here["w"], here["h"])[inside])
    assert np.mean(recall) > 0.75 and np.mean(precision) > 0.75
    assert told.length == pytest.approx(np.median(np.concatenate(length)), rel=0.35)


def white(picture):
    """White sheep on grass: light and of little colour."""
    hsv = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)
    mask = ((hsv[..., 2] > 150) & (hsv[..., 1] < 60)).astype(np.uint8)
    return cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))


@pytest.mark.parametrize("share", [0.5, 0.3, 0.1])
def test_a_mask_reaches_beyond_bodies_as_blur_says(share):
    """The edge of a half plane under a Gaussian is covered by a share at a distance known in closed form."""
    places = [(30 + 40 * k, 35 + 45 * j, 25 * (k + 3 * j)) for k in range(4) for j in range(3)]
    fine = drawn([(8 * x, 8 * y, a) for x, y, a in places], 192, 80, (1600, 1280)).astype(float)
    covered = cv2.GaussianBlur(cv2.resize(fine, (200, 160), interpolation=cv2.INTER_AREA), (0, 0), 1.2)[..., None]
    picture = (covered * (220, 215, 210) + (1 - covered) * (60, 110, 90)).astype(np.uint8)
    mask = (covered[..., 0] > share).astype(np.uint8)
    margin = blur_margin({0: picture}, {0: mask}, size(24.0, 10.0))
    assert margin == pytest.approx(-1.2 * ndtri(share), abs=0.25)  # bodies have round ends


@pytest.mark.parametrize("look", ["sheep", "cattle", "dun"])
def test_bodies_in_a_film_are_as_wide_as_they_were_drawn(look):
    film, masks = filmed("swarm", look, 20.0)
    pictures, found = dict(enumerate(film.frames)), size_of_bodies(masks)
    width = found.width - 2 * blur_margin(pictures, dict(enumerate(masks)), found)
    assert width == pytest.approx(2 * foreign_herds.RADIUS * 20.0, rel=0.15)
