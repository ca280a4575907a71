"""Bodies of many frames become animals: who is who, where the head is, how fast they go and turn."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from benchmarks import foreign_herds, headings, herd_film
from flockbrush.film.body_matching import follow, matched
from flockbrush.film.body_outlines import bodies_of, size_of_bodies
from flockbrush.film.body_shapes import Outlines
from flockbrush.film.observe import observe
from flockbrush.film.sightings import UNKNOWN, sightings_of

FISH = Path(__file__).parents[4] / "shared/data/zebrafish_100/test_trajectories.npy"
TO_BL = np.array([[0.1, 0.0, 0.0], [0.0, -0.1, 40.0]])  # 10 px to a body length


def bodies(xy, angle, noise=0.0, turned=0.0, rng=None):
    """Bodies in pixels at places in BL (y up), with axes whose ends mean nothing."""
    rng = rng or np.random.default_rng(0)
    angle = angle + turned * rng.normal(size=len(xy)) + np.pi * rng.integers(0, 2, len(xy))
    at = (xy + noise * rng.normal(size=xy.shape) - TO_BL[:, 2]) / [0.1, -0.1]
    axis = np.column_stack([np.cos(angle), -np.sin(angle)])
    one = np.ones(len(xy))
    return Outlines(at, axis, 10 * one, 4 * one, 36 * one, one.astype(bool))


def walk(speed=2.0, turn=0.5, frames=40, fps=25, count=9, **off):
    """Animals three BL apart that all walk circles: their bodies, and their headings (frames,)."""
    angle = 0.3 + turn * np.arange(frames) / fps
    step = speed / fps * np.column_stack([np.cos(angle), np.sin(angle)])
    path = np.cumsum(step, axis=0) - step
    start = 10 + 3.0 * np.column_stack([np.arange(count) % 3, np.arange(count) // 3])
    rng = np.random.default_rng(1)
    return [bodies(start + p, np.full(count, a), rng=rng, **off) for p, a in zip(path, angle, strict=True)], angle


def off_by(forward, angle):
    """(k,) degrees between headings and an angle."""
    return np.degrees(np.arctan2(np.cos(angle) * forward[:, 1] - np.sin(angle) * forward[:, 0],
                                 np.cos(angle) * forward[:, 0] + np.sin(angle) * forward[:, 1]))  # fmt: skip


def test_animals_on_a_curve_have_its_heading_speed_and_turn():
    frames, angle = walk(speed=2.0, turn=0.5)
    sightings, noise = sightings_of(frames, 25, TO_BL)
    assert len(sightings) == 40 and len(np.unique(sightings.track)) == 9
    assert np.abs(off_by(sightings.forward[sightings.of(20)], angle[20])).max() < 0.5
    assert np.allclose(sightings.speed, 2.0, atol=0.05)
    assert np.allclose(sightings.turn[sightings.of(20)], 0.5, atol=0.02)
    assert np.isfinite(sightings.turn).mean() > 0.8  # at the ends of tracks it is not known
    assert noise.xy < 0.01


def test_the_errors_of_speeds_are_as_large_and_last_as_long_as_is_said():
    frames, _ = walk(speed=2.0, turn=0.0, frames=300, count=16, noise=0.03)
    sightings, noise = sightings_of(frames, 25, TO_BL)
    off = sightings.speed[10 * 16 : -10 * 16].reshape(-1, 16) - 2.0
    said = noise.speed_errors(25)
    seen = np.array([(off[: len(off) - k] * off[k:]).mean() for k in range(len(said) + 3)])
    assert np.allclose(seen[: len(said)], said, atol=0.12 * said[0])
    assert np.abs(seen[len(said) :]).max() < 0.1 * said[0]
    assert not len(UNKNOWN.speed_errors(25))


@pytest.mark.parametrize("speed", [1.0, 4.0, 12.0])
def test_the_head_is_where_the_animal_goes(speed):
    frames, angle = walk(speed=speed, turn=0.2, noise=0.02, turned=0.05)
    sightings, _ = sightings_of(frames, 25, TO_BL)
    off = np.concatenate([off_by(sightings.forward[sightings.of(t)], angle[t]) for t in range(40)])
    assert len(off) == 40 * 9 and np.abs(off).max() < 12


def test_the_noise_of_heading_speed_and_turn_is_as_told():
    frames, angle = walk(turn=0.6, frames=120, noise=0.03, turned=0.06, count=25)
    sightings, noise = sightings_of(frames, 25, TO_BL)
    middle = slice(sightings.first[15], sightings.first[105])
    assert noise.xy == pytest.approx(0.03, rel=0.15) and noise.axis == pytest.approx(0.06, rel=0.15)
    assert (sightings.turn[middle] - 0.6).std() == pytest.approx(noise.turn, rel=0.25)
    assert (sightings.speed[middle] - 2.0).std() == pytest.approx(noise.speed, rel=0.3)
    off = np.concatenate([off_by(sightings.forward[sightings.of(t)], angle[t]) for t in range(15, 105)])
    assert np.radians(off).std() == pytest.approx(noise.heading, rel=0.3)
    assert abs(sightings.turn[middle].mean() - 0.6) < 0.02  # not biased


def test_who_is_not_seen_for_two_frames_is_where_he_must_be():
    frames, _ = walk()
    for t in (20, 21):
        frames[t] = frames[t].of(np.arange(9) != 4)
    sightings, _ = sightings_of(frames, 25, TO_BL)
    assert np.diff(sightings.first).tolist() == [9] * 40 and len(np.unique(sightings.track)) == 9


def test_what_is_seen_in_one_frame_alone_is_no_animal():
    frames, _ = walk()
    ghost = bodies(np.array([[30.0, 30.0]]), np.zeros(1))
    frames[7] = Outlines(
        *(np.concatenate([a, b]) for a, b in zip(vars(frames[7]).values(), vars(ghost).values(), strict=True))
    )
    sightings, _ = sightings_of(frames, 25, TO_BL)
    assert (np.diff(sightings.first) == 9).all()


def with_specks(frames, area):
    """The frames with two more bodies that lie still, of some area, px²."""
    still = bodies(np.array([[30.0, 30.0], [34.0, 31.0]]), np.array([0.2, 1.9]))
    still = Outlines(still.xy, still.axis, still.length, still.width, np.full(2, area), still.alone)
    return [
        Outlines(*(np.concatenate(v) for v in zip(vars(f).values(), vars(still).values(), strict=True))) for f in frames
    ]


def test_small_things_that_never_move_while_the_herd_does_are_the_grounds():
    frames, _ = walk()
    sightings, _ = sightings_of(with_specks(frames, 18.0), 25, TO_BL)
    assert (np.diff(sightings.first) == 9).all() and sightings.speed.min() > 1.9
    sightings, _ = sightings_of(with_specks(frames, 34.0), 25, TO_BL)  # an animal that stands
    assert (np.diff(sightings.first) == 11).all()


def test_in_a_herd_that_stands_small_animals_may_stand_too():
    frames, _ = walk(speed=0.0, noise=0.01)
    sightings, _ = sightings_of(with_specks(frames, 18.0), 25, TO_BL)
    assert (np.diff(sightings.first) == 11).all()


def test_an_axis_that_is_another_animals_turns_nobody():
    frames, angle = walk(turn=0.0, turned=0.02)
    axis = frames[18].axis.copy()
    axis[3] = axis[3][::-1] * (1, -1)
    frames[18] = Outlines(frames[18].xy, axis, *[getattr(frames[18], n) for n in ("length", "width", "area", "alone")])
    sightings, noise = sightings_of(frames, 25, TO_BL)
    assert np.abs(off_by(sightings.forward, angle[0])).max() < 8


@pytest.mark.parametrize("across", [False, True], ids=["pushed aside", "axis across"])
def test_who_is_pushed_aside_lies_as_its_body_and_who_seems_to_lie_across_its_way_along_the_way(across):
    """A push of .6 BL in four frames is a way at 60 degrees to the body; so is that of bodies seen across it."""
    push = np.zeros(40) if across else np.clip(np.arange(40) - 18, 0, 4) * 0.15
    seen = np.full(40, 1.1 if across else 0.0)
    start = 10 + 3.0 * np.column_stack([np.arange(9) % 3, np.arange(9) // 3])
    places = [start + [0.08 * t, aside] for t, aside in enumerate(push)]
    rng = np.random.default_rng(1)
    frames = [bodies(xy, np.full(9, a), noise=0.002, turned=0.01, rng=rng) for xy, a in zip(places, seen, strict=True)]
    sightings, _ = sightings_of(frames, 25, TO_BL)
    middle = slice(sightings.first[5], sightings.first[35])  # at its end, a way is too short to tell
    assert len(np.unique(sightings.track)) == 9 and np.abs(off_by(sightings.forward[middle], 0.0)).max() < 6


def test_animals_that_stand_lie_as_they_lie():
    frames, angle = walk(speed=0.0, turn=0.0, noise=0.01)
    sightings, _ = sightings_of(frames, 25, TO_BL)
    assert np.abs(np.sin(np.radians(off_by(sightings.forward, 0.3)))).max() < 0.05
    assert sightings.speed.max() < 0.3


def test_animals_that_meet_keep_their_names():
    fps, frames = 25, []
    for t in np.arange(50) / fps:  # two files pass each other, a body's width between them
        left = np.column_stack([5 + 2 * t + 1.3 * np.arange(5), np.full(5, 20.0)])
        right = np.column_stack([15 - 2 * t - 1.3 * np.arange(5), np.full(5, 20.5)])
        frames.append(bodies(np.concatenate([left, right]), np.repeat([0.0, np.pi], 5)))
    sightings, _ = sightings_of(frames, fps, TO_BL)
    assert len(np.unique(sightings.track)) == 10
    up = sightings.xy[:, 1] > 20.25
    assert (sightings.forward[up, 0] < -0.9).all() and (sightings.forward[~up, 0] > 0.9).all()


def test_fast_animals_side_by_side_are_followed_by_the_flow_of_the_picture():
    frames, angle = walk(speed=25.0, turn=0.0, frames=20)  # one BL a frame, three apart
    moves = [np.tile([10 * np.cos(0.3), -10 * np.sin(0.3)], (9, 1)) for _ in frames]
    sightings, _ = sightings_of(frames, 25, TO_BL, moves)
    assert len(np.unique(sightings.track)) == 9
    assert np.allclose(sightings.speed, 25, rtol=0.02)


def test_nobody_seen_is_nobody_sighted():
    sightings, _ = sightings_of([Outlines.none()] * 5, 25, TO_BL)
    assert len(sightings) == 5 and len(sightings.xy) == 0
    assert follow([np.zeros((0, 2))] * 3, [np.zeros((0, 2))] * 3)[2].tolist() == []


def test_two_are_matched_so_that_both_find_somebody():
    ahead, axis = np.array([[0.0, 0.0], [0.4, 0.0]]), np.tile([1.0, 0.0], (2, 1))
    seen = np.array([[0.35, 0.0], [0.75, 0.0]])  # the nearest to the second is the first's only one
    mine, theirs = matched(ahead, axis, np.array([0.5, 0.5]), seen, axis)
    assert dict(zip(mine.tolist(), theirs.tolist(), strict=True)) == {0: 0, 1: 1}


@pytest.mark.parametrize(
    ("name", "look", "heading"),
    [("swarm", "sheep", 4), ("mill", "cattle", 3), ("band", "fish", 3), ("graze", "dun", 6)],
)
def test_a_herd_filmed_by_a_moving_camera_is_followed(name, look, heading):
    truth = foreign_herds.herd(name, 60, 1.2)
    film = herd_film.shoot(truth, size=(480, 360), body_px=12, look=look)
    masks = [herd_film.mask_of(f, look) for f in film.frames]
    size = size_of_bodies(masks[::5])
    scale = np.hypot(*film.to_pixels[0][:, 0])
    seen = [bodies_of(m, size).moved(film.between(t)) for t, m in enumerate(masks)]
    sightings, noise = sightings_of(seen, truth.fps, np.array([[1 / scale, 0, 0], [0, -1 / scale, 360 / scale]]))
    told = film.seen_from(0)
    recall, precision, off = [], [], []
    for t in range(len(sightings)):
        rows = sightings.of(t)
        d = np.hypot(*(told.xy[t][:, None] - sightings.xy[rows]).transpose(2, 0, 1))
        i, j = linear_sum_assignment(np.minimum(d, 0.5))
        close = d[i, j] < 0.4
        recall.append(close.sum() / film.inside(t).sum())
        precision.append(close.sum() / d.shape[1])
        f, g = told.forward[t][i[close]], sightings.forward[rows][j[close]]
        off.append(np.degrees(np.arctan2(f[:, 0] * g[:, 1] - f[:, 1] * g[:, 0], (f * g).sum(1))))
    off = np.abs(np.concatenate(off))
    assert np.mean(recall) > 0.97 and np.mean(precision) > 0.97
    assert np.median(off) < heading
    assert (off > 90).mean() < (0.35 if name == "graze" else 0.02)  # who stands all the time shows no head


@pytest.mark.parametrize(
    ("model", "look", "length", "heading"), [("band", "cattle", 20.0, 0.045), ("school", "fish", 11.0, 0.07)]
)
def test_headings_of_bodies_that_nearly_touch_are_those_of_the_picture(model, look, length, heading, tmp_path):
    """By the moments of the mask they are off by .06 and .2 rad."""
    film = headings.film_of(model, look, length, tmp_path)
    found = headings.errors_of(film, observe(film.path))
    assert found["heading"] < heading and found["position"] < 0.03 and found["lost"] < 0.02


@pytest.mark.skipif(not FISH.exists(), reason="no real tracks here")
def test_real_fish_keep_their_names():
    data = np.load(FISH)
    length = 35.0  # px, about: the usual distance between them is of a body
    xy = [frame[np.isfinite(frame[:, 0])] / length for frame in data[:60]]
    ids = [np.flatnonzero(np.isfinite(frame[:, 0])) for frame in data[:60]]
    step = np.nan_to_num(data[1:61] - data[:60])
    axis = [step[t][ids[t]] / np.maximum(np.hypot(*step[t][ids[t]].T), 1e-6)[:, None] for t in range(60)]
    names = follow(xy, axis)
    last, switches, total = {}, 0, 0
    for who, name in zip(ids, names, strict=True):
        for a, b in zip(who, name, strict=True):
            switches += last.get(a, b) != b
            total += 1
            last[a] = b
    assert switches / total < 0.05  # who is out of sight for long gets another name


@pytest.mark.parametrize("spread", [0.05, 1.5], ids=["parallel", "at random"])
def test_in_a_picture_a_body_across_parallel_ones_that_it_touches_lies_as_they_do(spread):
    rng = np.random.default_rng(3)
    at = np.argwhere(np.ones((6, 6))) * 30.0
    angle = rng.uniform(-spread, spread, 36)
    angle[[2, 20]] += np.pi / 2
    alone = np.arange(36) != 20
    axis = np.column_stack([np.cos(angle), np.sin(angle)])
    picture = Outlines(at, axis, np.full(36, 20.0), np.full(36, 8.0), np.full(36, 140.0), alone)
    seen, _ = sightings_of([picture], 25.0, np.array([[0.05, 0, 0], [0, 0.05, 0]]))
    assert len(seen) == 1 and np.isnan(seen.speed).all() and np.isnan(seen.turn).all()
    own = np.abs((seen.forward * axis).sum(1))  # which end the head is nobody knows
    assert own[alone] == pytest.approx(1.0)
    assert own[20] < 0.1 if spread < 1 else own[20] == pytest.approx(1.0)
